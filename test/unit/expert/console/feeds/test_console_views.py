"""What the page is told of events."""

import json
import math

import pytest

from smach_oracle.expert.console.feeds.views import event_of, event_view
from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.records.events import EventKind


@pytest.mark.parametrize('kind', list(EventKind))
def test_every_kind_of_event_has_words(kind):
    message = OracleEvent(
        kind=int(kind),
        path='TASK',
        state='PICK',
        outcome='aborted',
        target='PLACE',
        by='ann',
        rate=math.nan,
    )
    shown = event_view(event_of(message))
    assert (
        shown['kind'] == kind.name.lower()
        and shown['words'].endswith('.')
        or kind == EventKind.WARNING
    )
    json.dumps(shown, allow_nan=False)


def test_of_a_traceback_an_event_has_the_last_line_with_its_head_and_tail():
    text = 'Traceback:\n  a\nValueError: {} no cup\n'.format('.' * 900)
    shown = event_view(event_of(OracleEvent(kind=OracleEvent.FAILURE, text=text)))
    assert len(shown['text']) == 300
    assert shown['text'].startswith('ValueError: ...') and shown['text'].endswith('. no cup')


def test_a_kind_of_a_later_release_does_no_harm():
    assert event_view(event_of(OracleEvent(kind=99, rate=math.inf)))['kind'] == '99'


@pytest.mark.parametrize(
    'message, words',
    [
        (
            OracleEvent(kind=OracleEvent.JUMP, target='KITCHEN', data='{"to": "KITCHEN/PICK"}'),
            'The machine goes to KITCHEN/PICK.',
        ),
        (
            OracleEvent(kind=OracleEvent.JUMP, target='KITCHEN', data='{"to": ["KITCHEN"]}'),
            'The machine goes to KITCHEN.',
        ),
        (
            OracleEvent(kind=OracleEvent.JUMP, target='KITCHEN', data='no JSON'),
            'The machine goes to KITCHEN.',
        ),
        (
            OracleEvent(
                kind=OracleEvent.DECISION,
                outcome='revisit',
                target='PICK',
                text='PICK is tried again',
                data='{"decided_by": "policy"}',
            ),
            'PICK is tried again.',
        ),
    ],
)
def test_what_the_data_of_an_event_tell_is_in_its_words(message, words):
    assert event_view(event_of(message))['words'] == words
