"""The policy `restart`: where a script begins again, with which userdata, and where it does not."""

import copy
import threading

import pytest
from machines import Scripted, Watched, chain_of, contents, watched

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind


def failing(fails=20, **settings):
    """A chain A, B, C whose B fails so often."""
    return watched(
        Scripted(),
        Scripted(*['aborted'] * fails),
        Scripted(),
        settings={'policy': 'restart', **settings},
    )


def test_a_restart_begins_with_the_initial_state_and_the_userdata_of_the_start():
    seen = []

    def first(state, ud):
        seen.append(dict(state_keys(ud)))
        ud.x = 'written'
        ud.y = 'new'
        return 'ok'

    machine = Watched(
        chain_of(
            Scripted(first, first, first, input_keys=['x'], output_keys=['x', 'y']),
            Scripted('aborted', 'aborted'),
        ),
        settings={'policy': 'restart', 'userdata': 'keep'},
    )
    machine.machine.userdata.x = 'start'
    assert machine.run() == 'done'
    assert seen == [{'x': 'start'}] * 3
    assert machine.decisions() == [('restart', 'A')] * 2
    assert [event.data['userdata'] for event in machine.of(EventKind.JUMP)] == ['start'] * 2
    assert contents(machine.machine.userdata) == {'x': 'written', 'y': 'new'}


def state_keys(ud):
    return {'x': ud.x}.items()


def test_what_was_changed_in_an_object_is_as_at_the_start_for_deep_copied_keys():
    def fill(state, ud):
        ud.cups.append('full')
        return 'ok'

    seen = []

    def look(state, ud):
        seen.append(list(ud.cups))
        return 'aborted' if len(seen) < 3 else 'ok'

    keys = dict(input_keys=['cups'], output_keys=['cups'])
    machine = Watched(
        chain_of(Scripted(fill, fill, fill, **keys), Scripted(look, look, look, **keys)),
        settings={'policy': 'restart', 'deep_copy_keys': ['cups']},
    )
    machine.machine.userdata.cups = []
    assert machine.run() == 'done'
    assert seen == [['full']] * 3


def nested(inner, before=None, after=None):
    """TOP: FIRST -> IN -> LAST."""
    top = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('FIRST', before or Scripted(), {'ok': 'IN'})
        smach.StateMachine.add('IN', inner, {'done': 'LAST'})
        smach.StateMachine.add('LAST', after or Scripted(), {'ok': 'done'})
    return top


def test_a_failure_deep_in_a_tree_starts_the_top_machine_over():
    deep = chain_of(Scripted(), Scripted('aborted', 'aborted'))
    inner = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with inner:
        smach.StateMachine.add('DEEP', deep, {'done': 'done'})
    machine = Watched(nested(inner), settings={'policy': 'restart'}, name='TOP')
    assert machine.run() == 'done'
    assert machine.visits() == ['FIRST', 'IN', 'DEEP', 'A', 'B'] * 3 + ['LAST']
    jumps = machine.of(EventKind.JUMP)
    assert [(jump.path, jump.target, jump.data['from']) for jump in jumps] == [
        ('TOP', 'FIRST', 'TOP/IN/DEEP/B')
    ] * 2
    assert machine.decisions() == [('restart', 'TOP/FIRST')] * 2


def writing():
    """What a state finds under `note`, and the state, which writes there."""
    seen = []

    def write(state, ud):
        seen.append(ud.note)
        ud.note = 'used'
        return 'ok'

    return seen, Scripted(write, write, input_keys=['note'], output_keys=['note'])


def test_a_restart_puts_the_userdata_of_nested_machines_back_too():
    seen, writes = writing()
    inner = chain_of(writes)
    inner.userdata.note = 'clean'
    machine = Watched(nested(inner, after=Scripted('aborted')), settings={'policy': 'restart'})
    assert machine.run() == 'done'
    assert seen == ['clean', 'clean']


def test_a_machine_that_has_run_since_does_not_change_the_userdata_of_the_start():
    seen, writes = writing()
    top = nested(chain_of(Scripted()), writes, Scripted('aborted'))
    top.userdata.note = 'clean'
    assert Watched(top, settings={'policy': 'restart'}).run() == 'done'
    assert seen == ['clean', 'clean']


