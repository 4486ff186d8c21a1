"""The bodies of a scene in a physics client, and the checks that a scene must pass before."""

import math
import os
import tempfile
import xml.etree.ElementTree as ElementTree
from typing import Dict, List, NamedTuple, Sequence

import numpy as np
import pybullet

from ..scenes.scene import Body, Scene
from .meshes import drum, egg, turned

RESERVED = ('robot', 'floor')  # names that no body of a scene may have
SHAPES = {
    'box': pybullet.GEOM_BOX,
    'cylinder': pybullet.GEOM_CYLINDER,
    'round': pybullet.GEOM_MESH,
    'cup': pybullet.GEOM_MESH,
    'bottle': pybullet.GEOM_MESH,
}
# radius and height of rings, as shares of the thing's extents
PROFILES = {
    'cup': ((0.34, -0.5), (0.5, 0.5)),
    'bottle': ((0.47, -0.5), (0.5, -0.45), (0.5, 0.0), (0.42, 0.22), (0.15, 0.5)),
}
FLOOR_COLOUR = (0.62, 0.60, 0.57, 1.0)
FLOOR_SIZE = 12.0  # m, of what is seen of it
TURNING_FRICTION = 0.002  # m, against spinning and rolling


class SceneBuildError(ValueError):
    """A scene that cannot be built. The text names the setting, its value and what is allowed."""


class PlacedBody(NamedTuple):
    """A body that stands in the world."""

    number: int  # in the physics client
    body: Body
    links: Dict[str, int]  # by name. -1 is the root
    joints: Dict[str, int]  # by name


def check_scene(scene: Scene) -> None:
    """Check a scene before it is built.

    :raises SceneBuildError: for a name that occurs twice, a number that is not finite, a size or a
        mass that cannot be.
    """
    seen: List[str] = []
    for body in scene.bodies:
        if not body.name or body.name in seen or body.name in RESERVED:
            raise SceneBuildError(
                'body {!r}: the name is empty, taken, or one of {}'.format(
                    body.name, ', '.join(RESERVED)
                )
            )
        seen.append(body.name)
        _check_body(body)
    if scene.goal.body and scene.goal.body not in seen:
        raise SceneBuildError(
            'the goal is about a body {!r} that is not in the scene; there: {}'.format(
                scene.goal.body, ', '.join(seen) or 'none'
            )
        )
    robot = scene.robot
    for name, values in (
        ('goal.position', scene.goal.position),
        ('robot.base', robot.base),
        ('robot.drive_error', robot.drive_error),
        ('robot.localisation_error', robot.localisation_error),
        ('robot.drive_bias', robot.drive_bias),
        ('robot.encoder_errors', [error for _, error in robot.encoder_errors]),
        ('robot.camera_error', robot.camera_error),
        ('camera', scene.camera),
    ):
        if not _finite(values):
            raise SceneBuildError('{} is {}; allowed: finite numbers'.format(name, tuple(values)))
    camera = scene.camera
    least = min(camera.noise, camera.brightness, camera.colour_noise, *scene.robot.drive_error)
    if least < 0 or not 0 <= camera.dropout <= 1:
        raise SceneBuildError(
            'camera {} or drive_error {}: a negative value, or a dropout outside 0 to 1'.format(
                tuple(scene.camera), scene.robot.drive_error
            )
        )


def _check_body(body: Body) -> None:
    if body.shape != 'urdf' and body.shape not in SHAPES:
        raise SceneBuildError(
            'body {!r}: shape is {!r}; allowed: {}'.format(
                body.name, body.shape, ', '.join(sorted(SHAPES) + ['urdf'])
            )
        )
    numbers = (*body.position, body.yaw, body.roll, body.pitch, *body.colour)
    if len(body.position) != 3 or not _finite(numbers):
        raise SceneBuildError(
            'body {!r}: position {}, angles or colour are not finite'.format(
                body.name, body.position
            )
        )
    if not (_finite((body.mass, body.friction)) and body.mass >= 0 and body.friction >= 0):
        raise SceneBuildError(
            'body {!r}: mass {} or friction {}; allowed: 0 or more'.format(
                body.name, body.mass, body.friction
            )
        )
    for joint, value in body.joints + body.joint_friction:
        if not _finite([value]):
            raise SceneBuildError(
                'body {!r}: joint {!r} is given {}; allowed: finite numbers'.format(
                    body.name, joint, value
                )
            )
    for joint, hinge in body.joint_closing:
        if not _finite(hinge) or min(hinge) <= 0:
            raise SceneBuildError(
                'body {!r}: joint {!r} closes with {}; allowed: above 0'.format(
                    body.name, joint, hinge
                )
            )
    if body.shape != 'urdf' and not (
        len(body.size) == 3 and _finite(body.size) and min(body.size) > 0
    ):
        raise SceneBuildError(
            'body {!r}: size is {}; allowed: three lengths above 0 m'.format(body.name, body.size)
        )


