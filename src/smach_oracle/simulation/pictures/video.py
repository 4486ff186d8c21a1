"""A video that is written image by image (MP4)."""

from pathlib import Path
from typing import Optional

import cv2
import numpy as np


class VideoError(OSError):
    """A video cannot be written. The text says which and why."""


class VideoFile:
    """Gets images of one size, and writes them to a file.

    :param path: its name ends in .mp4. A file that is there is replaced.
    :param frames_s: images per s of the video.
    """

    def __init__(self, path: Path, frames_s: float) -> None:
        self._path = path
        self._frames_s = frames_s
        self._writer: Optional[cv2.VideoWriter] = None

    def add(self, image: np.ndarray) -> None:
        """Append an image, (h, w, 3) uint8 RGB.

        :raises VideoError: where the file cannot be written, or OpenCV has no codec for it.
        """
        if self._writer is None:
            height, width = image.shape[:2]
            self._writer = cv2.VideoWriter(
                str(self._path), cv2.VideoWriter.fourcc(*'mp4v'), self._frames_s, (width, height)
            )
            if not self._writer.isOpened():
                raise VideoError(
                    '{}: cannot be written, or OpenCV has no codec for it'.format(self._path)
                )
        self._writer.write(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))

    def close(self) -> None:
        """End the file. Without an image there is none."""
        if self._writer is not None:
            self._writer.release()
