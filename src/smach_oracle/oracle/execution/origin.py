"""The origin of a trial and its inputs: they tell which trials can be compared, and which pair."""

import dataclasses
import hashlib
import json
import math
import os
import platform
import socket
import sys
from enum import Enum
from importlib import import_module
from typing import Dict, Mapping

import smach
from smach_oracle.release import VERSION

from ..branches.upstream import HOOK
from ..identity import WeakIdentityMap, name_of
from ..settings.settings import Settings
from ..smach_private import data_of

DIGITS = 12  # of a digest
MOST_INPUTS = 20  # keys
LONGEST_INPUT = 100  # characters
LARGEST_INPUT = 1 << 63
_of_settings: WeakIdentityMap[Settings, str] = WeakIdentityMap()
_of_process: Dict[str, str] = {}


def origin_of(settings: Settings) -> Dict[str, str]:
    """Return what TRIAL_START says of a trial's origin.

    `host`; `version` of this package; `python`; `engine`, the version of smach, which is `own` for
    the one of this package; `ros`, the distribution; `script`, the name of the file that was run
    and a digest of its content as it was at the first trial of the process; `settings`, a digest of
    all of them, those of single states too. What is not known is left out.
    """
    if not _of_process:
        _of_process.update(_process())
    digest = _of_settings.get(settings)
    if digest is None:
        text = json.dumps(_plain(settings), sort_keys=True)
        digest = _of_settings[settings] = _digest(text.encode())
    return dict(_of_process, settings=digest)


def inputs_of(userdata: object) -> Dict[str, object]:
    """Return the plain values of the userdata with which a trial begins.

    These are numbers, words of at most LONGEST_INPUT characters, and truth values, of at most
    MOST_INPUTS keys. Two trials that are to do the same have the same ones.
    """
    if not isinstance(userdata, smach.UserData):  # a script may put anything there
        return {}
    held = data_of(userdata).copy()
    keys = sorted(key for key, value in held.items() if type(key) is str and _is_input(value))
    return {key: held[key] for key in keys[:MOST_INPUTS]}


def _is_input(value: object) -> bool:
    """Whether it is a plain value: of a plain type itself, for another one may raise."""
    if type(value) is float:
        return math.isfinite(value)
    if type(value) is str:
        return len(value) <= LONGEST_INPUT
    # of a larger number Python makes no text
    return type(value) is bool or (type(value) is int and abs(value) < LARGEST_INPUT)


def _process() -> Dict[str, str]:
    told = {
        'host': socket.gethostname(),
        'version': VERSION,
        'python': platform.python_version(),
        'engine': _engine(),
        'ros': os.environ.get('ROS_DISTRO', ''),
        'script': _script(),
    }
    return {what: each for what, each in told.items() if each}


def _engine() -> str:
    if hasattr(smach.Container, HOOK):
        return 'own'
    metadata = import_module('importlib.metadata')  # here, as it takes 4 to 15 ms
    try:
        return str(metadata.version('smach'))
    except ImportError:  # of that name no package is installed, as in a workspace
        return 'upstream'


def _script() -> str:
    path = getattr(sys.modules.get('__main__'), '__file__', None)
    try:
        # none as `-c`, no text where a script has set it, and a pipe may be read once
        if not isinstance(path, str) or not os.path.isfile(path):
            return ''
        name = os.path.basename(path).encode('utf-8', 'replace').decode('utf-8')
        with open(path, 'rb') as source:
            return '{} {}'.format(name, _digest(source.read()))
    except (OSError, ValueError):
        return ''


def _digest(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=DIGITS // 2).hexdigest()


def _plain(value: object) -> object:
    """Return plain data that is equal where settings are. An object stands there by its name."""
    if dataclasses.is_dataclass(value):
        return {each.name: _plain(getattr(value, each.name)) for each in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, Enum):
        return value.name
    if value is None or isinstance(value, (str, int, float)):
        return value
    return '{}.{}'.format(getattr(value, '__module__', ''), name_of(value))
