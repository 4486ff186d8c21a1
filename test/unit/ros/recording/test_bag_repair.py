"""The bags of recorders that died, mended: what can be read is saved, and nothing else is lost."""

import os
import random
import shutil
import threading

import pytest
import rosbag
from recorded import STRING, messages, quiet, string_data, texts_in, write
from rosbags.rosbag1 import Reader

from smach_oracle import bag_format
from smach_oracle.analysis.bag_events import MessageStores
from smach_oracle.bag_format import BAG_HEADER_END
from smach_oracle.oracle.records.events import Event, EventKind, EventSource
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.ros.recording import (
    bag_mending,
    bag_repair,
    bag_writer,
    trial_bags,
)
from smach_oracle.ros.recording.bag_repair import recover_folder
from smach_oracle.ros.recording.bag_writer import BagWriter
from smach_oracle.ros.recording.event_packing import EVENT_TYPE, pack_event

STORES = MessageStores()
NAME = '20150401T101112.345Z_t.bag'


def mend(path):
    """Mend a bag beside the damaged one; returns the path of the new one and what was saved."""
    target = str(path) + '.mended'
    with open(str(path), 'rb') as bag:
        saved = bag_mending.mend(bag, target)
    bag_mending.read_back(target, saved)
    return target, saved


def test_cut_off_anywhere_a_bag_is_mended_to_its_whole_messages(tmp_path):
    texts = [str(number) for number in range(12)]
    write(tmp_path / 'whole', texts, chunks=6).abandon()
    size = os.path.getsize(str(tmp_path / 'whole'))
    lengths = set()
    for cut in [*range(BAG_HEADER_END, size, 13), size]:
        path = tmp_path / 'cut.bag'
        shutil.copy(str(tmp_path / 'whole'), str(path))
        os.truncate(str(path), cut)
        target, _ = mend(path)
        found = texts_in(target)
        assert found == texts[: len(found)]
        with Reader(target) as reader:
            assert reader.message_count == len(found)
        lengths.add(len(found))
    assert lengths == set(range(13))


def test_a_chunk_whose_second_index_is_missing_loses_nothing(tmp_path):
    path = tmp_path / 'a.bag'
    writer = write(path, ['whole'])
    writer.add('/talk', STRING, (200, 0), string_data('torn'))
    writer.add('/other', STRING, (200, 0), string_data('torn too'))
    writer.flush()
    writer.abandon()
    # the size of an index record with one entry
    os.truncate(str(path), os.path.getsize(str(path)) - 67)
    assert texts_in(mend(path)[0]) == ['whole', 'torn', 'torn too']


def test_a_damaged_index_is_made_anew(tmp_path):
    path = tmp_path / 'a.bag'
    write(path, ['one', 'two'], chunks=2).close()
    # a power cut while the index was written
    os.truncate(str(path), os.path.getsize(str(path)) - 10)
    assert texts_in(mend(path)[0]) == ['one', 'two']


def test_noise_in_the_middle_costs_only_what_it_hits(tmp_path):
    path = tmp_path / 'a.bag'
    writer = write(path, ['one'], chunks=1)
    good = os.path.getsize(str(path))
    for text in ('two', 'three'):
        writer.add('/talk', STRING, (len(text), 0), string_data(text))
    writer.flush()
    writer.abandon()
    overwrite(path, good, b'\xff' * 40)  # the header of the second chunk
    assert texts_in(mend(path)[0]) == ['two', 'three', 'one']  # by their stamps


def overwrite(path, position, data):
    with open(str(path), 'r+b') as bag:
        bag.seek(position)
        bag.write(data)


def test_an_index_without_entries_is_damage_and_not_a_reason_to_start_no_recorder(tmp_path):
    path = tmp_path / (NAME + '.active')
    write(path, ['one']).abandon()
    with open(str(path), 'ab') as bag:
        bag.write(bag_format.pack_chunk_header(0) + bag_format.pack_index(0, 0, b''))
    assert len(recover_folder(str(tmp_path), quiet, quiet)) == 1
    assert texts_in(tmp_path / NAME) == ['one']


