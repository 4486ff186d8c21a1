"""A video of each trial, that costs no trial where it cannot be written, and tells what happens."""

import cv2
import numpy as np
import pytest

from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.simulation.node import trial_film
from smach_oracle.simulation.node.film_story import told
from smach_oracle.simulation.node.settings import read_settings
from smach_oracle.simulation.node.trial_film import EVERY, FRAME, FRAMES_S, HELD_S, TrialFilm
from smach_oracle.simulation.pictures.caption import BLUE, GREEN, HEIGHT, RED, Caption, strip

TOPIC = 'robot/oracle/events'
HELD = round(HELD_S * FRAMES_S)  # images


@pytest.fixture
def film(tmp_path, monkeypatch):
    monkeypatch.setattr(
        trial_film, 'portrait', lambda world, size: np.full((size[1], size[0], 3), world, np.uint8)
    )
    return TrialFilm(tmp_path)


@pytest.fixture
def told_film(film, tmp_path, monkeypatch):
    """A film with captions, without ROS."""
    heard = []
    monkeypatch.setattr(trial_film.rospy, 'Subscriber', lambda *args: heard.append(args))
    one = TrialFilm(tmp_path, TOPIC)
    assert heard == [(TOPIC, OracleEvent, one.hear)]
    return one


def images_of(path):
    video, images = cv2.VideoCapture(str(path)), []
    while True:
        there, image = video.read()
        if not there:
            return images
        images.append(image[..., ::-1])


def look(film, images, shade=100):
    for _ in range(EVERY * images):
        film.look(shade)


def event(kind, **fields):
    return OracleEvent(kind=getattr(OracleEvent, kind), state='PICK', **fields)


def test_each_trial_has_a_video_of_its_own_with_an_image_now_and_then(film, tmp_path):
    for seed, images in ((5, 3), (6, 2), (5, 1)):
        film.begin(seed)
        look(film, images)
        film.look(100)
    film.end()
    assert {path.name: len(images_of(path)) for path in tmp_path.iterdir()} == {
        '5.mp4': 3,
        '6.mp4': 2,
        '5_2.mp4': 1,
    }
    assert images_of(tmp_path / '6.mp4')[0].shape == (FRAME[1], FRAME[0], 3)


def test_the_film_stands_still_for_a_failure_and_then_shows_the_next_state(told_film, tmp_path):
    told_film.begin(5)
    told_film.hear(event('STATE_START'))
    look(told_film, 2)
    told_film.hear(event('FAILURE', text='closed on nothing'))
    told_film.hear(event('STATE_START'))
    look(told_film, 1, shade=200)
    told_film.hear(event('TRIAL_END', outcome='succeeded'))
    told_film.end()
    images = images_of(tmp_path / '5.mp4')
    assert len(images) == 2 + HELD + 1 + HELD
    captions = [Caption('PICK')] * 2 + [Caption('PICK failed', 'closed on nothing', RED)] * HELD
    captions += [Caption('PICK')] + [Caption('End of the trial', 'succeeded', GREEN)] * HELD
    shades = [100] * (2 + HELD) + [200] * (1 + HELD)
    for image, caption, shade in zip(images, captions, shades):
        assert image.shape == (FRAME[1] + HEIGHT, FRAME[0], 3)
        assert image[: FRAME[1] - 20].mean() == pytest.approx(shade, abs=6)
        drawn = strip(caption, FRAME[0]).astype(int)
        assert np.abs(image[FRAME[1] :] - drawn).mean() < 6


def test_a_trial_does_not_begin_with_the_words_of_the_last_one(told_film, tmp_path):
    for seed in (5, 6):
        told_film.begin(seed)
        look(told_film, 1)
        told_film.hear(event('TRIAL_END', outcome='aborted'))
    told_film.end()
    first = images_of(tmp_path / '6.mp4')[0]
    assert np.abs(first[FRAME[1] :].astype(int) - strip(Caption(''), FRAME[0])).mean() < 6


def test_what_is_told_before_the_first_image_is_not_lost_nor_waited_for(told_film, tmp_path):
    told_film.begin(5)
    told_film.hear(event('DECISION', text='going back to LOOK'))
    look(told_film, 1)
    told_film.end()
    (image,) = images_of(tmp_path / '5.mp4')
    drawn = strip(Caption('Oracle', 'going back to LOOK', BLUE), FRAME[0]).astype(int)
    assert np.abs(image[FRAME[1] :] - drawn).mean() < 6


@pytest.mark.parametrize(
    'given, heading, detail',
    [
        (event('STATE_START'), 'PICK', ''),
        (event('FAILURE', outcome='aborted'), 'PICK failed', 'aborted'),
        (
            event('FAILURE', text='Traceback:\n  line 1\nKeyError: no arm\n'),
            'PICK failed',
            'KeyError: no arm',
        ),
        (event('PRECONDITION_START', target='LOOK'), 'Oracle', 'LOOK, a precondition of PICK'),
        (
            event('QUERY_ANSWERED', by='ann', outcome='goto', target='LOOK'),
            'Answer of ann',
            'go on with LOOK',
        ),
        (event('QUERY_ANSWERED', outcome='give_up'), 'Answer of an expert', 'give up'),
        (event('TRIAL_END', text='stopped'), 'End of the trial', 'stopped'),
    ],
)
def test_the_words_of_a_caption(given, heading, detail):
    assert told(given).caption[:2] == (heading, detail)


def test_of_most_events_nothing_is_told():
    assert told(event('TRANSITION')) is None


@pytest.mark.parametrize(
    'detail, lines',
    [('', 0), ('short', 1), ('a few words ' * 8, 2), ('a few words ' * 30, 2), ('é' * 500, 2)],
)
def test_a_caption_fits_the_image_however_long_it_is(detail, lines):
    drawn = strip(Caption('PICK', detail), FRAME[0])
    assert drawn.shape == (HEIGHT, FRAME[0], 3)
    assert (drawn[:, -4:] == 255).all()
    inked = (drawn[26:, 18:] < 128).any(axis=(1, 2))
    assert inked[:18].any() == (lines > 0) and inked[18:].any() == (lines > 1)


def test_a_video_that_cannot_be_written_is_told_once_and_the_trial_goes_on(
    film, tmp_path, monkeypatch
):
    told = []
    monkeypatch.setattr(trial_film.rospy, 'logerr', lambda *words: told.append(words))
    monkeypatch.setattr(trial_film, 'VideoFile', Unwritable)
    film.begin(5)
    look(film, 3)
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


@pytest.mark.parametrize('name', ['', 'two words', 7])
def test_a_topic_that_cannot_be_is_refused(name):
    with pytest.raises(SettingsError, match='~film_events: .*allowed: the name of a topic'):
        read_settings(lambda key, usual: name if key == '~film_events' else usual)
