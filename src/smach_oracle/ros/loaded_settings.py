"""Settings of the executive from a YAML file, the parameter server and the command line.

The parameter `~oracle` overrides the file, the command line overrides both. Mappings are merged key
by key, everything else is replaced. So is `on_no_answer`, and a policy by one of another name.
Before that, each source is put in groups, so that a key overrides the same one under its older
name. `smach_oracle.oracle` checks the values. Here every error learns where the key came from.
"""

import importlib
import os
from typing import Any, Dict, Iterable, Iterator, List, Mapping, NamedTuple, Optional, Tuple, cast

import rospy

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.identity import is_same
from smach_oracle.oracle.settings.names import did_you_mean
from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.oracle.settings.settings import GROUPS
from smach_oracle.oracle.settings.written import plain

from .log.said_once import warn_once
from .parameters import read_or_default
from .reading.yaml_files import read_yaml

DEFAULT_PARAM = '~oracle'
CHECKPOINT_PARAM = '~checkpoint'  # goes before the key of DEFAULT_PARAM
PYTHON_PREFIX = 'python:'
IN_CODE = 'settings given in code'


class SettingsSource(NamedTuple):
    """Settings from one place, in groups."""

    values: Mapping[str, Any]
    origin: str  # what to call the place in an error
    lines: Mapping[str, int] = {}  # of its dotted keys, where it is a file
    written: Mapping[str, str] = {}  # how a key is written, where it is in another way


class LoadedSettings(Dict[str, Any]):
    """Plain settings that know where each key was set."""

    def __init__(self, values: Optional[Mapping[str, Any]] = None) -> None:
        super().__init__()
        self._origins: Dict[str, str] = {}
        self._written: Dict[str, str] = {}
        if values:
            self.put(*in_groups(values, IN_CODE, tells=False))

    def put(
        self,
        values: Mapping[str, Any],
        origin: str,
        lines: Optional[Mapping[str, int]] = None,
        written: Optional[Mapping[str, str]] = None,
    ) -> None:
        """Merge values over those that are there.

        :param origin: what to call this source in an error.
        :param lines: dotted key -> line number, where the source is a file.
        :param written: dotted key -> how an error is to name it, where it is written so.
        """
        _merge_into(self, values)
        lines = lines or {}
        for key in _dotted_keys(values):
            self._written[key] = (written or {}).get(key, key)
            items = [item for item in lines if item.startswith(key + '[')]
            for replaced in [known for known in self._origins if known.startswith(key + '[')]:
                del self._origins[replaced]
            for each in [key] + items:
                line = lines.get(each)
                self._origins[each] = _place(origin, line)

    def overridden_by(self, values: Mapping[str, Any]) -> List[str]:
        """Return the values that `put` would replace, such as "max_recoveries: 5, now 0"."""
        mine, theirs = (
            dict(_leaves(cast('Mapping[str, object]', plain(each)))) for each in (self, values)
        )
        return [
            '{}: {!r}, now {!r}'.format(key, mine[key], value)
            for key, value in theirs.items()
            if key in mine and not is_same(mine[key], value)
        ]

    def origin(self, key: str) -> str:
        """Return where a dotted key, or the mapping it should be in, was set, '' for nowhere."""
        while key:
            if key in self._origins:
                return self._origins[key]
            key = key[: max(key.rfind('.'), key.rfind('['), 0)]
        return ''

    def located(self, err: SettingsError) -> SettingsError:
        """Return the same error, naming the source as well, and the key as it is written there."""
        origin = self.origin(err.key)
        return err.called(_moved(err.key, self._written)).set_at(origin) if origin else err


def load_settings(
    path: Optional[str] = None,
    param: Optional[str] = DEFAULT_PARAM,
    overrides: Optional[Mapping[str, Any]] = None,
    tells: bool = True,
    folder: str = '',
) -> LoadedSettings:
    """Read and merge the settings.

    :param path: a YAML file, or None.
    :param param: a parameter that holds a mapping. Read only where this process is a ROS node.
    :param overrides: from the command line.
    :param tells: whether older keys of the file are warned of.
    :param folder: where relative paths start, that of the file and those in it. '': where the
        process is now.
    :raises SettingsError: naming file and line, or parameter, key, value and what is allowed.
    """
    settings = LoadedSettings()
    if path:
        values, lines = read_yaml(os.path.join(folder, path_of(path)))
        settings.put(*in_groups(values, str(path), lines, tells))
        _start_at(folder, settings)
    if param and rospy.core.is_initialized():
        settings.put(*read_param(param))
        settings.put(*read_checkpoint())
    if overrides:
        settings.put(*in_groups(overrides, 'command line'))
    return settings


def _start_at(folder: str, settings: Dict[str, Any]) -> None:
    """Have relative paths in settings, in groups, start at a folder."""
    for group, key in ((settings, 'rates_file'), (settings.get('checkpoint', {}), 'file')):
        if folder and isinstance(group.get(key), str) and group[key]:
            group[key] = os.path.join(folder, path_of(group[key]))


