"""One trial's world, and how time passes in it."""

from typing import Dict, List, Optional, Set

import numpy as np

from ..rays import Circle, ranges, to_circle
from ..site import PANELS, START, WALLS, Pose
from .base import WheeledBase, noisy_ranges
from .causes import TrialScene
from .contacts import Contacts
from .extra_causes import SLACK_TYRE, STEAM, scattered
from .gauge import painted
from .hall_log import HallLog
from .people import Walker
from .view import Sunlight, view

BEAMS = np.radians(np.arange(-135.0, 135.1, 3.0))  # rad, of the laser scanner, to the left
SCANNER_RANGE = 12.0  # m
FULL_V, SAGGED_V = 25.2, 20.5  # volts of the battery
CLOSE_ENOUGH = 0.4  # bar between a reading that was reported and the true one


class InspectionWorld:
    """The hall of a seed, with its robot. Pure: no clock but what `step` is told."""

    def __init__(self, scene: TrialScene) -> None:
        self.scene = scene
        self.time_s = 0.0
        self.base = WheeledBase(START, scene.wet, scene.veer)
        self.reported: Dict[int, float] = {}  # bar, by the number of the panel
        self.contacts = Contacts()
        self.log = HallLog(scene)
        self._people = [Walker(errand) for errand in scene.errands]
        self._fronts = {
            panel.number: painted(panel.number, scene.readings[panel.number]) for panel in PANELS
        }
        self._rng = np.random.default_rng(scene.seed + 1)
        self.log.look(0.0, self._there())

    @property
    def people(self) -> List[Circle]:
        """x, y and radius of each person (m)."""
        return [walker.circle for walker in self._people]

    @property
    def battery_is_low(self) -> bool:
        """Whether the battery's voltage has broken down."""
        sag = self.scene.sag
        return sag is not None and sag.begins_s <= self.time_s < sag.ends_s

    @property
    def voltage(self) -> float:
        """The voltage of the battery (V)."""
        return SAGGED_V if self.battery_is_low else FULL_V

    def step(self, dt_s: float) -> None:
        """Let time pass (s)."""
        self.time_s += dt_s
        for walker in self._people:
            walker.step(dt_s, self.base.pose)
        self.base.powered = not self.battery_is_low
        people = self.people
        self.base.step(dt_s, people)
        self.contacts.look(self.base, people)
        self.log.look(self.time_s, self._there())

    def _there(self) -> Set[str]:
        """Return the kinds of the causes that are there now."""
        kinds = {walker.makes for walker in self._people if walker.makes}
        for kind, there in (
            ('wet_floor', self.scene.wet is not None),
            ('glare', self._sunlight() is not None),
            ('low_battery', self.battery_is_low),
            (SLACK_TYRE, self.scene.veer != 0.0),
            (STEAM, self._steam() is not None),
        ):
            if there:
                kinds.add(kind)
        return kinds

    def scan(self) -> np.ndarray:
        """(n,) m along each of BEAMS, as the laser scanner tells it."""
        pose: Pose = self.base.pose
        exact = ranges(pose, BEAMS + pose[2], WALLS, self.people)
        steam = self._steam()
        if steam is not None:
            exact = scattered(exact, to_circle(pose, BEAMS + pose[2], steam), self._rng)
        return np.minimum(noisy_ranges(exact, self._rng), SCANNER_RANGE)

    def image(self) -> np.ndarray:
        """(h, w, 3) uint8 RGB: what the camera sees."""
        base = self.base
        return view(
            base.pose,
            base.twist,
            self._fronts,
            self.people,
            self._sunlight(),
            self._rng,
            self._steam(),
        )

    def _steam(self) -> Optional[Circle]:
        plume = self.scene.plume
        if plume is None or not plume.begins_s <= self.time_s < plume.ends_s:
            return None
        return plume.x, plume.y, plume.radius

    def _sunlight(self) -> Optional[Sunlight]:
        glare = self.scene.glare
        if glare is None or not glare.begins_s <= self.time_s < glare.ends_s:
            return None
        return Sunlight(glare.panel, glare.angle)

    def wrong_readings(self) -> List[str]:
        """Return the panels of which another reading was reported than they show."""
        true = self.scene.readings
        return [
            'panel {}'.format(number)
            for number, reading in sorted(self.reported.items())
            if number in true and abs(reading - true[number]) > CLOSE_ENOUGH
        ]

    def shortcomings(self) -> List[str]:
        """Return what the goal lacks: every panel must have been reported, and reported right."""
        told = []
        for panel in PANELS:
            reading, true = self.reported.get(panel.number), self.scene.readings[panel.number]
            if reading is None:
                told.append('panel {} was not reported'.format(panel.number))
            elif abs(reading - true) > CLOSE_ENOUGH:
                told.append(
                    'panel {} was reported as {:.2f} and shows {:.2f} bar'.format(
                        panel.number, reading, true
                    )
                )
        return told
