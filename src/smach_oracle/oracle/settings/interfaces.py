"""The settings of shared-autonomy interfaces (paper, section V-A). Pure.

They say what is offered, for which states, and how it is started.
"""

import re
from typing import Mapping, NamedTuple, Optional, Sequence, Tuple

from ..errors import SettingsError
from . import checks as values
from .written import as_value

_KEYS = ('action', 'args', 'description', 'launch', 'node', 'start_limit_s', 'states')
_NAME = r'[A-Za-z0-9_.+-]+'
_LAUNCH = re.compile(r'({0})/({0}\.launch)'.format(_NAME))
_NODE = re.compile(r'({0}) +({0})'.format(_NAME))
_ARGUMENT = re.compile(r'[A-Za-z_][A-Za-z0-9_]*')
START_LIMIT_S = 60.0
_ACTION = values.graph_name('the name of an action, such as /hand', values.ROSPY_NAME)
_LIMIT = values.number(0.1, 3600.0, 'seconds from 0.1 to 3600')


class InterfaceStart(NamedTuple):
    """The way in which an interface that is not there is started."""

    kind: str  # 'launch' or 'node'
    package: str
    target: str  # file name or node type
    args: Tuple[str, ...] = ()
    limit_s: float = START_LIMIT_S  # how long its action server may take to come


class InterfaceOffer(NamedTuple):
    """A shared-autonomy interface on offer for the failed state (paper, section V-A)."""

    name: str
    action: str
    description: str = ''
    start: Optional[InterfaceStart] = None  # None: somebody else starts it


Offers = Tuple[Tuple[InterfaceOffer, Tuple[str, ...]], ...]


def checked_interfaces(key: str, given: object) -> Offers:
    """Return each offer with the states it serves, () for all of them.

    :raises SettingsError: naming key, value and what is allowed.
    """
    offers = []
    for name, entry in values.mapping(key, given).items():
        prefix = '{}.{}.'.format(key, name)
        entry = values.section(prefix[:-1], entry, _KEYS)
        if 'action' not in entry:
            raise SettingsError(prefix + 'action', None, 'the name of a SharedAutonomy action')
        offer = InterfaceOffer(
            name,
            _ACTION(prefix + 'action', entry['action']),
            values.text(prefix + 'description', entry.get('description', '')),
            _start(prefix, entry),
        )
        offers.append((offer, values.words(prefix + 'states', entry.get('states', ()))))
    return tuple(offers)


def _start(prefix: str, entry: Mapping[str, object]) -> Optional[InterfaceStart]:
    """Return how it is started, or None where it is somebody else's to start it."""
    kinds = [key for key in ('launch', 'node') if key in entry]
    if not kinds:
        for key in ('args', 'start_limit_s'):
            if key in entry:
                raise SettingsError(prefix + key, entry[key], 'given together with launch or node')
        return None
    if len(kinds) > 1:
        raise SettingsError(prefix + 'node', entry['node'], 'one of launch and node, not both')
    kind = kinds[0]
    pattern, allowed = {
        'launch': (_LAUNCH, 'PACKAGE/FILE.launch'),
        'node': (_NODE, 'PACKAGE TYPE'),
    }[kind]
    found = pattern.fullmatch(values.text(prefix + kind, entry[kind]))
    if found is None or '..' in found.string:
        raise SettingsError(prefix + kind, entry[kind], allowed)
    key, given = prefix + 'args', entry.get('args')
    if kind == 'launch':
        args: Sequence[str] = _launch_args(key, given)
    else:
        args = values.words(key, given if as_value(given) is not None else ())
    return InterfaceStart(
        kind,
        found.group(1),
        found.group(2),
        tuple(args),
        _LIMIT(prefix + 'start_limit_s', entry.get('start_limit_s', START_LIMIT_S)),
    )


def _launch_args(key: str, given: object) -> Sequence[str]:
    args = []
    for name, value in values.mapping(key, given).items():
        read = as_value(value)
        if not _ARGUMENT.fullmatch(name) or not isinstance(read, (str, int, float)):
            raise SettingsError(
                '{}.{}'.format(key, name),
                value,
                'the name of a launch argument, and text, a number or true or false',
            )
        args.append('{}:={}'.format(name, str(read).lower() if isinstance(read, bool) else read))
    return args
