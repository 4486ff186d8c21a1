"""Borders of settings: YAML files, parameters, rules."""

import contextlib
import os
import tempfile
from typing import Any, Callable, Dict, Sequence
from unittest import mock

import yaml
from hypothesis import strategies as st

from smach_oracle.expert.console.web.settings import read_settings as read_console
from smach_oracle.expert.rules import Rules
from smach_oracle.expert.scripted_expert import load_rules
from smach_oracle.interfaces.manipulation.arm_port import _FIELDS as ARM_FIELDS
from smach_oracle.interfaces.manipulation.joy_teleoperation import JoySettings
from smach_oracle.interfaces.manipulation.settings import TeleoperationSettings
from smach_oracle.interfaces.perception.output_templates import OUTPUT_PARTS, templates_from
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.settings import GROUPS, Settings
from smach_oracle.ros import loaded_settings, parameters
from smach_oracle.ros.expert import server
from smach_oracle.scripted_operator.state_plans import MEANS, StatePlans
from smach_oracle.simulation.node.settings import read_settings as read_world

from .border import TAKEN, Border, refused
from .setting_values import BY_NAME, counts, flags, names, seconds, shares
from .values import damaged, mapping_of, numbers, plain, texts, words


def _group(group: str) -> Any:
    members = {GROUPS.key_of(name).split('.')[1]: BY_NAME[name] for name in GROUPS.members(group)}
    return st.one_of(*([BY_NAME[group]] if group in BY_NAME else []), mapping_of(members))


settings_given = mapping_of({**BY_NAME, **{group: _group(group) for group in GROUPS.texts}})


def _settled(make: Callable[[], Any]) -> str:
    try:
        make()
    except SettingsError as err:
        return refused(err, 'allowed: ')
    return TAKEN


def _resolved(name: str) -> object:
    """In place of what imports whatever a setting names."""
    loaded_settings.split_python_name(name)
    return lambda *_: True


def _as_yaml(value: Any) -> bytes:
    return yaml.safe_dump(value, allow_unicode=True).encode('utf-8', 'surrogatepass')


def _odd_yaml(whole: bytes) -> Any:
    tags = st.sampled_from(
        [
            b'memory: !!int x',
            b'a: &a [*a]',
            b'a: &a {b: *a}',
            b'? [1]\n: 2',
            b'memory: 1\nmemory: 2',
            b'states: {A: !!python/object/apply:os.system [ls]}',
            b'{' * 2000,
            b'- ' * 3000,
            b'<<: {memory: 3}',
            b'memory: !!timestamp 2001-99-99',
            b'memory: 0x',
            b'memory: 1:99:99',
            b'a: !!binary "%"',
            b'!!set {a, b}',
            b'!!omap [a: 1]',
            b'memory: .inf',
            b'\xff\xfe',
            b'--- 1\n--- 2',
            b'states: !!pairs [a: 1]',
            b'"memory": 99999999999999999999',
            b'states: {1: {}}',
            b'memory: 2001-01-01',
            b'a: !!float x',
            b'a: !!bool x',
            b'a: !!null x',
            b'"\\ud800": 1',
            b'memory: "\\ud800"',
            b'memory: 2020-01-01 25:00:00',
            b'9' * 5000 + b': 1',
            b'memory: ' + b'9' * 5000,
        ]
    )
    return st.one_of(tags, damaged(whole), damaged(whole))


def _take_rules_file(text: bytes) -> str:
    return _in_file(text, lambda path: load_rules(None, path))


def _take_yaml(text: bytes) -> str:
    return _in_file(text, _with_origins)


def _in_file(text: bytes, read: Callable[[str], Any]) -> str:
    folder = tempfile.mkdtemp(prefix='border')
    path = os.path.join(folder, 'settings.yaml')
    try:
        with open(path, 'wb') as stream:
            stream.write(text)
        return _settled(lambda: read(path))
    finally:
        os.remove(path)
        os.rmdir(folder)


