"""An image of a camera at one moment: colour, registered depth, calibration and pose."""

from typing import NamedTuple

import numpy as np


class CameraImage(NamedTuple):
    """Colour with depth, and where the camera was. The base is the robot's base frame."""

    stamp: float  # s, ROS time
    colour: np.ndarray  # (h, w, 3) uint8, RGB
    # (h, w) m along the optical axis, registered to colour, or NaN where nothing was measured
    depth: np.ndarray
    intrinsics: np.ndarray  # (3, 3)
    base_from_camera: np.ndarray  # 4x4; camera: z forward, x right, y down; base: z up

    def stride(self, columns: int) -> int:
        """Return a step between columns (and rows) that leaves about so many columns."""
        return max(1, round(self.depth.shape[1] / columns))