def in_groups(
    values: Mapping[str, Any],
    origin: str,
    lines: Optional[Mapping[str, int]] = None,
    tells: bool = True,
) -> SettingsSource:
    """Return settings with each key in its group.

    An older key is warned of once, unless `tells` is false, as for code: there it is the name of a
    field.

    :raises SettingsError: as `Groups.given_in`, naming the place.
    """
    lines = lines or {}
    try:
        given = GROUPS.given_in(values)
    except SettingsError as err:
        raise err.set_at(_place(origin, lines.get(err.key))) from err
    written = {GROUPS.key_of(each.name): each.written for each in given}
    for key, older in written.items():
        if older in GROUPS.older_keys() and tells:
            place = _place(origin, lines.get(older))
            warn_once('{}: {} is now called {}'.format(place, older, key))
    moved = {older: key for key, older in written.items()}
    return SettingsSource(
        GROUPS.in_groups(given),
        origin,
        {_moved(key, moved): line for key, line in lines.items()},
        written,
    )


def _place(origin: str, line: Optional[int]) -> str:
    return '{} line {}'.format(origin, line) if line else origin


def _moved(key: str, moved: Mapping[str, str]) -> str:
    """Return a dotted key under another name, as what it lies in has one."""
    for old, new in moved.items():
        if old != new and (key == old or key.startswith((old + '.', old + '['))):
            return new + key[len(old) :]
    return key


def read_param(param: str) -> SettingsSource:
    """Read a mapping of settings from the parameter server.

    :returns: empty where it is not set, or the master cannot be asked (logged): a robot starts
        without it.
    :raises SettingsError: where it is set to something else, or is wrong as `in_groups` says.
    """
    name = 'parameter ' + str(rospy.resolve_name(param))
    values = read_or_default(param, {})
    if not isinstance(values, dict):
        raise SettingsError(name, values, 'a mapping of settings')
    if isinstance(values.get('states'), dict):
        values['states'] = dict(_state_entries(values['states']))
    return in_groups(values, name)


def read_checkpoint() -> SettingsSource:
    """Return the private parameter `~checkpoint` as a setting, empty where it is not set.

    :raises SettingsError: where it is neither the name of a file nor the group of this name.
    """
    value = read_or_default(CHECKPOINT_PARAM, '')
    return in_groups(
        {'checkpoint': value} if value != '' else {},
        'parameter ' + str(rospy.resolve_name(CHECKPOINT_PARAM)),
    )


def resolve_python(name: str) -> object:
    """Import the object that `python:module:attribute` names.

    An example is `python:my_robot.checks:view_is_clear`. A dotted attribute is followed. The class
    of a state is instantiated without arguments.

    :raises ValueError: where the form is wrong or the module has no such attribute.
    :raises ImportError: where the module cannot be imported. Any other exception of the module
        surfaces as it is.
    """
    module, attributes = split_python_name(name)
    found: object = importlib.import_module(module)
    for attribute in attributes.split('.'):
        if not hasattr(found, attribute):
            raise ValueError(missing_attribute(module, attribute, dir(found)))
        found = getattr(found, attribute)
    return found() if isinstance(found, type) and hasattr(found, 'execute') else found


def missing_attribute(module: str, attribute: str, names: Iterable[str]) -> str:
    """Return what to say where a module lacks an attribute. `names`: those that it has."""
    owner = 'the script' if module == '__main__' else 'the module ' + module
    return '{} has no {!r}{}'.format(owner, attribute, did_you_mean(attribute, names))


def split_python_name(name: str) -> Tuple[str, str]:
    """Return the module and attribute of `python:module:attribute`.

    :raises ValueError: where it has another form.
    """
    parts = name[len(PYTHON_PREFIX) :].split(':') if name.startswith(PYTHON_PREFIX) else []
    if len(parts) != 2 or not all(parts):
        raise ValueError('the form is python:module:attribute')
    return parts[0], parts[1]


def _merge_into(target: Dict[str, Any], values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        if isinstance(value, Mapping):
            inner = target.get(key)
            if not isinstance(inner, Mapping) or _is_another(key, inner, value):
                inner = {}
            target[key] = dict(inner)
            _merge_into(target[key], value)
        else:
            target[key] = value


def _is_another(key: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    """Whether a mapping takes the place of one: a fallback, or a policy of another name."""
    if key == 'policy':
        return bool(now.get('name', before.get('name')) != before.get('name'))
    return key == 'on_no_answer'


def _dotted_keys(values: Mapping[str, Any], prefix: str = '') -> Iterator[str]:
    for key, value in values.items():
        dotted = '{}{}'.format(prefix, key)
        yield dotted
        if isinstance(value, Mapping):
            yield from _dotted_keys(value, dotted + '.')


def _leaves(values: Mapping[str, Any], prefix: str = '') -> Iterator[Tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, '{}{}.'.format(prefix, key))
        else:
            yield '{}{}'.format(prefix, key), value


def _state_entries(states: Mapping[str, Any], prefix: str = '') -> Iterator[Tuple[str, Any]]:
    """Restore the key "PATH/LABEL", which the parameter server splits.

    It makes of it a mapping PATH with a mapping LABEL in it.

    No setting of a state is itself a mapping, so a mapping inside a state's settings is a state
    further down.
    """
    for label, entry in states.items():
        if not isinstance(entry, dict):
            yield prefix + label, entry
            continue
        own = {key: value for key, value in entry.items() if not isinstance(value, dict)}
        deeper = {key: value for key, value in entry.items() if isinstance(value, dict)}
        if own or not deeper:
            yield prefix + label, own
        yield from _state_entries(deeper, '{}{}/'.format(prefix, label))
