"""What events say of a trial for those who count: who decided, and why the trial ended."""

import pytest
from machines import Scripted, watched

import smach
from smach_oracle.oracle.records.events import NO_OUTCOME, Event, EventKind
from smach_oracle.oracle.records.facts import (
    LEFT,
    PASSED_BY,
    STOPPING,
    UNCOUNTED,
    Decider,
    TrialEnd,
    branches_of,
    decided_by,
    ended_by,
)


def end_of(machine):
    return ended_by(machine.of(EventKind.TRIAL_END)[-1], bool(machine.of(EventKind.STATE_START)))


def test_a_decision_says_that_the_limit_made_it():
    machine = watched(Scripted('aborted', 'aborted'), settings={'max_recoveries': 1})
    machine.run()
    assert [decided_by(event) for event in machine.of(EventKind.DECISION)] == [
        Decider.POLICY,
        Decider.MAX_RECOVERIES,
    ]


def test_a_trial_that_ends_with_an_outcome_says_so():
    machine = watched(Scripted())
    machine.run()
    assert end_of(machine) is TrialEnd.OUTCOME


@pytest.mark.parametrize(
    'raised, end',
    [
        (KeyboardInterrupt(), TrialEnd.STOPPED),
        (SystemExit(3), TrialEnd.STOPPED),
        (GeneratorExit(), TrialEnd.ERROR),
    ],
)
def test_a_trial_says_what_ended_it(raised, end):
    machine = watched(Scripted(raised))
    with pytest.raises(type(raised)):
        machine.run()
    assert end_of(machine) is end


def test_a_shutdown_is_no_inconsistent_machine():
    machine = watched(Scripted(), Scripted())
    machine.machine.register_transition_cb(lambda *_: smach.set_shutdown_check(lambda: True))
    try:
        assert machine.run() is None
    finally:
        smach.set_shutdown_check(lambda: False)
    assert end_of(machine) is TrialEnd.SHUTDOWN


def test_a_shutdown_before_the_first_state_is_no_inconsistent_machine():
    machine = watched(Scripted())
    smach.set_shutdown_check(lambda: True)
    try:
        assert machine.run() is None
    finally:
        smach.set_shutdown_check(lambda: False)
    assert end_of(machine) is TrialEnd.SHUTDOWN
    assert machine.of(EventKind.STATE_START) == []


@pytest.mark.parametrize(
    'text, entered, end',
    [
        ('KeyboardInterrupt: ', True, TrialEnd.STOPPED),
        ('SystemExit: 1', False, TrialEnd.STOPPED),
        (NO_OUTCOME, True, TrialEnd.SHUTDOWN),
        (NO_OUTCOME, False, TrialEnd.INCONSISTENT),
        ('ValueError: no', True, TrialEnd.ERROR),
    ],
)
def test_a_bag_from_before_is_read_by_its_text(text, entered, end):
    event = Event(EventKind.TRIAL_END, 'trial', 9, 0.0, 'TOP', text=text)
    assert ended_by(event, entered) is end


def test_a_decision_from_before_is_read_by_its_text():
    old = Event(
        EventKind.DECISION,
        'trial',
        5,
        0.0,
        'TOP',
        text='5 recoveries of this trial are spent on it',
    )
    assert decided_by(old) is Decider.MAX_RECOVERIES
    assert decided_by(old._replace(text='prose: LOW, not continuous')) is Decider.POLICY


def test_what_is_stated_counts_more_than_words():
    event = Event(
        EventKind.TRIAL_END,
        'trial',
        9,
        0.0,
        'TOP',
        text='KeyboardInterrupt: ',
        data={'ended_by': 'error'},
    )
    assert ended_by(event, True) is TrialEnd.ERROR


@pytest.mark.parametrize(
    'data, branches',
    [
        ({'branches': ['LEFT', 'RIGHT']}, ('LEFT', 'RIGHT')),
        ({'branches': ()}, ()),
        ({'branches': 'LEFT'}, ()),
        ({}, ()),
        (None, ()),
    ],
)
def test_the_start_of_a_container_names_its_branches(data, branches):
    event = Event(EventKind.CONTAINER_START, 'trial', 9, 0.0, 'TOP/BOTH', data=data)
    assert branches_of(event) == branches


@pytest.mark.parametrize('fields', [UNCOUNTED, LEFT, STOPPING, PASSED_BY])
def test_bags_say_by_a_word_of_their_own_what_is_not_counted(fields):
    assert fields['data'] == {'not_counted': True}
