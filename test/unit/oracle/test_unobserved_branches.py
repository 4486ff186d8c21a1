"""Branches go the same way whether somebody observes or not: a plain one takes the short way."""

import random
import re
import threading

import pytest
from branch_machines import Item, both, inside, iterator_over
from guarded_machines import chain
from held_machines import Held, eventually
from machines import FakeExpert, Scripted, chain_of, give_up, goto, supersede
from test_pinned_branches import rows_of
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.branches.wrapper import wrapper_of
from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.visits import VisitResult

OUTCOMES = ('done', 'aborted', 'preempted')
STEPS = ('ok', 'ok', 'ok', 'aborted', ValueError('slipped'), 'unheard_of', 'preempted')


def scripts(draw):
    """For some items, what their tries end with."""
    return {
        'item{}'.format(number): [draw.choice(STEPS) for _ in range(draw.randint(0, 2))]
        for number in range(1, 7)
    }


def plan(seed):
    """A machine, an expert and settings, drawn from a seed."""
    draw = random.Random(seed)
    loops = draw.choice((['ok'], ['ok', 'aborted']))
    iterator = iterator_over(Item(**scripts(draw)), items=range(1, 7), loop_outcomes=loops)
    machine = inside(iterator)
    with machine:
        concurrence = both(
            Scripted(*[draw.choice(STEPS) for _ in range(draw.randint(0, 3))]), Scripted()
        )
        smach.StateMachine.add('BOTH', concurrence, {'done': 'done', 'aborted': 'aborted'})
        smach.StateMachine.add(
            'AGAIN', Scripted(), {'ok': draw.choice(('ALL', 'BOTH')), 'aborted': 'aborted'}
        )
    machine._transitions['ALL']['done'] = 'BOTH'
    answers = [
        draw.choice((goto('EACH'), goto('LEFT'), supersede('ok'), give_up('aborted')))
        for _ in range(6)
    ]
    settings = {
        'max_recoveries': draw.choice((0, 1, 3)),
        'userdata': draw.choice(('restore', 'keep')),
        'memory': draw.choice((10, 1000)),
    }
    return machine, FakeExpert(*answers), settings


def run(seed, observed):
    """All that is left of some trials of a machine."""
    machine, expert, settings = plan(seed)
    wrapped = OracleContainer.wrap(machine, name='TOP', expert=expert, settings=settings)
    if observed:
        oracle_of(wrapped).events.observers.append(lambda event: None)
    left = []
    for _ in range(3):
        wrapped.userdata.done = []
        try:
            left.append(wrapped.execute())
        except (smach.InvalidUserCodeError, smach.InvalidTransitionError) as err:
            left.append(type(err).__name__)
        left.append(dict(wrapped.userdata._data))
        # where LEFT raises, or is left, RIGHT is preempted, and may have ended before
        left += [row for row in rows_of(wrapped) if not re.search('/RIGHT|BOTH [(]', row)]
    return left, [(each.failed_state, each.userdata, told(each)) for each in expert.questions]


def told(question):
    """The history of a question. Where BOTH is left, the end of RIGHT decides how that was."""
    return [
        visit._replace(outcome='left') if visit.result is VisitResult.PREEMPTED else visit
        for visit in question.history
    ]


@pytest.mark.parametrize('seed', range(60))
def test_what_is_left_is_the_same_with_an_observer_and_without(seed):
    assert run(seed, observed=False) == run(seed, observed=True)


class Waits(smach.State):
    """Ends at once, but at item 5 once it is preempted, with an outcome, which may service it."""

    def __init__(self, outcome):
        smach.State.__init__(self, ['ok', 'preempted'], input_keys=['item'])
        self.done, self.begun, self._outcome = [], threading.Event(), outcome

    def execute(self, ud):
        if ud.item == 5:
            self.begun.set()
            while not self.preempt_requested():
                pass
            if self._outcome == 'preempted':
                self.service_preempt()
        self.done.append(ud.item)
        return self._outcome if ud.item == 5 else 'ok'


@pytest.mark.parametrize('outcome', ['ok', 'preempted'])
def test_a_preempt_on_the_short_way_reaches_the_state_and_its_visit_teaches_nothing(outcome):
    state = Waits(outcome)
    iterator = iterator_over(state, items=range(1, 9), outcomes=(*OUTCOMES, 'ok'))
    machine = OracleContainer.wrap(inside(iterator, transitions={'ok': 'preempted'}))
    thread = threading.Thread(target=lambda: state.begun.wait(20) and machine.request_preempt())
    thread.start()
    machine.execute()
    thread.join()
    assert state.done == [1, 2, 3, 4, 5]
    assert {row.state: row.successes for row in machine.rates()}['EACH'] == 4


