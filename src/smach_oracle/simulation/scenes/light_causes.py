"""The causes in the light, which every scene has: glare, a reflection, a cloud, a shadow."""

from typing import Callable, Dict, Generic, NamedTuple, Optional, Tuple

import numpy as np

from smach_oracle.geometry.transforms import rotation_about

from .drafts import Draft, caused
from .scene import Disturbance, Near, Vector


class View(NamedTuple):
    """A look of the robot, at which the light is wrong from then on."""

    eye: np.ndarray  # (3,) m, where the camera is
    looks_at: np.ndarray  # (3,) m, the middle of its image
    near: Optional[Near] = None  # where the robot has to be, None: anywhere


class LightCauses(Generic[Draft]):
    """The causes in the light of one kind of scene."""

    def __init__(self, view: View, place_of_target: Callable[[Draft], Vector]) -> None:
        """`place_of_target`: (3,) m, of what the robot is to find."""
        self._view = view
        self._place_of_target = place_of_target

    def makers(self) -> Dict[str, Callable[[Draft, np.random.Generator], Draft]]:
        """Return what adds each kind of cause to a draft."""
        return {
            'glare': self._glare,
            'reflex': self._reflex,
            'dim_light': self._dim_light,
            'shadow': self._shadow,
        }

    def _glare(self, draft: Draft, generator: np.random.Generator) -> Draft:
        """The low sun falls through a window, and something shiny throws it into the lens."""
        minutes = float(generator.uniform(30.0, 90.0))
        text = 'the low sun dazzles the camera for {:.0f} minutes'.format(minutes)
        return self._dazzled(draft, generator, 'glare', 60 * minutes, text)

    def _reflex(self, draft: Draft, generator: np.random.Generator) -> Draft:
        """Something shiny that moves throws light into the lens."""
        seconds = passing_seconds(generator)
        text = 'a reflection dazzles the camera for {:.1f} s'.format(seconds)
        return self._dazzled(draft, generator, 'reflex', seconds, text)

    def _dazzled(
        self, draft: Draft, generator: np.random.Generator, kind: str, seconds: float, text: str
    ) -> Draft:
        """From when the camera has turned to the target for the first time."""
        view, target = self._view, np.array(self._place_of_target(draft))
        values = dazzling(view.eye, view.looks_at, target, generator)
        glare = Disturbance('glare', 'look_at', values + (('duration', seconds),), near=view.near)
        return caused(draft, kind, text, glare)

    def _dim_light(self, draft: Draft, generator: np.random.Generator) -> Draft:
        """A cloud, in a room without lamps."""
        brightness, minutes = float(generator.uniform(0.1, 0.4)), cloud_minutes(generator)
        text = 'a cloud leaves {:.0f}% of the light for {:.0f} minutes'.format(
            100 * brightness, minutes
        )
        return self._dimmed(draft, 'dim_light', brightness, 60 * minutes, text)

    def _shadow(self, draft: Draft, generator: np.random.Generator) -> Draft:
        """Somebody stands in the light."""
        brightness, seconds = float(generator.uniform(0.3, 0.6)), passing_seconds(generator)
        text = 'somebody stands in the light for {:.1f} s: {:.0f}% of it'.format(
            seconds, 100 * brightness
        )
        return self._dimmed(draft, 'shadow', brightness, seconds, text)

    def _dimmed(
        self, draft: Draft, kind: str, brightness: float, seconds: float, text: str
    ) -> Draft:
        values = (('brightness', brightness), ('duration', seconds))
        return caused(
            draft, kind, text, Disturbance('dim', 'look_at', values, near=self._view.near)
        )


def passing_seconds(generator: np.random.Generator) -> float:
    """Draw how long, s, somebody stands in the light, or something that moves reflects it."""
    return float(min(60.0, generator.lognormal(np.log(4.0), 0.8)))


def cloud_minutes(generator: np.random.Generator) -> float:
    """Draw how long, min, a cloud hides the sun."""
    return float(min(60.0, generator.lognormal(np.log(8.0), 0.6)))


def dazzling(
    eye: np.ndarray, looks_at: np.ndarray, thing: np.ndarray, generator: np.random.Generator
) -> Tuple[Tuple[str, float], ...]:
    """Values of a glare that hides a thing from a camera.

    What reflects the light stands where the thing would be if it were mirrored at the middle of the
    image: its own mirror image in the lens then lies on the thing, or a few degrees next to it.

    :param eye: (3,) m, where the camera is.
    :param looks_at: (3,) m, the middle of its image.
    :param thing: (3,) m.
    """
    axis = (looks_at - eye) / np.linalg.norm(looks_at - eye)
    way = thing - eye
    mirrored = 2 * (way @ axis) * axis - way
    aside = np.cross(axis, generator.normal(size=3))
    turn = rotation_about(aside / np.linalg.norm(aside), float(generator.normal(0.0, 0.05)))
    place = eye + turn @ mirrored
    values = dict(
        zip(('x', 'y', 'z'), place),
        **dict(zip(('eye_x', 'eye_y', 'eye_z'), eye)),
        radius=generator.uniform(0.10, 0.22),
        lobe=generator.uniform(0.15, 0.25),
    )
    return tuple((name, float(value)) for name, value in values.items())