def test_the_restarts_are_those_of_the_trial_whichever_state_has_failed():
    machine = watched(
        Scripted('aborted'),
        Scripted('aborted'),
        Scripted('aborted'),
        settings={'policy': 'restart'},
    )
    assert machine.run() == 'aborted'
    assert machine.visits() == ['A', 'A', 'B', 'A', 'B', 'C']
    assert "the trial's 2 restarts are spent" in machine.of(EventKind.DECISION)[-1].text


def test_the_next_trial_has_its_restarts_again():
    machine = failing(4)
    assert (machine.run(), machine.run()) == ('aborted', 'done')
    assert [action for action, _ in machine.decisions()] == [
        'restart',
        'restart',
        'give_up',
        'restart',
    ]


def test_nothing_starts_over_where_the_author_goes_on():
    inner = chain_of(Scripted('aborted'))
    top = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('FIRST', Scripted(), {'ok': 'IN'})
        smach.StateMachine.add('IN', inner, {'done': 'done', 'aborted': 'TIDY'})
        smach.StateMachine.add('TIDY', Scripted(), {'ok': 'done'})
    machine = Watched(top, settings={'policy': 'restart'})
    assert machine.run() == 'done'
    assert machine.visits() == ['FIRST', 'IN', 'A', 'TIDY']
    (decision,) = machine.of(EventKind.DECISION)
    assert (decision.outcome, decision.data['decided_by']) == ('give_up', 'author')
    assert 'its author goes on from there' in decision.text


@pytest.mark.parametrize('on_retry', ['confirm', 'never'])
def test_a_restart_repeats_no_state_that_is_not_to_be_repeated(on_retry):
    machine = failing(states={'A': {'on_retry': on_retry}})
    assert machine.run() == 'aborted'
    assert machine.visits() == ['A', 'B']
    (decision,) = machine.of(EventKind.DECISION)
    assert (decision.outcome, decision.data['decided_by']) == ('give_up', 'on_retry')


def test_a_restart_spends_the_budget_of_the_trial():
    machine = failing(budget={'recoveries': 1})
    assert machine.run() == 'aborted'
    assert [event.data['decided_by'] for event in machine.of(EventKind.DECISION)] == [
        'policy',
        'budget',
    ]


def test_a_branch_that_fails_starts_the_whole_script_over_once():
    gate = threading.Barrier(2, timeout=20)

    def fail(state, ud):
        gate.wait()
        return 'aborted'

    both = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': {'L': 'ok', 'R': 'ok'}},
    )
    with both:
        smach.Concurrence.add('L', Scripted(fail))
        smach.Concurrence.add('R', Scripted(fail))
    machine = Watched(nested(both), settings={'policy': 'restart'}, name='TOP')
    assert machine.run() == 'done'
    assert [event.state for event in machine.of(EventKind.STATE_START) if event.path == 'TOP'] == [
        'FIRST',
        'IN',
        'FIRST',
        'IN',
        'LAST',
    ]
    assert machine.machine._oracle.tree.restarts.count == 1


def test_a_machine_that_was_copied_has_begun_no_trial():
    machine = failing()
    machine.run()
    twin = copy.deepcopy(machine.machine)
    assert machine.machine._oracle.tree.restarts.count == 2
    assert twin._oracle.tree.restarts.count == 0


def test_a_copy_numbers_its_visits_from_one():
    """Python 3.14 copies no counter of itertools."""
    machine = failing()
    machine.run()
    machine.machine._oracle.tree.next_visit()
    assert copy.deepcopy(machine.machine)._oracle.tree.next_visit() == 1


@pytest.mark.parametrize('policy', ['restart', 'retry'])
def test_where_the_oracle_only_observes_nothing_is_kept_of_the_start(policy):
    class Copied:
        times = 0

        def __deepcopy__(self, memo):
            Copied.times += 1
            return self

    machine = chain_of(Scripted(), Scripted())
    settings = {'policy': policy, 'deep_copy_keys': ['x']}
    machine = OracleContainer.wrap(machine, settings=settings, recover=False)
    machine.userdata.x = Copied()
    assert (machine.execute(), Copied.times) == ('done', 2)
