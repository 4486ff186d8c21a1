"""Several states at the same time."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from smach_states import Fixed, Scripted, UntilPreempted, concurrence, machine, naming, that_name
from waiting import Once, asleep, wait_for

import smach


def after(event):
    """A state that ends once the event is set, and ignores preempts."""
    return Scripted(lambda state, ud: event.wait(20.0) and 'done')


def ignore_the_preempt(state, ud):
    """End once it has come, but leave the request standing."""
    assert wait_for(state.preempt_requested)
    return 'done'


def flags(container):
    return [state.preempt_requested() for state in container.get_children().values()]


def test_all_children_run_at_the_same_time_and_the_slowest_ends_it(said):
    meet = threading.Barrier(2, timeout=5.0)
    both = concurrence(
        {label: Scripted(lambda state, ud: meet.wait() is None or 'done') for label in 'AB'}
    )
    assert both.execute() == 'done'
    assert "Concurrent Outcomes: {'A': 'done', 'B': 'done'}" in said('info')
    assert "Concurrent state 'A' returned outcome 'done' on termination." in said('info')


@pytest.mark.improvement
def test_each_child_is_asked_once_for_its_preempt():
    class Counts(Fixed):
        def preempt_requested(self):
            asked.append('requested')
            return True

        def recall_preempt(self):
            asked.append('recall')

    asked = []
    assert concurrence({'A': Counts('done')}).execute() == 'done'
    assert asked == ['requested', 'recall']


def test_the_satisfied_entry_with_most_conditions_wins():
    outcome_map = {
        'done': {'A': 'done'},
        'failed': {'A': 'done', 'B': 'failed'},
        'preempted': {'B': 'done'},
    }
    children = {'A': Fixed('done'), 'B': Fixed('failed')}
    with pytest.raises(smach.InvalidStateError):
        concurrence(children, outcome_map={'unknown': {'A': 'done'}})
    children['B'].register_outcomes(['done'])
    assert concurrence(children, default='preempted', outcome_map=outcome_map).execute() == 'failed'


@pytest.mark.parametrize(
    'outcome_map',
    [
        ['done'],
        ('done',),
        {'done': 'A'},
        {'done': ['A']},
        {'done': None},
        {'done': 3},
        {'done': [('A', 'done')]},
    ],
)
def test_an_outcome_map_that_is_no_mapping_is_a_type_error_when_the_with_block_ends(outcome_map):
    made = smach.Concurrence(['done', 'failed'], 'failed', outcome_map=outcome_map)
    with pytest.raises(TypeError):
        with made:
            smach.Concurrence.add('A', Fixed())


def test_an_outcome_map_that_cannot_be_gone_through_is_a_type_error_at_once():
    with pytest.raises(TypeError):
        smach.Concurrence(['done', 'failed'], 'failed', outcome_map=5)


@pytest.mark.improvement
def test_the_type_error_of_an_outcome_map_says_how_it_is_written():
    with pytest.raises(TypeError, match=r"\{outcome: \{label: child's outcome\}\}; 'A' is no"):
        concurrence({'A': Fixed()}, outcome_map={'failed': 'A'})


@pytest.mark.parametrize('outcome_map', [{}, [], '', {'done': {}}, {'done': ''}, {'done': []}])
def test_an_entry_without_conditions_never_holds(outcome_map):
    made = concurrence({'A': Fixed()}, default='failed', outcome_map=outcome_map)
    assert made.execute() == 'failed' and made.get_internal_edges() == []


def test_the_default_counts_when_nothing_else_does():
    children = {'A': Fixed('done'), 'B': Fixed('failed')}
    outcome_map = {'done': {'B': 'failed', 'A': 'done'}}
    assert concurrence(children, default='preempted', outcome_map=outcome_map).execute() == 'done'
    assert concurrence(children, default='failed').execute() == 'failed'
    with pytest.raises(smach.InvalidStateError, match=naming('unknown')):
        concurrence(children, default='unknown')


def test_the_outcome_callback_comes_first_if_it_gives_an_outcome(said):
    given = []
    children = {'A': Fixed('done'), 'B': Fixed('failed')}
    both = concurrence(
        children, outcome_cb=lambda outcomes: given.append(dict(outcomes)) or 'failed'
    )
    assert both.execute() == 'failed' and given == [{'A': 'done', 'B': 'failed'}]
    assert (
        concurrence(
            children, outcome_cb=lambda outcomes: None, outcome_map={'preempted': {'A': 'done'}}
        ).execute()
        == 'preempted'
    )
    assert any(
        "Outcome callback returned None, using outcome 'preempted'" in text for text in said('warn')
    )


def test_an_exception_in_the_outcome_callback_surfaces():
    with pytest.raises(smach.InvalidUserCodeError, match='ZeroDivisionError'):
        concurrence({'A': Fixed()}, outcome_cb=lambda outcomes: 1 // 0).execute()


def test_a_termination_callback_may_preempt_the_others():
    seen = []

    def first_wins(outcomes):
        seen.append(dict(outcomes))
        return True

    both = concurrence({'A': Fixed(), 'B': UntilPreempted()}, child_termination_cb=first_wins)
    both.execute()
    assert seen == [{'A': 'done', 'B': None}, {'A': 'done', 'B': 'preempted'}]
    assert not both.preempt_requested()


@pytest.mark.improvement
def test_a_termination_callback_may_name_whom_to_preempt():
    seen = {}

    def only_b(outcomes):
        seen.update(outcomes)
        return ['B', 'A']

    three = concurrence(
        {'A': Fixed(), 'B': UntilPreempted(), 'C': UntilPreempted(0.1)}, child_termination_cb=only_b
    )
    three.execute()
    assert seen == {'A': 'done', 'B': 'preempted', 'C': 'done'} and flags(three) == [False] * 3


@pytest.mark.improvement
def test_an_exception_in_the_termination_callback_surfaces_after_the_others_ended():
    other = UntilPreempted()
    both = concurrence(
        {'A': after(other.started), 'B': other}, child_termination_cb=lambda outcomes: 1 // 0
    )
    begin = time.monotonic()
    with pytest.raises(smach.InvalidUserCodeError, match='child termination callback'):
        both.execute()
    assert time.monotonic() - begin < 10.0 and both.get_active_states() == []


def test_a_childs_exception_preempts_the_others_and_surfaces_when_they_have_ended(said):
    other = UntilPreempted()
    begin = time.monotonic()
    with pytest.raises(smach.InvalidStateError):
        concurrence(
            {'A': Scripted(lambda state, ud: other.started.wait(5.0) and 1 // 0), 'B': other}
        ).execute()
    assert time.monotonic() - begin < 10.0
    assert any('ZeroDivisionError' in text for text in that_name(['A'], said('err')))


@pytest.mark.improvement
def test_a_child_that_returns_nothing_is_an_error_not_a_hang():
    with pytest.raises(smach.InvalidStateError):
        concurrence({'A': Scripted(lambda state, ud: None), 'B': UntilPreempted()}).execute()


@pytest.mark.improvement
def test_a_childs_unregistered_outcome_is_logged(said):
    assert (
        concurrence({'A': Scripted(lambda state, ud: 'surprise')}, default='failed').execute()
        == 'failed'
    )
    assert any("'surprise', which it has not registered" in text for text in said('err'))


def test_no_children_is_an_error():
    with pytest.raises(smach.InvalidStateError):
        smach.Concurrence(['done'], 'done').execute()


def test_userdata_goes_through_the_remapping_in_both_directions():
    def add(state, ud):
        ud.sum = ud.a + 1
        return 'done'

    both = smach.Concurrence(['done'], 'done', input_keys=['x'], output_keys=['y'])
    with both:
        smach.Concurrence.add(
            'A', Scripted(add, input_keys=['a'], output_keys=['sum']), {'a': 'x', 'sum': 'y'}
        )
    parent = smach.UserData()
    parent.x = 1
    assert both.execute(parent) == 'done' and parent.y == 2


def test_a_preempt_reaches_all_running_children_and_is_serviced(said):
    both = concurrence(
        {'A': UntilPreempted(), 'B': UntilPreempted(), 'ENDED': Fixed()},
        outcome_map={'preempted': {'A': 'preempted', 'B': 'preempted'}},
    )
    asker = Once(lambda: sorted(both.get_active_states()) == ['A', 'B'], both.request_preempt)
    assert both.execute() == 'preempted'
    asker.join()
    assert not both.preempt_requested() and flags(both) == [False] * 3
    assert 'Concurrence serviced preempt.' in said('info')


@pytest.mark.improvement
def test_a_serviced_preempt_ends_in_preempted_without_a_map():
    both = concurrence({'A': UntilPreempted(), 'B': UntilPreempted()}, default='failed')
    asker = Once(lambda: len(both.get_active_states()) == 2, both.request_preempt)
    assert both.execute() == 'preempted'
    asker.join()


class SlowToAsk(UntilPreempted):
    """Has ended, and its container knows, before its request_preempt() returns.

    So may an action state that sends a cancel.
    """

    def __init__(self):
        UntilPreempted.__init__(self)
        self.end_is_known = threading.Event()

    def request_preempt(self):
        UntilPreempted.request_preempt(self)
        self.end_is_known.wait(5.0)


@pytest.mark.improvement
def test_a_child_that_ends_while_it_is_being_asked_has_serviced_the_preempt():
    child = SlowToAsk()

    def child_ended(outcomes):
        child.end_is_known.set()
        asker.join(5.0)

    cc = concurrence({'A': child}, default='failed', child_termination_cb=child_ended)
    asker = Once(child.started.is_set, cc.request_preempt)
    assert cc.execute() == 'preempted'
    asker.join()
    assert not cc.preempt_requested()


def test_a_child_that_ignores_the_preempt_leaves_it_to_the_parent(said):
    heeds, deaf = UntilPreempted(), Scripted(ignore_the_preempt)
    both = concurrence({'A': heeds, 'DEAF': deaf}, default='done')
    asker = Once(heeds.started.is_set, both.request_preempt)
    assert both.execute() == 'done' and both.preempt_requested()
    asker.join()
    assert len(that_name(['DEAF'], said('warn'))) == 1 and not that_name(['A'], said('warn'))
    assert flags(both) == [False, False]


@pytest.mark.improvement
def test_a_preempt_that_comes_while_it_ends_is_not_swallowed():
    both = concurrence({'A': Fixed()}, outcome_cb=lambda outcomes: both.request_preempt() or 'done')
    sm = machine(
        ('BOTH', both, {'done': 'NEXT'}),
        (
            'NEXT',
            Scripted(lambda state, ud: 'preempted' if state.preempt_requested() else 'failed'),
            None,
        ),
    )
    both_of_machine = sm['BOTH']
    both_of_machine.register_termination_cb(lambda ud, labels, outcome: sm.request_preempt())
    assert sm.execute() == 'preempted'
    assert flags(both) == [False]


@pytest.mark.improvement
def test_a_preempt_left_over_from_the_last_run_is_not_meant_for_the_next():
    asked = threading.Event()
    both = concurrence({'DEAF': after(asked)}, outcomes=('done', 'preempted'))
    asker = Once(both.get_active_states, lambda: (both.request_preempt(), asked.set()))
    both.execute()
    asker.join()
    assert both.preempt_requested()
    assert both.execute() == 'done' and not both.preempt_requested()


@pytest.mark.improvement
def test_hammering_it_with_preempts_neither_hangs_nor_leaves_flags_behind():
    both = concurrence({'A': UntilPreempted(0.01), 'B': UntilPreempted(0.01)})
    stop = threading.Event()

    def hammer():
        while not stop.wait(0.0005):
            both.request_preempt()

    thread = threading.Thread(target=hammer, daemon=True)
    thread.start()
    outcomes = {both.execute() for _ in range(30)}
    stop.set()
    thread.join()
    assert outcomes <= {'done', 'preempted'} and flags(both) == [False, False]


def test_active_states_are_those_that_still_run():
    active, alone = [], threading.Event()

    def note(ud, states):
        active.append(sorted(states))
        if active[-1] == ['B']:
            alone.set()

    both = concurrence({'A': Fixed(), 'B': after(alone)})
    both.register_transition_cb(note)
    both.execute()
    assert (
        active[:1] == [['A', 'B']] and active[-2:] == [['B'], []] and both.get_active_states() == []
    )


def test_edges_are_the_conditions_of_the_outcome_map():
    both = concurrence(
        {'A': Fixed(), 'B': Fixed()}, outcome_map={'failed': {'A': 'done', 'B': 'done'}}
    )
    assert sorted(both.get_internal_edges()) == [('done', 'A', 'failed'), ('done', 'B', 'failed')]
    assert sorted(both.get_initial_states()) == ['A', 'B']


def test_a_map_that_names_an_outcome_no_child_has_is_logged(said):
    concurrence({'A': Fixed()}, outcome_map={'failed': {'A': 'unknown'}})
    assert that_name(['A', 'unknown', 'done'], said('err'))


@pytest.mark.improvement
def test_a_shutdown_preempts_the_children_and_a_deaf_one_cannot_hold_it_up(monkeypatch, said):
    down, over = threading.Event(), threading.Event()
    monkeypatch.setattr(smach, 'is_shutdown', down.is_set)
    both = concurrence({'A': UntilPreempted(), 'DEAF': after(over)})
    stopper = Once(lambda: len(both.get_active_states()) == 2, down.set)
    begin = time.monotonic()
    both.execute()
    assert time.monotonic() - begin < 4.0
    over.set()
    stopper.join()
    assert any("['DEAF'] did not end" in text for text in said('err'))


INTERRUPTED = """
import sys, threading
sys.path[:0] = {paths!r}
import smach
from smach_states import UntilPreempted, concurrence, machine
child = UntilPreempted(30.0)
sm = machine(('BOTH', concurrence({{'A': child, 'B': UntilPreempted(30.0)}}), None))
threading.Thread(target=lambda: (child.started.wait(), print('started', flush=True))).start()
try:
    sm.execute()
