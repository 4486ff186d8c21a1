"""A trial that ends early: the first reason stays."""

from smach_oracle.oracle.records.early_end import EarlyEnd
from smach_oracle.oracle.records.facts import TrialEnd


def test_a_trial_that_is_kept_says_so_unless_it_has_ended_before():
    early = EarlyEnd()
    early.begin_trial(is_stored=True)
    early.keep()
    assert early.why is TrialEnd.KEPT
    early.begin_trial(is_stored=True)
    assert early.why is None
    with early.asking():
        early.note_shutdown()
    early.keep()
    assert early.why is TrialEnd.SHUTDOWN
