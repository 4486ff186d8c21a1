"""The four kinds of precondition, and that they run on failure alone."""

import contextvars
import threading
import time

import pytest
from machines import FakeWaiting, Gate, Scripted, Watched, chain_of, in_thread

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind

BRIEF = {'grace_period_s': 0.05}  # waited for in full by a function that hangs


def machine_with(*preconditions, b=None, extra=(), **settings):
    """A, B, C, where B fails once (unless given) and has the preconditions; `extra`: (label, state)
    never visited.
    """
    machine = chain_of(Scripted(), b or Scripted('aborted'), Scripted())
    with machine:
        for label, state in extra:
            smach.StateMachine.add(
                label, state, {'ok': 'A'} if 'ok' in state.get_registered_outcomes() else {}
            )
    return Watched(machine, preconditions={'B': list(preconditions)}, settings=settings)


def ends(machine):
    return [(event.target, event.outcome) for event in machine.of(EventKind.PRECONDITION_END)]


def test_preconditions_do_not_run_while_nothing_fails():
    state = Scripted()
    machine = machine_with(state, b=Scripted())
    assert machine.run() == 'done'
    assert state.runs == 0


def test_a_state_is_a_precondition():
    state = Scripted()
    machine = machine_with(state)
    assert machine.run() == 'done'
    assert state.runs == 1
    assert ends(machine) == [('Scripted', 'met')]
    assert [event.target for event in machine.of(EventKind.PRECONDITION_START)] == ['Scripted']


@pytest.mark.parametrize('end', ['aborted', 'preempted', ValueError('x'), None, 'unregistered'])
def test_a_state_that_does_not_end_well_leaves_the_precondition_unmet(end):
    machine = machine_with(Scripted(end))
    machine.run()
    assert ends(machine) == [('Scripted', 'not met')]
    assert machine.decisions() == [('step_back', 'A')]


def test_an_outcome_that_is_listed_as_a_failure_leaves_the_precondition_unmet():
    machine = machine_with(
        Scripted('cloudy', outcomes=('ok', 'cloudy')), failure_outcomes=['cloudy']
    )
    machine.run()
    assert ends(machine) == [('Scripted', 'not met')]


def test_the_label_of_another_state_is_a_precondition_and_its_run_is_no_visit():
    clear = Scripted(outcomes=('ok', 'aborted'))
    machine = machine_with('CLEAR', extra=[('CLEAR', clear)])
    assert machine.run() == 'done'
    assert clear.runs == 1
    assert machine.visits() == ['A', 'B', 'B', 'C']
    assert (machine.rate('CLEAR').successes, machine.rate('CLEAR').failures) == (0, 0)
    assert ends(machine) == [('CLEAR', 'met')]


def test_a_labelled_state_whose_outcome_would_end_the_machine_badly_is_not_met():
    lost = Scripted('lost', outcomes=('ok', 'lost'))
    machine = chain_of(Scripted(), Scripted('aborted'), Scripted())
    with machine:
        smach.StateMachine.add('CLEAR', lost, {'ok': 'A', 'lost': 'aborted'})
    machine = Watched(machine, preconditions={'B': ['CLEAR']})
    machine.run()
    assert ends(machine) == [('CLEAR', 'not met')]


def test_a_labelled_state_is_run_with_its_remapping():
    seen = []
    state = Scripted(lambda self, ud: seen.append(ud.mine) or 'ok', input_keys=['mine'])
    machine = chain_of(Scripted(), Scripted('aborted'), Scripted())
    machine.userdata.yours = 5
    with machine:
        smach.StateMachine.add('CLEAR', state, {'ok': 'A'}, remapping={'mine': 'yours'})
    Watched(machine, preconditions={'B': ['CLEAR']}).run()
    assert seen == [5]


def test_a_callable_is_a_precondition_and_sees_the_userdata():
    machine = machine_with(lambda ud: ud.clear)
    machine.machine.userdata.clear = True
    assert machine.run() == 'done'
    assert ends(machine)[0][1] == 'met'


@pytest.mark.parametrize('result', [False, None, 0, ''])
def test_a_callable_that_does_not_say_true_is_not_met(result):
    machine = machine_with(lambda ud: result)
    machine.run()
    assert ends(machine)[0][1] == 'not met'


def test_a_callable_that_raises_is_not_met_and_the_machine_goes_on():
    def broken(ud):
        raise OSError('no camera')

    machine = machine_with(broken)
    assert machine.run() == 'done'
    end = machine.of(EventKind.PRECONDITION_END)[0]
    assert (end.target, end.outcome) == ('broken', 'not met')
    assert 'no camera' in end.text


