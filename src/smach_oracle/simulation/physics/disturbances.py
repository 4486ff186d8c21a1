"""Things that happen to a trial's world while it goes on, each once, at its event.

Kinds, with their values (a scene's Disturbance.values) and the defaults of these:
* ``arm``: joints by name, rad: somebody moves an arm there, in ``duration`` s (1.5).
* ``dim``: the light falls to ``brightness`` (0.15) for the next ``frames`` (2) of the camera.
* ``glare``: the share ``dropout`` (0.9) of the depth is lost in the next ``frames`` (2).
* ``swing:BODY``: the joints of a body that is a URDF, a door, swing to ``angle`` rad (0) in
  ``duration`` s (1.5).
* ``nudge:BODY``: a body is pushed over what it stands on by ``dx``, ``dy`` m (0) in ``duration`` s
  (0.4).

Events are counted since the reset: ``see`` or ``see:1`` is the first image, ``drive:2`` the end of
the second drive. They are start, follow, follow_left, follow_right, open_left, close_left (and
right), torso, look_at, drive, see.
"""
import math
from collections import Counter
from typing import Counter as CounterOf
from typing import Dict, List, NamedTuple, Protocol

import numpy as np

from smach_oracle.pr2.robot import ARMS

from ..scenes.scene import CameraQuality, Disturbance, Scene
from .bodies import SceneBuildError
from .easing import eased
from .pr2_body import PERIOD, Pr2Body

EVENTS = ('start', 'follow', 'torso', 'look_at', 'drive', 'see') + tuple(
    '{}_{}'.format(what, arm) for what in ('follow', 'open', 'close') for arm in ARMS)
FASTEST = 0.5  # m/s, of a nudge
OPTIONS: Dict[str, Dict[str, float]] = {
    'arm': {'duration': 1.5},
    'dim': {'brightness': 0.15, 'frames': 2},
    'glare': {'dropout': 0.9, 'frames': 2},
    'swing': {'angle': 0.0, 'duration': 1.5},
    'nudge': {'dx': 0.0, 'dy': 0.0, 'duration': 0.4},
}


class DisturbedWorld(Protocol):
    """What a disturbance moves: see World."""

    periods: int  # control periods since the reset

    @property
    def robot(self) -> Pr2Body:
        """See World."""

    def set_target(self, joint: str, position: float, velocity: float) -> None:
        """See World."""

    def body_pose(self, name: str) -> np.ndarray:
        """See World."""

    def body_joint(self, name: str, joint: str) -> float:
        """See World."""

    def body_joints(self, name: str) -> List[str]:
        """See World."""

    def slide_body(self, name: str, x: float, y: float, let_go: bool) -> None:
        """See World."""

    def turn_body(self, name: str, joint: str, speed: float, let_go: bool) -> None:
        """See World."""


class _Blinding(NamedTuple):
    """A disturbance of the camera, and the images that it still spoils."""

    cause: Disturbance
    images: int


class _ActiveDisturbance(NamedTuple):
    """A disturbance that moves something, on its way."""

    cause: Disturbance
    values: Dict[str, float]
    periods: int  # how long it takes
    begun: int  # at which period
    start: Dict[str, float]  # arm, swing: where the joints were; nudge: where the body was, x and y


class Disturbances:
    """Those of one trial."""

    def __init__(self, scene: Scene, robot: Pr2Body) -> None:
        """Check the scene's disturbances.

        :raises SceneBuildError: for a kind, event, value, joint or body that is not known.
        """
        for disturbance in scene.disturbances:
            _check(disturbance, scene, robot)
        self._waiting = list(scene.disturbances)
        self._counts: CounterOf[str] = Counter()
        self._due: List[Disturbance] = []
        self._moving: List[_ActiveDisturbance] = []
        self._blinding: List[_Blinding] = []

    def happened(self, event: str) -> None:
        """Count an event, and set off what waited for it."""
        self._counts[event] += 1
        now = '{}:{}'.format(event, self._counts[event])
        for disturbance in list(self._waiting):
            if _numbered(disturbance.after) == now:
                self._waiting.remove(disturbance)
                if disturbance.kind in ('dim', 'glare'):
                    self._blinding.append(
                        _Blinding(disturbance, int(_values(disturbance)['frames'])))
                else:
                    self._due.append(disturbance)

    @property
    def moving(self) -> bool:
        """Something is being moved."""
        return bool(self._due or self._moving)

    def next_period(self, period: int, end: int) -> int:
        """The control period, from `period` to `end`, up to which no disturbance is due."""
        return period if self.moving else end

    def tick(self, world: DisturbedWorld) -> None:
        """Move what is disturbed; called before each control period."""
        for disturbance in self._due:
            values = _values(disturbance)
            self._moving.append(
                _ActiveDisturbance(disturbance, values, max(1, round(values['duration'] / PERIOD)),
                                   world.periods, _start(world, disturbance)))
        self._due = []
        for active in list(self._moving):
            done = world.periods - active.begun
            if done >= active.periods:
                self._moving.remove(active)
            if active.cause.kind == 'arm' and done < active.periods:
                _move_arm(world, active, done)
            elif active.cause.kind.startswith('swing'):
                _swing_body(world, active, done)
            elif active.cause.kind != 'arm':
                _move_body(world, active, done)

    def camera_quality(self, quality: CameraQuality) -> CameraQuality:
        """How well the camera sees just now.

        :param quality: of the camera undisturbed.
        """
        for cause, _ in self._blinding:
            values = _values(cause)
            if cause.kind == 'dim':
                quality = quality._replace(brightness=min(quality.brightness, values['brightness']))
            else:
                quality = quality._replace(dropout=max(quality.dropout, values['dropout']))
        return quality

    def image_taken(self) -> None:
        """Count an image of the camera."""
        self._blinding = [
            _Blinding(cause, images - 1) for cause, images in self._blinding if images > 1
        ]


