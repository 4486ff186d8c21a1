"""Videos of trials, for people: one for each, as seen from where one might stand."""
from pathlib import Path
from typing import Optional

import rospy

from ..physics.world import World
from ..pictures.portrait import portrait
from ..pictures.video import VideoFile
from .loop import PERIOD_S

FRAME = (480, 320)  # pixels
EVERY = 12  # control periods from one image to the next
SPEED = 2.0  # times the world's own: so a trial of the kitchen lasts about a minute


class TrialFilm:
    """Writes FOLDER/SEED.mp4 for each trial. A second trial of a seed has SEED_2.mp4.

    Time that passes in a leap, as while somebody thinks, is left out. A file that cannot be written
    is told once, and costs the trial nothing. An image takes about half a second of wall time.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._video: Optional[VideoFile] = None
        self._periods = 0

    def begin(self, seed: int) -> None:
        """End the last trial's video and begin another one."""
        self.end()
        number, path = 1, self._folder / '{}.mp4'.format(seed)
        while path.exists():
            number += 1
            path = self._folder / '{}_{}.mp4'.format(seed, number)
        self._video = VideoFile(path, SPEED / (EVERY * PERIOD_S))
        self._periods = 0

    def look(self, world: World) -> None:
        """Take an image where one is due. It is called after each control period."""
        self._periods += 1
        if self._video is None or self._periods % EVERY:
            return
        try:
            self._video.add(portrait(world, FRAME))
        except OSError as err:
            rospy.logerr('pr2_world: no video of this trial: %s', err)
            self._video = None

    def end(self) -> None:
        """End the video of the trial, if there is one."""
        video, self._video = self._video, None
        if video is not None:
            video.close()
