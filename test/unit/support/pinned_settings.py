"""Every setting with every kind of value, and what becomes of it: taken as what, or refused how.

    python3 test/unit/support/pinned_settings.py FOLDER [--pin]

writes that to FOLDER, and with --pin the digests to test/data/pinned/settings.txt. What users see
of a change is the difference of two folders, of before and after it.
"""

import os
import re
import sys
from pathlib import Path
from typing import Any, Dict, Iterator, List, Tuple
from unittest import mock

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from pinned import ADDRESS, write_told

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.checks import settings_of
from smach_oracle.oracle.settings.settings import GROUPS, Settings, StateSettings, as_settings
from smach_oracle.oracle.settings.written import WrittenFloat, WrittenInt, WrittenWord

FILE = 'pinned_settings'


def holds(userdata: Any) -> bool:
    """A precondition, or a condition of health."""
    return True


def _int(text: str) -> WrittenInt:
    number = WrittenInt(text)
    number.text = text
    return number


def _float(text: str) -> WrittenFloat:
    number = WrittenFloat(text)
    number.text = text
    return number


VALUES: Tuple[Any, ...] = (
    None,
    True,
    False,
    -1,
    0,
    1,
    2,
    3,
    10**6,
    10**6 + 1,
    2**62,
    2**62 + 1,
    2**63,
    -0.5,
    0.0,
    0.1,
    0.5,
    0.9,
    1.0,
    1.5,
    30.0,
    60.0,
    60.5,
    3600.0,
    3600.5,
    1e9,
    float('inf'),
    float('nan'),
    '',
    ' ',
    'A',
    'ARM/A',
    'ARM/*',
    '**/A',
    '/A',
    'A/',
    'a b',
    'ORACLE',
    '0.5',
    'yes',
    'stop',
    'goto',
    'file.yaml',
    'no/such/folder/file.yaml',
    'python:module:holds',
    'python:module:nothing',
    'python:module',
    'fresh(/scan, 1.0)',
    WrittenWord('ON', True),
    WrittenWord('off', False),
    WrittenWord('~', None),
    _int('007'),
    _int('3'),
    _float('0.50'),
    _float('1e3'),
    (),
    [],
    [''],
    ['A'],
    ['A', 'A'],
    ['A', 1],
    ['python:module:holds'],
    [holds],
    ('A', 'B'),
    ('goto', 'A'),
    ('give_up', ''),
    {1, 2},
    b'A',
    holds,
    int,
    object(),
    {},
    {'A': 1},
    {'A': {}},
    {1: 'A'},
    {'goto': 'A'},
    {'goto': 'A', 'give_up': 'aborted'},
    {'give_up': 'aborted'},
    {'give_up': 3},
    {'name': 'prose'},
    {'name': 'algorithm1', 'memory': 3},
    {'name': 'random', 'seed': 1},
    {'name': 'nothing'},
    {'name': 'retry', 'times': 0},
    {'name': 'retry', 'times': 10**6},
    {'name': 'retry', 'times': 10**6 + 1},
    {'name': 'ladder', 'wait_s': 0, 'tries': 0, 'steps_back': 0},
    {'name': 'ladder', 'wait_s': 3600.0, 'tries': 1.0},
    {'name': 'ladder', 'wait_s': 3600.5},
    {'name': 'learned', 'explore': 0, 'seed': 0},
    {'name': 'learned', 'explore': 1, 'seed': 1},
    {'name': 'learned', 'explore': 1.5},
    {'recoveries': 1},
    {'recoveries': -1, 'questions': 2},
    {'recoveries': 0, 'questions': 0},
    {'minutes': 0},
    {'minutes': 0.001},
    {'question': 1},
    {'retry': 0.5, 'question': 10.0},
    {'robot_minute': 0, 'harm': 1e6},
    {'lost_trial': 1e6 + 0.5},
    {'file': 'robot.db', 'wait_s': 1.0},
    {'hand': {'action': 'hand/assist'}},
    {'hand': {'action': 'hand/assist', 'states': ['A'], 'description': 'by hand'}},
    {'hand': {'action': ''}},
    {'hand': {'states': 'A'}},
    {'hand': {'action': 'a', 'launch': 'p/l.launch', 'node': 'p/n'}},
    {'hand': {'action': 'a', 'launch': 'p/l.launch', 'start_limit_s': 0}},
    {'hand': {'action': 'a', 'launch': 'p/l.launch', 'start_limit_s': 0.1}},
    {'hand': {'action': 'a', 'node': 'p n', 'start_limit_s': 3600.0}},
    {'hand': {'action': 'a', 'node': 'p n', 'start_limit_s': 3600.5}},
    {'topic': '/battery', 'field': 'level', 'least': 0.2},
    {'topic': '/battery', 'at_least': 1, 'at_most': 1.0, 'max_age_s': 0.001},
    {'topic': '/battery', 'at_least': 1.5, 'at_most': 1},
    {'topic': '/battery', 'max_age_s': 0.0005},
    {'topic': '/battery', 'type': 'std_msgs/Float32', 'field': 'data', 'at_least': 0.2},
    {'function': holds},
    {'function': 'python:module:holds', 'name': 'ready'},
    {'diagnostics': 'arm'},
    {'fresh': '/scan', 'within_s': 1.0},
    [{'function': holds}, {'diagnostics': 'arm'}],
    {'A': {'memory': 5}},
    {'A': {'memory': 'x'}},
    {'A': {'memmory': 5}},
    {'A': {'policy': 'prose'}},
    {'A': {'deadline_s': 1.0}},
    {'ARM/*': {'prior': 0.5}, 'ARM/A': {'prior': 0.25}, '**': {'prior': 0.75}},
    {'A': {'moderate_from': 0.9}},
    {'A': {'high_from': 0.1}},
    {'A': {'preconditions': ['B', holds, '!C']}},
    {'A': {'preconditions': 'B'}},
)
PLACES = ('A', 'B', 'ARM/A', 'ARM/B', 'ARM/HAND/A')


