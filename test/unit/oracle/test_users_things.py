"""What users' states and files may be: deaf, of any make, gone meanwhile, on a full disk."""

import copy
import errno
import fcntl
import json
import os
import threading
from types import SimpleNamespace

import pytest
from branch_machines import Item, inside, iterator_over
from guarded_machines import both
from held_machines import Held
from machines import FakeExpert, Scripted, Watched, chain_of, goto, supersede, watched
from test_time_limits import LimitClock
from waiting import wait_for

import smach
import smach_oracle.oracle.machine.workers as worker
from smach_oracle.oracle.asking.answer_rules import check_output_keys
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.oracle.machine.userdata import UserdataGate
from smach_oracle.oracle.records import rates_file
from smach_oracle.oracle.records.events import EventKind, FailureKind
from smach_oracle.oracle.records.folder_locks import folder_lock
from smach_oracle.oracle.records.history import History
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.oracle.smach_private import items_of, states_of

LIMITED = {'time_limit_s': 0.1, 'grace_period_s': 0.1}


def warnings_in(log):
    return [text for level, text in log if level == 'warn']


class Deaf(Scripted):
    """A state whose own `request_preempt` raises."""

    def request_preempt(self):
        raise OSError('the line is dead')


class Odd(Scripted):
    """A state that is a container in name alone."""

    def get_children(self):
        raise OSError('there are none')


@pytest.fixture(name='free')
def what_frees_states():
    """Until it is set, states that heed no preempt go on."""
    free = threading.Event()
    yield free
    free.set()


def heedless(free, kind=Scripted):
    return kind(lambda state, ud: free.wait(20) and 'ok')


def above(inner, after=None):
    """A machine of INNER and, where that ends well, AFTER."""
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'AFTER'})
        smach.StateMachine.add('AFTER', after or Scripted(), {'ok': 'done'})
    return machine


@pytest.mark.parametrize(
    ('kind', 'level', 'told'),
    [
        (Deaf, 'err', "failed: OSError('the line is dead')"),
        (Odd, 'warn', 'Could not stop what is left of '),
    ],
)
def test_a_state_that_overruns_may_be_of_any_make(kind, level, told, log, free):
    machine = watched(heedless(free, kind), settings={**LIMITED, 'max_recoveries': 0})
    assert machine.run() == 'aborted'
    (failure,) = machine.of(EventKind.FAILURE)
    assert failure.failure_kind == FailureKind.TIME_LIMIT
    assert failure.text.startswith('overran its time limit of 0.1 s and was abandoned')
    assert any(told in text for each, text in log if each == level)


@pytest.mark.parametrize('inside_of', [chain_of, lambda state: both(LEFT=chain_of(state))])
def test_what_is_left_behind_stays_preempted_though_its_container_has_ended(inside_of, free):
    """A container that has failed takes back the requests to the states that have ended alone."""
    left = heedless(free)
    machine = Watched(above(inside_of(left)), settings=LIMITED)
    assert machine.run() == 'aborted'
    assert left.preempt_requested()
    free.set()
    assert wait_for(lambda: not left.preempt_requested()), 'once it has ended, it may come again'


def test_nobody_takes_the_request_back_from_what_is_left_behind(free):
    """An action server would, for the goal before. A copy of the state has its own again."""
    left = heedless(free)
    machine = Watched(above(chain_of(left)), settings={'states': {'INNER/A': LIMITED}})
    machine.run()
    left.recall_preempt()
    assert left.preempt_requested()
    copied = copy.deepcopy(left)
    copied.recall_preempt()
    assert (copied.preempt_requested(), left.preempt_requested()) == (False, True)
    machine.run()
    assert (left.runs, left.preempt_requested()) == (1, True)
    free.set()
    assert wait_for(lambda: not left.preempt_requested()), 'once it has ended, it may come again'
    assert 'recall_preempt' not in vars(left)


@pytest.mark.parametrize('limits', [{'INNER': LIMITED}, {'INNER': LIMITED, 'INNER/LEFT': LIMITED}])
def test_what_is_in_a_machine_that_is_left_behind_stays_preempted_too(limits, free):
    left, inner = heedless(free), chain_of(Scripted())
    with inner:
        smach.StateMachine.add('LEFT', left, {'ok': 'done'})
    smach.StateMachine.set_initial_state(inner, ['LEFT'])
    machine = Watched(above(inner), settings={'states': limits})
    assert machine.run() == 'aborted'
    for state in (inner, left):
        state.recall_preempt()
    assert left.preempt_requested()
    free.set()
    assert wait_for(lambda: not left.preempt_requested())