def test_a_damaged_type_or_topic_in_the_first_chunk_is_known_from_a_later_one(tmp_path):
    for word in (b'std_msgs/String', b'topic=/talk', b'string data'):
        path = tmp_path / 'a.bag'
        write(path, ['one', 'two', 'three'], chunks=3).abandon()
        data = path.read_bytes()
        overwrite(path, data.index(word) + len(word) - 3, b'\0')
        target, saved = mend(path)
        assert texts_in(target) == ['one', 'two', 'three']
        with rosbag.Bag(target) as bag:
            assert list(bag.get_type_and_topic_info().topics) == ['/talk']
        os.unlink(str(path))


def test_the_bag_of_a_dead_recorder_is_mended_and_renamed(tmp_path):
    write(tmp_path / 'x.bag.active', ['one']).abandon()
    said = []
    assert recover_folder(str(tmp_path), said.append, pytest.fail) == [str(tmp_path / 'x.bag')]
    assert texts_in(tmp_path / 'x.bag') == ['one']
    assert not (tmp_path / 'x.bag.active').exists()
    assert 'x.bag' in said[0]


def test_the_bag_of_a_living_recorder_is_left_alone(tmp_path):
    writer = write(tmp_path / 'x.bag.active', ['one'])
    assert recover_folder(str(tmp_path), pytest.fail, pytest.fail) == []
    writer.close()
    assert texts_in(tmp_path / 'x.bag.active') == ['one']


def test_a_mended_bag_takes_no_other_bags_name(tmp_path):
    write(tmp_path / 'x.bag.active', ['new']).abandon()
    write(tmp_path / 'x.bag', ['old']).close()
    assert recover_folder(str(tmp_path), quiet, pytest.fail) == [str(tmp_path / 'x_2.bag')]
    assert texts_in(tmp_path / 'x.bag') == ['old']


def test_files_of_rosbag_record_are_left_alone(tmp_path):
    bag = rosbag.Bag(str(tmp_path / '2020-01-01-00-00-00.bag.active'), 'w')
    bag._file.flush()
    before = (tmp_path / '2020-01-01-00-00-00.bag.active').read_bytes()
    assert recover_folder(str(tmp_path), pytest.fail, pytest.fail) == []
    assert (tmp_path / '2020-01-01-00-00-00.bag.active').read_bytes() == before
    bag.close()


def test_a_file_that_cannot_be_mended_is_named_and_the_others_are_mended(tmp_path, monkeypatch):
    for name in ('a', 'b'):
        write(tmp_path / (name + '.bag.active'), [name]).abandon()
    real = os.rename

    def rename(source, target):
        if target.endswith('a.bag'):
            raise OSError(28, 'No space left on device')
        real(source, target)

    monkeypatch.setattr(bag_repair.os, 'rename', rename)
    warnings = []
    assert recover_folder(str(tmp_path), quiet, warnings.append) == [str(tmp_path / 'b.bag')]
    assert len(warnings) == 1 and 'a.bag.active' in warnings[0] and 'No space left' in warnings[0]


@pytest.mark.parametrize('size', [300, 4096, BAG_HEADER_END])
def test_a_file_whose_writer_was_killed_before_its_first_message_is_removed(tmp_path, size):
    write(tmp_path / 'a.bag.active', ['one']).abandon()
    os.truncate(str(tmp_path / 'a.bag.active'), size)
    assert recover_folder(str(tmp_path), pytest.fail, pytest.fail) == []
    assert os.listdir(str(tmp_path)) == []


def test_an_empty_file_is_removed_only_if_it_is_ours_and_not_just_made(tmp_path):
    names = [
        '20150401T101112.345Z_old.bag.active',
        '20150401T101112.345Z_new.bag.active',
        'theirs.bag.active',
    ]
    for name in names:
        (tmp_path / name).touch()
    for name in (names[0], names[2]):
        os.utime(str(tmp_path / name), (1.0, 1.0))
    assert recover_folder(str(tmp_path), pytest.fail, pytest.fail) == []
    assert sorted(os.listdir(str(tmp_path))) == sorted(names[1:])


