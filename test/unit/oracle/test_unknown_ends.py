"""Ends that say neither success nor failure are named before and as a machine first runs."""

import itertools

import pytest
from machines import Scripted, Watched

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.prospects import prospects_of
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.settings.failure_rule import RULE

NUMBERS = itertools.count()


@pytest.fixture(name='name')
def new_name():
    """A name that no machine of this process had before: what is said is said once for it."""
    return 'MISSION_{}'.format(next(NUMBERS))


def mission(*ends):
    machine = smach.StateMachine(list(ends))
    with machine:
        smach.StateMachine.add('DRIVE', Scripted(outcomes=[ends[0]]))
    return machine


def said(log):
    return [text for _, text in log if 'other end' in text]


def test_the_first_trial_names_such_ends_once_in_a_process(log, name):
    for _ in range(2):  # as a program does that builds a new machine for each trial
        machine = OracleContainer.wrap(mission('parked', 'left', 'aborted'), name=name)
        assert not said(log)[1:]
        machine.execute()
        machine.execute()
    (text,) = said(log)
    assert text.startswith(name + ': ') and 'left or parked' in text and 'failing_outcomes' in text
    assert len(text) < 300


def test_nothing_is_said_of_a_machine_whose_ends_are_clear(log, name):
    OracleContainer.wrap(mission('done', 'mission_failed', 'preempted'), name=name).execute()
    settings = {'failing_outcomes': ['aborted']}
    OracleContainer.wrap(mission('parked', 'aborted'), name=name, settings=settings).execute()
    assert not said(log)


def test_it_is_said_of_a_machine_that_is_only_observed_as_statistics_count_it_too(log, name):
    OracleContainer.wrap(mission('parked'), name=name, recover=False).execute()
    assert len(said(log)) == 1


@pytest.mark.parametrize(
    'settings, rule',
    [
        ({}, {'by_name': 1}),
        ({'failing_outcomes': ['lost', 'parked']}, {'failing_outcomes': ['lost', 'parked']}),
    ],
)
def test_the_start_of_a_trial_names_the_rule(settings, rule):
    watched = Watched(mission('parked'), settings=settings)
    watched.run()
    assert watched.of(EventKind.TRIAL_START)[0].data[RULE] == rule


def of(machine, settings=None):
    wrapped = OracleContainer.wrap(machine, settings=settings or {}, name='TOP')
    return {each.path: each.unknown_ends for each in prospects_of(wrapped)}


def test_before_anything_runs_the_ends_of_the_top_machine_are_told():
    assert of(mission('parked', 'succeeded', 'aborted')) == {'TOP': ('parked',)}
    assert of(mission('parked'), {'failing_outcomes': ['aborted']}) == {'TOP': ()}


def nested(leads_to):
    """CARRY ends in `left` after a failure of LIFT, and in `elsewhere` as a choice."""
    carry = smach.StateMachine(['done', 'left', 'elsewhere'])
    with carry:
        smach.StateMachine.add(
            'LIFT',
            Scripted(outcomes=['ok', 'failed', 'other']),
            {'ok': 'done', 'failed': 'left', 'other': 'elsewhere'},
        )
    top = smach.StateMachine(['succeeded', 'aborted'])
    with top:
        ways = {'done': 'succeeded', 'left': leads_to, 'elsewhere': 'succeeded'}
        smach.StateMachine.add('CARRY', carry, ways)
    return top


def test_of_a_concurrence_no_end_is_told():
    concurrence = smach.Concurrence(['done', 'left'], default_outcome='left')
    with concurrence:
        smach.Concurrence.add('LIFT', Scripted('aborted'))
    top = smach.StateMachine(['succeeded', 'aborted'])
    with top:
        ways = {'done': 'succeeded', 'left': 'succeeded'}
        smach.StateMachine.add('BOTH', concurrence, ways)
    assert of(top) == {'TOP': (), 'TOP/BOTH': ()}


@pytest.mark.parametrize('leads_to, ends', [('succeeded', ('left',)), ('aborted', ())])
def test_of_a_nested_machine_an_end_is_told_that_hides_a_failure(leads_to, ends):
    assert of(nested(leads_to)) == {'TOP': (), 'TOP/CARRY': ends}
