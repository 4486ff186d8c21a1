"""A damaged bag of release 0.1, whose events have another md5 and the same fields, is mended."""

import shutil
from pathlib import Path

import rosbag

from smach_oracle.analysis.bag_events import EventReader
from smach_oracle.ros.recording import bag_mending
from smach_oracle.ros.recording.event_packing import EARLIER_MD5S, EVENT_TYPE

HELD = Path(__file__).resolve().parents[3] / 'data/v0_1/trials/fetch'


def mended(path):
    target = str(path) + '.mended'
    with open(str(path), 'rb') as bag:
        return target, bag_mending.mend(bag, target)


def test_the_events_that_are_lost_are_counted_and_the_others_read(tmp_path):
    source = sorted(HELD.glob('*.bag'))[0]
    whole = EventReader().read(str(source)).events
    path = tmp_path / 'a.bag'
    shutil.copy(str(source), str(path))
    data = path.read_bytes()
    with rosbag.Bag(str(source)) as bag:
        types = {
            item.md5sum for item in bag._connections.values() if item.datatype == EVENT_TYPE.name
        }
    assert types <= EARLIER_MD5S and len(types) == 1
    # the length of an event in the middle
    middle = whole[len(whole) // 2]
    place = data.index(
        middle.seq.to_bytes(8, 'little'), data.index(middle.trial_id.encode(), len(data) // 3)
    )
    path.write_bytes(data[: place - 60] + b'\xff' * 60 + data[place:])
    target, saved = mended(path)
    found = EventReader().read(target).events
    assert 0 < saved.events_lost < len(whole)
    assert len(found) == len(whole) - saved.events_lost
    assert {event.seq for event in found} < {event.seq for event in whole}