def test_a_branch_on_the_short_way_ends_before_an_operator_could_send_it(log):
    def sends(state, ud):
        hand.go_to('TOP/BOTH', 'LEFT')
        return 'ok'

    machine = OracleContainer.wrap(
        inside(both(Scripted('ok', sends), Scripted()), 'BOTH'), name='TOP'
    )
    hand = OperatorHand(machine)
    assert [machine.execute(), machine.execute()] == ['done', 'done']
    assert not hand.status().jumps
    assert any('has ended before it could be sent to LEFT' in text for _, text in log)


def test_an_item_that_fails_on_the_short_way_finds_its_userdata_restored():
    def spoils(state, ud):
        ud.done = ud.done + ['spoiled']
        return 'aborted'

    machine = OracleContainer.wrap(
        inside(iterator_over(Item(item4=[spoils]), items=(1, 2, 3, 4, 5))),
        settings={'userdata': 'restore'},
    )
    assert machine.execute() == 'done'
    assert machine.userdata.done == [1, 2, 3, 4, 5]


def test_the_end_of_a_machine_on_the_short_way_is_counted():
    machine = OracleContainer.wrap(chain_of(Scripted(), Scripted()))
    assert [machine.execute() for _ in range(4)] == ['done'] * 4
    assert [row.successes for row in machine.rates()] == [4, 4]
    assert sum(row.count for row in machine.transition_counts()) == 8


def active(hand):
    return {'{}/{}'.format(each.path, each.state) for each in hand.status().active}


def test_a_branch_that_has_ended_on_the_short_way_is_not_active():
    """Neither while another one runs, nor behind its container."""
    seen = []

    def looks(state, ud):
        assert wait_for(lambda: 'TOP/BOTH/LEFT' not in active(hand), 20.0)
        seen.append(active(hand))
        return 'ok'

    machine = chain(
        BOTH=both(Scripted(), Scripted('ok', looks)),
        ALL=iterator_over(Item(), (1, 2), outcomes=('done', 'preempted')),
        LAST=Scripted('ok', lambda state, ud: seen.append(active(hand)) or 'ok'),
    )
    machine.userdata.done = []
    wrapped = OracleContainer.wrap(machine, name='TOP')
    hand = OperatorHand(wrapped)
    assert [wrapped.execute(), wrapped.execute()] == ['done', 'done']
    assert seen == [{'TOP/BOTH', 'TOP/BOTH/RIGHT'}, {'TOP/LAST'}]


def test_each_item_of_a_state_with_a_time_limit_runs_in_another_thread():
    threads = []
    each = Scripted(*[lambda state, ud: threads.append(threading.current_thread()) or 'ok'] * 3)
    machine = OracleContainer.wrap(
        inside(iterator_over(each, (1, 2, 3))),
        settings={'states': {'ALL/EACH': {'time_limit_s': 30.0}}},
    )
    assert machine.execute() == 'done'
    assert len(threads) == 3 and threading.current_thread() not in threads


def test_a_preempt_on_the_short_way_reaches_the_state_in_each_execution():
    """The first item, whose container begins once more, and an item behind others."""
    reached = []

    def is_reached(state, ud):
        machine.request_preempt()
        reached.append(state.preempt_requested())
        state.service_preempt()
        return 'preempted'

    for at in (1, 3):
        each = Scripted(*['ok'] * 3, *['ok'] * (at - 1), is_reached)
        machine = OracleContainer.wrap(inside(iterator_over(each, (1, 2, 3))))
        assert [machine.execute(), machine.execute()] == ['done', 'preempted']
    assert reached == [True, True]


def test_a_branch_that_ends_under_a_shutdown_teaches_nothing(monkeypatch):
    def shut_down(state, ud):
        monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        return 'ok'

    each = Scripted(*['ok'] * 4, shut_down)
    iterator = iterator_over(each, (1, 2, 3), outcomes=(*OUTCOMES, 'ok'))
    machine = OracleContainer.wrap(inside(iterator, transitions={'ok': 'preempted'}))
    machine.execute()
    machine.execute()
    assert {row.state: row.successes for row in machine.rates()}['EACH'] == 4


class Hears(Scripted):
    """Counts its preempts."""

    heard = 0

    def request_preempt(self):
        self.heard += 1
        Scripted.request_preempt(self)


def test_a_branch_hears_of_a_preempt_once_until_it_has_obeyed():
    heard = []

    def preempted(state, ud):
        state.request_preempt()  # not by its container
        for serviced in (False, False, True):
            if serviced:
                state.service_preempt()
            iterator.request_preempt()
            heard.append(state.heard)
        return 'preempted'

    iterator = iterator_over(Hears('ok', preempted), (1, 2, 3))
    OracleContainer.wrap(inside(iterator)).execute()
    assert heard == [2, 2, 3]