def _with_origins(path: str) -> None:
    """As the executive takes its settings from a file."""
    loaded = loaded_settings.load_settings(path, overrides={'policy': 'prose'})
    try:
        Settings.from_dict(loaded, _resolved)
    except SettingsError as err:
        raise loaded.located(err) from err


@contextlib.contextmanager
def parameters_are(given: Dict[str, Any]) -> Any:
    """Have a parameter server, as far as settings ask it."""

    def get(name: str, default: object = None) -> object:
        return given.get(name.lstrip('~').split('/node/')[-1], default)

    with mock.patch.multiple('rospy', get_param=get, resolve_name=lambda name: name), mock.patch(
        'rospy.core.is_initialized', lambda: True
    ), mock.patch.object(parameters, '_read', {}):
        yield


def _take_parameter(given: Dict[str, Any]) -> str:
    with parameters_are(given):
        return _settled(lambda: Settings.from_dict(loaded_settings.load_settings(), _resolved))


def _take_server(given: Dict[str, Any]) -> str:
    with parameters_are(given):
        return _settled(server.settings_from_parameters)


def _take_machine(given: Dict[str, Any]) -> str:
    with parameters_are(given):
        return _settled(
            lambda: (
                parameters.private_flag('introspection', True),
                parameters.private_text('record'),
                parameters.private_names('record_topics'),
            )
        )


def _take_hand(given: Dict[str, Any]) -> str:
    with parameters_are(given):
        return _settled(TeleoperationSettings.from_parameters)


def _take_console(given: Dict[str, Any]) -> str:
    # a file of tokens that is not there is made: none is named here
    given = {key: value for key, value in given.items() if key != 'token_file'}
    return _settled(
        lambda: read_console(lambda name, default: given.get(name.lstrip('~'), default))
    )


def _take_world(given: Dict[str, Any]) -> str:
    return _settled(lambda: read_world(lambda name, default: given.get(name.lstrip('~'), default)))


def _take_rules(given: Any) -> str:
    try:
        rules = Rules.parse(given)
    except SettingsError as err:
        return refused(err, 'allowed: ')
    for state in ('A', 'B'):
        rule = rules.next('robot', 'trial', 'TASK', state)
        assert rule.why_not(()) == '' and (rule.kind == 'ignore' or rule.answer('eva').by == 'eva')
    return TAKEN


def _nodes(fields: Dict[str, Any], always: Sequence[str] = ()) -> Any:
    """Parameters of a node: a mapping always."""
    return mapping_of(fields, always).filter(lambda drawn: isinstance(drawn, dict))


_ARM = mapping_of(
    dict({name: words('left_tool') for name in ARM_FIELDS}, posture=st.lists(numbers, max_size=2)),
    ARM_FIELDS,
)
_RULE = mapping_of(
    {
        'kind': words('goto', 'supersede', 'give_up', 'interface', 'ignore'),
        'state': names,
        'outcome': names,
        'interface': names,
        'outputs': st.dictionaries(texts, plain, max_size=2),
        'why': texts,
        'delay_s': seconds,
        'confirm': flags,
        'container': texts,
    },
    ['kind', 'state', 'outcome', 'interface'],
)
_RULES = st.dictionaries(
    words('A', 'TASK/B', 'default'), st.one_of(_RULE, st.lists(_RULE, max_size=2)), max_size=3
)
_TEMPLATES = st.dictionaries(
    texts,
    mapping_of(
        {
            'outcome': names,
            'outputs': st.dictionaries(
                names, st.sampled_from(sorted(OUTPUT_PARTS)), min_size=1, max_size=2
            ),
        },
        ['outputs'],
    ),
    max_size=2,
)

