"""Bags that are read by their index, beside the same bags read by rosbags."""

import os
import random
import subprocess
import sys
from pathlib import Path

import pytest
import rosbag
from fake_trials import FakeMachine
from geometry_msgs.msg import Pose
from sensor_msgs.msg import Image, LaserScan
from std_msgs.msg import Bool, Header, String

from smach_oracle.analysis import bag_events
from smach_oracle.analysis.bag_events import CAUSE_TYPE, EVENT_TYPE, BagError, EventReader
from smach_oracle.analysis.plain_bags.decoding import MessageDecoder
from smach_oracle.analysis.plain_bags.definition_sum import sum_of
from smach_oracle.analysis.plain_bags.indexed_bag import IndexedBag, NotPlain
from smach_oracle.msg import OracleEvent, OracleRates, TrialCause
from smach_oracle.oracle.records.events import Event
from smach_oracle.ros.recorder import TrialRecorder

HELD = sorted((Path(__file__).resolve().parents[2] / 'data').rglob('*.bag'))


@pytest.fixture(name='bag')
def recorded(tmp_path):
    """A bag of this package's recorder."""
    recorder = TrialRecorder(str(tmp_path / 'bags'), warn=pytest.fail)
    FakeMachine(recorder).run(4)
    assert recorder.close(20.0)
    (path,) = (tmp_path / 'bags').glob('*.bag')
    return path


class BySlowWay(EventReader):
    """Reads by rosbags alone."""

    def _quickly(self, path):
        raise NotPlain('not wanted')


class ByQuickWay(EventReader):
    """Reads by the index alone."""

    def _by_rosbags(self, path):
        pytest.fail('rosbags had to read ' + path)


def told_by(reader, path):
    """What a reader says about a bag, or why it cannot."""
    try:
        return repr(reader.read(str(path)))
    except BagError as err:
        return 'BagError: {}'.format(err)


@pytest.mark.parametrize('path', HELD, ids=lambda path: path.stem[-20:])
def test_bags_of_earlier_versions_are_read_alike_and_by_the_index(path):
    assert told_by(ByQuickWay(), path) == told_by(BySlowWay(), path)


