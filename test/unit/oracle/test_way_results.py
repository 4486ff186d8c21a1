"""Kinds of failure by their texts."""

import pytest

from smach_oracle.oracle.records.events import FailureKind
from smach_oracle.oracle.records.way_results import failure_text_key


@pytest.mark.parametrize(
    'text, same',
    [
        ('no object within 0.25 m', 'no object within 3 m'),
        ('off by -0.3 rad', 'off by 1.5e-05 rad'),
        ('try 9 of 10', 'try 10  of 10\n'),
        ('<Grasp object at 0x7f3a00c0>', '<Grasp object at 0x7F3B11D2>'),
        ('File "look.py", line 12', 'File "look.py", line 9'),
    ],
)
def test_texts_that_differ_by_numbers_and_blanks_are_one_kind(text, same):
    assert failure_text_key(1, 'aborted', text) == failure_text_key(1, 'aborted', same)


def test_kinds_outcomes_and_words_tell_failures_apart():
    known = {
        failure_text_key(kind, outcome, text)
        for kind in (FailureKind.FAILING_OUTCOME, FailureKind.EXCEPTION)
        for outcome in ('', 'aborted', 'lost')
        for text in ('', 'no object', 'two objects')
    }
    assert len(known) == 2 * 3 * 3


def test_a_kind_of_a_later_release_has_a_name_and_a_long_text_a_short_one():
    assert failure_text_key(99, 'aborted', '').startswith('99 aborted')
    assert len(failure_text_key(3, '', 'no object ' * 10000)) <= 120