def tell() -> Dict[str, List[str]]:
    """Return, for each setting and each place where it may stand, a line for each value."""
    with mock.patch.dict(os.environ, HOME='/ann'):  # '~' in the path of a file
        return _told()


def _told() -> Dict[str, List[str]]:
    told: Dict[str, List[str]] = {}
    for key in sorted({*settings_of(Settings), *settings_of(StateSettings), *GROUPS.top_keys()}):
        told['top {}'.format(key)] = [_line(value, {key: value}) for value in VALUES]
        group, _, member = GROUPS.key_of(key).partition('.')
        if member:
            told['group {}.{}'.format(group, member)] = [
                _line(value, {group: {member: value}}) for value in VALUES
            ]
        told['state {}'.format(key)] = [
            _line(value, {'states': {'A': {key: value}}}) for value in VALUES
        ]
        told['typos {}'.format(key)] = [_line(typo, given) for typo, given in _typos(key)]
    told['preconditions beside'] = [_beside(value) for value in VALUES]
    return told


def _typos(key: str) -> Iterator[Tuple[str, Dict[str, Any]]]:
    for typo in (key[1:], key[:-1], key + 's', key.upper(), key.replace('_', '-'), key[::-1]):
        yield typo, {typo: 1}
        yield typo, {'expert': {typo: 1}}
        yield typo, {'states': {'A': {typo: 1}}}


def _line(shown: Any, given: Dict[str, Any]) -> str:
    try:
        settings = Settings.from_dict(given, {'module:holds': holds}.get)
    except SettingsError as error:
        return _plain('{!r}: refused: {}'.format(shown, error))
    return _plain('{!r}: {}'.format(shown, _taken(settings)))


def _beside(value: Any) -> str:
    try:
        return _plain('{!r}: {}'.format(value, _taken(as_settings(None, value))))
    except SettingsError as error:
        return _plain('{!r}: refused: {}'.format(value, error))


def _taken(settings: Settings) -> str:
    """What differs from the defaults: as a whole, and for some states."""
    usual = Settings()
    found = [
        '{}={!r}'.format(name, getattr(settings, name))
        for name in sorted(settings_of(Settings))
        if getattr(settings, name) != getattr(usual, name)
    ]
    for place in PLACES:
        path, _, label = place.rpartition('/')
        own = settings.for_state(path, label)
        found += [
            '{}.{}={!r}'.format(place, name, getattr(own, name))
            for name in sorted(settings_of(StateSettings))
            if getattr(own, name) != getattr(usual.defaults, name)
        ]
        found += ['{} has {!r}'.format(place, each) for each in settings.offers_for(path, label)]
    return ', '.join(found)


def _plain(text: str) -> str:
    return re.sub(r'\{1, 2\}|\{2, 1\}', 'a set', ADDRESS.sub('', text)).replace('__main__', FILE)


if __name__ == '__main__':
    write_told('settings', tell(), Path(sys.argv[1]), '--pin' in sys.argv)