@pytest.mark.parametrize(
    'holds, achieved, met, runs',
    [(True, 'ok', 'met', 0), (False, 'ok', 'met', 1), (False, 'aborted', 'not met', 1)],
)
def test_the_second_half_of_a_pair_runs_only_where_the_first_does_not_hold(
    holds, achieved, met, runs
):
    achieve, checks = Scripted(achieved), []
    machine = machine_with((lambda ud: checks.append(1) or holds, achieve))
    machine.run()
    assert ends(machine)[0][1] == met
    assert achieve.runs == runs
    assert len(checks) == 1, 'the check is not run again'


def test_a_state_that_is_not_repeated_by_itself_is_a_precondition_once():
    once = Scripted()
    machine = machine_with(
        'X',
        b=Scripted('aborted', 'aborted'),
        extra=[('X', once)],
        states={'X': {'on_retry': 'never'}},
        memory=1000,
    )
    assert machine.run() == 'done'
    assert once.runs == 1 and [met for _, met in ends(machine)] == ['met', 'not met']


def test_preconditions_run_in_order_and_stop_at_the_first_that_is_not_met():
    ran = []
    machine = machine_with(
        lambda ud: ran.append(1) or True,
        lambda ud: ran.append(2) or False,
        lambda ud: ran.append(3) or True,
    )
    machine.run()
    assert ran == [1, 2]


def test_a_precondition_that_never_ends_is_ended_by_a_preempt():
    gate = Gate()
    machine = machine_with(Scripted(gate))
    run = in_thread(machine.run)
    assert gate.entered.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert not machine.of(EventKind.DECISION)
    assert machine.machine.preempt_requested() is False


def test_a_precondition_that_is_left_behind_in_a_preempt_is_still_asked_to_stop():
    begun, go = threading.Event(), threading.Event()

    def hangs(state, ud):
        begun.set()
        assert go.wait(20)
        return 'ok'

    state = Scripted(hangs)
    machine = machine_with(state, time_limit_s=0.2, grace_period_s=0.1)
    run = in_thread(machine.run)
    assert begun.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert state.preempt_requested()
    go.set()


def test_a_preempt_between_two_preconditions_lets_no_more_begin():
    second = Scripted()
    holder = []
    machine = machine_with(lambda ud: holder[0].request_preempt() or True, second)
    holder.append(machine.machine)
    assert machine.run() == 'preempted'
    assert second.runs == 0


def test_a_labelled_state_keeps_its_time_limit():
    gate = Gate()
    machine = chain_of(Scripted(), Scripted('aborted'), Scripted())
    with machine:
        smach.StateMachine.add('CLEAR', Scripted(gate), {'ok': 'A'})
    machine = Watched(
        machine,
        preconditions={'B': ['CLEAR']},
        settings={'states': {'CLEAR': {'time_limit_s': 0.05, 'grace_period_s': 5}}},
    )
    assert machine.run() == 'done'
    assert ends(machine) == [('CLEAR', 'not met')]
    assert 'time limit' in machine.of(EventKind.PRECONDITION_END)[0].text


class Hanging:
    """A function that does not come back until let go, and writes then."""

    __name__ = 'hanging'

    def __init__(self):
        self.entered = threading.Event()
        self.let_go = threading.Event()
        self.left = threading.Event()
        self.calls = 0

    def __call__(self, ud):
        self.calls += 1
        self.thread = threading.current_thread()
        self.entered.set()
        assert self.let_go.wait(20)
        ud.late = 'too late'
        self.left.set()
        return True

    def leave(self):
        """Let it end, and wait for it."""
        self.let_go.set()
        assert self.left.wait(20)


BRIEF = {'states': {'B': {'time_limit_s': 0.1, 'grace_period_s': 0.1}}}


def test_a_function_has_the_time_limit_of_the_state_whose_precondition_it_is():
    hanging = Hanging()
    machine = machine_with(hanging, **BRIEF)
    in_thread(machine.run).result()
    assert ends(machine) == [('hanging', 'not met')]
    assert 'overran its time limit of 0.1 s' in machine.of(EventKind.PRECONDITION_END)[0].text
    hanging.leave()
    assert 'late' not in machine.machine.userdata


def test_the_machine_does_not_go_on_by_itself_while_a_function_still_runs():
    hanging = Hanging()
    machine = machine_with(hanging, b=Scripted('aborted', 'aborted'), **BRIEF)
    assert in_thread(machine.run).result() == 'aborted'
    (decision,) = machine.of(EventKind.DECISION)
    assert decision.outcome == 'ask' and 'hanging still runs' in decision.text
    hanging.leave()


