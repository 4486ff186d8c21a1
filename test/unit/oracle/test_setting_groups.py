"""Groups of settings: flat and in groups they are the same, and what is wrong is told clearly."""

import pytest
from drawn_settings import IN_GROUPS, QUICK, drawn_settings, taken
from hypothesis import given, settings

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.execution.origin import origin_of
from smach_oracle.oracle.settings.settings import GROUPS, Settings, StateSettings
from smach_oracle.oracle.settings.written import WrittenFloat

MOST_AT_THE_TOP = 28
STORE = {
    'checkpoint': '/var/lib/robot.db',
    'checkpoint_wait_s': 3.0,
    'checkpoint_synchronous': 'NORMAL',
    'on_resume': 'state:LOOK',
    'resume_from': 7,
    'resume_map': {'OLD': 'NEW'},
    'resume_repeat': ['POUR'],
}
FLAT = {
    'memory': 5,
    'deadline_s': 60,
    'on_no_answer': {'goto': 'HOME'},
    'history_length': 9,
    'watch_preconditions': False,
    'interfaces': {'by_hand': {'action': 'by_hand'}},
    'nested': ['ARM', 'ARM/**'],
    'escalate': True,
    'step_back_across': True,
    'still_running_s': 30,
    'still_running_factor': 2,
    'healthy': [{'topic': '/motors_on'}],
    'health_settle_s': 2,
    **STORE,
}
GROUPED = {
    'memory': 5,
    'expert': {
        'deadline_s': 60,
        'on_no_answer': {'goto': 'HOME'},
        'history_length': 9,
        'watch_preconditions': False,
        'interfaces': {'by_hand': {'action': 'by_hand'}},
    },
    'tree': {'nested': ['ARM', 'ARM/**'], 'escalate': True, 'step_back_across': True},
    'still_running': {'after_s': 30, 'factor': 2},
    'healthy': {'conditions': [{'topic': '/motors_on'}], 'settle_s': 2},
    'checkpoint': {
        'file': '/var/lib/robot.db',
        'wait_s': 3.0,
        'synchronous': 'NORMAL',
        'on_resume': 'state:LOOK',
        'from': 7,
        'map': {'OLD': 'NEW'},
        'repeat': ['POUR'],
    },
}


def digest(read):
    return origin_of(read)['settings']


def test_at_the_top_there_are_few_settings():
    assert len(GROUPS.top_keys()) <= MOST_AT_THE_TOP, GROUPS.top_keys()


def test_every_setting_of_a_group_has_an_example_here():
    assert set(IN_GROUPS) == set(FLAT) - {'memory'}
    assert all(GROUPS.members(group) for group in GROUPS.texts)


def test_flat_and_in_groups_they_are_the_same_with_the_same_digest():
    flat, grouped = Settings.from_dict(FLAT), Settings.from_dict(GROUPED)
    assert flat == grouped != Settings()
    assert digest(flat) == digest(grouped) != digest(Settings())
    assert grouped.deadline_s == 60.0 and grouped.checkpoint_synchronous == 'NORMAL'
    changed = Settings(deadline_s=60.0)
    assert changed == Settings.from_dict({'expert': {'deadline_s': 60}}), 'fields are flat'


@pytest.mark.parametrize('name', sorted(set(FLAT) - {'memory'}))
def test_each_one_is_itself_in_its_group(name):
    group, key = GROUPS.key_of(name).split('.')
    one = Settings.from_dict({name: FLAT[name]})
    assert one == Settings.from_dict({group: {key: FLAT[name]}}) != Settings()
    assert [each for each in vars(one) if getattr(one, each) != getattr(Settings(), each)] == [name]


@pytest.mark.parametrize(
    'values, same',
    [
        (
            {'checkpoint': 'a.db', 'on_resume': 'recover'},
            {'checkpoint': {'file': 'a.db', 'on_resume': 'recover'}},
        ),
        (
            {'healthy': {'topic': '/a', 'settle_s': 2}},
            {'healthy': {'conditions': {'topic': '/a'}, 'settle_s': 2}},
        ),
        ({'healthy': {'topic': '/a'}}, {'healthy': [{'topic': '/a'}]}),
        ({'expert': None, 'healthy': None, 'checkpoint': None, 'tree': {}}, {}),
        ({'deadline_s': 5, 'expert': {'deadline_s': 5.0}}, {'expert': {'deadline_s': 5}}),
        ({'checkpoint': ''}, {}),
    ],
)
def test_short_and_empty_forms(values, same):
    assert Settings.from_dict(values) == Settings.from_dict(same)


