"""Every decision is one sentence that a person understands."""

import pytest
from machines import Scripted, Watched

import smach
from smach_oracle.oracle.decision.policy import Action
from smach_oracle.oracle.decision.sentence import (
    DecisionFacts,
    cause_of,
    decision_sentence,
    going_would_repeat,
    ran_in_words,
)
from smach_oracle.oracle.records.events import EventKind


def facts(action, **fields):
    return DecisionFacts(
        'PICK',
        fields.pop('recent', (1, 10)),
        fields.pop('rate', 0.1),
        fields.pop('continuous', False),
        action,
        **fields,
    )


@pytest.mark.parametrize(
    'given, sentence',
    [
        (facts(Action.REVISIT, target='PICK'), 'PICK failed (1 of its last 10): trying it again'),
        (
            facts(Action.REVISIT, target='PICK', met=['DETECT']),
            'PICK failed (1 of its last 10), and its precondition DETECT holds: trying it again',
        ),
        (
            facts(Action.REVISIT, target='PICK', met=['DETECT', 'door open']),
            'PICK failed (1 of its last 10), and its preconditions DETECT and door open hold: '
            'trying it again',
        ),
        (
            facts(Action.STEP_BACK, target='DETECT', continuous=True),
            'PICK keeps failing (1 of its last 10): going back to DETECT',
        ),
        (
            facts(Action.ASK, continuous=True, not_met='DETECT', asked='an expert, 300 s'),
            'PICK keeps failing (1 of its last 10), and DETECT did not help: asking an expert, '
            '300 s',
        ),
        (
            facts(Action.ASK, spent=5, asked='an expert, without end'),
            'PICK failed again after 5 recoveries of this trial: asking an expert, without end',
        ),
        (
            facts(Action.ASK, spent=0),
            'PICK failed (1 of its last 10), and no recovery of it is allowed: asking an expert',
        ),
        (
            facts(Action.ASK, spent=1),
            'PICK failed again after 1 recovery of this trial: asking an expert',
        ),
        (
            facts(Action.ASK, blocked='MOVE still runs'),
            'PICK failed (1 of its last 10); MOVE still runs: asking an expert',
        ),
        (
            facts(
                Action.REVISIT,
                target='PICK',
                not_failed='has no result, since the program was stopped while it ran',
            ),
            'PICK has no result, since the program was stopped while it ran: trying it again',
        ),
        (
            facts(Action.ASK, not_failed='was done in this trial and is not repeated by itself'),
            'PICK was done in this trial and is not repeated by itself: asking an expert',
        ),
        (
            facts(Action.ASK, blocked=going_would_repeat('PICK', 'DETECT', ['POUR', 'ARM/CUT'])),
            'PICK failed (1 of its last 10); going back to DETECT would repeat POUR, ARM/CUT: '
            'asking an expert',
        ),
        (
            facts(Action.ASK, blocked=going_would_repeat('PICK', 'PICK', ['PICK'])),
            'PICK failed (1 of its last 10); it is not repeated by itself: asking an expert',
        ),
        (
            facts(Action.ASK, blocked=going_would_repeat('ARM', 'ARM', ['ARM/CUT'])),
            'PICK failed (1 of its last 10); trying it again would repeat ARM/CUT: asking an '
            'expert',
        ),
        (
            facts(Action.REVISIT, target='PICK', recent=(1, 1)),
            'PICK failed (its first result): trying it again',
        ),
        (
            facts(Action.REVISIT, target='PICK', recent=(4, 4), tried='going back to DETECT'),
            'PICK failed again after going back to DETECT (4 of its last 4): trying it again',
        ),
        (
            facts(Action.REVISIT, target='PICK', recent=(0, 0), rate=0.255),
            'PICK failed (failure rate 26%): trying it again',
        ),
    ],
)
def test_a_decision_is_told_in_a_sentence(given, sentence):
    assert decision_sentence(given, cause_of(given)) == sentence


def test_each_failure_after_the_first_says_what_was_tried_before():
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('DETECT', Scripted('ok', 'aborted'), {'ok': 'GRASP'})
        smach.StateMachine.add('GRASP', Scripted(*['aborted'] * 3), {'ok': 'done'})
    watched = Watched(machine, settings={'memory': 1000})
    assert watched.run() == 'done'
    assert [event.text for event in watched.of(EventKind.DECISION)] == [
        'GRASP failed (its first result): trying it again',
        'GRASP keeps failing after trying it again (2 of its last 2): going back to DETECT',
        'DETECT failed (1 of its last 2): trying it again',
        'GRASP failed again after going back to DETECT (3 of its last 3): trying it again',
    ]
    watched.machine._states['GRASP'].script.append('aborted')
    watched.events.clear()
    assert watched.run() == 'done'
    assert watched.of(EventKind.DECISION)[0].text.startswith('GRASP failed (4 of its last 5)')


@pytest.mark.parametrize(
    'ran_s, longest_s, words',
    [
        (62.4, 3.2, '62 s; its longest so far was 3.2 s'),
        (0.5, 1.1e-6, '0.5 s; its longest so far was under 0.1 s'),
        (0.05, None, 'under 0.1 s; how long it took before is not known'),
    ],
)
def test_how_long_a_state_has_run_reads_well(ran_s, longest_s, words):
    assert ran_in_words(ran_s, longest_s) == words
