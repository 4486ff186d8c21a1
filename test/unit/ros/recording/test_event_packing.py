"""The fast way to serialise an event gives byte for byte what the message object gives."""

import random

import pytest

from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.ros.event_messages import to_msg
from smach_oracle.ros.recording import event_packing as recorder_packing

TEXTS = ('', 'PICK', 'caf\xe9 \u2713 \U0001f916', 'half a pair \ud83e', 'two\nlines\0', 'x' * 5000)


def random_event(rng):
    def text():
        return rng.choice(TEXTS)

    return Event(
        rng.choice(list(EventKind)),
        text(),
        rng.randrange(2**63),
        rng.uniform(0, 2e9),
        text(),
        text(),
        text(),
        text(),
        rng.choice(list(FailureKind)),
        rng.randrange(4),
        rng.choice([0.0, 0.75, float('nan')]),
        rng.choice([True, False]),
        text(),
        text(),
        text(),
        rng.choice([None, {}, {'missing_keys': ['a', 'b'], 'userdata': 'keep'}, {'odd': {1, 2}}]),
    )


def test_it_is_used():
    """Where this fails, OracleEvent.msg was changed: change `_pack_directly` and PACKED_MD5 with
    it.
    """
    assert recorder_packing.pack_event is recorder_packing._pack_directly
    assert OracleEvent._md5sum == recorder_packing.PACKED_MD5


def test_every_event_is_packed_as_its_message_is():
    rng = random.Random(1)
    for _ in range(500):
        event, stamp = random_event(rng), (rng.randrange(2**32), rng.randrange(10**9))
        message = to_msg(event)
        message.header.stamp.secs, message.header.stamp.nsecs = stamp
        packed = recorder_packing.pack_event(event, stamp)
        assert packed == recorder_packing.serialise(message)
        assert packed == recorder_packing._pack_through_message(event, stamp)


def test_another_definition_goes_through_the_message():
    assert (
        recorder_packing.choose_packing('of another release')
        is recorder_packing._pack_through_message
    )


@pytest.mark.parametrize('field', ['state', 'outcome', 'target'])
def test_what_is_no_text_is_recorded_as_text(field):
    event = Event(EventKind.TRANSITION, 't', 0, 1.0, 'TOP')._replace(**{field: 7})
    assert (
        getattr(OracleEvent().deserialize(recorder_packing.pack_event(event, (0, 0))), field) == '7'
    )


class Loud(str):
    """A string that is equal to a plain one, and reads otherwise."""

    def __str__(self):
        return self.upper()


def test_values_that_are_equal_but_read_otherwise_are_not_taken_for_each_other():
    for value in ['1', 1, 1.0, True, 'pick', Loud('pick'), 'pick', '1']:
        event = Event(EventKind.TRANSITION, value, 0, 1.0, 'TOP', value, target=value)
        packed = recorder_packing.pack_event(event, (0, 0))
        assert packed == recorder_packing._pack_through_message(event, (0, 0))


def test_packed_strings_do_not_pile_up():
    most = recorder_packing._MOST_KEPT
    for number in range(2 * most):
        event = Event(EventKind.TRANSITION, 't', number, 1.0, str(number), 'x' * number)
        recorder_packing.pack_event(event, (0, 0))
    assert len(recorder_packing._kept) <= most
    assert max(map(len, recorder_packing._kept.values())) <= recorder_packing._LONGEST_KEPT