def recorded_bag(path, chunks=12, events_per_chunk=20):
    """A bag as the recorder makes it, left open.

    :returns: where each chunk begins, and the end of the last.
    """
    writer = BagWriter(str(path))
    number = 0
    borders = []
    for _ in range(chunks):
        borders.append(os.path.getsize(str(path)))
        for _ in range(events_per_chunk):
            event = Event(EventKind.STATE_START, 't', number, 100.0 + number, 'TOP', 'PICK_\u00e4')
            writer.add(
                '/robot/oracle/events',
                EVENT_TYPE,
                (100 + number, 0),
                pack_event(event, (100 + number, 0)),
            )
            number += 1
        writer.add('/talk', STRING, (100 + number, 5), string_data('text'), {'callerid': '/me'})
        writer.flush()
    writer.abandon()
    return borders + [os.path.getsize(str(path))]


def damage(random_, data):
    """A damaged copy of a bag, and the part that was touched: first byte, and the end."""
    size = len(data)
    kind = random_.choice(['byte', 'zeros', 'noise', 'cut'])
    start = random_.randrange(size)
    if kind == 'cut':
        return data[:start], start, size
    length = 1 if kind == 'byte' else min(random_.choice([4, 50, 3000, 20000]), size - start)
    new = bytes(length) if kind == 'zeros' else bytes(random_.randrange(256) for _ in range(length))
    return data[:start] + new + data[start + length :], start, start + length


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """The bytes of a recorded bag, and where its chunks begin."""
    path = tmp_path_factory.mktemp('whole') / NAME
    borders = recorded_bag(path)
    return path.read_bytes(), borders


@pytest.mark.parametrize('seed', range(110))
def test_whatever_is_damaged_the_events_of_all_other_chunks_are_saved(tmp_path, whole, seed):
    data, borders = whole
    damaged, start, end = damage(random.Random(seed), data)
    (tmp_path / (NAME + '.active')).write_bytes(damaged)
    intact = {
        number
        for chunk, (first, last) in enumerate(zip(borders, borders[1:]))
        if last <= start or end <= first
        for number in range(chunk * 20, chunk * 20 + 20)
    }
    warnings = []
    mended = recover_folder(str(tmp_path), quiet, warnings.append)
    assert mended or not intact
    assert os.listdir(str(tmp_path)) == [NAME] * len(mended)
    for path in mended:
        found = [event.seq for event in messages(path) if event._type.endswith('OracleEvent')]
        assert intact <= set(found) and len(found) <= 240  # a changed number may come twice
        with Reader(path) as reader:
            read = [
                STORES.read(connection, raw)
                for connection, _, raw in reader.messages()
                if connection.topic.endswith('/oracle/events')
            ]
        assert len(read) == len(found)


def test_one_wrong_byte_in_the_first_chunks_header_loses_no_event(tmp_path):
    path = tmp_path / (NAME + '.active')
    borders = recorded_bag(path)
    overwrite(path, borders[0] + 2, b'\x7f')
    warnings = []
    assert recover_folder(str(tmp_path), quiet, warnings.append) == [str(tmp_path / NAME)]
    assert [event.seq for event in messages(str(tmp_path / NAME), '/robot/oracle/events')] == list(
        range(240)
    )
    assert len(warnings) == 1 and 'among them 0 events' in warnings[0]


def test_the_log_tells_bytes_chunks_and_events_that_were_lost(tmp_path):
    path = tmp_path / (NAME + '.active')
    borders = recorded_bag(path)
    overwrite(path, borders[3], bytes(borders[4] - borders[3]))
    warnings = []
    recover_folder(str(tmp_path), pytest.fail, warnings.append)
    assert (
        '{} bytes in at least 1 chunk, among them 20 events'.format(borders[4] - borders[3])
        in warnings[0]
    )


def test_where_the_events_lose_their_type_for_good_it_is_known_all_the_same(tmp_path):
    path = tmp_path / (NAME + '.active')
    borders = recorded_bag(path, chunks=4)
    overwrite(path, borders[0], bytes(borders[3] - borders[0]))  # chunk 4 would repeat the types
    recover_folder(str(tmp_path), quiet, quiet)
    with rosbag.Bag(str(tmp_path / NAME)) as bag:
        assert [item.message.seq for item in bag.read_messages('/oracle/events')] == list(
            range(60, 80)
        )


