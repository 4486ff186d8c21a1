"""Where outcomes lead, and what happens when they lead nowhere."""

import pytest
from smach_states import Counting, Fixed, Scripted, machine, naming, that_name

import smach


def test_states_follow_their_transitions_and_the_machine_ends_with_its_outcome(said):
    sm = machine(('A', Fixed('x'), {'x': 'B'}), ('B', Fixed('y'), {'y': 'done'}))
    assert sm.execute() == 'done'
    assert said('info') == [
        "State machine starting in initial state 'A' with userdata: \n\t[]",
        "State machine transitioning 'A':'x'-->'B'",
        "State machine terminating 'B':'y':'done'",
    ]


def test_a_machine_can_run_again_and_keeps_its_userdata():
    sm = machine(('COUNT', Counting(3), {'again': 'COUNT', 'done': 'done'}))
    sm.userdata.count = 0
    assert sm.execute() == 'done' and sm.userdata.count == 3
    assert sm.execute() == 'done' and sm.userdata.count == 4


@pytest.mark.parametrize('transitions', [None, {}, {'done': None}, {'done': ''}])
def test_an_outcome_without_target_falls_through_to_the_outcome_of_its_name(transitions):
    assert machine(('A', Fixed('done'), transitions)).execute() == 'done'


def test_a_target_exchanged_while_running_counts_and_an_unknown_one_falls_through():
    def redirect(state, ud):
        sm._transitions['A']['done'] = 'nowhere'
        return 'done'

    sm = machine(('A', Scripted(redirect, ['done']), {'done': 'failed'}))
    assert sm.execute() == 'done'


def test_an_outcome_that_leads_nowhere_is_an_error():
    def forget(state, ud):
        sm._outcomes = {'other'}
        return 'done'

    sm = machine(('A', Scripted(forget, ['done']), {'done': 'failed'}))
    with pytest.raises(smach.InvalidTransitionError, match=naming('A', 'done')):
        sm.execute()


@pytest.mark.parametrize('outcome', ['surprise', None, 7])
def test_an_unregistered_outcome_is_an_error_naming_the_registered_ones(outcome):
    sm = machine(('A', Scripted(lambda state, ud: outcome, ['done']), None))
    with pytest.raises(smach.InvalidTransitionError, match=naming('A', outcome, 'done')):
        sm.execute()
    assert not sm.is_running()


def test_an_outcome_registered_late_has_no_transition():
    sm = machine(('A', Fixed('done'), None))
    sm['A'].register_outcomes(['failed'])
    sm['A'].outcome = 'failed'
    with pytest.raises(smach.InvalidTransitionError, match=naming('A', 'failed', 'done')):
        sm.execute()


