"""Failures and events in words, and text from robots made safe."""

from smach_oracle.expert.wording import clean, event_words, next_step_words
from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.records.events import Event, EventKind


def test_lines_stay_lines_only_where_there_is_room_for_them():
    assert clean('a\n\tb') == 'a  b'
    assert clean('a\n\tb', lines=True) == 'a\n b'


def test_what_happens_after_an_answer_is_said_in_words():
    said = {
        kind: next_step_words(
            OracleEvent(
                kind=kind,
                path='P',
                state='PICK',
                target='DETECT',
                outcome='done',
                text='low battery',
            )
        )
        for kind in (
            OracleEvent.JUMP,
            OracleEvent.SUPERSEDE,
            OracleEvent.GIVE_UP,
            OracleEvent.WARNING,
            OracleEvent.HEALTH_WAIT_START,
            OracleEvent.HEALTH_WAIT_END,
        )
    }
    assert list(said.values()) == [
        'The machine goes to DETECT.',
        'PICK counts as having ended with done.',
        'P gives up with done.',
        'The robot warns: low battery',
        'The machine waits until the robot is well (low battery).',
        'Low battery.',
    ]


def test_a_decision_is_told_by_the_sentence_of_the_oracle():
    def told(**fields):
        return event_words(Event(EventKind.DECISION, 't', 3, 0.0, 'TASK', 'PICK', **fields))

    assert (
        told(
            outcome='revisit',
            target='PICK',
            text='PICK failed: trying it again',
            data={'decided_by': 'policy'},
        )
        == 'PICK failed: trying it again.'
    )
    assert (
        told(outcome='step_back', target='DETECT', text='prose: LOW')
        == 'The oracle decides: step back to DETECT.'
    ), 'of a bag of 0.1'
