"""Commands that read bags say of those with replays of failures what they say without them."""

import os

import pytest
import rosbag
from sensor_msgs.msg import CompressedImage, JointState

import smach
from smach_oracle.analysis import bag_statistics, what_if
from smach_oracle.analysis.learning import command as learn
from smach_oracle.msg import FailureReplay
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.ros.recorder import TrialRecorder

TOPIC = '/robot/failure_replay'
TRIALS = 12


class NoWait:
    """Takes no time."""

    def wait(self, seconds, what, scope):
        pass


@pytest.fixture(name='folders', scope='module')
def make_folders(tmp_path_factory):
    """Of the same bags one folder with replays, and one without."""
    root = tmp_path_factory.mktemp('replays')
    record(str(root / 'with' / 'bags'))
    os.makedirs(str(root / 'without' / 'bags'))
    for name in os.listdir(str(root / 'with' / 'bags')):
        with rosbag.Bag(str(root / 'with' / 'bags' / name)) as source, rosbag.Bag(
            str(root / 'without' / 'bags' / name), 'w'
        ) as copy:
            for topic, message, stamp in source.read_messages():
                if topic != TOPIC:
                    copy.write(topic, message, stamp)
    return root


def record(folder):
    tries = []

    def pick(_userdata):
        tries.append(1)
        return 'aborted' if len(tries) % 3 else 'succeeded'

    machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    outcomes = ['succeeded', 'aborted']
    with machine:
        smach.StateMachine.add(
            'LOOK', smach.CBState(lambda ud: 'succeeded', outcomes=outcomes), {'succeeded': 'PICK'}
        )
        smach.StateMachine.add('PICK', smach.CBState(pick, outcomes=outcomes))
    container = OracleContainer.wrap(machine, name='TOP', settings={'policy': 'escalating'})
    oracle_of(machine).waiting = NoWait()
    recorder = TrialRecorder(folder, warn=pytest.fail)
    recorder.attach(container)

    def put(event):
        if event.kind == EventKind.FAILURE:
            recorder.put(event.trial_id, TOPIC, replay(event))

    container.events.observers.append(put)
    for _ in range(TRIALS):
        machine.execute()
    assert recorder.close(20.0)


def replay(event):
    images = [CompressedImage(format='jpeg', data=bytes(9000)) for _ in range(60)]
    return FailureReplay(
        trial_id=event.trial_id, seq=event.seq, images=images, joints=[JointState(name=['a'])] * 9
    )


def has_replays(path):
    with rosbag.Bag(path) as bag:
        return bag.get_message_count(TOPIC) > 0


def said(monkeypatch, capsys, tmp_path, folder, main, *arguments):
    """What a command prints about the bags of a folder, with nothing kept of an earlier count."""
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / folder.name))
    monkeypatch.chdir(str(folder))
    assert main(['bags', *arguments]) == 0
    return capsys.readouterr().out.replace(str(folder), '')


@pytest.mark.parametrize(
    'main, arguments',
    [
        (bag_statistics.main, ['--by-state']),
        (what_if.main, ['--policy', 'prose', 'algorithm1']),
        (learn.main, []),
    ],
    ids=['bag_statistics', 'what_if', 'learn'],
)
def test_readers_say_the_same(folders, monkeypatch, capsys, tmp_path, main, arguments):
    bags = [str(folders / 'with' / 'bags' / name) for name in os.listdir(folders / 'with' / 'bags')]
    assert len(bags) == TRIALS and sum(map(has_replays, bags)) > TRIALS // 2
    with_replays, without = (
        said(monkeypatch, capsys, tmp_path, folders / name, main, *arguments)
        for name in ('with', 'without')
    )
    assert with_replays == without
    assert str(TRIALS) in without