BORDERS = [
    Border('settings of a YAML file', settings_given.map(_as_yaml).flatmap(_odd_yaml), _take_yaml),
    Border(
        'settings of a mapping',
        settings_given,
        lambda given: _settled(lambda: Settings.from_dict(given, _resolved)),
    ),
    Border(
        'parameter oracle', _nodes({'oracle': settings_given, 'checkpoint': texts}), _take_parameter
    ),
    Border(
        'parameters of a wrapped machine',
        _nodes(
            {
                'introspection': st.booleans(),
                'record': texts,
                'record_topics': st.lists(texts, max_size=2),
            }
        ),
        _take_machine,
    ),
    Border(
        'parameters of expert_query_server',
        _nodes({'server_name': words('experts'), 'lease_s': seconds, 'asker_gone_s': seconds}),
        _take_server,
    ),
    Border(
        'parameters of manipulation_interface',
        _nodes(
            {
                'arms': st.dictionaries(words('left', 'right'), _ARM, min_size=1, max_size=2),
                'base_frame': names,
                'limits': mapping_of(
                    {
                        'linear': shares,
                        'stop_below': shares,
                        'slow_below': shares,
                        'workspace': st.lists(
                            st.lists(numbers, min_size=3, max_size=3), min_size=2, max_size=2
                        ),
                    }
                ),
                'states': st.dictionaries(
                    names,
                    mapping_of(
                        {
                            'arm': words('left'),
                            'outputs': st.dictionaries(names, words('tool_pose'), max_size=2),
                        }
                    ),
                    max_size=2,
                ),
                'rate_hz': st.sampled_from((30, 60, 45, 500)),
                'lock_step': flags,
                'lead': shares,
            },
            ['arms'],
        ),
        _take_hand,
    ),
    Border(
        'parameters of perception_interface',
        st.one_of(_TEMPLATES, plain),
        lambda given: _settled(lambda: templates_from(given)),
    ),
    Border(
        'parameters of expert_console',
        _nodes(
            {
                'address': words('127.0.0.1', 'localhost', '0.0.0.0'),
                'port': numbers,
                'allow_remote': st.booleans(),
                'certificate': texts,
                'private_key': texts,
                'hosts': st.lists(texts, max_size=2),
                'bags': st.lists(texts, max_size=2),
                'cameras': st.dictionaries(texts, st.lists(texts, max_size=2), max_size=2),
            }
        ),
        _take_console,
    ),
    Border(
        'parameters of pr2_world',
        _nodes(
            {
                'task': words('pick_and_place', 'kitchen'),
                'seed': counts,
                'benign': flags,
                'real_time_factor': shares,
                'idle_speed': seconds,
                'idle_grace': seconds,
                'truth_file': words('none'),
                'film': words('none'),
                'film_events': words('none'),
                'state_rate': seconds,
                'camera_rate': seconds,
                'camera_binning': counts,
            }
        ),
        _take_world,
    ),
    Border(
        'parameters of joy_teleoperation',
        _nodes(
            {
                'axes': st.dictionaries(
                    words('x', 'y', 'yaw'), st.tuples(counts, shares), min_size=1, max_size=2
                ),
                'buttons': mapping_of(
                    {'dead_man': counts, 'open': counts, 'toggle': counts}, ['dead_man']
                ),
                'dead_zone': shares,
                'rate_hz': seconds,
                'frame': names,
                'arm': texts,
            },
            ['axes', 'buttons', 'frame'],
        ),
        lambda given: _settled(lambda: JoySettings.from_dict(given)),
    ),
    Border(
        'parameters of scripted_operator',
        st.one_of(
            plain,
            st.dictionaries(
                names,
                mapping_of(
                    {
                        'means': st.sampled_from(sorted(MEANS)),
                        'arm': words('left', 'right'),
                        'otherwise': names,
                        'tries': counts,
                        'inside': flags,
                    },
                    ['means'],
                ),
                max_size=2,
            ),
        ),
        lambda given: _settled(lambda: StatePlans(given)),
    ),
    Border(
        'rules of a YAML file',
        # most drawn rules are odd as they are, so that some files must stay as they are
        st.one_of(_RULES.map(_as_yaml), _RULES.map(_as_yaml).flatmap(_odd_yaml)),
        _take_rules_file,
    ),
    Border('rules of scripted_expert', st.one_of(_RULES, plain), _take_rules),
]