def write(path, compression='none', chunks=1, foreign=False):
    """Write a bag as `rosbag record` does, several topics of events in it."""
    with rosbag.Bag(str(path), 'w', compression, 800 if chunks > 1 else 768 * 1024) as bag:
        for seq in range(40):
            event = OracleEvent(kind=5 + seq % 3, trial_id='t', seq=seq, path='TOP', text='ü' * seq)
            event.header = Header(stamp=type(Header().stamp)(100 + seq // 4, seq), frame_id='map')
            bag.write('/one/oracle/events', event, event.header.stamp)
            if seq % 5 == 0:
                cause = TrialCause(seed=seq, task='t', kinds=['a', 'bc'] * (seq % 2), details=[])
                bag.write('/world/cause', cause, event.header.stamp)
                bag.write('/two/oracle/events', event, event.header.stamp)
            if foreign:
                bag.write('/chatter', String('x' * seq), event.header.stamp)
                bag.write('/image', Image(data=bytes(3000)), event.header.stamp)
    return path


@pytest.mark.parametrize('compression', ['none', 'bz2'])
@pytest.mark.parametrize('chunks', [1, 9])
@pytest.mark.parametrize('foreign', [False, True])
def test_bags_of_rosbag_record_are_read_alike_and_by_the_index(
    tmp_path, compression, chunks, foreign
):
    path = write(tmp_path / 'a.bag', compression, chunks, foreign)
    quick = told_by(ByQuickWay(), path)
    assert quick == told_by(BySlowWay(), path) and 'BagError' not in quick


def test_a_bag_with_lz4_is_read_by_rosbags(tmp_path):
    path = write(tmp_path / 'a.bag', 'lz4', 3)
    with pytest.raises(NotPlain, match='compression'), IndexedBag(str(path)) as bag:
        bag.messages(EVENT_TYPE)
    assert told_by(EventReader(), path) == told_by(BySlowWay(), path)


def test_a_bag_without_events_is_refused_as_rosbags_would_be(tmp_path):
    with rosbag.Bag(str(tmp_path / 'a.bag'), 'w') as bag:
        bag.write('/chatter', String('x'))
    assert told_by(ByQuickWay(), tmp_path / 'a.bag') == 'BagError: no events of the executive in it'


@pytest.mark.parametrize('seed', range(12))
@pytest.mark.parametrize('is_large', [False, True])
def test_a_damaged_bag_is_told_of_as_rosbags_tells(bag, tmp_path, seed, is_large):
    rng = random.Random(seed)
    if is_large:  # a chunk that is read by pieces
        write(bag, foreign=True)
    whole, told_of_whole = bag.read_bytes(), told_by(EventReader(), bag)
    for number in range(25):
        content, path = bytearray(whole), tmp_path / '{}.bag'.format(number)
        if number % 5:
            content[rng.randrange(len(content))] = rng.randrange(256)
        else:
            del content[rng.randrange(len(content)) :]
        path.write_bytes(content)
        ours, theirs = told_by(EventReader(), path), told_by(BySlowWay(), path)
        # rosbags also refuses what is damaged where nothing is wanted
        assert ours == theirs or (theirs.startswith('BagError') and ours == told_of_whole)


def test_a_chunk_that_grows_without_end_is_not_unpacked(tmp_path, monkeypatch):
    path = write(tmp_path / 'a.bag', 'bz2')
    content = path.read_bytes()
    at = content.index(b'size=') + len(b'size=')
    path.write_bytes(content[:at] + (100).to_bytes(4, 'little') + content[at + 4 :])
    with pytest.raises(NotPlain, match='another length'), IndexedBag(str(path)) as bag:
        bag.messages(EVENT_TYPE)


def test_of_a_large_chunk_only_pieces_are_read(tmp_path, monkeypatch):
    path = write(tmp_path / 'a.bag', foreign=True)
    read, pread = [], os.pread
    monkeypatch.setattr(
        os, 'pread', lambda file, size, at: read.append(size) or pread(file, size, at)
    )
    with IndexedBag(str(path)) as bag:
        sizes = [end - start for *_, start, end in bag.messages(EVENT_TYPE)]
    assert len(sizes) == 48 and max(read) < 40000 < path.stat().st_size / 3


@pytest.mark.parametrize('size', [3000, 4090, 5000, 70000])
def test_a_message_of_any_length_is_read_from_a_large_chunk(tmp_path, size):
    path = tmp_path / 'a.bag'
    with rosbag.Bag(str(path), 'w') as bag:
        bag.write('/image', Image(data=bytes(100000)))
        bag.write('/oracle/events', OracleEvent(kind=1, trial_id='t', path='TOP', text='x' * size))
        bag.write('/image', Image(data=bytes(100)))
    assert told_by(ByQuickWay(), path) == told_by(BySlowWay(), path)
    assert 'x' * size in told_by(ByQuickWay(), path)


@pytest.mark.parametrize(
    'message', [OracleEvent, TrialCause, OracleRates, Header, Bool, Pose, Image, String, LaserScan]
)
def test_the_sum_of_a_definition_is_the_one_of_ros(message):
    assert sum_of(message._full_text) == message._md5sum


def test_a_definition_that_is_not_sound_has_another_sum_or_none():
    rng, text = random.Random(3), OracleEvent._full_text
    code = [at for at, letter in enumerate(text) if letter.isalnum() and not _is_comment(text, at)]
    for at in rng.sample(code, 150):
        letter = rng.choice([each for each in 'abzXY019_/[' if each != text[at]])
        try:
            assert sum_of(text[:at] + letter + text[at + 1 :]) != OracleEvent._md5sum
        except NotPlain:
            pass


def _is_comment(text, at):
    return '#' in text[text.rfind('\n', 0, at) + 1 : at]


@pytest.mark.parametrize(
    'text', ['string NAME=a', 'Pose pose', 'uint8', 'Pose a\n====\nPose b', 'int8 a\n===\nint8 b']
)
def test_a_definition_that_is_seldom_has_no_sum(text):
    with pytest.raises(NotPlain):
        sum_of(text)


def test_a_bag_whose_definitions_are_sound_is_read_without_rosbags(bag):
    script = (
        'import sys\n'
        'from smach_oracle.analysis.bag_events import EventReader\n'
        "print(len(EventReader().read(sys.argv[1]).events), 'rosbags' in sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, '-c', script, str(bag)], check=True, stdout=subprocess.PIPE
    )
    events, is_loaded = done.stdout.split()
    assert int(events) > 10 and is_loaded == b'False'


def test_the_events_are_taken_by_their_names():
    assert set(Event._fields) <= set(MessageDecoder(OracleEvent._full_text).names)
    assert set(bag_events._TAKEN[CAUSE_TYPE]) <= set(MessageDecoder(TrialCause._full_text).names)


@pytest.mark.parametrize('message', [Pose(), Image()])
def test_another_type_of_field_is_left_to_rosbags(message):
    with pytest.raises(NotPlain, match='type'):
        MessageDecoder(message._full_text)


@pytest.mark.parametrize('data', [b'', b'\x01\x01'])
def test_a_message_of_another_length_is_left_to_rosbags(data):
    with pytest.raises(NotPlain):
        MessageDecoder(Bool._full_text)(data)


def test_no_file_stays_open(bag):
    for text in (b'', b'#ROSBAG V2.0\nnothing more'):
        bag.write_bytes(text)
        before = len(list(Path('/proc/self/fd').iterdir()))
        with pytest.raises(NotPlain):
            IndexedBag(str(bag))
        assert len(list(Path('/proc/self/fd').iterdir())) == before
