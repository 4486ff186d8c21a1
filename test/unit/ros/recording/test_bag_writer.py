"""Bags that are readable by everyone, whatever happened while they were written."""

import errno
import fcntl
import os
import struct
import subprocess
import threading

import pytest
import rosbag
from recorded import STRING, quiet, string_data, texts_in, write
from rosbags.rosbag1 import Reader

from smach_oracle.ros.recording import bag_writer
from smach_oracle.ros.recording.bag_repair import recover_folder
from smach_oracle.ros.recording.bag_writer import BagWriter


def test_rosbag_and_rosbags_read_the_same_messages_at_the_same_times(tmp_path):
    path = tmp_path / 'a.bag'
    write(path, ['one', 'two', 'drei'], chunks=2).close()
    with rosbag.Bag(str(path)) as bag:
        by_rosbag = [
            (topic, message.data, stamp.to_nsec()) for topic, message, stamp in bag.read_messages()
        ]
    with Reader(path) as reader:
        by_rosbags = [
            (item.topic, data[4:].decode(), stamp) for item, stamp, data in reader.messages()
        ]
    assert by_rosbag == by_rosbags
    assert by_rosbag == [
        ('/talk', text, (100 + number) * 10**9 + 5)
        for number, text in enumerate(['one', 'two', 'drei'])
    ]


def test_rosbag_info_tells_topics_types_and_counts(tmp_path):
    path = tmp_path / 'a.bag'
    writer = write(path, ['x'] * 10, chunks=3)
    writer.add('/other', STRING, (200, 0), string_data('y'))
    writer.close()
    with rosbag.Bag(str(path)) as bag:
        topics = bag.get_type_and_topic_info().topics
        assert {name: (info.msg_type, info.message_count) for name, info in topics.items()} == {
            '/talk': ('std_msgs/String', 10),
            '/other': ('std_msgs/String', 1),
        }
        assert (bag.get_start_time(), bag.get_end_time()) == (100.000000005, 200.0)


def test_a_clock_that_jumps_back_leaves_a_readable_bag(tmp_path):
    path = tmp_path / 'a.bag'
    writer = BagWriter(str(path))
    for seconds in (50, 10, 30):
        writer.add('/talk', STRING, (seconds, 0), string_data(str(seconds)))
    writer.close()
    assert texts_in(path) == ['10', '30', '50']
    with Reader(path) as reader:
        assert [stamp // 10**9 for _, stamp, _ in reader.messages()] == [10, 30, 50]


def test_a_message_that_cannot_be_written_leaves_a_readable_bag(tmp_path):
    path = tmp_path / 'a.bag'
    writer = BagWriter(str(path))
    with pytest.raises(struct.error):
        writer.add('/talk', STRING, (-1, 0), string_data('before 1970'))
    writer.flush()
    assert not writer.has_chunks
    writer.add('/talk', STRING, (1, 0), string_data('kept'))
    with pytest.raises(struct.error):
        writer.add('/talk', STRING, (-1, 0), string_data('before 1970'))
    writer.close()
    assert texts_in(path) == ['kept']


def test_an_empty_bag_can_be_opened(tmp_path):
    path = tmp_path / 'a.bag'
    BagWriter(str(path)).close()
    assert texts_in(path) == []
    with Reader(path) as reader:
        assert reader.message_count == 0


def test_a_file_system_without_locks_is_recorded_to_all_the_same(tmp_path, monkeypatch):
    def no_locks(fd, operation):
        raise OSError(errno.EOPNOTSUPP, 'Operation not supported')

    monkeypatch.setattr(fcntl, 'flock', no_locks)
    path = tmp_path / 'a.bag'
    write(path, ['one', 'two']).close()
    assert texts_in(path) == ['one', 'two']


def test_a_bag_that_exists_is_never_overwritten(tmp_path):
    path = tmp_path / 'a.bag'
    path.write_bytes(b'precious')
    with pytest.raises(FileExistsError):
        BagWriter(str(path))
    assert path.read_bytes() == b'precious'


def test_a_recorder_that_looks_at_a_new_bag_for_a_moment_costs_nothing(tmp_path, monkeypatch):
    path, looked = str(tmp_path / 'a.bag.active'), threading.Event()
    real = fcntl.flock

    def locked_meanwhile(fd, how):
        with open(path, 'rb') as other:  # as a recorder that starts has it
            real(other.fileno(), fcntl.LOCK_EX)
            held = os.dup(other.fileno())

        def let_go():
            looked.set()
            real(held, fcntl.LOCK_UN)

        looker = threading.Timer(0.1, let_go)  # nothing tells that somebody waits for a lock
        looker.start()
        monkeypatch.undo()
        real(fd, how)
        assert looked.is_set()
        looker.join()
        os.close(held)

    monkeypatch.setattr(fcntl, 'flock', locked_meanwhile)
    BagWriter(path).close()
    assert recover_folder(str(tmp_path), quiet, pytest.fail) == []


def test_latched_topics_are_marked_so_that_rosbag_play_latches_them(tmp_path):
    path = tmp_path / 'a.bag'
    writer = BagWriter(str(path))
    writer.add('/talk', STRING, (1, 0), string_data('x'), {'latching': '1', 'callerid': '/me'})
    writer.close()
    with rosbag.Bag(str(path)) as bag:
        (entry,) = bag.read_messages(return_connection_header=True)
        assert entry.connection_header['latching'] == b'1'


def test_a_failing_write_is_cut_off_and_what_was_written_before_stays(tmp_path, monkeypatch):
    path = tmp_path / 'a.bag.active'
    writer = write(path, ['kept', 'kept too'], chunks=1)
    size = os.path.getsize(str(path))
    real = os.pwrite

    def half(fd, data, position):
        real(fd, data[: len(data) // 2], position)
        raise OSError(28, 'No space left on device')

    writer.add('/talk', STRING, (900, 0), string_data('lost'))
    monkeypatch.setattr(bag_writer.os, 'pwrite', half)
    with pytest.raises(OSError, match='No space left'):
        writer.flush()
    monkeypatch.undo()
    assert os.path.getsize(str(path)) == size
    writer.abandon()
    assert recover_folder(str(tmp_path), quiet, pytest.fail) == [str(tmp_path / 'a.bag')]
    assert texts_in(tmp_path / 'a.bag') == ['kept', 'kept too']


def test_rosbag_reindex_mends_a_bag_too(tmp_path):
    write(tmp_path / 'a.bag', ['one', 'two', 'three', 'four'], chunks=2).abandon()
    os.truncate(str(tmp_path / 'a.bag'), os.path.getsize(str(tmp_path / 'a.bag')) - 3)
    subprocess.run(['rosbag', 'reindex', '-q', 'a.bag'], cwd=str(tmp_path), check=True, timeout=60)
    assert texts_in(tmp_path / 'a.bag') == ['one', 'two']
