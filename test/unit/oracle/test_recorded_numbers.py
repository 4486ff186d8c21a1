"""The numbers that messages and bags hold are those that their definitions name."""

import re
from pathlib import Path

import pytest

from smach_oracle.oracle.asking.question import AnswerKind
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.records.events import EventKind, FailureKind
from smach_oracle.oracle.records.visits import VisitResult

MESSAGES = Path(__file__).resolve().parents[3] / 'msg'
# how a message names what is a kind of its own here
FAILURES_OF_QUESTIONS = {'HELD_BACK': 6, 'STILL_RUNNING': 7}


def constants(message):
    """The constants of a message, by name."""
    text = (MESSAGES / (message + '.msg')).read_text('utf-8')
    found = re.findall(r'^uint8 ([A-Z_]+)\s*=\s*(\d+)', text, re.MULTILINE)
    return {name: int(value) for name, value in found}


@pytest.mark.parametrize(
    'kinds, message',
    [
        ([VisitResult], 'VisitedState'),
        ([AnswerKind], 'ExpertDecision'),
        ([EventKind, FailureKind, FailureClass], 'OracleEvent'),
    ],
)
def test_a_number_that_is_recorded_means_what_its_message_says(kinds, message):
    named = {name: int(kind) for each in kinds for name, kind in each.__members__.items()}
    if FailureKind in kinds:
        assert FAILURES_OF_QUESTIONS.items() <= named.items()
        named = {name: named[name] for name in named if name not in FAILURES_OF_QUESTIONS}
    assert named == constants(message)
