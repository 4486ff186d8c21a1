"""Things that happen to a trial's world while it goes on, each once, at its event.

Kinds, with their values (a scene's Disturbance.values) and the defaults of these:
* ``arm``: joints of an arm by name, rad: somebody pushes it there, in ``duration`` s (1.5). Its
  controllers are stopped meanwhile, and hold it then where it was let go. With ``motors`` 1 (0)
  they run on, and take it back. See pushed_arm.py.
* ``dim``: the light falls to ``brightness`` (0.15) for ``duration`` s (60).
* ``glare``: a place (``x``, ``y``, ``z``, m in the world) reflects light towards ``eye_x``,
  ``eye_y``, ``eye_z`` for ``duration`` s (60), within ``lobe`` rad (0.2) about that direction. It
  dazzles a patch of ``radius`` rad (0.2) of the image. See light.py.
* ``swing:BODY``: the joints of a body that is a URDF, a door, swing to ``angle`` rad (0) in
  ``duration`` s (1.5).
* ``nudge:BODY``: a body is pushed over what it stands on by ``dx``, ``dy`` m (0) in ``duration`` s
  (0.4).
* ``suck:BODY``: the doors of a body that are shut are held so with ``torque`` N m (50) at first,
  and with less and less, for ``duration`` s (30). It ends where one is opened.
* ``halt:ARM``: the motor of an arm's gripper is off for ``duration`` s (30).
* ``stick:BODY``: a body sticks to what it stands on with ``force`` N (20), until it is pulled off.

Each also takes ``delay`` s (0): how long after its event it begins. All times are the world's.

Events are counted since the reset: ``see`` or ``see:1`` is the first image, ``drive:2`` the end of
the second drive. They are start, follow, follow_left, follow_right, open_left, close_left (and
right), torso, look_at, depart, drive, see. A disturbance that has ``near`` counts only those that
happen near to that place. The place of look_at and see is the camera's, that of depart is where
the drive goes, and that of all others is the base's.
"""

import math
from typing import Dict, List, NamedTuple, Protocol

import numpy as np

from smach_oracle.pr2.robot import ARMS

from ..scenes.scene import Disturbance, Scene
from . import light
from .bodies import SceneBuildError
from .cause_log import CauseLog
from .easing import eased
from .pr2_body import PERIOD, Pr2Body, arm_of
from .pushed_arm import SETTLING_S

EVENTS = ('start', 'follow', 'torso', 'look_at', 'depart', 'drive', 'see') + tuple(
    '{}_{}'.format(what, arm) for what in ('follow', 'open', 'close') for arm in ARMS
)
SEEING = ('look_at', 'see')  # events that happen where the camera is
FASTEST = 0.5  # m/s, of a nudge
LOOK_PERIODS = 30  # control periods from one look at what has become of the causes to the next
SIGNED = ('dx', 'dy') + light.PLACES  # values that may be negative
OPTIONS: Dict[str, Dict[str, float]] = {
    'arm': {'duration': 1.5, 'motors': 0},
    **light.OPTIONS,
    'swing': {'angle': 0.0, 'duration': 1.5},
    'nudge': {'dx': 0.0, 'dy': 0.0, 'duration': 0.4},
    'suck': {'torque': 50.0, 'duration': 30.0},
    'halt': {'duration': 30.0},
    'stick': {'force': 20.0},
}
HOLDING = ('suck', 'halt', 'stick')  # those that move nothing, and hold something


class DisturbedWorld(Protocol):
    """The parts of World that a disturbance moves or needs."""

    periods: int  # control periods since the reset
    map_error: np.ndarray  # 4x4, odom_combined from the world

    @property
    def robot(self) -> Pr2Body:
        """See World."""

    def push_arm(self, joints: Dict[str, float], seconds: float, motors: bool) -> None:
        """See World."""

    def body_pose(self, name: str) -> np.ndarray:
        """See World."""

    def joints(self) -> Dict[str, float]:
        """See World."""

    def body_joint(self, name: str, joint: str) -> float:
        """See World."""

    def body_joints(self, name: str) -> List[str]:
        """See World."""

    def slide_body(self, name: str, x: float, y: float, let_go: bool) -> None:
        """See World."""

    def turn_body(self, name: str, joint: str, speed: float, let_go: bool) -> None:
        """See World."""

    def suck_door(self, name: str, torque: float) -> bool:
        """See World."""

    def stick_body(self, name: str, force: float) -> None:
        """See World."""

    def comes_off(self, name: str) -> bool:
        """See World."""


class _Outstanding:
    """A disturbance whose event has not come yet."""

    def __init__(self, disturbance: Disturbance) -> None:
        self.disturbance = disturbance
        self._event, _, number = _numbered(disturbance.after).partition(':')
        self._left = int(number)

    def comes_with(self, event: str, place: np.ndarray) -> bool:
        """Whether an event at a place (3,) is the one. It is counted."""
        near = self.disturbance.near
        if event == self._event and (
            near is None or float(np.linalg.norm(place - near.place)) <= near.within
        ):
            self._left -= 1
            return self._left == 0
        return False


