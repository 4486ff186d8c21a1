"""The truth for an expert: the bodies as they are, and where the camera has them."""

import xml.etree.ElementTree as ElementTree
from typing import Dict, List, NamedTuple, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from scipy.spatial import ConvexHull, QhullError
from sensor_msgs.msg import RegionOfInterest
from std_msgs.msg import Header

from smach_oracle.geometry.depth import pixels_of
from smach_oracle.geometry.joints import origin_of
from smach_oracle.geometry.transforms import inverse, quaternion
from smach_oracle.msg import RevealedBody
from smach_oracle.pr2.robot import BASE_FRAME

from ..physics.camera import RenderedView, camera_pose, intrinsics_of, size_of
from ..physics.world import World
from ..scenes.fridge import DOOR_JOINT

PARTS = {'door': 'box', 'handle': 'cylinder'}  # of a door's link: the first shape of each kind


class _BodyPart(NamedTuple):
    """A body, or a part of one."""

    body: str  # in the world
    pose: np.ndarray  # 4x4, the world from its centre
    size: np.ndarray  # (3,) m. 0 means not known


def reveal(world: World, names: Sequence[str], stamp: rospy.Time) -> List[RevealedBody]:
    """The bodies of these names, or all.

    :raises ValueError: for a name that is not there, with those that are.
    """
    parts = _body_parts(world)
    unknown = [name for name in names if name not in parts]
    if unknown:
        raise ValueError(
            'no body {!r} in this scene; there: {}'.format(unknown[0], ', '.join(parts) or 'none')
        )
    seen = RenderedView(world, camera_pose(world), size_of(world)).bodies
    return [_message(world, name, parts[name], seen, stamp) for name in names or parts]


def _body_parts(world: World) -> Dict[str, _BodyPart]:
    found = {}
    for name in world.body_names:
        body = world.body(name)
        size = np.array(body.size) * ([2, 2, 1] if body.shape == 'cylinder' else [1, 1, 1])
        found[name] = _BodyPart(
            name, world.body_pose(name), np.zeros(3) if body.shape == 'urdf' else size
        )
        if dict(body.joint_friction).get(DOOR_JOINT) is not None:
            for part, (pose, extent) in _door_parts(body.urdf).items():
                found[part] = _BodyPart(name, world.body_pose(name, 'door') @ pose, extent)
    return found


def _door_parts(urdf: str) -> Dict[str, Tuple[np.ndarray, np.ndarray]]:
    """Pose in the door's link, and size, of the door and its handle."""
    parts = {}
    for name, shape in PARTS.items():
        for part in ElementTree.fromstring(urdf).findall("./link[@name='door']/visual"):
            solid = part.find('geometry/' + shape)
            if solid is not None:
                parts[name] = (origin_of(part), _extent(solid))
                break
    return parts


def _extent(solid: ElementTree.Element) -> np.ndarray:
    if solid.tag == 'box':
        return np.array([float(word) for word in solid.get('size', '0 0 0').split()])
    across = 2 * float(solid.get('radius', 0))
    return np.array([across, across, float(solid.get('length', 0))])


def _message(
    world: World, name: str, part: _BodyPart, seen: np.ndarray, stamp: rospy.Time
) -> RevealedBody:
    pose = inverse(world.true_base()) @ part.pose
    body = world.body(part.body)
    region, visible = _region(world, part, seen) if part.size.any() else (RegionOfInterest(), 0.0)
    return RevealedBody(
        name=name,
        size=Vector3(*part.size),
        movable=name in world.movable(),
        region=region,
        visible=visible,
        pose=PoseStamped(
            Header(stamp=stamp, frame_id=BASE_FRAME),
            Pose(Point(*pose[:3, 3]), Quaternion(*quaternion(pose))),
        ),
        held=world.holding(part.body) if name == part.body else '',
        angle=world.body_joint(part.body, DOOR_JOINT)
        if DOOR_JOINT in dict(body.joint_friction)
        else 0.0,
    )


def _region(world: World, part: _BodyPart, seen: np.ndarray) -> Tuple[RegionOfInterest, float]:
    """Return where the camera has it, and the share of its outline that nothing hides."""
    corners = np.array(np.meshgrid(*([[-0.5, 0.5]] * 3))).reshape(3, 8).T * part.size
    camera = camera_pose(world)
    points = corners @ part.pose[:3, :3].T + part.pose[:3, 3]
    pixels = pixels_of(points, intrinsics_of(world), camera)
    if (pixels[:, 2] <= 0).any():
        return RegionOfInterest(), 0.0
    width, height = size_of(world)
    left, top = np.maximum(np.floor(pixels[:, :2].min(axis=0)).astype(int), 0)
    right, bottom = np.minimum(
        np.ceil(pixels[:, :2].max(axis=0)).astype(int), (width - 1, height - 1)
    )
    if right < left or bottom < top:
        return RegionOfInterest(), 0.0
    window = seen[top : bottom + 1, left : right + 1]
    own = [index for index in np.unique(window) if world.seen_as(int(index)) == part.body]
    rows, columns = np.nonzero(np.isin(window, own))
    if not len(rows):
        return RegionOfInterest(), 0.0
    outline = _area(pixels[:, :2])
    return (
        RegionOfInterest(
            x_offset=int(left + columns.min()),
            y_offset=int(top + rows.min()),
            width=int(np.ptp(columns)) + 1,
            height=int(np.ptp(rows)) + 1,
        ),
        float(min(1.0, len(rows) / max(outline, 1.0))),
    )


def _area(points: np.ndarray) -> float:
    """Return the area within the outline of points (n, 2), pixels."""
    try:
        return float(ConvexHull(points).volume)
    except QhullError:  # all on a line
        return 0.0
