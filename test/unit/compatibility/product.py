"""All modules of the product that these tests import. Where one moves, this file alone changes.

Names that users import are not here: test_held_names.py looks for them where they were.
"""

import importlib
import sys
from pathlib import Path
from typing import Any, Dict, Mapping, Tuple

import rospy

from smach_oracle import OracleContainer
from smach_oracle.analysis.bag_machines import read_machines
from smach_oracle.expert.console.web.access import load_tokens
from smach_oracle.expert.scripted_expert import load_rules
from smach_oracle.interfaces.manipulation.joy_teleoperation import JoySettings
from smach_oracle.interfaces.manipulation.settings import TeleoperationSettings
from smach_oracle.interfaces.perception.output_templates import templates_from
from smach_oracle.oracle import Settings
from smach_oracle.ros.loaded_settings import load_settings, read_param
from smach_oracle.scripted_operator.node import OperatorSettings

__all__ = [
    'OracleContainer',
    'from_parameter',
    'joystick',
    'machine',
    'manipulation',
    'operator',
    'perception',
    'plain',
    'read_machines',
    'rules',
    'settings_of',
    'tokens',
]

# keys of the YAML files, which are attributes of Settings and of the result of its for_state
MACHINE_KEYS = (
    'policy',
    'failing_outcomes',
    'userdata',
    'deep_copy_keys',
    'deadline_s',
    'on_no_answer',
    'escalate',
    'watch_preconditions',
    'history_length',
    'rates_file',
    'oracle_label',
    'nested',
)
STATE_KEYS = (
    'memory',
    'prior',
    'moderate_from',
    'high_from',
    'estimator',
    'max_recoveries',
    'failure_outcomes',
    'author_recoveries',
    'time_limit_s',
    'grace_period_s',
)
NOWHERE = 'A_STATE_THAT_IS_NOWHERE'  # in no file: it has the settings of every state


def settings_of(path: Path) -> Dict[str, Any]:
    """The effective values of a settings file of the oracle."""
    return _effective(load_settings(str(path), None))


def from_parameter(value: Mapping[str, Any], monkeypatch: Any) -> Dict[str, Any]:
    """The effective values of a mapping that the parameter server holds as ~oracle."""
    _serve({'oracle': value}, monkeypatch)
    return _effective(read_param('~oracle').values)


def _effective(given: Mapping[str, Any]) -> Dict[str, Any]:
    settings = Settings.from_dict(given, _resolve)
    effective = {key: plain(getattr(settings, key)) for key in MACHINE_KEYS}
    named = [NOWHERE] + sorted(given.get('states') or {})
    effective['states'] = {name: _effective_of_state(settings, *_split(name)) for name in named}
    return effective


def _effective_of_state(settings: Settings, path: str, label: str) -> Dict[str, Any]:
    chosen = settings.for_state(path, label)
    found = {key: plain(getattr(chosen, key)) for key in STATE_KEYS}
    found['preconditions'] = [
        [spec.name, spec.kind.value, list(spec.labels())] for spec in chosen.preconditions
    ]
    found['interfaces'] = [plain(offer) for offer in settings.offers_for(path, label)]
    return found


def _split(name: str) -> Tuple[str, str]:
    path, _, label = name.rpartition('/')
    return path, label


def _resolve(name: str) -> Any:
    """Stands for an object of the user's own, which this machine does not have."""

    def check(userdata: object) -> bool:
        return bool(userdata)

    check.__name__ = name.rpartition(':')[2]
    return check


def rules(path: Path) -> Any:
    """The scripted expert's rules; `next(robot, trial_id, container_path, state)` is one."""
    return load_rules(None, str(path))


def manipulation(given: Mapping[str, Any], monkeypatch: Any) -> Any:
    """The settings of the manipulation interface."""
    _serve(given, monkeypatch)
    return TeleoperationSettings.from_parameters()


def joystick(given: Mapping[str, Any]) -> Any:
    """The settings of the joystick."""
    return JoySettings.from_dict(given)


def perception(given: Mapping[str, Any]) -> Any:
    """What the perception interface hands over, by state."""
    return templates_from(given['states'])


def operator(given: Mapping[str, Any], monkeypatch: Any) -> Any:
    """The settings of the scripted operator."""
    _serve(given, monkeypatch)
    return OperatorSettings()


def tokens(path: Path) -> Any:
    """The console's tokens; `identify(token)` is the role and the name of its owner."""
    return load_tokens(str(path))


def _serve(values: Mapping[str, Any], monkeypatch: Any) -> None:
    """Let the node's private parameters be these."""

    def get_param(key: str, default: Any = None) -> Any:
        return values.get(key.lstrip('~'), default)

    monkeypatch.setattr(rospy, 'get_param', get_param)
    monkeypatch.setattr(rospy, 'resolve_name', lambda name: '/node/' + name.lstrip('~'))


def machine(name: str) -> Any:
    """The state machine of one of the scripts that made the data."""
    folder = str(Path(__file__).resolve().parents[2] / 'data/v0_1/make')
    if folder not in sys.path:
        sys.path.append(folder)
    return importlib.import_module(name).build()


def plain(value: Any) -> Any:
    """Plain data, as JSON has it, of named tuples and their contents."""
    if hasattr(value, '_asdict'):
        return {key: plain(item) for key, item in value._asdict().items()}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value
