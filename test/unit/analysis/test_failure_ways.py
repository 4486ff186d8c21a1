"""What followed each kind of failure: the same counts as by state, told apart by the failure."""

from pathlib import Path

import pytest
from failing_machines import run
from test_by_state import story
from test_way_reader import Scripted, machine_of

from smach_oracle.analysis.by_state.follower import states_of
from smach_oracle.analysis.reporting.failure_ways import (
    FailureWays,
    add_preconditions,
    failure_ways,
    precondition_counts,
)
from smach_oracle.analysis.reporting.taken import TakenJump, add_taken, nothing_taken
from smach_oracle.analysis.trials import events_of as events_in_bags
from smach_oracle.analysis.trials import load_trials
from smach_oracle.oracle.records.events import EventKind

OLD_BAGS = Path(__file__).parents[2] / 'data/v0_1/trials'


def events_of(machine):
    events = []
    machine.events.observers.append(events.append)
    machine.execute()
    return events


def ways(followed):
    return {
        words: (count.helped, count.in_vain, count.not_known)
        for words, count in followed.ways.items()
    }


def test_each_kind_of_failure_has_its_own_ways():
    texts = [RuntimeError('arm 3 at 0.5 m'), RuntimeError('arm 4 at 0.25 m'), 'aborted']
    found = failure_ways(events_of(machine_of(Scripted(), Scripted(*texts))))
    (first, two), (second, one) = found.in_order()
    assert first == ('TOP/PICK', 'exception: RuntimeError: arm # at # m') and two.failures == 2
    assert ways(two) == {'trying it again': (0, 1, 0), 'trying it again after 10 s': (0, 1, 0)}
    assert second == ('TOP/PICK', 'fell_through aborted') and one.failures == 1
    assert ways(one) == {'going back to LOOK': (1, 0, 0)}
    assert two.decided() == [('revisit', 2)] and one.decided() == [('step_back', 1)]
    assert [words for words, _ in one.rows()] == ['going back to LOOK']
    assert found.actions() == ['revisit', 'step_back'] and sum(found.decisions.values()) == 3


@pytest.mark.parametrize('name', ['old bags', 'machines'])
def test_the_sums_over_kinds_are_the_counts_of_the_states(name):
    if name == 'machines':
        trials = run(30)
    else:
        found = load_trials([str(OLD_BAGS)]).trials
        trials = [events for _, events in events_in_bags(found)]
    for events in trials:
        states, found = states_of(events).states, failure_ways(events)
        for state, counts in states.items():
            mine = [each for key, each in found.followed.items() if key.state == state]
            assert sum(each.failures for each in mine) == counts.failures
            assert sum(each.nothing for each in mine) == counts.not_recovered
            for words, count in counts.ways.items():
                own = [each.ways[words] for each in mine if words in each.ways]
                assert sum(each.helped for each in own) == count.helped
                assert sum(each.gone for each in own) == count.gone


def test_sums_of_trials():
    trials, total = run(5), FailureWays()
    for events in trials:
        total.add(failure_ways(events))
    assert sum(each.failures for each in total.followed.values()) == sum(
        each.failures for events in trials for each in failure_ways(events).followed.values()
    )
    assert set(total.classes()) <= {'LOW', 'MODERATE', 'HIGH'} and total.classes()[0] == 'LOW'


def test_preconditions_share_the_next_result_of_their_state():
    met = {'outcome': 'met'}
    steps = [
        (EventKind.PRECONDITION_END, dict(met, target='door')),
        (EventKind.PRECONDITION_END, dict(met, target='LOOK')),
        (EventKind.STATE_START, {}),
        (EventKind.FAILURE, {}),
        (EventKind.PRECONDITION_END, {'outcome': 'not met', 'target': 'door'}),
        (EventKind.PRECONDITION_END, dict(met, target='LOOK')),
        (EventKind.STATE_START, {}),
        (EventKind.TRANSITION, {'outcome': 'succeeded', 'target': 'succeeded'}),
        (EventKind.PRECONDITION_END, dict(met, target='LOOK')),
        (EventKind.GIVE_UP, {}),
        (EventKind.PRECONDITION_END, dict(met, target='LOOK')),
    ]
    total = {}
    for _ in range(2):
        add_preconditions(total, precondition_counts(story(*steps)))
    door, look = total['TOP/PICK', 'door'], total['TOP/PICK', 'LOOK']
    assert (door.runs, door.met, door.not_met) == (4, 2, 2)
    assert (door.helped, door.in_vain, door.not_known) == (0, 2, 0)
    assert (look.runs, look.helped, look.in_vain, look.not_known) == (8, 2, 2, 4)


def test_transitions_and_jumps_are_counted():
    events = story(
        (EventKind.TRANSITION, {'outcome': 'succeeded', 'target': 'PLACE'}),
        (EventKind.TRANSITION, {'outcome': 'succeeded', 'target': 'PLACE'}),
        (EventKind.TRANSITION, {'outcome': '', 'target': ''}),
        (EventKind.JUMP, {'target': 'LOOK'}),
        (
            EventKind.JUMP,
            {'target': 'A', 'by': 'ann', 'data': {'from': 'TOP/A/B', 'to': 'TOP/A/C'}},
        ),
    )
    taken = nothing_taken()
    add_taken(taken, events)
    assert {(each.path, *each.edge): number for each, number in taken.transitions.items()} == {
        ('TOP', 'PICK', 'succeeded', 'PLACE'): 2
    }
    assert taken.jumps == {
        TakenJump('TOP/PICK', 'TOP/LOOK', False): 1,
        TakenJump('TOP/A/B', 'TOP/A/C', True): 1,
    }
