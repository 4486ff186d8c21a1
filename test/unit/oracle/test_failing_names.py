"""The names of outcomes that are failures, by their words and by words that a user has given."""

import pytest

from smach_oracle.oracle.settings.failing_outcomes import (
    FORMER_FAILING_OUTCOMES,
    FailingNames,
    sounds_like_success,
)

FAILING = """
aborted failed failure error fail abort timeout timed_out TimedOut timedout time_out TIME-OUT
unreachable lost Aborted FAIL ERROR LOST_LINE lostObject grasp_failed grasp-failure graspFailed
failed_grasp failedGrasp FailedToGrasp IOError place2Failed pick_ERROR mission_abort aborted2
failed_2 fail3 error42_code goal_unreachable unreachableGoal planning-timeout timeout_of_arm
move.failed FAILURE: failed-in-flight not_completed not_succeeded notSucceeded task_not_completed
not_successful unsuccessful unsucceeded grasp_unsuccessful ABORTED_BY_USER
""".split()

OTHER = """
preempted Preempted PREEMPTED pre-empted pre_empted preEmpted done succeeded not_found found none
no_error noError NO-ERROR no_errors not_failed never_failed nothing non_failure without_error
no_object no yes low failed_over failedOver fail_safe failSafe error_free error-cleared
error_handled failure_recovered failure_resolved error_fixed timeout_ok terror TERROR unfailed
blackboard lostness failover aboard default timer timely out retry not_completed_yet
not_grasp_failed not_quite_completed 2 _ -
""".split()


@pytest.mark.parametrize('name', [*FAILING, 'failed to grasp', 'plan failed', 'not successful'])
def test_a_failure_by_the_words_of_its_name(name):
    assert name in FailingNames()


@pytest.mark.parametrize('name', [*OTHER, '', ' ', 'time is out', 7, None, ('failed',)])
def test_not_a_failure_by_the_words_of_its_name(name):
    assert name not in FailingNames()


@pytest.mark.parametrize('word', FORMER_FAILING_OUTCOMES)
@pytest.mark.parametrize('form', ['{}', 'pick_{}', 'pick-{}', 'p_i_c_k_{}', 'pick2_{}'])
def test_a_name_that_failed_by_the_former_rule_still_fails(word, form):
    for name in (form.format(word), form.format(word).upper(), form.format(word.capitalize())):
        assert name in FailingNames(FORMER_FAILING_OUTCOMES)
        assert name in FailingNames()


@pytest.mark.parametrize(
    'name', ['lost_line', 'failed', 'fail', 'no_error', 'line_losts', 'preempted']
)
def test_words_of_a_user_are_the_only_ones(name):
    names = FailingNames(['lost', 'preempted'])
    assert name not in names
    assert 'line_lost' in names
    assert 'lineLost' in names


def test_a_word_of_a_user_follows_a_change_to_its_capital_only_if_it_begins_with_a_letter():
    assert 'statusE2' in FailingNames(['e2'])
    assert 'x2bad' not in FailingNames(['2bad'])
    assert 'x_2bad' in FailingNames(['2bad'])


def test_no_words_of_a_user_are_none():
    assert 'failed' not in FailingNames([])


@pytest.mark.parametrize(
    'name', ['succeeded', 'success', 'grasp_succeeded', 'SUCCESS', 'completed', 'was_successful']
)
def test_a_success_by_its_name(name):
    assert sounds_like_success(name)


@pytest.mark.parametrize('name', ['not_succeeded', 'no_success', 'unsuccessful', 'said', 'ok', ''])
def test_not_a_success_by_its_name(name):
    assert not sounds_like_success(name)