@pytest.mark.parametrize(
    'values, told',
    [
        (
            {'expert': [1]},
            'expert: [1] is not allowed; allowed: a mapping with some of ',
        ),
        ({'expert': 'eva'}, "expert: 'eva' is not allowed; allowed: a mapping"),
        (
            {'tree': False},
            'tree: False is not allowed; allowed: a mapping with some',
        ),
        (
            {'still_running': 30},
            'still_running: 30 is not allowed; allowed: a mapping with some of the keys after_s',
        ),
        (
            {'checkpoint': ['a']},
            "checkpoint: ['a'] is not allowed; allowed: the name of a file, or a mapping",
        ),
        (
            {'checkpoint': 5},
            'checkpoint: 5 is not allowed; allowed: the name of a file, or a mapping',
        ),
        (
            {'healthy': '/motors_on'},
            "healthy: '/motors_on' is not allowed; allowed: a list of conditions, or one, or",
        ),
        ({'expert': {5: 1}}, 'expert: 5 is not allowed'),
        (
            {'expert': {'deadlin_s': 1}},
            'expert.deadlin_s: no such setting (did you mean expert.deadline_s?); allowed: one of ',
        ),
        (
            {'checkpoint': {'resume_from': 1}},
            'checkpoint.resume_from: no such setting (did you mean checkpoint.from?)',
        ),
        (
            {'expert': {'settle_s': 1}},
            'expert.settle_s: no such setting (did you mean healthy.settle_s?)',
        ),
        (
            {'expert': {'memory': 1}},
            'expert.memory: no such setting (did you mean memory at the top?)',
        ),
        ({'tree': {'xyzzy': 1}}, 'tree.xyzzy: no such setting; allowed: one of the keys'),
        (
            {'healthy': {'topc': '/a'}},
            'healthy.topc: no such setting (did you mean healthy.topic?)',
        ),
        (
            {'wait_s': 3},
            'wait_s: no such setting (did you mean checkpoint.wait_s?)',
        ),
        ({'resume_mpa': {}}, 'resume_mpa: no such setting (did you mean checkpoint.map?)'),
        ({'experts': {}}, 'experts: no such setting (did you mean expert?)'),
        (
            {'states': {'A': {'deadline_s': 1}}},
            'states.A.deadline_s: no such setting of a state (it holds for the whole machine: '
            'it is called expert.deadline_s)',
        ),
        (
            {'states': {'A': {'tree': {}}}},
            'states.A.tree: no such setting of a state (it holds for the whole machine: move',
        ),
        ({'states': {'A': {'policy': 'prose'}}}, 'move it to the top of the settings'),
        ({'expert': {'deadline_s': -1}}, 'expert.deadline_s: -1 is not allowed'),
        ({'deadline_s': -1}, 'deadline_s: -1 is not allowed'),
        ({'expert': {'deadline_s': WrittenFloat('nan')}}, 'expert.deadline_s: nan is not allowed'),
        ({'cost': {'harm': WrittenFloat('nan')}}, 'cost.harm: nan is not allowed'),
        ({'checkpoint': {'file': 5}}, 'checkpoint.file: 5 is not allowed'),
        ({'healthy': {'conditions': [{'topic': 3}]}}, 'healthy.conditions[0].topic: 3'),
        ({'healthy': [{'topic': 3}]}, 'healthy[0].topic: 3'),
    ],
)
def test_what_is_wrong_is_told_with_what_is_allowed(values, told):
    with pytest.raises(SettingsError) as caught:
        Settings.from_dict(values)
    assert str(caught.value).startswith(told) or told in str(caught.value).split('; ')[0], caught


@pytest.mark.parametrize(
    'values',
    [
        {'deadline_s': 60, 'expert': {'deadline_s': 30}},
        {'expert': {'deadline_s': 30}, 'deadline_s': 60},
    ],
)
def test_two_values_of_one_setting_are_refused_and_both_keys_are_named(values):
    with pytest.raises(SettingsError) as caught:
        Settings.from_dict(values)
    text = str(caught.value)
    assert 'expert.deadline_s: 30' in text and 'deadline_s: 60' in text
    assert text.endswith('allowed: one value, under expert.deadline_s')
    with pytest.raises(SettingsError, match=r'healthy\.conditions'):
        Settings.from_dict({'healthy': {'topic': '/a', 'conditions': [{'topic': '/b'}]}})


@settings(max_examples=300, **QUICK)
@given(drawn_settings())
def test_whichever_of_them_are_in_groups_they_come_to_the_same(drawn):
    flat, mixed = taken(drawn.flat), taken(drawn.source())
    assert flat is not None and flat == mixed
    assert digest(flat) == digest(mixed)
    grouped = GROUPS.in_groups(GROUPS.given_in(drawn.source()))
    assert taken(grouped) == flat, 'all of them in groups'
    assert GROUPS.in_groups(GROUPS.given_in(grouped)) == grouped, 'and so they stay'
    assert set(grouped) <= set(GROUPS.top_keys())


def test_settings_of_states_are_in_no_group():
    assert not set(vars(StateSettings())).intersection(IN_GROUPS)
