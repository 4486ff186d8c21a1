"""The rule by which failures are told, and what an end means by it."""

import json

import pytest

from smach_oracle.oracle.settings.failing_outcomes import FORMER_FAILING_OUTCOMES
from smach_oracle.oracle.settings.failure_rule import (
    BY_NAME_VERSION,
    FORMER_RULE,
    RULE,
    EndMeaning,
    FailureRule,
    rule_after,
    rule_in,
)

BY_NAME = FailureRule()
MEANINGS = {
    EndMeaning.SUCCESS: (
        'succeeded',
        'success',
        'SUCCESS_1',
        'overall_succeeded',
        'completed',
        'mission_complete',
        'allDone',
        'finished',
        'ok',
        'parked_successfully',
    ),
    EndMeaning.FAILURE: (
        'aborted',
        'fail',
        'mission_failed',
        'lost',
        'timed_out',
        'not_completed',
        'not successful',
        'abort_complete',
    ),
    EndMeaning.PREEMPTED: (
        'preempted',
        'PREEMPTED',
        'task_preempted',
        'pre-empted',
        'goal_pre_empted',
    ),
    EndMeaning.UNKNOWN: (
        'parked',
        'end',
        'exit',
        'quit',
        'stopped',
        'yes',
        'not_done',
        'almost_done',
        'mission_abort_complete',
        'no_error',
        'failed_over',
        'error_ok',
        'incomplete',
        '',
        '3',
    ),
}


@pytest.mark.parametrize(
    'end, meaning', [(end, meaning) for meaning, ends in MEANINGS.items() for end in ends]
)
def test_an_end_means_by_its_name_a_success_a_failure_a_preempt_or_nothing(end, meaning):
    assert BY_NAME.meaning(end) is meaning


@pytest.mark.parametrize('end', sorted(set().union(*map(set, MEANINGS.values()))))
def test_by_a_list_an_end_that_is_not_on_it_is_a_success(end):
    rule = FailureRule(('parked',))
    expected = {'parked': EndMeaning.FAILURE}.get(end, EndMeaning.SUCCESS)
    if end.lower() == 'preempted':
        expected = EndMeaning.PREEMPTED
    assert rule.meaning(end) is expected
    assert not rule.unknown([end])


def test_the_ends_of_unknown_meaning_are_told_in_order_and_others_are_left_out():
    assert BY_NAME.unknown(['parked', 'aborted', 7, 'left', 'succeeded']) == ('left', 'parked')


@pytest.mark.parametrize('rule', [BY_NAME, FORMER_RULE, FailureRule(()), FailureRule(None, 9)])
def test_a_record_gives_back_the_rule_that_it_was_given(rule):
    assert rule_in(json.loads(json.dumps({RULE: rule.as_data()}))) == rule


@pytest.mark.parametrize(
    'told',
    [
        None,
        5,
        'by_name',
        [],
        {},
        {'by_name': 0},
        {'by_name': True},
        {'failing_outcomes': 'aborted'},
        {'failing_outcomes': ['aborted', 5]},
    ],
)
def test_a_record_that_names_no_known_rule_has_none(told):
    assert rule_in({RULE: told}) is None
    assert rule_in(told) is None


def test_a_trial_goes_on_by_the_rule_that_its_latest_record_names():
    assert rule_after(FORMER_RULE, {RULE: BY_NAME.as_data()}) == BY_NAME
    assert rule_after(BY_NAME, {RULE: None}) == BY_NAME


def test_a_rule_is_told_in_words():
    assert str(FailureRule(('lost', 'parked'))) == 'by a list: lost, parked'
    assert str(FailureRule(())) == 'by a list: nothing'
    assert str(FailureRule(None, 9)) == 'by name, version 9'


def test_only_a_later_version_of_the_rule_is_not_known():
    assert FailureRule(None, BY_NAME_VERSION + 1).is_of_later_version
    assert not FailureRule(('lost',), BY_NAME_VERSION + 1).is_of_later_version
    assert not BY_NAME.is_of_later_version and not FORMER_RULE.is_of_later_version
    assert FORMER_RULE.words == FORMER_FAILING_OUTCOMES
