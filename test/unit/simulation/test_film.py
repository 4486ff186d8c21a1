"""A video of the robot is a file that other programs can show."""
import cv2
import numpy as np
import pytest

from smach_oracle.simulation.world.film import main, write_video


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