def _move_arm(world: DisturbedWorld, active: _ActiveDisturbance, done: int) -> None:
    for name, start in active.start.items():
        way = active.values[name] - start
        here, there = (eased(step / active.periods) for step in (done, done + 1))
        world.set_target(name, start + way * there, way * (there - here) / PERIOD)


def _move_body(world: DisturbedWorld, active: _ActiveDisturbance, done: int) -> None:
    name, share = active.cause.kind.partition(':')[2], min(1.0, (done + 1) / active.periods)
    x, y = world.body_pose(name)[:2, 3]
    pace = np.array([active.start['x'] + share * active.values['dx'] - x,
                     active.start['y'] + share * active.values['dy'] - y]) / PERIOD
    let_go = done >= active.periods
    pace *= 0.0 if let_go else min(1.0, FASTEST / max(float(np.hypot(*pace)), 1e-9))
    world.slide_body(name, pace[0], pace[1], let_go)


def _swing_body(world: DisturbedWorld, active: _ActiveDisturbance, done: int) -> None:
    name, let_go = active.cause.kind.partition(':')[2], done >= active.periods
    for joint, start in active.start.items():
        goal = start + eased(min(1.0,
                                 (done + 1) / active.periods)) * (active.values['angle'] - start)
        world.turn_body(name, joint, (goal - world.body_joint(name, joint)) / PERIOD, let_go)


def _values(disturbance: Disturbance) -> Dict[str, float]:
    return dict(OPTIONS[disturbance.kind.partition(':')[0]], **dict(disturbance.values))


def _start(world: DisturbedWorld, disturbance: Disturbance) -> Dict[str, float]:
    if disturbance.kind == 'arm':
        return {
            name: world.robot.position(name)
            for name, _ in disturbance.values if name not in OPTIONS['arm']
        }
    kind, _, body = disturbance.kind.partition(':')
    if kind == 'swing':
        return {joint: world.body_joint(body, joint) for joint in world.body_joints(body)}
    return dict(zip('xy', world.body_pose(body)[:2, 3].tolist()))


def _numbered(event: str) -> str:
    return event if ':' in event else event + ':1'


def _check(disturbance: Disturbance, scene: Scene, robot: Pr2Body) -> None:
    kind, _, body = disturbance.kind.partition(':')
    event, _, number = _numbered(disturbance.after).partition(':')
    wrong = ''
    if kind not in OPTIONS:
        wrong = 'unknown kind; allowed: {}'.format(', '.join(OPTIONS))
    elif event not in EVENTS or not number.isdigit() or int(number) < 1:
        wrong = 'unknown event {!r}; allowed: {}, each with :NUMBER'.format(
            disturbance.after, ', '.join(EVENTS))
    elif kind == 'swing' and body not in [
            each.name for each in scene.bodies if each.shape == 'urdf'
    ]:
        wrong = 'no body {!r} with joints'.format(body)
    elif kind == 'nudge' and body not in [each.name for each in scene.bodies if each.mass > 0]:
        wrong = 'no body {!r} that can be moved'.format(body)
    else:
        wrong = _wrong_value(kind, disturbance, robot)
    if wrong:
        raise SceneBuildError('disturbance {!r}: {}'.format(disturbance.kind, wrong))


def _wrong_value(kind: str, disturbance: Disturbance, robot: Pr2Body) -> str:
    for name, value in disturbance.values:
        if not math.isfinite(value):
            return '{} is {}; allowed: finite numbers'.format(name, value)
        if name in OPTIONS[kind]:
            if name not in ('dx', 'dy') and value < 0:
                return '{} is {}; allowed: 0 or more'.format(name, value)
        elif kind != 'arm':
            return 'unknown value {!r}; allowed: {}'.format(name, ', '.join(OPTIONS[kind]))
        elif robot.refusal(name, value):
            return robot.refusal(name, value)
    return ''
