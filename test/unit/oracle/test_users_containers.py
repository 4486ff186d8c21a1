"""Concurrences and Iterators that execute in a way of their own, or at a time of their own."""

import copy
import os
import threading

import pytest
from branch_machines import Item, both, inside, iterator_over
from guarded_machines import OUTCOMES, chain
from machines import FakeExpert, Scripted, Watched, give_up, goto, in_thread, supersede
from test_time_limits import ABANDONING, LimitClock

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.facts import ENDED_BY, TrialEnd


class Own(smach.Concurrence):
    """A user's class. It executes its only state A by a function of that and the userdata."""

    def __init__(self, way, state):
        smach.Concurrence.__init__(self, [*OUTCOMES, 'ok'], 'aborted')
        self._way = way
        with self:
            smach.Concurrence.add('A', state)

    def a(self):
        return self._states['A']

    def execute(self, parent_ud=None):
        return self._way(self.a(), self.userdata)


def own(way, *script):
    return inside(Own(way, Scripted(*script)), transitions={'ok': 'done'})


def test_a_class_may_look_at_the_type_of_its_state():
    machine = own(lambda a, ud: hasattr(type(a), 'execute') and a.execute(ud))
    assert OracleContainer.wrap(machine).execute() == 'done'


def test_a_state_is_preempted_for_its_container_while_its_failure_is_asked_about():
    def preempt(question, cancelled, progress):
        container.a().request_preempt()
        seen.append(container.a().preempt_requested())

    seen, container = [], Own(lambda a, ud: a.execute(ud), Scripted('aborted'))
    settings = {'policy': 'always_ask'}
    expert = FakeExpert(preempt)
    machine = inside(container, transitions={'ok': 'done'})
    OracleContainer.wrap(machine, expert=expert, settings=settings).execute()
    assert seen == [True]


def test_a_container_sees_the_request_that_its_state_has_by_itself():
    def look(a, ud):
        state.request_preempt()
        seen.append(a.preempt_requested())
        state.recall_preempt()
        seen.append(a.preempt_requested())
        return a.execute(ud)

    seen, state = [], Scripted()
    machine = inside(Own(look, state), transitions={'ok': 'done'})
    assert OracleContainer.wrap(machine).execute() == 'done' and seen == [True, False]


def test_two_executions_of_one_container_leave_it_with_its_own_states():
    begun, go_on = [threading.Event(), threading.Event()], [threading.Event(), threading.Event()]

    def waits(number):
        def wait(state, ud):
            begun[number].set()
            assert go_on[number].wait(20)
            return 'ok'

        return wait

    state = Scripted(waits(0), waits(1))
    container = Own(lambda a, ud: a.execute(ud), state)
    machine = OracleContainer.wrap(inside(container, transitions={'ok': 'done'}))
    runs = []
    for run, has_begun in zip((machine.execute, container.execute), begun):
        runs.append(in_thread(run))
        assert has_begun.wait(20)
    outcomes = []
    for run, goes_on in zip(runs, go_on):
        goes_on.set()
        outcomes.append(run.result())
    assert outcomes == ['done', 'ok']
    assert container.a() is state and container.get_children() == {'A': state}


def test_a_container_that_a_state_executes_recovers_though_its_machine_does_not_run():
    def by_hand(state, ud):
        assert concurrence.execute() == 'done'
        return 'ok'

    left = Scripted('aborted')
    concurrence = both(left, Scripted())
    machine = chain(HAND=Scripted(by_hand), INNER=inside(concurrence))
    assert OracleContainer.wrap(machine).execute() == 'done'
    assert left.runs == 3


def test_a_branch_ends_the_program_though_its_container_does_not_say_so():
    def hides(a, ud):
        try:
            a.execute(ud)
        except SystemExit:
            pass
        raise smach.InvalidStateError('A has raised') from None

    machine = Watched(own(hides, SystemExit(3)))
    with pytest.raises(smach.InvalidUserCodeError):
        machine.run()
    assert not machine.of(EventKind.FAILURE)
    assert machine.events[-1].data[ENDED_BY] == TrialEnd.STOPPED.value


def test_an_error_of_smach_that_a_branch_raises_is_passed_on_itself():
    error = smach.InvalidUserCodeError('no map')
    error.__cause__ = ValueError('no file')
    machine = OracleContainer.wrap(inside(iterator_over(Scripted(error))), recover=False)
    with pytest.raises(smach.InvalidUserCodeError) as raised:
        machine.execute()
    assert raised.value is error


def test_a_machine_that_is_executed_without_its_iterator_names_no_item():
    inner = chain(A=Scripted('ok', 'aborted', 'aborted'))
    iterator = iterator_over(inner, (1, 2, 3), loop_outcomes=['done'])
    machine = Watched(inside(iterator), recover=False)
    assert [machine.run(), inner.execute()] == ['aborted', 'aborted']
    told = [event.text for event in machine.of(EventKind.FAILURE) if event.state == 'A']
    assert told == ['item 2 of 3', '']


class Deaf(Scripted):
    """A state that gets no preempt."""

    def request_preempt(self):
        pass


