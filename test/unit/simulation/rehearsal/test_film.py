"""A video of the robot is a file that other programs can show."""

import cv2
import numpy as np
import pytest

from smach_oracle.simulation.rehearsal import film
from smach_oracle.simulation.rehearsal.film import TASKS, main, write_video
from smach_oracle.simulation.rehearsal.pick_and_place import RehearsalResult


def test_a_video_has_the_frames_it_was_given(tmp_path):
    frames = [np.full((320, 480, 3), shade, np.uint8) for shade in (20, 120, 220)]
    path = str(tmp_path / 'robot.mp4')
    if not write_video(path, frames, 5.0):
        pytest.skip('this OpenCV has no codec for it')
    video = cv2.VideoCapture(path)
    shades = [int(video.read()[1].mean()) for _ in frames]
    assert shades == pytest.approx([20, 120, 220], abs=6) and not video.read()[0]


@pytest.mark.parametrize('argv', [['a.png', '--fps', '0'], ['a.png', '--seed', '-1'], []])
def test_wrong_arguments_are_named(argv, capsys):
    with pytest.raises(SystemExit):
        main(argv)
    assert 'usage' in capsys.readouterr().err


@pytest.mark.parametrize(
    'argv, words',
    [
        (['robot'], 'robot: what kind of file? Its name may end in .png, .jpg, .jpeg'),
        (['robot.gif'], 'robot.gif: what kind of file?'),
        (['robot.png', '--video', 'robot'], 'robot: what kind of file? Its name may end in .mp4'),
        (['nowhere/robot.png'], 'there is no folder'),
        (['robot.png', '--video', 'nowhere/robot.mp4'], 'nowhere/robot.mp4: there is no folder'),
    ],
)
def test_a_file_that_cannot_be_written_is_told_before_anything_is_filmed(
    argv, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(film, 'film', lambda *args: pytest.fail('filmed'))
    with pytest.raises(SystemExit) as caught:
        main(argv)
    assert caught.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    'failed, reason, words',
    [
        ('', '', 'seed 5: nothing was held for 2 s'),
        ('PICK', 'out of reach', 'seed 5: PICK failed: out of reach'),
    ],
)
def test_why_there_is_no_picture_is_told(failed, reason, words, monkeypatch, tmp_path, capsys):
    class Empty:
        def __init__(self, *args):
            self.picture = None

        def close(self):
            pass

    monkeypatch.setattr(film, 'FilmedWorld', Empty)
    monkeypatch.setattr(film, 'rehearse', lambda scene, world, steps: film_result(failed, reason))
    monkeypatch.setitem(
        TASKS, 'pick_and_place', TASKS['pick_and_place']._replace(draw=lambda seed, benign: None)
    )
    assert main([str(tmp_path / 'robot.png'), '--seed', '5']) == 1
    assert words in capsys.readouterr().err


def film_result(failed, reason):
    return RehearsalResult(5, failed, reason, False, '', (), {}, 0.0)
