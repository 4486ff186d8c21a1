"""A video of each trial, that costs no trial where it cannot be written."""
import cv2
import numpy as np
import pytest

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.simulation.node import trial_film
from smach_oracle.simulation.node.settings import read_settings
from smach_oracle.simulation.node.trial_film import EVERY, TrialFilm


@pytest.fixture
def film(tmp_path, monkeypatch):
    monkeypatch.setattr(trial_film, 'portrait',
                        lambda world, size: np.full((size[1], size[0], 3), world, np.uint8))
    return TrialFilm(tmp_path)


def frames_of(path):
    video, count = cv2.VideoCapture(str(path)), 0
    while video.read()[0]:
        count += 1
    return count


def test_each_trial_has_a_video_of_its_own_with_an_image_now_and_then(film, tmp_path):
    for seed, images in ((5, 3), (6, 2), (5, 1)):
        film.begin(seed)
        for _ in range(EVERY * images + 1):
            film.look(100)
    film.end()
    assert {path.name: frames_of(path) for path in tmp_path.iterdir()} == {
        '5.mp4': 3, '6.mp4': 2, '5_2.mp4': 1}


def test_a_video_that_cannot_be_written_is_told_once_and_the_trial_goes_on(film, tmp_path,
                                                                          monkeypatch):
    told = []
    monkeypatch.setattr(trial_film.rospy, 'logerr', lambda *words: told.append(words))
    monkeypatch.setattr(trial_film, 'VideoFile', Unwritable)
    film.begin(5)
    for _ in range(3 * EVERY):
        film.look(100)
    film.end()
    assert len(told) == 1 and 'no video' in told[0][0]


class Unwritable:
    def __init__(self, path, frames_s):
        self.path = path

    def add(self, image):
        raise OSError('{}: no space left'.format(self.path))


def test_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(SettingsError, match='~film: .*nowhere.* is not allowed; allowed: a folder'):
        read_settings(lambda name, usual: str(tmp_path / 'nowhere') if name == '~film' else usual)