def test_while_a_function_still_runs_no_way_begins_with_it():
    hanging = Hanging()
    machine = machine_with(hanging, b=Scripted(*['aborted'] * 9), policy='escalating', **BRIEF)
    oracle_of(machine.machine).waiting = FakeWaiting()
    assert in_thread(machine.run).result() == 'aborted'
    hanging.leave()
    blocked = [
        [way['blocked'] for way in event.data['menu'] if way['kind'] == 'prepare']
        for event in machine.of(EventKind.DECISION)
    ]
    assert {way['blocked'] for way in machine.of(EventKind.DECISION)[0].data['menu']} == {''}
    still = ['hanging still runs since it overran its time limit']
    assert blocked == [[''], ['hanging did not help'], still, still, still]


def test_a_function_that_ends_within_its_grace_period_lets_the_machine_go_on():
    def slow(ud):
        time.sleep(0.2)  # longer than the limit alone, which is the point
        ud.late = 'too late'
        return True

    machine = machine_with(slow, states={'B': {'time_limit_s': 0.1, 'grace_period_s': 20.0}})
    assert in_thread(machine.run).result() == 'done'
    assert ends(machine) == [('slow', 'not met')] and 'late' not in machine.machine.userdata


def test_a_function_that_still_runs_is_not_called_again():
    hanging = Hanging()
    machine = machine_with(hanging, b=Scripted('aborted', 'aborted'), **BRIEF)
    for _ in range(2):  # trials
        in_thread(machine.run).result()
    assert hanging.calls == 1
    assert 'still runs' in machine.of(EventKind.PRECONDITION_END)[-1].text
    assert [event.outcome for event in machine.of(EventKind.DECISION)] == ['ask', 'ask']
    hanging.leave()


@pytest.mark.parametrize('settings', [BRIEF, dict(BRIEF, time_limit_s=1000.0)])
def test_a_function_that_does_not_come_back_does_not_outlast_a_preempt(settings):
    hanging = Hanging()
    machine = machine_with(hanging, **settings)
    run = in_thread(machine.run)
    assert hanging.entered.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert not machine.of(EventKind.DECISION)
    hanging.leave()
    assert 'late' not in machine.machine.userdata


def test_a_function_that_does_not_come_back_does_not_outlast_a_shutdown(monkeypatch):
    hanging = Hanging()
    machine = machine_with(hanging, **BRIEF)
    run = in_thread(machine.run)
    assert hanging.entered.wait(10)
    monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
    assert run.result() == 'preempted'
    hanging.leave()


@pytest.mark.parametrize('stop', [KeyboardInterrupt, SystemExit])
def test_what_ends_a_program_passes_through_a_function(stop):
    def stops(ud):
        raise stop()

    machine = machine_with(stops)
    with pytest.raises(stop):
        machine.run()
    assert machine.machine.is_running() is False


def test_a_function_is_called_with_the_context_of_the_machine():
    variable = contextvars.ContextVar('v', default='unset')
    variable.set('set')
    machine = machine_with(lambda ud: variable.get() == 'set')
    machine.run()
    assert ends(machine)[0][1] == 'met'


def test_functions_share_a_thread_that_ends_with_the_trial():
    threads = []

    def look(ud):
        threads.append(threading.current_thread())
        return True

    machine = machine_with(look, lambda ud: look(ud))
    assert machine.run() == 'done'
    assert threads[0] is threads[1] and threads[0] is not threading.current_thread()
    for thread in threads:
        thread.join(20)
        assert not thread.is_alive()


def test_a_function_that_was_left_behind_keeps_its_thread_to_itself():
    hanging, others = Hanging(), []

    def look(ud):
        others.append(threading.current_thread())
        return True

    machine = machine_with((hanging, look), **BRIEF)
    assert in_thread(machine.run).result() == 'aborted'
    assert hanging.thread.is_alive() and others[0] is not hanging.thread
    hanging.leave()
    hanging.thread.join(20)
    assert not hanging.thread.is_alive()


def test_a_state_has_the_time_limit_of_the_state_whose_precondition_it_is():
    gate = Gate()
    machine = machine_with(Scripted(gate), **BRIEF)
    assert in_thread(machine.run).result() == 'done'
    assert ends(machine) == [('Scripted', 'not met')]
    assert machine.of(EventKind.PRECONDITION_END)[0].text.startswith('overran its time limit of 0.')


