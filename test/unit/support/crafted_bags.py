"""Bags of one event that are more than they seem, written byte by byte."""

import bz2

from smach_oracle import bag_format
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.ros.recording.event_packing import EVENT_TYPE, pack_event

STAMP = (1_700_000_000, 0)
ZEROS = bz2.compress(bytes(10_000_000), 9)


def event(**fields):
    return Event(
        **{
            'kind': EventKind.TRIAL_START,
            'trial_id': 'crafted',
            'seq': 0,
            'wall_time': 1_700_000_000.0,
            'path': 'TOP',
            **fields,
        }
    )


def crafted_bag(first=None, unpacked_zeros=0, listed=1):
    """The bytes of a bag.

    :param unpacked_zeros: so many times ten million zeros follow the event, packed by bz2.
    :param listed: so many times the index lists the one event.
    """
    details = {
        'type': EVENT_TYPE.name,
        'md5sum': EVENT_TYPE.md5sum,
        'message_definition': EVENT_TYPE.definition,
    }
    connection = bag_format.pack_connection(0, '/alpha/oracle/events', details)
    message = bag_format.pack_record(
        {
            'op': bytes((bag_format.OP_MESSAGE,)),
            'conn': bag_format.UINT32.pack(0),
            'time': bag_format.STAMP.pack(*STAMP),
        },
        pack_event(first or event(), STAMP),
    )
    chunk = bag_format.pack_record(
        {
            'op': bytes((bag_format.OP_CHUNK,)),
            'compression': 'bz2',
            'size': bag_format.UINT32.pack(
                min(2**32 - 1, len(message) + unpacked_zeros * 10_000_000)
            ),
        },
        bz2.compress(message) + ZEROS * unpacked_zeros,
    )
    index = bag_format.pack_index(0, listed, bag_format.INDEX_ENTRY.pack(*STAMP, 0) * listed)
    info = bag_format.pack_chunk_info(
        bag_format.ChunkInfo(bag_format.BAG_HEADER_END, STAMP, STAMP, {0: listed})
    )
    index_position = bag_format.BAG_HEADER_END + len(chunk) + len(index)
    return b''.join(
        (
            bag_format.MAGIC,
            bag_format.pack_bag_header(index_position, 1, 1),
            chunk,
            index,
            connection,
            info,
        )
    )
