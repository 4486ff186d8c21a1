"""Videos of trials, for people: one for each, as seen from where one might stand."""

import queue
from pathlib import Path
from typing import Optional

import numpy as np
import rospy

from smach_oracle.msg import OracleEvent

from ..physics.world import World
from ..pictures.caption import Caption, captioned
from ..pictures.portrait import portrait
from ..pictures.video import VideoFile
from .film_story import told
from .loop import PERIOD_S
from .settings import NONE

FRAME = (480, 320)  # pixels, without caption
EVERY = 12  # control periods from one image to the next
SPEED = 2.0  # times the world's own: so a trial of the kitchen lasts about a minute
FRAMES_S = SPEED / (EVERY * PERIOD_S)  # images per s of the video
HELD_S = 2.5  # of the video, that it stands still for a caption


class TrialFilm:
    """Writes FOLDER/SEED.mp4 for each trial. A second trial of a seed has SEED_2.mp4.

    Time that passes in a leap, as while somebody thinks, is left out. A file that cannot be written
    is told once, and costs the trial nothing. An image takes about half a second of wall time.
    """

    def __init__(self, folder: Path, events: str = NONE) -> None:
        """Begin without a video.

        :param events: topic of the events of a machine, which captions below the images tell. NONE
            means no captions.
        """
        self._folder = folder
        self._video: Optional[VideoFile] = None
        self._periods = 0
        self._image: Optional[np.ndarray] = None  # the last one, without caption
        self._caption: Optional[Caption] = None if events == NONE else Caption('')
        self._events: 'queue.Queue[OracleEvent]' = queue.Queue()
        if events != NONE:
            rospy.Subscriber(events, OracleEvent, self.hear)

    def hear(self, event: OracleEvent) -> None:
        """Keep an event for the next image, in any thread."""
        self._events.put(event)

    def begin(self, seed: int) -> None:
        """End the last trial's video and begin another one."""
        self.end()
        number, path = 1, self._folder / '{}.mp4'.format(seed)
        while path.exists():
            number += 1
            path = self._folder / '{}_{}.mp4'.format(seed, number)
        self._video = VideoFile(path, FRAMES_S)
        self._periods = 0

    def look(self, world: World) -> None:
        """Take an image where one is due. It is called after each control period."""
        self._periods += 1
        if self._video is None or self._periods % EVERY:
            return
        self._tell()
        self._image = portrait(world, FRAME)
        self._add()

    def end(self) -> None:
        """End the video of the trial, if there is one."""
        self._tell()
        self._image = None
        if self._caption:
            self._caption = Caption('')
        video, self._video = self._video, None
        if video is not None:
            video.close()

    def _tell(self) -> None:
        """Go on to the caption of the last event. Hold the last image for those that hold."""
        while not self._events.empty():
            new = told(self._events.get())
            if new is None:
                continue
            self._caption = new.caption
            if new.holds:
                self._add(round(HELD_S * FRAMES_S))

    def _add(self, count: int = 1) -> None:
        """Append the image that was taken last, if there is one."""
        if self._image is None:
            return
        image = captioned(self._image, self._caption) if self._caption else self._image
        try:
            for _ in range(count):
                if self._video is not None:
                    self._video.add(image)
        except OSError as err:
            rospy.logerr('pr2_world: no video of this trial: %s', err)
            self._video = None