def test_a_users_own_recall_is_there_again_once_what_was_left_behind_has_ended(free):
    recalled, left = [], heedless(free)
    left.recall_preempt = lambda: recalled.append(True)
    machine = Watched(above(chain_of(left)), settings={'states': {'INNER/A': LIMITED}})
    machine.run()
    left.recall_preempt()
    assert (recalled, left.preempt_requested()) == ([], True)
    free.set()
    assert wait_for(lambda: recalled)
    assert vars(left)['recall_preempt'].__name__ == '<lambda>'


def test_marks_of_what_has_ended_keep_nothing_from_being_left_behind():
    """A copy has them, and what had ended while it was being left behind."""
    inner = chain_of(Scripted())
    outer = chain_of(inner)
    calls = [SimpleNamespace(done=threading.Event()) for _ in range(2)]
    worker._leave_behind(outer, calls[0])
    calls[0].done.set()
    worker._leave_behind(outer, calls[1])
    for each in (outer, inner):
        each.request_preempt()
        each.recall_preempt()
        assert each.preempt_requested()
    calls[1].done.set()
    for each in (outer, inner):
        each.recall_preempt()
        assert not each.preempt_requested() and 'recall_preempt' not in vars(each)


def test_what_overruns_while_its_container_is_left_stays_preempted(log, free, monkeypatch):
    """RIGHT fails, and the expert sends the machine out of the Concurrence. LEFT heeds nothing."""
    begun, after = threading.Event(), Scripted()

    def slow(state, ud):
        begun.set()
        return free.wait(20) and 'ok'

    def fails(state, ud):
        assert begun.wait(20)
        return 'aborted'

    left = Scripted(slow)
    is_left = SimpleNamespace(is_set=left.preempt_requested)
    LimitClock(monkeypatch).end(2, is_left)  # the limit of INNER, and its grace period
    inner = both(LEFT=chain_of(left), RIGHT=chain_of(Scripted(fails)))
    machine = Watched(
        above(inner, after),
        expert=FakeExpert(goto('AFTER', container='SM_ROOT')),
        settings={'states': {'INNER': LIMITED, 'INNER/RIGHT/A': {'max_recoveries': 0}}},
    )
    assert machine.run() == 'done'
    assert (after.runs, left.preempt_requested()) == (1, True)
    assert [event.path for event in machine.of(EventKind.FAILURE)] == ['SM_ROOT/INNER/RIGHT']
    told = 'SM_ROOT/INNER: was left for a state of another container, and overran its time limit'
    assert any(text.startswith(told) for text in warnings_in(log))


def test_a_precondition_that_heeds_no_preempt_is_not_preempted_when_it_runs_again():
    def asked_to_stop(state, ud):
        machine.machine.request_preempt()
        assert state.preempt_requested()
        return 'ok'

    look = Scripted(asked_to_stop)
    machine = Watched(chain_of(Scripted('aborted'), look), preconditions={'A': ['B']})
    assert machine.run() == 'preempted'
    assert not look.preempt_requested()


def test_a_question_shows_the_visits_of_this_execution_of_a_concurrence_alone():
    concurrence = smach.Concurrence(
        outcomes=['done', 'aborted'], default_outcome='aborted', outcome_map={'done': {'A': 'ok'}}
    )
    with concurrence:
        smach.Concurrence.add('A', Scripted('ok', 'aborted'))
    machine = smach.StateMachine(outcomes=['done', 'aborted'])
    with machine:
        smach.StateMachine.add('BOTH', concurrence, {'done': 'AGAIN'})
        again = Scripted('again', outcomes=('ok', 'again'))
        smach.StateMachine.add('AGAIN', again, {'again': 'BOTH', 'ok': 'done'})
    expert = FakeExpert(supersede('ok'))
    machine = Watched(machine, expert=expert, settings={'max_recoveries': 0})
    assert machine.run() == 'done'
    (question,) = expert.questions
    assert [(visit.state, visit.outcome) for visit in question.history] == [('A', 'aborted')]


def test_an_error_that_a_state_of_a_concurrence_makes_itself_is_the_one_that_is_told(log):
    """It begins as SMACH's own does, and has no cause."""
    own = smach.InvalidUserCodeError("Could not execute state 'ARM': no power")
    concurrence = both(A=Scripted(own))
    machine = Watched(inside(concurrence), settings={'max_recoveries': 0})
    with pytest.raises((smach.InvalidUserCodeError, smach.InvalidStateError)):
        machine.run()
    (failure, *_) = machine.of(EventKind.FAILURE)
    assert 'no power' in failure.text
    assert not any('TypeError' in text for _, text in log)


