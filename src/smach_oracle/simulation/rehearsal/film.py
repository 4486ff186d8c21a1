"""A picture and a video of the robot at work, for people: a trial in one process, without ROS."""

import argparse
import sys
from pathlib import Path
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np

from smach_oracle.oracle.settings.paths import path_of, why_not_writable

from ..physics.world import World
from ..pictures.portrait import portrait
from ..pictures.video import VideoError, VideoFile
from ..scenes import kitchen_scene, tabletop_scene
from ..scenes.scene import Scene
from .drink_retrieval import DrinkRetrievalRehearsal
from .pick_and_place import PickAndPlaceRehearsal, Rehearsal, rehearse

FRAME = (480, 320)  # pixels, of the video
PICTURE = (960, 640)
PICTURES, VIDEOS = ('.png', '.jpg', '.jpeg'), ('.mp4',)  # how the names of files end
PERIODS_S = 60  # control periods in a simulated second


class FilmedTask(NamedTuple):
    """A task, and the moment for its picture."""

    draw: Callable[[int, bool], Scene]
    steps: Callable[[World], Rehearsal]
    carried_s: float  # of simulated time, for which something has been in the hand
    seed: int  # of a scene that looks good


TASKS = {
    'pick_and_place': FilmedTask(tabletop_scene.draw, PickAndPlaceRehearsal, 2.0, 23),
    'drink_retrieval': FilmedTask(kitchen_scene.draw, DrinkRetrievalRehearsal, 3.2, 600),
}


class FilmedWorld(World):
    """A world of which images are taken while its time goes on."""

    def __init__(self, frames_s: float, carried_s: float) -> None:
        """Begin with an empty world.

        :param frames_s: images of the video per simulated s. 0 means no video.
        :param carried_s: simulated s for which something must have been carried when the picture is
            taken.
        """
        self._carried = int(round(carried_s * PERIODS_S))
        self._every = int(round(PERIODS_S / frames_s)) if frames_s else 0
        self._held = 0  # control periods for which something has been in a hand
        self._count = 0
        self.shots: List[np.ndarray] = []  # (h, w, 3) uint8 RGB
        self.picture: Optional[np.ndarray] = None  # when something has been carried for a while
        super().__init__()
        self.shots.clear()  # it has begun with a scene of its own

    def step(self, count: int = 1) -> None:
        """See World."""
        for _ in range(count):
            super().step(1)
            self._count += 1
            if self._every and self._count % self._every == 0:
                self.shots.append(portrait(self, FRAME))
            self._watch()

    def _watch(self) -> None:
        if self._count % 10 or self.picture is not None:
            return
        self._held = self._held + 10 if any(map(self.holding, self.movable())) else 0
        if self._held >= self._carried:
            self.picture = portrait(self, PICTURE)


def film(task: FilmedTask, seed: int, frames_s: float) -> Tuple[np.ndarray, List[np.ndarray]]:
    """The picture and the images of one trial, each (h, w, 3) uint8 RGB.

    :param frames_s: images per simulated s. 0 means none.
    :raises RuntimeError: where nothing was carried in it.
    """
    world = FilmedWorld(frames_s, task.carried_s)
    try:
        done = rehearse(task.draw(seed, True), world, task.steps)
        if world.picture is None:
            why = (
                '{} failed: {}'.format(done.failed, done.reason)
                if done.failed
                else ('nothing was held for {:g} s'.format(task.carried_s))
            )
            raise RuntimeError('seed {}: {}'.format(seed, why))
        return world.picture, world.shots
    finally:
        world.close()


def write_video(path: str, frames: List[np.ndarray], frames_s: float) -> bool:
    """Write images, (h, w, 3) uint8 RGB, one at least, as a video.

    :param frames_s: images per s.
    :returns: whether this OpenCV can.
    """
    video = VideoFile(Path(path), frames_s)
    try:
        for frame in frames:
            video.add(frame)
    except VideoError:
        return False
    video.close()
    return Path(path).stat().st_size > 0


def check_file(path: str, suffixes: Sequence[str]) -> None:
    """Check before the work that a picture or a video can be written.

    :raises ValueError: for another suffix, or a file that cannot be written.
    """
    if not path.lower().endswith(tuple(suffixes)):
        raise ValueError(
            '{}: what kind of file? Its name may end in {}'.format(path, ', '.join(suffixes))
        )
    why = why_not_writable(path)
    if why:
        raise ValueError('{}: {}'.format(path, why))


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog='pr2_film', description=__doc__)
    parser.add_argument(
        'picture', type=path_of, help='file of the picture ({})'.format(', '.join(PICTURES))
    )
    parser.add_argument(
        '--video',
        metavar='FILE',
        type=path_of,
        help='also write a video ({}), at simulated time'.format(', '.join(VIDEOS)),
    )
    parser.add_argument(
        '--fps', type=float, default=5.0, help='frames of the video per simulated s (default: 5)'
    )
    parser.add_argument(
        '--task', choices=sorted(TASKS), default='pick_and_place', help='(default: %(default)s)'
    )
    parser.add_argument('--seed', type=int, help='of the scene (default: one that looks good)')
    args = parser.parse_args(argv)
    task = TASKS[args.task]
    seed = task.seed if args.seed is None else args.seed
    if not 0.5 <= args.fps <= 60 or seed < 0:
        parser.error('--fps must be from 0.5 to 60, --seed 0 or more')
    try:
        check_file(args.picture, PICTURES)
        if args.video:
            check_file(args.video, VIDEOS)
    except ValueError as err:
        parser.error(str(err))
    try:
        picture, frames = film(task, seed, args.fps if args.video else 0.0)
    except RuntimeError as err:
        print('pr2_film: {}'.format(err), file=sys.stderr)
        return 1
    if not cv2.imwrite(args.picture, cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)):
        print('pr2_film: {}: cannot be written'.format(args.picture), file=sys.stderr)
        return 1
    print('Picture: {}'.format(args.picture))
    if args.video:
        print(
            'Video: {}'.format(
                args.video if write_video(args.video, frames, args.fps) else 'no codec here for one'
            )
        )
    return 0