def test_an_exception_in_a_state_surfaces_with_its_traceback_and_the_machine_has_stopped(said):
    sm = machine(('A', Scripted(lambda state, ud: 1 // 0), None))
    with pytest.raises(smach.InvalidUserCodeError, match='ZeroDivisionError') as caught:
        sm.execute()
    assert "Could not execute state 'A'" in str(caught.value)
    assert not sm.is_running()
    assert any('ZeroDivisionError' in text for text in said('err'))


def test_an_exception_in_a_nested_machine_surfaces_once_with_the_innermost_traceback():
    inner = machine(('I', Scripted(lambda state, ud: 1 // 0), None))
    outer = machine(('IN', inner, None))
    with pytest.raises(smach.InvalidUserCodeError, match="Could not execute state 'I'"):
        outer.execute()
    assert not inner.is_running() and not outer.is_running()


@pytest.mark.improvement
@pytest.mark.parametrize('interrupt', [KeyboardInterrupt, SystemExit])
def test_ctrl_c_and_exit_pass_through_nested_machines_as_they_are(interrupt):
    def leave(state, ud):
        raise interrupt()

    inner = machine(('I', Scripted(leave), None))
    outer = machine(('IN', inner, None))
    with pytest.raises(interrupt):
        outer.execute()
    assert not outer.is_running() and not inner.is_running()
    assert outer._state_transitioning_lock.acquire(False)
    outer._state_transitioning_lock.release()


def test_an_inconsistent_machine_logs_why_and_returns_none(said):
    assert machine(('A', Fixed('x'), {'x': 'NOWHERE'})).execute() is None
    assert that_name(['A', 'NOWHERE'], said('err'))


def test_an_empty_machine_logs_that_it_has_no_initial_state_and_returns_none(said):
    assert smach.StateMachine(['done']).execute() is None
    assert any('initial state' in text for text in that_name(['done'], said('err')))


def test_a_machine_stops_with_none_when_everything_is_shut_down(monkeypatch):
    checks = iter([False, False, True])
    monkeypatch.setattr(smach, 'is_shutdown', lambda: next(checks))
    sm = machine(('A', Fixed('x'), {'x': 'A'}))
    assert sm.execute() is None
    assert not sm.is_running()


def test_one_state_object_may_have_two_labels():
    shared = Counting(2)
    sm = machine(
        ('A', shared, {'again': 'B', 'done': 'failed'}),
        ('B', shared, {'again': 'failed', 'done': 'done'}),
    )
    sm.userdata.count = 0
    assert sm.execute() == 'done'


def test_a_state_exchanged_between_visits_is_the_one_that_runs():
    sm = machine(('A', Fixed('done'), None))
    assert sm.execute() == 'done'
    sm._states['A'] = Scripted('failed')
    sm._transitions['A'] = {'failed': None}
    assert sm.execute() == 'failed'


def test_a_machine_may_run_inside_a_state():
    inner = machine(('I', Fixed('done'), None))
    assert machine(('A', Scripted(lambda state, ud: inner.execute()), None)).execute() == 'done'


def test_the_initial_state_can_be_set_and_brings_userdata_along():
    sm = machine(('A', Fixed('failed'), None), ('B', Fixed('done'), None))
    given = smach.UserData()
    given.key = 5
    sm.set_initial_state(['B'], given)
    assert sm.get_initial_states() == ['B'] and sm.userdata.key == 5
    assert sm.execute() == 'done'


def test_methods_that_scripts_override_are_called_at_every_step():
    class Watched(smach.StateMachine):
        calls = []

        def _update_once(self):
            self.calls.append('update')
            return smach.StateMachine._update_once(self)

        def _set_current_state(self, state_label):
            self.calls.append(state_label)
            return smach.StateMachine._set_current_state(self, state_label)

        def call_transition_cbs(self):
            self.calls.append('transition')
            return smach.StateMachine.call_transition_cbs(self)

    sm = Watched(['done'])
    with sm:
        smach.StateMachine.add('A', Fixed('x'), {'x': 'B'})
        smach.StateMachine.add('B', Fixed('done'))
    assert sm.execute() == 'done'
    assert sm.calls == ['A', 'update', 'B', 'transition', 'update', None]


def test_a_step_patched_on_one_machine_is_used(monkeypatch):
    sm = machine(('A', Fixed('done'), None))
    monkeypatch.setattr(sm, '_update_once', lambda: 'failed')
    assert sm.execute() == 'failed'


def test_a_method_patched_on_the_base_class_is_used(monkeypatch):
    calls = []
    monkeypatch.setattr(
        smach.Container, 'call_transition_cbs', lambda self: calls.append(self.get_active_states())
    )
    machine(('A', Fixed('x'), {'x': 'B'}), ('B', Fixed('done'), None)).execute()
    assert calls == [['B']]


def test_a_logger_set_in_mid_run_hears_the_next_transition(said):
    heard = []

    def replace(state, ud):
        smach.loginfo = heard.append
        return 'done'

    machine(
        ('A', Scripted(replace), {'done': 'B', 'failed': 'done'}), ('B', Fixed('done'), None)
    ).execute()
    assert heard == [
        "State machine transitioning 'A':'done'-->'B'",
        "State machine terminating 'B':'done':'done'",
    ]


def test_edges_children_and_lookup_describe_the_machine():
    a, b = Fixed('x'), Fixed('done')
    sm = machine(('A', a, {'x': 'B'}), ('B', b, None))
    assert sorted(sm.get_internal_edges(), key=str) == [('done', 'B', None), ('x', 'A', 'B')]
    assert dict(sm.get_children()) == {'A': a, 'B': b}
    assert sm['A'] is a and sm.get_active_states() == ['None']
    with pytest.raises(KeyError):
        sm['C']