except KeyboardInterrupt:
    print('interrupted', sm.is_running(), child.preempt_requested())
"""


@pytest.mark.improvement
def test_ctrl_c_stops_a_concurrence_in_a_machine_at_once():
    here = os.path.dirname(os.path.abspath(__file__))
    script = INTERRUPTED.format(paths=[here] + sys.path)
    process = subprocess.Popen(
        [sys.executable, '-c', script], stdout=subprocess.PIPE, universal_newlines=True
    )
    try:
        while 'started' not in process.stdout.readline():
            pass
        assert wait_for(lambda: asleep(process.pid))
        begin = time.monotonic()
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=60.0)
    finally:
        process.kill()
    assert 'interrupted False False' in rest and time.monotonic() - begin < 10.0


def test_a_subclass_may_keep_the_outcomes_so_far_by_upstreams_name_for_them():
    class OneByOne(smach.Concurrence):
        def execute(self, parent_ud=None):
            self._child_outcomes = {}
            for label, state in self.get_children().items():
                self._child_outcomes[label] = state.execute(self.userdata)
            return 'succeeded' if self._child_outcomes == {'A': 'done', 'B': 'done'} else 'failed'

    one_by_one = OneByOne(['succeeded', 'failed'], 'failed')
    with one_by_one:
        smach.Concurrence.add('A', Fixed())
        smach.Concurrence.add('B', Fixed())
    assert one_by_one.execute() == 'succeeded'


def test_the_outcomes_so_far_are_there_while_it_executes():
    told = []
    both = concurrence(
        {'A': Fixed(), 'B': Fixed()},
        child_termination_cb=lambda outcomes: told.append(dict(both._child_outcomes)),
    )
    both.execute()
    assert told[-1] == {'A': 'done', 'B': 'done'} and not both._child_outcomes