def test_what_cannot_be_read_at_all_is_left_as_it_is(tmp_path):
    path = tmp_path / (NAME + '.active')
    borders = recorded_bag(path)
    overwrite(path, borders[0], bytes(borders[-1] - borders[0]))
    before = path.read_bytes()
    warnings = []
    assert recover_folder(str(tmp_path), pytest.fail, warnings.append) == []
    assert os.listdir(str(tmp_path)) == [NAME + '.active'] and path.read_bytes() == before
    assert 'left as it is' in warnings[0]


def test_a_disk_that_is_full_while_mending_loses_nothing(tmp_path, monkeypatch):
    path = tmp_path / (NAME + '.active')
    recorded_bag(path)
    before = path.read_bytes()
    real = os.pwrite
    room = []  # for so many writes

    def write_where_there_is_room(fd, data, position):
        if not room:
            raise OSError(28, 'No space left on device')
        room.pop()
        return real(fd, data, position)

    monkeypatch.setattr(bag_writer.os, 'pwrite', write_where_there_is_room)
    for writes in range(3):  # the header, the chunk, the index
        room[:] = [True] * writes
        warnings = []
        assert recover_folder(str(tmp_path), pytest.fail, warnings.append) == []
        assert os.listdir(str(tmp_path)) == [NAME + '.active']
        assert path.read_bytes() == before
        assert 'No space left' in warnings[0]
    monkeypatch.undo()
    recover_folder(str(tmp_path), quiet, pytest.fail)
    assert len(messages(str(tmp_path / NAME))) == 252


def test_the_original_stays_until_the_mended_bag_has_been_read_back(tmp_path, monkeypatch):
    path = tmp_path / (NAME + '.active')
    recorded_bag(path)
    before = path.read_bytes()
    real = bag_mending.mend

    def badly(bag, target):
        saved = real(bag, target)
        overwrite(target, BAG_HEADER_END + 30, b'\0' * 9)
        return saved

    monkeypatch.setattr(bag_repair, 'mend', badly)
    warnings = []
    recover_folder(str(tmp_path), pytest.fail, warnings.append)
    assert (tmp_path / (NAME + '.damaged')).read_bytes() == before
    assert 'read back' in warnings[0] and NAME + '.damaged' in warnings[0]
    monkeypatch.undo()
    os.unlink(str(tmp_path / NAME))
    recover_folder(str(tmp_path), quiet, pytest.fail)
    assert os.listdir(str(tmp_path)) == [NAME] and len(messages(str(tmp_path / NAME))) == 252


@pytest.mark.parametrize('dies_at', range(5))
def test_a_mender_that_dies_at_any_step_is_gone_on_from(tmp_path, monkeypatch, dies_at):
    recorded_bag(tmp_path / (NAME + '.active'))
    steps = []

    class Killed(BaseException):
        pass

    def step(real):
        def run(*args):
            if len(steps) == dies_at:
                raise Killed
            steps.append(real)
            return real(*args)

        return run

    with monkeypatch.context() as patch:
        patch.setattr(bag_repair, 'mend', step(bag_repair.mend))
        patch.setattr(bag_repair, 'read_back', step(bag_repair.read_back))
        patch.setattr(bag_repair.os, 'rename', step(os.rename))
        patch.setattr(bag_repair.os, 'unlink', step(os.unlink))
        with pytest.raises(Killed):
            recover_folder(str(tmp_path), quiet, pytest.fail)
    recover_folder(str(tmp_path), quiet, pytest.fail)
    assert os.listdir(str(tmp_path)) == [NAME]
    assert len(messages(str(tmp_path / NAME))) == 252


def test_the_recorder_does_not_wait_for_a_large_bag_to_be_mended(tmp_path, monkeypatch):
    let_go, mended = threading.Event(), threading.Event()

    def takes_long(*_):
        assert let_go.wait(20)
        mended.set()

    monkeypatch.setattr(trial_bags, 'recover_folder', takes_long)
    monkeypatch.setattr(trial_bags, 'MEND_WAIT_S', 0.05)
    recorder = TrialRecorder(str(tmp_path))
    source = EventSource(print)
    recorder.attach(source)
    source.begin_trial('t')
    source.emit(EventKind.TRIAL_START, 'TOP')
    source.emit(EventKind.TRIAL_END, 'TOP')
    assert recorder.close(20.0) and list(tmp_path.glob('*.bag'))
    let_go.set()
    assert mended.wait(20)