def test_a_preempt_that_comes_before_a_branch_has_a_state_reaches_that():
    class Copied:
        def __deepcopy__(self, memo):
            if not reached:
                asked.append('asks')
                iterator.request_preempt()
                asked.append('has asked')
            return self

    def is_reached(state, ud):
        reached.append(state.preempt_requested())
        state.service_preempt()
        return 'preempted'

    asked, reached = [], []
    iterator = iterator_over(Scripted(is_reached), (1, 2))
    machine = OracleContainer.wrap(inside(iterator), settings={'deep_copy_keys': ['done']})
    machine.userdata.done = Copied()
    assert machine.execute() == 'preempted' and reached == [True]
    assert asked.count('asks') == asked.count('has asked')


def test_a_preempt_that_comes_between_two_tries_of_a_branch_is_heard_once():
    def ask(event):
        if event.kind is EventKind.JUMP:
            asking.start()
            passed.append(wait_for(branch.preempt_requested, 20))

    class Obeys(Hears):
        def request_preempt(self):
            self.heard += 1

    def preempted(state, ud):
        asking.join(20)
        return 'preempted'

    each, passed = Obeys('aborted', preempted), []
    iterator = iterator_over(each, (1, 2))
    machine = OracleContainer.wrap(inside(iterator), settings={'policy': 'retry'})
    branch = wrapper_of(iterator).branches['EACH']
    asking = threading.Thread(target=branch.request_preempt)
    machine.events.observers.append(ask)
    machine.execute()
    assert (passed, each.heard) == ([True], 1)


class Twice(smach.Concurrence):
    """A user's class that goes through its states one after the other, and goes on when left."""

    def execute(self, parent_ud=None):
        for label in ('LEFT', 'RIGHT', 'LEFT'):
            self._states[label].execute(self.userdata)
        return 'done'


def twice(left, right=None):
    container = Twice(['done', 'aborted', 'preempted'], 'aborted')
    with container:
        smach.Concurrence.add('LEFT', left)
        smach.Concurrence.add('RIGHT', right or Scripted())
    return container


def test_a_branch_that_was_left_has_its_oracle_again_where_its_container_goes_on():
    expert = FakeExpert(goto('LAST'), supersede('ok'))
    left = Scripted(*['ok'] * 4, 'aborted', 'aborted')
    machine = chain(BOTH=twice(left), LAST=Scripted())
    wrapped = OracleContainer.wrap(machine, expert=expert, settings={'policy': 'always_ask'})
    assert [wrapped.execute() for _ in range(3)] == ['done'] * 3
    assert [each.failed_state for each in expert.questions] == ['LEFT', 'LEFT']


@pytest.mark.parametrize('behind', [{}, {'LAST': Scripted()}])
def test_a_container_that_ends_well_though_it_was_left_is_left(behind):
    """It is the last state of its machine, or not."""
    first, left = Scripted(), Scripted('ok', 'ok', 'aborted')
    concurrence = both(left, Scripted(), outcome_map={'done': {'RIGHT': 'ok'}})
    expert, settings = FakeExpert(goto('FIRST')), {'policy': 'always_ask'}
    machine = OracleContainer.wrap(
        chain(FIRST=first, BOTH=concurrence, **behind), expert=expert, settings=settings
    )
    assert [machine.execute() for _ in range(3)] == ['done'] * 3
    assert (first.runs, left.runs) == (4, 4)


def test_a_preempt_that_comes_as_a_branch_begins_reaches_its_state():
    class Asked(Hears):
        def preempt_requested(self):
            if at_last and not asked:
                asked.append(self.heard)
                machine.request_preempt()
            return Hears.preempt_requested(self)

    def is_reached(state, ud):
        reached.append(state.preempt_requested())
        state.service_preempt()
        return 'preempted'

    asked, at_last, reached = [], [], []
    each = Asked('ok', 'ok', is_reached)
    machine = OracleContainer.wrap(inside(iterator_over(each, (1, 2))))
    assert machine.execute() == 'done'
    at_last.append(True)
    assert machine.execute() == 'preempted'
    assert asked and all(reached)


def test_each_item_is_confirmed_though_nobody_observes():
    each = Scripted()
    held = Held(
        inside(iterator_over(each, (1, 2, 3))),
        name='TOP',
        settings={'states': {'ALL/EACH': {'autonomy': 'confirm'}}},
    )
    held.machine.events.observers.remove(held.events.append)
    with held.begin():
        for done in range(3):
            held.waits_before('TOP/ALL/EACH')
            assert each.runs == done
            held.hand.confirm()
            eventually(lambda number=done + 1: each.runs == number)
        assert held.end() == 'done'


@pytest.mark.parametrize('is_observed', [False, True])
def test_an_item_that_begins_with_a_request_of_its_state_teaches_nothing(is_observed):
    each = Scripted()
    machine = OracleContainer.wrap(inside(iterator_over(each, (1, 2))))
    if is_observed:
        machine.events.observers.append(lambda event: None)
    assert machine.execute() == 'done'
    each.request_preempt()
    assert machine.execute() == 'done'
    successes = {row.state: row.successes for row in machine.rates()}['EACH']
    assert (each.runs, successes) == (4, 2)
