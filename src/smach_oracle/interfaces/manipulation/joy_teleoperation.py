"""The node `joy_teleoperation`: a joystick drives a manipulation interface.

The joystick is any that publishes sensor_msgs/Joy, such as a SpaceNav or a gamepad.
"""

import math
import threading
import time
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import rospy
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from smach_oracle.msg import TeleopCommand, TeleopState
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.master_watch import start_master_watch

from .cartesian_drive import GRIPPER_OPEN

BUTTONS = ('dead_man', 'open', 'close', 'toggle')
AXES = ('x', 'y', 'z', 'roll', 'pitch', 'yaw')
_MOST_INDEX = 63


class JoySettings(NamedTuple):
    """See launch/joy_teleoperation.yaml."""

    # by name: index in Joy.axes, and m/s or rad/s at full deflection
    axes: Dict[str, Tuple[int, float]]
    dead_man: int  # index in Joy.buttons
    open: int  # -1: none
    close: int
    toggle: int  # closes and opens by turns
    gripper_open: float  # m
    dead_zone: float  # share of the full deflection
    silent_s: float  # without a message of the joystick for so long, its dead-man counts as let go
    rate_hz: float
    frame: str
    arm: str  # '': the one that the interface has chosen for the state
    operator: str

    @classmethod
    def from_dict(cls, given: Mapping[str, Any]) -> 'JoySettings':
        """Check parameters.

        :raises SettingsError: naming the parameter, its value and what is allowed.
        """
        axes = given.get('axes')
        if not isinstance(axes, Mapping) or not axes:
            raise SettingsError(
                '~axes', axes, 'a mapping of {} to [index, speed]'.format(', '.join(AXES))
            )
        buttons = given.get('buttons', {})
        if not isinstance(buttons, Mapping) or 'dead_man' not in buttons:
            raise SettingsError(
                '~buttons',
                buttons,
                'a mapping with dead_man, and open, close or toggle where there are such',
            )
        unknown = sorted(set(buttons) - set(BUTTONS), key=str)
        if unknown:
            raise SettingsError(
                '~buttons/{}'.format(unknown[0]),
                buttons[unknown[0]],
                'the keys ' + ', '.join(BUTTONS),
            )
        pressed = {
            name: _index('~buttons/' + name, buttons.get(name, -1), 0 if name == 'dead_man' else -1)
            for name in BUTTONS
        }
        return cls(
            {name: _axis(name, value) for name, value in axes.items()},
            pressed['dead_man'],
            pressed['open'],
            pressed['close'],
            pressed['toggle'],
            _number('~gripper_open', given.get('gripper_open', GRIPPER_OPEN), 0.0, 1.0),
            _number('~dead_zone', given.get('dead_zone', 0.05), 0.0, 0.9),
            _number('~silent_s', given.get('silent_s', 0.3), 0.02, 2.0),
            _number('~rate_hz', given.get('rate_hz', 50.0), 30.0, 200.0),
            _text('~frame', given.get('frame'), 'the name of a link of the robot'),
            _text('~arm', given.get('arm', ''), 'the name of an arm, or none', 0),
            _text('~operator', given.get('operator', 'joystick'), 'a name'),
        )


class JoystickCommand(NamedTuple):
    """A command of the joystick: m/s and rad/s of the tool, m between the finger tips."""

    held: bool
    linear: Tuple[float, float, float]
    angular: Tuple[float, float, float]
    gripper: Optional[float]  # m


RELEASED = JoystickCommand(False, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), None)


def joystick_command(
    settings: JoySettings, axes: Sequence[float], buttons: Sequence[int]
) -> JoystickCommand:
    """The command of a joystick's message. An axis that is missing or not finite moves nothing."""
    if not _pressed(buttons, settings.dead_man):
        return RELEASED
    speeds = []
    for name in AXES:
        index, most = settings.axes.get(name, (-1, 0.0))
        value = axes[index] if 0 <= index < len(axes) else 0.0
        if not math.isfinite(value):
            return RELEASED
        speeds.append(
            0.0 if abs(value) <= settings.dead_zone else max(-1.0, min(1.0, value)) * most
        )
    gripper = None
    if _pressed(buttons, settings.open) != _pressed(buttons, settings.close):
        gripper = settings.gripper_open if _pressed(buttons, settings.open) else 0.0
    return JoystickCommand(
        True, (speeds[0], speeds[1], speeds[2]), (speeds[3], speeds[4], speeds[5]), gripper
    )


