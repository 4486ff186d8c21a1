"""The errors of the robot's own measures: encoders and the head camera's mounting.

They are those of one trial, fixed for its time. Their size is what remains on a PR2 after its
bundle adjustment (V. Pradeep, K. Konolige, E. Berger, "Calibrating a multi-arm multi-sensor robot",
ISER 2010, calibrates joint offsets and camera poses together): all of it together takes a hand that
goes to what the camera sees there up to about 1 cm off.
"""

from typing import Tuple

import numpy as np

from smach_oracle.pr2.robot import ARM_JOINTS, ARMS

from .chance import generator_for

ENCODER_SIGMA = 0.0015  # rad
CAMERA_SIGMA = (0.003, 0.0025)  # m along each axis, rad about each
MOST = 2.0  # sigmas: worse than that and it would be calibrated again
JOINTS = tuple(name for arm in ARMS for name in ARM_JOINTS[arm]) + (
    'head_pan_joint',
    'head_tilt_joint',
)


def encoder_errors(seed: int) -> Tuple[Tuple[str, float], ...]:
    """Draw how much too high the joints of arms and head read, rad by joint."""
    return encoder_errors_of(
        generator_for(seed, 'encoder_errors').normal(0.0, 1.0, len(JOINTS)).clip(-MOST, MOST)
    )


def encoder_errors_of(sigmas: np.ndarray) -> Tuple[Tuple[str, float], ...]:
    """Likewise, by how many sigmas each of JOINTS is off."""
    return tuple((name, ENCODER_SIGMA * float(each)) for name, each in zip(JOINTS, sigmas))


def camera_error(seed: int) -> Tuple[float, float, float, float, float, float]:
    """Draw how the camera sits, from where the URDF has it: m, then rad of roll, pitch, yaw."""
    return camera_error_of(
        generator_for(seed, 'camera_error').normal(0.0, 1.0, 6).clip(-MOST, MOST)
    )


def camera_error_of(sigmas: np.ndarray) -> Tuple[float, float, float, float, float, float]:
    """Likewise, by how many sigmas each of the six is off."""
    x, y, z = (CAMERA_SIGMA[0] * sigmas[:3]).tolist()
    roll, pitch, yaw = (CAMERA_SIGMA[1] * sigmas[3:]).tolist()
    return x, y, z, roll, pitch, yaw