def add_floor(client: int) -> int:
    """The floor at z = 0. What is seen of it is a plate a millimetre below."""
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    seen = pybullet.createVisualShape(
        pybullet.GEOM_BOX,
        halfExtents=[FLOOR_SIZE / 2, FLOOR_SIZE / 2, 0.01],
        visualFramePosition=[0, 0, -0.011],
        rgbaColor=FLOOR_COLOUR,
        physicsClientId=client,
    )
    floor: int = pybullet.createMultiBody(0, shape, seen, physicsClientId=client)
    pybullet.changeDynamics(floor, -1, lateralFriction=0.8, physicsClientId=client)
    return floor


def add_body(client: int, body: Body) -> PlacedBody:
    """Put a body of a scene into the client.

    :raises SceneBuildError: where its model cannot be read, or has not the joints that are named.
    """
    turn = pybullet.getQuaternionFromEuler([body.roll, body.pitch, body.yaw])
    index = _load(client, body, turn) if body.shape == 'urdf' else _create(client, body, turn)
    links, joints = {'': -1}, {}
    for number in range(pybullet.getNumJoints(index, physicsClientId=client)):
        info = pybullet.getJointInfo(index, number, physicsClientId=client)
        joints[info[1].decode()] = number
        links[info[12].decode()] = number
    placed = PlacedBody(index, body, links, joints)
    for link in links.values():
        pybullet.changeDynamics(
            index,
            link,
            lateralFriction=body.friction,
            spinningFriction=TURNING_FRICTION,
            rollingFriction=TURNING_FRICTION,
            physicsClientId=client,
        )
    _set_joints(client, placed)
    return placed


def _create(client: int, body: Body, turn: Sequence[float]) -> int:
    solid: Dict[str, object] = {}
    seen: Dict[str, object] = {}
    if body.shape == 'box':
        half = [extent / 2 for extent in body.size]
        solid, seen = {'halfExtents': half}, {'halfExtents': half}
    elif body.shape in ('round', *PROFILES):
        file = egg() if body.shape == 'round' else turned(body.shape, PROFILES[body.shape])
        solid = seen = {'fileName': file, 'meshScale': list(body.size)}
    else:
        solid = {'radius': body.size[0], 'height': body.size[2]}
        seen = {'fileName': drum(), 'meshScale': list(body.size[:1] * 2 + body.size[2:])}
    shape = pybullet.createCollisionShape(SHAPES[body.shape], physicsClientId=client, **solid)
    skin = pybullet.createVisualShape(
        pybullet.GEOM_BOX if body.shape == 'box' else pybullet.GEOM_MESH,
        rgbaColor=[*body.colour, 1.0],
        physicsClientId=client,
        **seen,
    )
    index: int = pybullet.createMultiBody(
        body.mass, shape, skin, list(body.position), turn, physicsClientId=client
    )
    return index


def _load(client: int, body: Body, turn: Sequence[float]) -> int:
    try:
        ElementTree.fromstring(body.urdf)
    except ElementTree.ParseError as err:
        raise SceneBuildError(
            'body {!r}: its urdf cannot be read: {}'.format(body.name, err)
        ) from err
    handle, path = tempfile.mkstemp(suffix='.urdf')
    try:
        with os.fdopen(handle, 'w', encoding='utf-8') as file:
            file.write(body.urdf)
        index: int = pybullet.loadURDF(
            path,
            list(body.position),
            turn,
            useFixedBase=body.mass == 0,
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client,
        )
    except pybullet.error as err:
        raise SceneBuildError(
            'body {!r}: its urdf cannot be loaded: {}'.format(body.name, err)
        ) from err
    finally:
        os.unlink(path)
    return index


def _set_joints(client: int, placed: PlacedBody) -> None:
    """Set where its joints start, and their dry friction. Nothing else drives them."""
    friction = dict(placed.body.joint_friction)
    start = dict(placed.body.joints)
    for name in list(friction) + list(start) + [each[0] for each in placed.body.joint_closing]:
        if name not in placed.joints:
            raise SceneBuildError(
                'body {!r}: no joint {!r}; there: {}'.format(
                    placed.body.name, name, ', '.join(placed.joints) or 'none'
                )
            )
    for name, joint in placed.joints.items():
        pybullet.setJointMotorControl2(
            placed.number,
            joint,
            pybullet.VELOCITY_CONTROL,
            targetVelocity=0.0,
            force=friction.get(name, 0.0),
            physicsClientId=client,
        )
        if name in start:
            pybullet.resetJointState(placed.number, joint, start[name], physicsClientId=client)


def _finite(values: Sequence[float]) -> bool:
    try:
        return all(math.isfinite(value) for value in values)
    except TypeError:
        return False


def pose_of(position: Sequence[float], xyzw: Sequence[float]) -> np.ndarray:
    """4x4 of a position (m) and a unit quaternion (x, y, z, w), as PyBullet has them."""
    result = np.eye(4)
    result[:3, :3] = np.array(pybullet.getMatrixFromQuaternion(xyzw)).reshape(3, 3)
    result[:3, 3] = position
    return result
