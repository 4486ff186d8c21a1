"""Things that happen to a trial's world while it goes on: each waits for its event, then has its course, once.

Kinds, with their values (a scene's Disturbance.values) and what these are where not given:
* ``arm``: joints by name, rad: somebody moves an arm there, in ``duration`` s (1.5).
* ``dim``: the light falls to ``brightness`` (0.15) for the next ``frames`` (2) of the camera.
* ``glare``: the share ``dropout`` (0.9) of the depth is lost in the next ``frames`` (2).
* ``swing:BODY``: the joints of a body that is a URDF, a door, swing to ``angle`` rad (0) in ``duration`` s (1.5).
* ``nudge:BODY``: a body is pushed over what it stands on by ``dx``, ``dy`` m (0) in ``duration`` s (0.4).

Events are counted since the reset: ``see`` or ``see:1`` is the first frame, ``drive:2`` the end of the second drive.
They are start, follow, follow_left, follow_right, open_left, close_left (and right), torso, look_at, drive, see.
"""
import math
from collections import Counter
from typing import TYPE_CHECKING, Dict, List, NamedTuple

import numpy as np

from ..robot.interface import ARMS
from .bodies import SceneError
from .pr2_body import PERIOD, Pr2Body
from .scene import Disturbance, Scene, Sensor

if TYPE_CHECKING:
    from .physics import World

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


class _Course(NamedTuple):
    """A disturbance that moves something, on its way."""

    cause: Disturbance
    values: Dict[str, float]
    periods: int  # how long it takes
    begun: int  # at which period
    start: Dict[str, float]  # arm, swing: where the joints were; nudge: where the body was, x and y


class Disturbances:
    """Those of one trial."""

    def __init__(self, scene: Scene, robot: Pr2Body) -> None:
        """Raises SceneError for a kind, event, value, joint or body that is not known."""
        for disturbance in scene.disturbances:
            _check(disturbance, scene, robot)
        self._waiting = list(scene.disturbances)
        self._counts: Counter = Counter()
        self._due: List[Disturbance] = []
        self._moving: List[_Course] = []
        self._blinding: List[List] = []  # [disturbance, frames left]

    def happened(self, event: str) -> None:
        """Count an event, and set off what waited for it."""
        self._counts[event] += 1
        now = '{}:{}'.format(event, self._counts[event])
        for disturbance in list(self._waiting):
            if _numbered(disturbance.after) == now:
                self._waiting.remove(disturbance)
                if disturbance.kind in ('dim', 'glare'):
                    self._blinding.append([disturbance, int(_values(disturbance)['frames'])])
                else:
                    self._due.append(disturbance)

    @property
    def moving(self) -> bool:
        """Something is being moved."""
        return bool(self._due or self._moving)

    def tick(self, world: 'World') -> None:
        """Called before each control period."""
        for disturbance in self._due:
            values = _values(disturbance)
            self._moving.append(_Course(disturbance, values, max(1, round(values['duration'] / PERIOD)), world.periods,
                                        _start(world, disturbance)))
        self._due = []
        for course in list(self._moving):
            done = world.periods - course.begun
            if done >= course.periods:
                self._moving.remove(course)
            if course.cause.kind == 'arm' and done < course.periods:
                _move_arm(world, course, done)
            elif course.cause.kind.startswith('swing'):
                _swing_body(world, course, done)
            elif course.cause.kind != 'arm':
                _move_body(world, course, done)

    def sensor(self, sensor: Sensor) -> Sensor:
        """How the camera sees just now, of how it sees undisturbed."""
        for disturbance, _ in self._blinding:
            values = _values(disturbance)
            if disturbance.kind == 'dim':
                sensor = sensor._replace(brightness=min(sensor.brightness, values['brightness']))
            else:
                sensor = sensor._replace(dropout=max(sensor.dropout, values['dropout']))
        return sensor

    def frame_taken(self) -> None:
        """The camera took a frame."""
        for entry in self._blinding:
            entry[1] -= 1
        self._blinding = [entry for entry in self._blinding if entry[1] > 0]


def _move_arm(world: 'World', course: _Course, done: int) -> None:
    for name, start in course.start.items():
        way = course.values[name] - start
        here, there = (_smooth(step / course.periods) for step in (done, done + 1))
        world.set_target(name, start + way * there, way * (there - here) / PERIOD)


def _move_body(world: 'World', course: _Course, done: int) -> None:
    name, share = course.cause.kind.partition(':')[2], min(1.0, (done + 1) / course.periods)
    x, y = world.body_pose(name)[:2, 3]
    pace = np.array([course.start['x'] + share * course.values['dx'] - x,
                     course.start['y'] + share * course.values['dy'] - y]) / PERIOD
    let_go = done >= course.periods
    pace *= 0.0 if let_go else min(1.0, FASTEST / max(float(np.hypot(*pace)), 1e-9))
    world.slide_body(name, pace[0], pace[1], let_go)


def _swing_body(world: 'World', course: _Course, done: int) -> None:
    name, let_go = course.cause.kind.partition(':')[2], done >= course.periods
    for joint, start in course.start.items():
        goal = start + _smooth(min(1.0, (done + 1) / course.periods)) * (course.values['angle'] - start)
        world.turn_body(name, joint, (goal - world.body_joint(name, joint)) / PERIOD, let_go)


def _smooth(share: float) -> float:
    return share * share * (3.0 - 2.0 * share)


def _values(disturbance: Disturbance) -> Dict[str, float]:
    return dict(OPTIONS[disturbance.kind.partition(':')[0]], **dict(disturbance.values))


def _start(world: 'World', disturbance: Disturbance) -> Dict[str, float]:
    if disturbance.kind == 'arm':
        return {name: world.robot.position(name) for name, _ in disturbance.values if name not in OPTIONS['arm']}
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
        wrong = 'unknown event {!r}; allowed: {}, each with :NUMBER'.format(disturbance.after, ', '.join(EVENTS))
    elif kind == 'swing' and body not in [each.name for each in scene.bodies if each.shape == 'urdf']:
        wrong = 'no body {!r} with joints'.format(body)
    elif kind == 'nudge' and body not in [each.name for each in scene.bodies if each.mass > 0]:
        wrong = 'no body {!r} that can be moved'.format(body)
    else:
        wrong = _wrong_value(kind, disturbance, robot)
    if wrong:
        raise SceneError('disturbance {!r}: {}'.format(disturbance.kind, wrong))


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