class _Due(NamedTuple):
    """A disturbance whose event has come."""

    cause: Disturbance
    period: int  # at which it begins


class _ActiveDisturbance(NamedTuple):
    """A disturbance that moves something, on its way."""

    cause: Disturbance
    values: Dict[str, float]
    periods: int  # how long it takes
    begun: int  # at which period
    start: Dict[str, float]  # arm, swing: where the joints were. Nudge: where the body was, x and y


class _ActiveHold(NamedTuple):
    """A disturbance that holds something, from a control period on."""

    cause: Disturbance
    values: Dict[str, float]
    begun: int

    @property
    def ends(self) -> float:
        """The control period at which it ends by itself, inf for none."""
        periods = self.values.get('duration', math.inf) / PERIOD
        return self.begun + (max(1, round(periods)) if math.isfinite(periods) else math.inf)

    def begin(self, world: DisturbedWorld) -> None:
        """Take hold."""
        kind, _, what = self.cause.kind.partition(':')
        if kind == 'stick':
            world.stick_body(what, self.values['force'])
        elif kind == 'halt':
            world.robot.halt_gripper(what, True)

    def tick(self, world: DisturbedWorld) -> int:
        """Hold on. Return the control period at which it has ended, 0 where it has not."""
        kind, _, what = self.cause.kind.partition(':')
        ended = int(self.ends) if world.periods >= self.ends else 0
        if kind == 'suck':
            left = 0.0 if ended else (self.ends - world.periods) / (self.ends - self.begun)
            shut = world.suck_door(what, left * self.values['torque'])
            return ended if shut else ended or world.periods
        if kind == 'halt' and ended:
            world.robot.halt_gripper(what, False)
        if kind == 'stick' and world.comes_off(what):
            return world.periods
        return ended


class Disturbances:
    """The disturbances of one trial."""

    def __init__(self, scene: Scene, robot: Pr2Body) -> None:
        """Check the scene's disturbances.

        :raises SceneBuildError: for a kind, event, value, joint or body that is not known.
        """
        for disturbance in scene.disturbances:
            _check(disturbance, scene, robot)
        self._waiting = [_Outstanding(each) for each in scene.disturbances]
        self._due: List[_Due] = []
        self._moving: List[_ActiveDisturbance] = []
        self._holding: List[_ActiveHold] = []
        self.lights = light.Lights()
        self.log = CauseLog(scene.causes, [each.cause for each in scene.disturbances])

    def happened(self, event: str, period: int, place: np.ndarray) -> None:
        """Count an event, and set off what waited for it.

        :param period: the control period, since the reset.
        :param place: (3,) m in the world, where it happened.
        """
        for waiting in list(self._waiting):
            disturbance = waiting.disturbance
            if waiting.comes_with(event, place):
                self._waiting.remove(waiting)
                begins = period + round(_values(disturbance)['delay'] / PERIOD)
                if disturbance.kind in light.OPTIONS:
                    self._light(disturbance, begins)
                else:
                    self._due.append(_Due(disturbance, begins))

    def _light(self, disturbance: Disturbance, begins: int) -> None:
        values = _values(disturbance)
        ends = begins + max(1, round(values['duration'] / PERIOD))
        self.lights.add(light.Light(disturbance.kind, values, begins, ends))
        self.log.began(disturbance.cause, begins)
        self.log.ended(disturbance.cause, ends)

    @property
    def moving(self) -> bool:
        """Something is being moved, or is about to be."""
        return bool(self._moving or any(not _values(each.cause)['delay'] for each in self._due))

    def next_period(self, period: int, end: int) -> int:
        """The control period, from `period` to `end`, up to which none is due, and none lets go."""
        if self._moving:
            return period
        lets_go = [int(each.ends) for each in self._holding if math.isfinite(each.ends)]
        return max(period, min([end, *lets_go] + [each.period for each in self._due]))

    def tick(self, world: DisturbedWorld) -> None:
        """Move what is disturbed. It is called before each control period."""
        if world.periods % LOOK_PERIODS == 0:
            self.log.look(world, self.moving)
        now = [each for each in self._due if each.period <= world.periods]
        for disturbance, _ in now:
            values = _values(disturbance)
            self.log.began(disturbance.cause, world.periods)
            if disturbance.kind.partition(':')[0] in HOLDING:
                self._holding.append(_ActiveHold(disturbance, values, world.periods))
                self._holding[-1].begin(world)
                continue
            self._moving.append(
                _ActiveDisturbance(
                    disturbance,
                    values,
                    _periods(disturbance, values),
                    world.periods,
                    _start(world, disturbance),
                )
            )
        self._due = [each for each in self._due if each not in now]
        for hold in list(self._holding):
            ended = hold.tick(world)
            if ended:
                self._holding.remove(hold)
                self.log.ended(hold.cause.cause, ended)
        for active in list(self._moving):
            done = world.periods - active.begun
            if done >= active.periods:
                self._moving.remove(active)
                self.log.ended(active.cause.cause, world.periods)
            if active.cause.kind == 'arm' and not done:
                world.push_arm(
                    {name: active.values[name] for name in active.start},
                    active.values['duration'],
                    bool(active.values['motors']),
                )
            elif active.cause.kind.startswith('swing'):
                _swing_body(world, active, done)
            elif active.cause.kind != 'arm':
                _move_body(world, active, done)