def test_a_state_that_ignores_the_end_of_its_time_is_left_behind():
    entered, let_go, left = threading.Event(), threading.Event(), threading.Event()

    def stubborn(state, ud):
        entered.set()
        assert let_go.wait(20)
        ud.late = 'too late'
        left.set()
        return 'ok'

    machine = machine_with(Scripted(stubborn, output_keys=['late']), **BRIEF)
    assert in_thread(machine.run).result() == 'done'
    assert 'abandoned' in machine.of(EventKind.PRECONDITION_END)[0].text
    let_go.set()
    assert left.wait(20)
    assert 'late' not in machine.machine.userdata


def test_each_half_of_a_pair_has_the_limit():
    hanging, gate = Hanging(), Gate()
    machine = machine_with((hanging, Scripted(gate)), **BRIEF)
    in_thread(machine.run).result()
    assert gate.entered.is_set(), 'a check that does not come back does not hold'
    assert ends(machine) == [('hanging or Scripted', 'not met')]
    hanging.leave()


def test_what_the_second_half_writes_counts_though_the_first_one_still_runs():
    let_go = threading.Event()
    check = Scripted(lambda self, ud: 'ok' if let_go.wait(20) else 'aborted')

    def clear(state, ud):
        ud.cleared = True
        return 'ok'

    machine = machine_with((check, Scripted(clear, output_keys=['cleared'])), **BRIEF)
    try:
        in_thread(machine.run).result()
    finally:
        let_go.set()
    assert ends(machine)[0][1] == 'met'
    assert machine.machine.userdata.cleared is True


def test_a_state_added_with_preconditions_has_them():
    ran = []
    machine = OracleContainer(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        OracleContainer.add(
            'A',
            Scripted('aborted'),
            {'ok': 'done'},
            preconditions=[lambda ud: ran.append(1) or True],
        )
    assert machine.execute() == 'done'
    assert ran == [1]
    assert machine.rates()[0].has_preconditions


def test_a_precondition_naming_no_state_is_refused_with_the_labels_there_are():
    with pytest.raises(
        SettingsError, match=r"states.B.preconditions: 'NOWHERE' is not allowed.*A, C"
    ):
        machine_with('NOWHERE')


def test_a_state_cannot_be_its_own_precondition():
    with pytest.raises(SettingsError, match='states.B.preconditions'):
        machine_with('B')


def test_where_not_strict_an_unknown_label_is_warned_of_and_never_met(log):
    machine = Watched(
        chain_of(Scripted(), Scripted('aborted')),
        preconditions={'B': ['NOWHERE'], 'GHOST': [bool]},
        strict=False,
    )
    machine.run()
    assert ends(machine) == [('NOWHERE', 'not met')]
    warnings = [text for level, text in log if level == 'warn']
    assert any('NOWHERE' in text for text in warnings) and any('GHOST' in text for text in warnings)


@pytest.mark.parametrize(
    'wrong, position',
    [
        (5, '[0]'),
        ({'check': 'A'}, '[0]'),
        ('', '[0]'),
        (('A',), '[0]'),
        ('python:a:b', '[0]'),
        (Scripted, '[0]'),
        ((('A', 'C'), 'C'), '[0]'),
    ],
)
def test_what_is_no_precondition_is_refused_with_its_place(wrong, position):
    with pytest.raises(SettingsError) as raised:
        Watched(chain_of(Scripted(), Scripted(), Scripted()), preconditions={'B': [wrong]})
    assert raised.value.key.startswith('states.B.preconditions' + position)


def test_a_list_is_asked_for():
    with pytest.raises(SettingsError, match='a list of preconditions'):
        Watched(chain_of(Scripted(), Scripted()), preconditions={'B': 'A'})


def test_python_names_are_resolved_by_what_is_handed_in():
    from smach_oracle.oracle.settings.settings import Settings

    found = {'python:robot:is_clear': lambda ud: True}
    settings = Settings.from_dict(
        {'states': {'B': {'preconditions': [{'check': 'python:robot:is_clear', 'achieve': 'A'}]}}},
        resolver=found.__getitem__,
    )
    machine = Watched(chain_of(Scripted(), Scripted('aborted')), settings=settings)
    assert machine.run() == 'done'
    assert ends(machine) == [('is_clear or A', 'met')]
    with pytest.raises(SettingsError, match='python:robot:lost'):
        Settings.from_dict(
            {'states': {'B': {'preconditions': ['python:robot:lost']}}}, resolver=found.__getitem__
        )
