"""The last seconds before failures, out of bags: whole, bounded, and with hostile content."""

import json
import shutil
import tempfile

import console_case
import cv2
import numpy as np
from console_bags import bag_with_replays, images_of, replay_of
from genpy import Time
from sensor_msgs.msg import CompressedImage, JointState

from smach_oracle.analysis import bag_worker
from smach_oracle.analysis.bag_machines import read_machines
from smach_oracle.expert.console.graphs.layout_worker import LayoutWorker
from smach_oracle.expert.console.sensors.question_images import ImageStore
from smach_oracle.expert.console.trials import recorded_trials
from smach_oracle.expert.console.trials.bag_catalogue import BagCatalogue
from smach_oracle.expert.console.trials.recorded_trials import RecordedTrials
from smach_oracle.expert.console.web.sections import PageSections

JPEG = bytes(cv2.imencode('.jpg', np.full((24, 32, 3), 120, np.uint8))[1])


def opened(folder, *replays):
    """What the page gets of the one trial of a bag with such replays, and how it finds one."""
    bag_with_replays(str(folder), *replays)
    sections = PageSections()
    catalogue = BagCatalogue([str(folder)], sections)
    catalogue.scan()
    shown = RecordedTrials(catalogue, LayoutWorker(), ImageStore())
    number = sections.get('bags')['trials'][0]['number']
    return json.loads(shown.text(number)), shown


def frames(shown, number):
    return shown.find_replay(number).view['frames']


def test_each_failure_has_what_the_ones_before_it_hold_as_far_as_it_reaches_back(tmp_path):
    data, shown = opened(
        tmp_path,
        replay_of(3, 100.0, images_of(JPEG, 75.0, 99.0)),
        replay_of(7, 110.0, images_of(JPEG, 109.0, topic='/hand')),
    )
    assert sorted(data['replays']) == ['3', '7']
    assert frames(shown, data['replays']['3']) == [(0, -25.0), (0, -1.0)]
    assert frames(shown, data['replays']['7']) == [(0, -11.0), (1, -1.0)]
    assert shown.find_replay(data['replays']['7']).view['cameras'] == ['/eye', '/hand']
    assert shown.find_replay(10**6) is None


def test_joints_are_there_without_any_camera(tmp_path):
    states = {
        'joints_came': [Time.from_sec(98.0), Time.from_sec(99.0)],
        'joints': [JointState(name=['elbow'], position=[each]) for each in (0.5, float('nan'))],
    }
    data, shown = opened(tmp_path, replay_of(3, 100.0, {}, **states))
    joints = shown.find_replay(data['replays']['3']).view['joints']
    assert joints == [{'name': 'elbow', 'samples': [(-2.0, 0.5)]}]


def test_of_other_trials_and_with_nothing_in_it_there_is_none(tmp_path):
    other = replay_of(3, 100.0, images_of(JPEG, 99.0))
    other.trial_id = 'another'
    data, _ = opened(tmp_path, other, replay_of(4, 100.0, {}))
    assert data['replays'] == {} and data['events']


def test_what_makes_no_sense_is_left_out(tmp_path):
    wild = images_of(JPEG, 99.0, 98.0)
    wild['cameras'] = bytes([0, 200])  # there is no such camera
    data, shown = opened(
        tmp_path,
        replay_of(3, 100.0, wild),
        replay_of(4, 2.0**31, images_of(JPEG, 1.0), seconds=float('nan')),
        replay_of(5, 100.0, images_of(JPEG, 99.0), seconds=-1e300),
        replay_of(6, 100.0, images_of(JPEG, 99.0), seconds=1e300),
    )
    assert frames(shown, data['replays']['3']) == [(0, -1.0)]
    assert '4' not in data['replays']
    for kept in map(shown.find_replay, data['replays'].values()):
        json.dumps(kept.view, allow_nan=False)
        assert 1.0 <= kept.view['seconds'] <= 600.0


def test_images_and_their_number_are_bounded(tmp_path, monkeypatch):
    many = replay_of(3, 100.0, images_of(JPEG, *np.linspace(80, 99, 3000)))
    bag_with_replays(str(tmp_path), many, many)
    (path,) = tmp_path.glob('*.bag')
    assert [len(each.images) for each in read_machines(str(path)).replays] == [2400, 2400]
    monkeypatch.setattr(bag_worker, 'MOST_REPLAYED', 10 * len(JPEG))
    trial = read_machines(str(path)).replays
    kept = list(bag_worker._replays(trial, trial[0].trial_id))
    assert [len(fields[4]) for fields in kept] == [10, 0]


def test_they_go_with_their_trial(tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_trials, 'REMEMBERED', 1)
    for name in ('one', 'two'):
        replay = replay_of(3, 100.0, images_of(JPEG, 99.0))
        bag_with_replays(str(tmp_path / name), replay, trial_id=name)
    sections = PageSections()
    catalogue = BagCatalogue([str(tmp_path)], sections)
    catalogue.scan()
    shown = RecordedTrials(catalogue, LayoutWorker(), ImageStore())
    first, second = (
        json.loads(shown.text(each['number']))['replays']['3']
        for each in sections.get('bags')['trials']
    )
    assert shown.find_replay(first) is None and shown.find_replay(second)


class TestServed(console_case.ConsoleCase):
    def folders(self):
        place = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, place)
        bomb = cv2.imencode('.png', np.zeros((12000, 12000), np.uint8))[1].tobytes()
        images = images_of(JPEG, 97.0, 98.0, 99.0)
        images['images'][1:] = [
            CompressedImage(format='jpeg', data=each) for each in (b'no image', bomb)
        ]
        bag_with_replays(place, replay_of(3, 100.0, images))
        return [place]

    def test_sound_images_are_served_and_others_refused_with_a_sentence(self):
        self.catalogue.scan()
        cookie, info = self.sign_in('viewer')
        headers = {'Cookie': cookie, 'X_Xsrf': info['xsrf']}
        trial = self.sections.get('bags')['trials'][0]['number']
        recorded = json.loads(self.ask('/recorded/{}'.format(trial), **headers).body)
        path = '/replay/{}'.format(recorded['replays']['3'])
        view = json.loads(self.ask(path, **headers).body)
        assert [time_s for _, time_s in view['frames']] == [-3.0, -2.0, -1.0]
        sound, broken, bomb, gone = (
            self.ask('{}/{}'.format(path, frame), **headers) for frame in range(4)
        )
        assert sound.code == 200 and sound.headers['Content-Type'] == 'image/jpeg'
        assert sound.body != JPEG, 'it is encoded again'
        assert (broken.code, bomb.code, gone.code) == (422, 422, 404)
        assert self.ask(path).code == 401