def _move_body(world: DisturbedWorld, active: _ActiveDisturbance, done: int) -> None:
    name, share = active.cause.kind.partition(':')[2], min(1.0, (done + 1) / active.periods)
    x, y = world.body_pose(name)[:2, 3]
    pace = (
        np.array(
            [
                active.start['x'] + share * active.values['dx'] - x,
                active.start['y'] + share * active.values['dy'] - y,
            ]
        )
        / PERIOD
    )
    let_go = done >= active.periods
    pace *= 0.0 if let_go else min(1.0, FASTEST / max(float(np.hypot(*pace)), 1e-9))
    world.slide_body(name, pace[0], pace[1], let_go)


def _swing_body(world: DisturbedWorld, active: _ActiveDisturbance, done: int) -> None:
    name, let_go = active.cause.kind.partition(':')[2], done >= active.periods
    for joint, start in active.start.items():
        goal = start + eased(min(1.0, (done + 1) / active.periods)) * (
            active.values['angle'] - start
        )
        world.turn_body(name, joint, (goal - world.body_joint(name, joint)) / PERIOD, let_go)


def _values(disturbance: Disturbance) -> Dict[str, float]:
    return dict(
        {'delay': 0.0, **OPTIONS[disturbance.kind.partition(':')[0]]}, **dict(disturbance.values)
    )


def _periods(disturbance: Disturbance, values: Dict[str, float]) -> int:
    """Return how many control periods it takes until the world is left to itself."""
    seconds = values['duration'] + (SETTLING_S if disturbance.kind == 'arm' else 0.0)
    return max(1, round(seconds / PERIOD))


def _start(world: DisturbedWorld, disturbance: Disturbance) -> Dict[str, float]:
    if disturbance.kind == 'arm':
        return {name: world.robot.position(name) for name in _joints(disturbance)}
    kind, _, body = disturbance.kind.partition(':')
    if kind == 'swing':
        return {joint: world.body_joint(body, joint) for joint in world.body_joints(body)}
    x, y = (float(each) for each in world.body_pose(body)[:2, 3])
    return {'x': x, 'y': y}


def _joints(disturbance: Disturbance) -> List[str]:
    """Return the joints that an ``arm`` names."""
    return [
        name for name, _ in disturbance.values if name not in OPTIONS['arm'] and name != 'delay'
    ]


def _numbered(event: str) -> str:
    return event if ':' in event else event + ':1'


def _check(disturbance: Disturbance, scene: Scene, robot: Pr2Body) -> None:
    kind, _, body = disturbance.kind.partition(':')
    event, _, number = _numbered(disturbance.after).partition(':')
    wrong = ''
    if kind not in OPTIONS:
        wrong = 'unknown kind; allowed: {}'.format(', '.join(OPTIONS))
    elif event not in EVENTS or not number.isdecimal() or int(number) < 1:
        wrong = 'unknown event {!r}; allowed: {}, each with :NUMBER'.format(
            disturbance.after, ', '.join(EVENTS)
        )
    elif disturbance.near and not (
        disturbance.near.within > 0 and all(map(math.isfinite, disturbance.near.place))
    ):
        wrong = 'near is {}; allowed: a place of finite m, within more than 0 m'.format(
            tuple(disturbance.near)
        )
    elif kind in ('swing', 'suck') and body not in [
        each.name for each in scene.bodies if each.shape == 'urdf'
    ]:
        wrong = 'no body {!r} with joints'.format(body)
    elif kind in ('nudge', 'stick') and body not in [
        each.name for each in scene.bodies if each.mass > 0
    ]:
        wrong = 'no body {!r} that can be moved'.format(body)
    elif kind == 'halt' and body not in ARMS:
        wrong = 'unknown arm {!r}; allowed: {}'.format(body, ', '.join(ARMS))
    else:
        wrong = _wrong_value(kind, disturbance, robot)
    if wrong:
        raise SceneBuildError('disturbance {!r}: {}'.format(disturbance.kind, wrong))


def _wrong_value(kind: str, disturbance: Disturbance, robot: Pr2Body) -> str:
    for name, value in disturbance.values:
        if not math.isfinite(value):
            return '{} is {}; allowed: finite numbers'.format(name, value)
        if name in OPTIONS[kind] or name == 'delay':
            if name not in SIGNED and value < 0:
                return '{} is {}; allowed: 0 or more'.format(name, value)
        elif kind != 'arm':
            return 'unknown value {!r}; allowed: {}'.format(name, ', '.join(OPTIONS[kind]))
        elif robot.refusal(name, value):
            return robot.refusal(name, value)
    arms = {arm_of(name) for name in _joints(disturbance)}
    if kind == 'arm' and (len(arms) != 1 or '' in arms):
        return 'joints of arms {}; allowed: those of one'.format(sorted(arms))
    return ''
