"""Commands to drive a robot's arm through a manipulation interface. Pure."""

from typing import Any, Dict, Mapping, Tuple

from .checks import QUESTION, CommandSpec, flag, number, one_of, shown, text

FRAMES = ('tool', 'base', 'camera')
STOPPING_COMMANDS = ('leave_wheel', 'stop_hand')
GRIPPER = ('', 'open', 'close')
_LONGEST_PAGE_MS = 1e12  # how long a page may have been open


_AXES = 'three numbers from -1 to 1'
_share = number(-1.0, 1.0, _AXES)
_age = number(0.0, _LONGEST_PAGE_MS, 'milliseconds from 0')


def _axes(value: object) -> Tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError('{} is not allowed; allowed: {}'.format(shown(value), _AXES))
    return _share(value[0]), _share(value[1]), _share(value[2])


DRIVING_COMMANDS: Dict[str, CommandSpec] = {
    'take_wheel': CommandSpec('teleoperator', QUESTION),
    # whoever sees a robot may stop it
    'leave_wheel': CommandSpec('viewer', QUESTION),
    'stop_hand': CommandSpec('viewer', QUESTION),
    # linear, angular: forward, left, up, and turns about these, as shares of the interface's limits
    # sent: by the page's clock
    # arm: checked against the interface's own. '' means the one that it has chosen for the state
    'drive': CommandSpec(
        'teleoperator',
        dict(
            QUESTION,
            held=flag,
            frame=one_of(FRAMES),
            linear=_axes,
            angular=_axes,
            gripper=one_of(GRIPPER),
            sent=_age,
            arm=text(100),
        ),
    ),
}


def stops(name: str, arguments: Mapping[str, Any]) -> bool:
    """Whether a command can only stop something: it is never refused, and waits for nothing."""
    return name in STOPPING_COMMANDS or (name == 'drive' and not arguments['held'])
