"""doc/draw_trial.py: from the film of a trial it draws the failure, the recovery and the end."""

import sys

import cv2
import numpy as np
import pytest
from house import ROOT

from smach_oracle.simulation.pictures.caption import BLUE, GREEN, HEIGHT, RED, Caption, captioned
from smach_oracle.simulation.pictures.video import VideoFile

sys.path.insert(0, str(ROOT / 'doc'))
draw = pytest.importorskip('draw_trial')
pytest.importorskip('PIL')

PICTURES = ('drink_failure', 'drink_recovered', 'drink_handed_over')
STORY = [
    (Caption(''), 3),
    (Caption('PICK_DRINK'), 6),
    (Caption('PICK_DRINK failed', 'gone', RED), 8),
    (Caption('Oracle', 'trying it again', BLUE), 8),
    (Caption('PICK_DRINK'), 6),
    (Caption('MOVE_OUT'), 3),
    (Caption('HAND_OVER'), 6),
    (Caption('End of the trial', 'succeeded', GREEN), 8),
]


def film_of(story, path):
    """A square moves to the right. It stands still where the caption has a colour."""
    video, x = VideoFile(path, 10.0), 10
    for caption, count in story:
        for _ in range(count):
            x += 0 if caption.detail else 8
            image = np.full((320, 480, 3), 120, np.uint8)
            image[100:180, x : x + 80] = (200, 30, 30)
            video.add(captioned(image, caption))
    video.close()
    return str(path)


def test_a_film_gives_the_pictures_and_what_stands_still_is_shown_as_long(tmp_path):
    from PIL import Image

    draw.draw(film_of(STORY, tmp_path / '5.mp4'), str(tmp_path))
    failed, recovered, ended = (cv2.imread(str(tmp_path / (name + '.png'))) for name in PICTURES)
    for image, colour in ((failed, RED), (ended, GREEN)):
        assert image[-HEIGHT:, :4].mean(axis=(0, 1))[::-1] == pytest.approx(colour, abs=20)
    assert draw.during([recovered[..., ::-1]], 'MOVE_OUT') == [0]
    moving = Image.open(str(tmp_path / 'drink_retrieval.gif'))
    shown_ms = []
    for number in range(moving.n_frames):
        moving.seek(number)
        shown_ms.append(moving.info['duration'])
    # the codec may split an image that stands still in two
    assert sum(each for each in shown_ms if each > 100) == pytest.approx(3 * 800, abs=310)
    assert len(shown_ms) == pytest.approx(3 + 21 / draw.FASTER, abs=4)


@pytest.mark.parametrize('left_out', [2, 5, 6, 7])
def test_a_trial_that_went_otherwise_is_not_drawn(left_out, tmp_path):
    story = STORY[:left_out] + STORY[left_out + 1 :]
    with pytest.raises(AssertionError, match='no failure, or|no recovery, or'):
        draw.draw(film_of(story, tmp_path / '5.mp4'), str(tmp_path))
    assert not list(tmp_path.glob('*.png'))


def test_the_pictures_of_the_documentation_are_there_and_small():
    data = (ROOT / 'doc/images/drink_retrieval.gif').read_bytes()
    assert data.startswith(b'GIF89a') and data.count(b'\x00\x21\xf9\x04') >= 50, 'frames'
    assert len(data) < draw.MOST_BYTES_MOVING
    for name in PICTURES:
        path = ROOT / 'doc/images' / (name + '.png')
        assert cv2.imread(str(path)).shape == (320 + HEIGHT, 480, 3)
        assert path.stat().st_size < draw.MOST_BYTES
