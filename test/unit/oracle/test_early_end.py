"""A trial that ends early: the first reason stays."""

from smach_oracle.oracle.records.early_end import EarlyEnd
from smach_oracle.oracle.records.facts import TrialEnd
from smach_oracle.oracle.scope.scope import Reason, Scope


def test_a_trial_that_is_kept_says_so_unless_it_has_ended_before():
    scope = Scope()
    early = EarlyEnd(scope)
    early.begin_trial(is_stored=True)
    early.keep()
    assert early.why is TrialEnd.KEPT and scope.reason is Reason.EARLY_END
    early.begin_trial(is_stored=True)
    assert early.why is None and scope.reason is None
    with early.asking():
        early.note_shutdown()
    early.keep()
    assert early.why is TrialEnd.SHUTDOWN


def test_a_process_that_goes_down_ends_a_stored_trial_before_its_machines_know():
    for is_stored in (True, False):
        early = EarlyEnd(Scope())
        early.begin_trial(is_stored=is_stored)
        assert not early.end_at_shutdown()
        early.note_shutdown()
        assert early.why is None, 'no question is open'
        assert early.end_at_shutdown() is is_stored


def test_once_no_question_is_open_a_process_that_goes_down_ends_nothing_early():
    early_end = EarlyEnd(Scope())
    early_end.begin_trial(is_stored=True)
    with early_end.asking(), early_end.asking():
        assert early_end.is_near()
    assert not early_end.is_near()
    early_end.note_shutdown()
    early_end.note_end_of_state()
    assert early_end.why is None
    with early_end.asking():
        early_end.note_end_of_state()
    assert early_end.why is TrialEnd.SHUTDOWN and early_end.is_near()


def test_a_stored_trial_ends_early_too_where_its_machines_hear_of_a_shutdown_first():
    early_end = EarlyEnd(Scope(look=lambda: Reason.SHUTDOWN))
    early_end.begin_trial(is_stored=True)
    assert early_end.end_at_shutdown() and early_end.why is TrialEnd.SHUTDOWN