def test_an_operators_jump_to_a_state_that_is_taken_out_meanwhile_is_dropped(log):
    def takes_out(state, ud):
        held.hand.go_to('', 'C')
        del states_of(held.machine)['C']
        return 'ok'

    second = Scripted(outcomes=('done', 'aborted', 'preempted'))
    held = Held(chain_of(Scripted(takes_out), second, Scripted()))
    assert held.run() == 'done'
    assert second.runs == 1
    assert any('there is no such state' in text for text in warnings_in(log))


def test_the_items_of_an_iterator_look_as_its_author_gave_them():
    seen = []
    each = Item(item2=[lambda state, ud: seen.append(items_of(iterator)) or 'ok'])
    iterator = iterator_over(each, items=[1, 2, 3, 4])
    assert Watched(inside(iterator)).run() == 'done'
    (items,) = seen
    assert (len(items), items[1], bool(items), items.index(3)) == (4, 2, True, 2)
    assert (repr(items), str(items)) == ('[1, 2, 3, 4]', '[1, 2, 3, 4]')
    assert not hasattr(items, 'no_such_method') and not hasattr(items, '_private')


def test_keys_that_come_with_where_a_machine_begins_are_in_its_userdata():
    machine, given = watched(Scripted(), Scripted()).machine, smach.UserData()
    given.x = 1
    machine.set_initial_state(['B'], given)
    assert machine.get_initial_states() == ['B'] and machine.userdata.x == 1


def test_writes_to_userdata_pass_a_gate_until_it_is_shut():
    machine, late = chain_of(Scripted()), []
    machine.userdata.x, machine.userdata.y = 1, 2
    gate = UserdataGate(machine, late.append)
    assert (sorted(gate), len(gate)) == (['x', 'y'], 2)
    del gate['x']
    assert (gate.written, sorted(machine.userdata.keys())) == ({'x'}, ['y'])
    gate.shut()
    del gate['y']
    gate['z'] = 3
    assert (late, sorted(machine.userdata.keys())) == (['y', 'z'], ['y'])
    with pytest.raises(KeyError):
        del UserdataGate(machine)['gone']


def test_an_output_key_of_an_answer_comes_once():
    check_output_keys('A', ['x', 'y'], ['x', 'y'])
    with pytest.raises(AnswerError, match='output keys come twice: x$'):
        check_output_keys('A', ['x', 'y', 'x'], ['x', 'y'])


def test_a_history_that_keeps_fewer_visits_still_knows_their_number():
    history = History(5)
    history.count_visits()
    for label in 'ABC':
        history.visited(Visit(label, 'ok', VisitResult.SUCCESS), False)
    history.resize(2)
    assert [visit.state for visit in history.latest()] == ['B', 'C']
    assert history.visits_of_execution == 3


# -- files


def test_rates_that_cannot_be_set_aside_are_no_matter(tmp_path, monkeypatch, log):
    path = tmp_path / 'rates.json'
    path.write_text('{')

    def refuse(*paths):
        raise OSError(errno.EROFS, 'read-only')

    monkeypatch.setattr(os, 'replace', refuse)
    machine = watched(Scripted(), settings={'rates_file': str(path)})
    assert machine.rate('A').successes == 0
    assert any('it could not be set aside' in text for text in warnings_in(log))
    assert path.read_text() == '{'


def test_a_new_name_that_cannot_be_noted_learns_from_the_old_one(tmp_path, monkeypatch, log):
    path = tmp_path / 'rates.json'
    watched(Scripted('aborted'), name='OLD', settings={'rates_file': str(path)}).run()

    def refuse(*of):
        raise OSError(errno.ENOSPC, 'full')

    monkeypatch.setattr(rates_file, 'write_machines', refuse)
    machine = watched(Scripted(), name='NEW', settings={'rates_file': str(path)})
    assert machine.rate('A').failures == 1
    assert any("that 'NEW' is new cannot be noted there" in text for text in warnings_in(log))
    assert list(json.loads(path.read_text())['machines']) == ['OLD']


def test_a_file_system_without_locks_is_used_without_them(tmp_path, monkeypatch):
    def none(*of):
        raise OSError(errno.ENOLCK, 'no locks')

    monkeypatch.setattr(fcntl, 'flock', none)
    with folder_lock(str(tmp_path)):
        pass

    def broken(*of):
        raise OSError(errno.EIO, 'broken')

    monkeypatch.setattr(fcntl, 'flock', broken)
    with pytest.raises(OSError, match='broken'), folder_lock(str(tmp_path)):
        raise AssertionError('nobody holds the lock')