def test_a_branch_waits_for_no_state_that_still_runs_under_another_label(monkeypatch):
    def overruns(state, ud):
        stuck.set()
        assert let_go.wait(20)

    clock, stuck, let_go = LimitClock(monkeypatch), threading.Event(), threading.Event()
    clock.end(2, stuck)
    state = Deaf('ok', 'ok', 'ok', overruns)
    machine = smach.StateMachine(OUTCOMES)
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('ALL', iterator_over(state, (1,)), {'done': 'A'})
        smach.StateMachine.add('A', state, {'ok': 'done'})
        smach.StateMachine.add('B', Scripted(), {'ok': 'ALL'})
    expert = FakeExpert(goto('B'), supersede('ok'), supersede('ok'))
    settings = {'states': {'A': ABANDONING}, 'policy': 'always_ask'}
    wrapped = OracleContainer.wrap(machine, expert=expert, settings=settings)
    assert [wrapped.execute(), wrapped.execute()] == ['done', 'done']
    let_go.set()
    assert state.runs == 4
    assert [each.failed_state for each in expert.questions] == ['A', 'EACH', 'A']


def test_where_an_outcome_of_a_container_leads_says_whether_a_branch_has_failed():
    left, right = Scripted('aborted'), Scripted()
    container = both(
        left,
        right,
        outcomes=['done', 'odd', 'aborted'],
        outcome_map={'done': {'LEFT': 'ok', 'RIGHT': 'ok'}, 'odd': {'LEFT': 'aborted'}},
    )
    machine = inside(container, transitions={'done': 'done', 'odd': 'aborted'})
    assert OracleContainer.wrap(machine).execute() == 'done'
    assert (left.runs, right.runs) == (2, 1)


def test_an_outcome_that_is_registered_later_leads_an_iterator_without_loop_outcomes_on():
    each, expert = Scripted('aborted'), FakeExpert()
    iterator = iterator_over(each, (1, 2), break_outcomes=['ok', 'aborted', 'preempted'])
    each.register_outcomes(['more'])
    machine = inside(iterator)
    settings = {'policy': 'always_ask'}
    OracleContainer.wrap(machine, expert=expert, settings=settings).execute()
    leads = {each.outcome: each.target for each in expert.questions[0].supersede_outcomes}
    assert leads['more'] == 'the next item' != leads['ok']


def test_a_state_without_a_name_has_no_oracle_of_its_own():
    nameless, right = Scripted('aborted'), Scripted()
    container = smach.Concurrence(
        OUTCOMES, 'aborted', outcome_map={'done': {'': 'ok', 'RIGHT': 'ok'}}
    )
    with container:
        smach.Concurrence.add('', nameless)
        smach.Concurrence.add('RIGHT', right)
    machine = OracleContainer.wrap(inside(container))
    assert (machine.execute(), nameless.runs, right.runs) == ('done', 2, 2)
    assert [row.state for row in machine.rates()] == ['ALL', 'RIGHT']


def test_a_container_without_an_oracle_is_stored_as_any_state(tmp_path, log):
    settings = {'nested': False, 'checkpoint': str(tmp_path / 'robot.db')}
    machine = OracleContainer.wrap(inside(both(Scripted(), Scripted())), settings=settings)
    assert machine.execute() == 'done'
    assert not [text for level, text in log if level in ('warn', 'err')]


def test_an_iterator_that_is_executed_by_hand_is_no_execution_in_its_tree(log):
    iterator = iterator_over(Item(), iter([1, 2, 3]))
    assert OracleContainer.wrap(inside(iterator)).execute() == 'done'
    userdata = smach.UserData()
    userdata.done = []
    assert iterator.execute(userdata) == 'done'
    assert not [text for level, text in log if level == 'warn']


class TriesFirst(smach.Iterator):
    """Executes its state once before the first item."""

    def execute(self, parent_ud=None):
        self._state.execute(self.userdata)
        return smach.Iterator.execute(self, parent_ud)


def test_a_state_that_fails_before_the_first_item_passes_over_none():
    iterator = TriesFirst(OUTCOMES, [], [], it=(1, 2), it_label='item', exhausted_outcome='done')
    with iterator:
        each = Scripted('aborted', 'ok', 'aborted')
        smach.Iterator.set_contained_state('EACH', each, break_outcomes=['preempted'])
    machine = Watched(inside(iterator))
    assert machine.run() == 'done' and each.runs == 3
    texts = [event.text for event in machine.of(EventKind.WARNING)]
    assert texts == ['item 2 of 2 is passed over with aborted, as its author has drawn it']


def test_a_failure_that_was_given_up_in_a_branch_settles_none_after_it_has_ended_well():
    expert = FakeExpert(give_up('ok'), supersede('ok'))
    machine = own(lambda a, ud: [a.execute(ud) for _ in range(3)] and 'aborted', 'ok', 'aborted')
    settings = {'policy': 'always_ask'}
    assert OracleContainer.wrap(machine, expert=expert, settings=settings).execute() == 'done'
    assert [each.failed_state for each in expert.questions] == ['A', 'ALL']


class LooksFirst(smach.Concurrence):
    """A user's class that looks for a request before it executes its state, and makes one then."""

    def execute(self, parent_ud=None):
        self.seen = self._states['A'].preempt_requested()
        return self._states['A'].execute(self.userdata)


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')), reason='this engine cannot copy a machine'
)
def test_a_copy_of_a_branch_that_is_preempted_has_no_request():
    def take(state, ud):
        if not taken:
            container._states['A'].request_preempt()
            state.service_preempt()
            taken.append(copy.deepcopy(machine))
        return 'ok'

    taken, container = [], LooksFirst(['ok', 'preempted', 'aborted'], 'aborted')
    with container:
        smach.Concurrence.add('A', Scripted(take))
    machine = inside(container, transitions={'ok': 'done'})
    OracleContainer.wrap(machine).execute()
    (other,) = taken
    assert other.execute() == 'done' and not other.get_children()['ALL'].seen
