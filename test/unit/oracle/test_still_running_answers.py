"""What an answer about a state that still runs comes to, and what a question may look at."""

import threading

import pytest
from machines import FakeExpert, Gate, Scripted, chain_of, goto, supersede, watched
from test_still_running import SOON, asked, failures, letting_go

from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind


@pytest.mark.parametrize('by, who', [('eva', 'eva'), ('', 'the expert')])
def test_the_log_says_who_waits_on(by, who, log):
    gate = Gate()
    expert = FakeExpert(goto('A')._replace(by=by), letting_go(gate, None))
    assert asked(Scripted('aborted', gate), expert=expert).run() == 'done'
    assert ('info', 'SM_ROOT/A: {} waits on'.format(who)) in log


def test_an_answer_of_another_kind_that_names_the_state_is_not_to_wait_on():
    expert = FakeExpert(supersede('ok', state='A'))
    machine = asked(Scripted('aborted', Gate()), Scripted(), expert=expert)
    assert machine.run() == 'done' and machine.visits() == ['A', 'A', 'B']


def test_a_state_of_the_same_name_in_another_container_is_gone_to():
    inner = chain_of(Scripted())
    machine = asked(
        Scripted('aborted', Gate()), inner, expert=FakeExpert(goto('A', container='SM_ROOT/B'))
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'A', 'B', 'A'] and not failures(machine)[1:]


def test_where_the_policy_asks_nobody_the_log_warns():
    gate, expert = Gate(), FakeExpert()
    machine = asked(Scripted('aborted', gate), expert=expert, policy='retry')
    machine.machine.events.observers.append(
        lambda event: event.kind is EventKind.WARNING and gate.go.set()
    )
    assert machine.run() == 'done' and not expert.questions


def test_the_question_looks_at_nothing_that_the_state_may_write_meanwhile():
    class Box:
        looked_at_by = []

        def __deepcopy__(self, memo):
            return self

        def __reduce__(self):
            self.looked_at_by.append(threading.current_thread())
            return str, ()

    gate = Gate()
    expert = FakeExpert(letting_go(gate, None))
    machine = asked(Scripted('aborted', gate), expert=expert, deep_copy_keys=['box'])
    machine.machine.userdata.box = Box()
    assert machine.run() == 'done' and len(expert.questions) == 1
    assert set(Box.looked_at_by) == {threading.current_thread()}


def test_an_answer_before_a_preempt_is_not_said_to_be_of_no_use():
    machine = asked(Scripted('aborted', Gate()), Scripted(), expert=FakeExpert(goto('B')))
    machine.machine.events.observers.append(
        lambda event: event.kind is EventKind.QUERY_ANSWERED and machine.machine.request_preempt()
    )
    assert machine.run() == 'preempted'
    assert not machine.of(EventKind.WARNING)


def test_to_wait_on_repeats_nothing_and_to_go_elsewhere_does():
    gate = Gate()
    expert = FakeExpert(goto('B'), letting_go(gate, None))
    machine = watched(
        Scripted(),
        Scripted('aborted', gate),
        expert=expert,
        settings={**SOON, 'max_recoveries': 0, 'on_retry': 'confirm'},
    )
    assert machine.run() == 'done'
    told = {each.state: each.repeats for each in expert.questions[1].choices}
    assert told == {'A': ('A', 'B'), 'B': ()}


def test_a_state_that_heeds_the_preempt_of_an_answer_is_not_said_to_run_on(log):
    machine = asked(
        Scripted('aborted', Gate()), Scripted(), expert=FakeExpert(goto('B')), grace_period_s=3.0
    )
    assert machine.run() == 'done'
    for thread in threading.enumerate():
        if thread.name == 'smach_oracle still running':
            thread.join(20)
    assert not any('does not heed' in text for _, text in log)


def test_the_question_says_that_without_an_answer_it_runs_on():
    gate = Gate()
    expert = FakeExpert(letting_go(gate, None))
    assert asked(Scripted('aborted', gate), expert=expert).run() == 'done'
    assert expert.questions[0].fallback == 'it runs on'


def test_a_state_that_the_oracle_enters_is_asked_about_though_it_was_wrapped_on_the_way():
    def wrap_again(event):
        if event.kind is EventKind.JUMP:
            OracleContainer.wrap(machine.machine, settings={**SOON, 'memory': 5})

    gate = Gate()
    expert = FakeExpert(letting_go(gate, None))
    machine = asked(Scripted('aborted', gate), expert=expert)
    machine.machine.events.observers.append(wrap_again)
    assert machine.run() == 'done' and len(expert.questions) == 1


def test_where_nobody_is_there_to_be_asked_the_log_gives_no_reason():
    gate = Gate()
    machine = asked(Scripted('aborted', gate))
    machine.machine.events.observers.append(
        lambda event: event.kind is EventKind.WARNING and gate.go.set()
    )
    assert machine.run() == 'done'
    assert 'Nobody' not in machine.of(EventKind.WARNING)[0].text
