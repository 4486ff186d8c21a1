"""Bags that are readable by everyone, whatever happened while they were written."""
import errno
import fcntl
import os
import shutil
import subprocess

import pytest
import rosbag
from recorded import STRING, messages, string_data
from rosbags.rosbag1 import Reader

from smach_oracle.ros.recording import bag_format, bag_repair, bag_writer
from smach_oracle.ros.recording.bag_format import BAG_HEADER_END, BagFormatError
from smach_oracle.ros.recording.bag_repair import recover_folder, repair
from smach_oracle.ros.recording.bag_writer import BagWriter


def write(path, texts, chunks=1, topic='/talk'):
    """A bag with the texts spread over chunks, left open."""
    writer = BagWriter(str(path))
    for number, text in enumerate(texts):
        writer.add(topic, STRING, (100 + number, 5), string_data(text))
        if (number + 1) % max(1, len(texts) // chunks) == 0:
            writer.flush()
    return writer


def quiet(_text):
    pass


def texts_in(path):
    return [message.data for message in messages(str(path))]


def test_rosbag_and_rosbags_read_the_same_messages_at_the_same_times(tmp_path):
    path = tmp_path / 'a.bag'
    write(path, ['one', 'two', 'drei'], chunks=2).close()
    with rosbag.Bag(str(path)) as bag:
        by_rosbag = [(topic, message.data, stamp.to_nsec())
                     for topic, message, stamp in bag.read_messages()]
    with Reader(path) as reader:
        by_rosbags = [(item.topic, data[4:].decode(), stamp)
                      for item, stamp, data in reader.messages()]
    assert by_rosbag == by_rosbags
    assert by_rosbag == [('/talk', text, (100 + number) * 10 ** 9 + 5)
                         for number, text in enumerate(['one', 'two', 'drei'])]


def test_rosbag_info_tells_topics_types_and_counts(tmp_path):
    path = tmp_path / 'a.bag'
    writer = write(path, ['x'] * 10, chunks=3)
    writer.add('/other', STRING, (200, 0), string_data('y'))
    writer.close()
    with rosbag.Bag(str(path)) as bag:
        topics = bag.get_type_and_topic_info().topics
        assert {name: (info.msg_type, info.message_count) for name, info in topics.items()} == {
            '/talk': ('std_msgs/String', 10), '/other': ('std_msgs/String', 1)}
        assert (bag.get_start_time(), bag.get_end_time()) == (100.000000005, 200.0)


def test_a_clock_that_jumps_back_leaves_a_readable_bag(tmp_path):
    path = tmp_path / 'a.bag'
    writer = BagWriter(str(path))
    for seconds in (50, 10, 30):
        writer.add('/talk', STRING, (seconds, 0), string_data(str(seconds)))
    writer.close()
    assert texts_in(path) == ['10', '30', '50']
    with Reader(path) as reader:
        assert [stamp // 10 ** 9 for _, stamp, _ in reader.messages()] == [10, 30, 50]


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


def test_latched_topics_are_marked_so_that_rosbag_play_latches_them(tmp_path):
    path = tmp_path / 'a.bag'
    writer = BagWriter(str(path))
    writer.add('/talk', STRING, (1, 0), string_data('x'), {'latching': '1', 'callerid': '/me'})
    writer.close()
    with rosbag.Bag(str(path)) as bag:
        (entry,) = bag.read_messages(return_connection_header=True)
        assert entry.connection_header['latching'] == b'1'


def test_a_failing_write_is_cut_off_and_what_was_written_before_stays(tmp_path, monkeypatch):
    path = tmp_path / 'a.bag'
    writer = write(path, ['kept', 'kept too'], chunks=1)
    size = os.path.getsize(str(path))
    real = os.pwrite

    def half(fd, data, position):
        real(fd, data[:len(data) // 2], position)
        raise OSError(28, 'No space left on device')

    writer.add('/talk', STRING, (900, 0), string_data('lost'))
    monkeypatch.setattr(bag_writer.os, 'pwrite', half)
    with pytest.raises(OSError, match='No space left'):
        writer.flush()
    monkeypatch.undo()
    assert os.path.getsize(str(path)) == size
    writer.abandon()
    with open(str(path), 'r+b') as bag:
        repair(bag)
    assert texts_in(path) == ['kept', 'kept too']


def test_cut_off_anywhere_a_bag_is_mended_to_what_its_whole_chunks_hold(tmp_path):
    texts = [str(number) for number in range(12)]
    writer = write(tmp_path / 'whole', texts, chunks=6)
    writer.abandon()
    size = os.path.getsize(str(tmp_path / 'whole'))
    lengths = set()
    for cut in [*range(BAG_HEADER_END, size, 13), size]:
        path = tmp_path / 'cut.bag'
        shutil.copy(str(tmp_path / 'whole'), str(path))
        os.truncate(str(path), cut)
        with open(str(path), 'r+b') as bag:
            repair(bag)
        found = texts_in(path)
        assert found == texts[:len(found)]
        with Reader(path) as reader:
            assert reader.message_count == len(found)
        lengths.add(len(found))
    assert lengths == {0, 2, 4, 6, 8, 10, 12}


def test_a_chunk_whose_second_index_is_missing_is_not_half_read(tmp_path):
    path = tmp_path / 'a.bag'
    writer = write(path, ['whole'])
    writer.add('/talk', STRING, (200, 0), string_data('torn'))
    writer.add('/other', STRING, (200, 0), string_data('torn'))
    writer.flush()
    writer.abandon()
    # the size of an index record with one entry
    os.truncate(str(path), os.path.getsize(str(path)) - 67)
    with open(str(path), 'r+b') as bag:
        repair(bag)
    assert texts_in(path) == ['whole']


def test_rosbag_reindex_mends_a_bag_too(tmp_path):
    write(tmp_path / 'a.bag', ['one', 'two', 'three', 'four'], chunks=2).abandon()
    os.truncate(str(tmp_path / 'a.bag'), os.path.getsize(str(tmp_path / 'a.bag')) - 3)
    subprocess.run(['rosbag', 'reindex', '-q', 'a.bag'], cwd=str(tmp_path), check=True, timeout=60)
    assert texts_in(tmp_path / 'a.bag') == ['one', 'two']


def test_a_damaged_index_is_made_anew(tmp_path):
    path = tmp_path / 'a.bag'
    write(path, ['one', 'two'], chunks=2).close()
    # a power cut while the index was written
    os.truncate(str(path), os.path.getsize(str(path)) - 10)
    with open(str(path), 'r+b') as bag:
        repair(bag)
    assert texts_in(path) == ['one', 'two']


def test_noise_in_the_middle_costs_only_what_comes_after(tmp_path):
    path = tmp_path / 'a.bag'
    writer = write(path, ['one'], chunks=1)
    good = os.path.getsize(str(path))
    writer.add('/talk', STRING, (7, 0), string_data('two'))
    writer.flush()
    writer.abandon()
    with open(str(path), 'r+b') as bag:
        bag.seek(good)
        bag.write(b'\xff' * 40)
    with open(str(path), 'r+b') as bag:
        repair(bag)
    assert texts_in(path) == ['one']


def test_an_index_without_entries_is_damage_and_not_a_reason_to_start_no_recorder(tmp_path):
    path = tmp_path / '20150401T101112.345Z_t.bag.active'
    writer = write(path, ['one'])
    writer.abandon()
    with open(str(path), 'ab') as bag:
        bag.write(bag_format.pack_chunk_header(0) + bag_format.pack_index(0, 0, b''))
    assert len(recover_folder(str(tmp_path), quiet, quiet)) == 1
    assert texts_in(tmp_path / '20150401T101112.345Z_t.bag') == ['one']


def test_what_is_no_bag_is_refused(tmp_path):
    (tmp_path / 'a.bag').write_bytes(b'#ROSBAG V1.2\n' + b'x' * 9000)
    with open(str(tmp_path / 'a.bag'), 'r+b') as bag, pytest.raises(BagFormatError,
                                                                    match='version 2.0'):
        repair(bag)


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
        '20150401T101112.345Z_old.bag.active', '20150401T101112.345Z_new.bag.active',
        'theirs.bag.active'
    ]
    for name in names:
        (tmp_path / name).touch()
    for name in (names[0], names[2]):
        os.utime(str(tmp_path / name), (1.0, 1.0))
    assert recover_folder(str(tmp_path), pytest.fail, pytest.fail) == []
    assert sorted(os.listdir(str(tmp_path))) == sorted(names[1:])
