"""Right values of the executive's settings, drawn at random. This needs no ROS."""

from typing import Any, Callable, Dict

from hypothesis import strategies as st

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.checks import settings_of
from smach_oracle.oracle.settings.settings import Settings, StateSettings

from .values import mapping_of, numbers, plain, texts, words

names = words('A', 'B', 'KITCHEN/LOOK')
shares, seconds, flags = st.floats(0, 1), st.floats(0, 60), st.booleans()
counts, lists = st.integers(1, 20), st.lists(names, max_size=3)
_PRECONDITION = st.one_of(
    names,
    st.just('python:checks:near'),
    mapping_of({'check': names, 'achieve': names}, ['check', 'achieve']),
)
# of the settings whose defaults do not tell what else they may be
_OF_KEY = {
    'policy': words('prose', 'algorithm1', 'retry'),
    'budget': mapping_of({'recoveries': counts, 'minutes': seconds, 'questions': counts}),
    'on_no_answer': words('stop', 'goto:A', 'give_up:aborted'),
    'time_limit_s': seconds,
    'still_running_factor': st.floats(1, 9),
    'on_resume': words('ask', 'recover', 'restart', 'state:A'),
    'resume_map': st.dictionaries(names, names, max_size=2),
    'oracle_label': names,
    'nested': st.one_of(flags, lists),
    'preconditions': st.lists(_PRECONDITION, max_size=2),
    'prior': shares,
    'moderate_from': shares,
    'high_from': shares,
}
_OF_TYPE = {bool: flags, int: counts, float: seconds, tuple: lists}


def _drawn(group: Any, *without: str) -> Dict[str, Any]:
    """Strategies for the settings of a dataclass."""
    return {
        key: _strategy(key, type(getattr(group, key)), facts['check'])
        for key, facts in settings_of(type(group)).items()
        if key not in without
    }


def _strategy(key: str, kind: type, check: Callable[[str, Any], Any]) -> Any:
    if key in _OF_KEY:
        return _OF_KEY[key]
    if kind in _OF_TYPE:
        return _OF_TYPE[kind]
    try:
        check(key, '\0')
    except SettingsError as err:  # a choice
        return words(*err.allowed.split(', '))
    return texts


_OFFER = mapping_of(
    {
        'action': names,
        'states': lists,
        'description': texts,
        'launch': words('robot/assist.launch'),
        'node': words('robot assist.py'),
        'args': st.dictionaries(names, numbers, max_size=2),
        'start_limit_s': seconds,
    },
    ['action'],
)
_HEALTHY = st.one_of(
    mapping_of(
        {
            'topic': words('/motors_on'),
            'field': words('data', 'a.b'),
            'equals': plain,
            'at_least': numbers,
            'at_most': numbers,
            'max_age_s': seconds,
        },
        ['topic'],
    ),
    mapping_of({'diagnostics': texts, 'worst': words('ok', 'warn')}, ['diagnostics']),
    mapping_of({'function': words('python:checks:near'), 'name': texts}, ['function']),
)
BY_NAME = {
    **_drawn(StateSettings(), 'preconditions'),
    **_drawn(Settings()),
    'states': st.dictionaries(names, mapping_of(_drawn(StateSettings())), max_size=2),
    'interfaces': st.dictionaries(names, _OFFER, max_size=2),
    'healthy': st.one_of(st.lists(_HEALTHY, max_size=2), _HEALTHY),
}