class GripperToggle:
    """A button that closes the gripper, and opens it when it is pressed again."""

    def __init__(self, settings: JoySettings) -> None:
        self._settings = settings
        self._down = False
        self._counts = False  # it was pressed while the dead-man was held
        self._closes = False

    def applied(self, command: JoystickCommand, buttons: Sequence[int]) -> JoystickCommand:
        """A command, with the gripper as the button wants it.

        A press counts if the dead-man is held when it begins, and is repeated while both are held:
        a moment without the dead-man in the midst of a press is no new one, and does not open the
        hand.
        """
        was_down, self._down = self._down, _pressed(buttons, self._settings.toggle)
        if self._down and not was_down:
            self._counts = command.held
            self._closes = self._closes != command.held
        if not (self._down and self._counts and command.held):
            return command
        return command._replace(gripper=0.0 if self._closes else self._settings.gripper_open)


class JoyTeleoperation:
    """Sends commands while the dead-man button is held, and one that stops when it is let go."""

    def __init__(self, settings: JoySettings) -> None:
        self._settings = settings
        self._command, self._came_s = RELEASED, -math.inf
        self._toggle = GripperToggle(settings)
        self._arm = settings.arm
        self._seq = 0
        self._lock = threading.Lock()
        self._publisher = rospy.Publisher('command', TeleopCommand, queue_size=2, tcp_nodelay=True)
        self._subscribers = [
            rospy.Subscriber('state', TeleopState, self._on_state, queue_size=2),
            rospy.Subscriber('joy', Joy, self._on_joy, queue_size=1, tcp_nodelay=True),
        ]

    def run(self) -> None:
        """Until the node goes down, in wall time, as a joystick is."""
        was_held = False
        while not rospy.is_shutdown():
            with self._lock:
                fresh = time.monotonic() - self._came_s <= self._settings.silent_s
                command = self._command if fresh else RELEASED
            if command.held or was_held:
                self._send(command)
            was_held = command.held
            time.sleep(1.0 / self._settings.rate_hz)

    def _send(self, command: JoystickCommand) -> None:
        self._seq += 1
        self._publisher.publish(
            TeleopCommand(
                header=Header(frame_id=self._settings.frame, stamp=rospy.Time.now()),
                operator=self._settings.operator,
                seq=self._seq,
                arm=self._arm,
                dead_man=command.held,
                twist=Twist(Vector3(*command.linear), Vector3(*command.angular)),
                move_gripper=command.gripper is not None,
                gripper=command.gripper or 0.0,
            )
        )

    def _on_joy(self, message: Joy) -> None:
        command = self._toggle.applied(
            joystick_command(self._settings, message.axes, message.buttons), message.buttons
        )
        with self._lock:
            self._command, self._came_s = command, time.monotonic()

    def _on_state(self, state: TeleopState) -> None:
        if not self._settings.arm:
            self._arm = state.arm


def _pressed(buttons: Sequence[int], index: int) -> bool:
    return 0 <= index < len(buttons) and buttons[index] == 1


def _axis(name: str, value: object) -> Tuple[int, float]:
    key = '~axes/{}'.format(name)
    if name not in AXES:
        raise SettingsError(key, value, 'the keys ' + ', '.join(AXES))
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise SettingsError(key, value, '[index, speed at full deflection in m/s or rad/s]')
    return _index(key, value[0], 0), _number(key, value[1], -5.0, 5.0)


def _index(key: str, value: object, least: int) -> int:
    allowed = 'an index from {} to {}'.format(least, _MOST_INDEX)
    index: int = checks.whole(least, allowed, _MOST_INDEX)(key, value)
    return index


def _number(key: str, value: object, least: float, most: float) -> float:
    allowed = 'a number from {:g} to {:g}'.format(least, most)
    number: float = checks.number(least, most, allowed)(key, value)
    return number


def _text(key: str, value: object, allowed: str, least: int = 1) -> str:
    if not isinstance(value, str) or len(value) < least:
        raise checks.no_name(key, value, allowed)
    return value


def _parameters() -> Dict[str, Any]:
    names: List[str] = [
        'axes',
        'buttons',
        'gripper_open',
        'dead_zone',
        'silent_s',
        'rate_hz',
        'frame',
        'arm',
        'operator',
    ]
    return {name: rospy.get_param('~' + name) for name in names if rospy.has_param('~' + name)}


def main() -> None:
    """Entry point of the node."""
    parameters_only(
        'Node: a joystick (topic joy) drives a manipulation interface (topics command and state). '
        'Parameters: ~axes, ~buttons, ~frame and more; see launch/joy_teleoperation.yaml.'
    )
    rospy.init_node('joy_teleoperation')
    start_master_watch()
    try:
        settings = JoySettings.from_dict(_parameters())
    except SettingsError as err:
        rospy.logfatal('joy_teleoperation: %s', err)
        raise SystemExit(2) from err
    JoyTeleoperation(settings).run()
