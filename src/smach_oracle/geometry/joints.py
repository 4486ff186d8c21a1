"""The joints of a URDF, and how each moves the link that it carries: all kinematics begins here."""

import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np

from .transforms import from_rpy, skew

TURNING = ('revolute', 'continuous')
MOVING = TURNING + ('prismatic',)


class Mimic(NamedTuple):
    """A joint that follows another one: its position is multiplier * that of `joint` + offset."""

    joint: str
    multiplier: float
    offset: float  # rad or m


class Joint(NamedTuple):
    """A joint of a model, as its URDF has it."""

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray  # 4x4, parent from joint at zero
    axis: np.ndarray  # (3,), unit length, in the joint's frame
    lower: float  # rad or m, or -inf for a continuous joint
    upper: float  # likewise, or inf
    velocity: float  # rad/s or m/s, the limit, or inf where none is given
    # (3, 4, 4): the motion at q is parts[0] + sin q * parts[1] + cos q * parts[2], of a joint that
    # slides parts[0] + q * parts[1]
    parts: np.ndarray
    mimic: Optional[Mimic] = None  # None where it follows no other

    @property
    def moves(self) -> bool:
        """Whether it has a position: fixed joints have none, and others count as fixed."""
        return self.kind in MOVING

    @property
    def turns(self) -> bool:
        """Whether its position is an angle."""
        return self.kind in TURNING

    def motion(self, position: float) -> np.ndarray:
        """4x4: the joint's frame at zero from that at a position (rad or m)."""
        return moved(self.parts, self.turns, position) if self.moves else np.eye(4)

    def position(self, positions: Mapping[str, float]) -> float:
        """Return the position at which the joint stands, in rad or m.

        :param positions: rad or m by joint. A joint that is missing goes with the one that it
            mimics, else it stands at zero.
        """
        if self.name in positions:
            return positions[self.name]
        if self.mimic is None:
            return 0.0
        return self.mimic.multiplier * positions.get(self.mimic.joint, 0.0) + self.mimic.offset


def moved(
    parts: np.ndarray, turns: Union[bool, np.ndarray], q: Union[float, np.ndarray]
) -> np.ndarray:
    """Joints after their motion.

    :param parts: (3, ..., 4, 4), of each joint as `Joint.parts`, in whatever frame.
    :param turns: (...) whether the joint turns.
    :param q: (k, ...) or (...) rad or m.
    :returns: (k, ..., 4, 4) or (..., 4, 4), in the frame of `parts`.
    """
    along = np.where(turns, np.sin(q), q)[..., None, None]
    return parts[0] + along * parts[1] + np.asarray(np.cos(q))[..., None, None] * parts[2]


def placed_parts(joints: Sequence[Joint], places: Sequence[np.ndarray]) -> np.ndarray:
    """(3, n, 4, 4): the parts of n joints for `moved`, in the frames of their places.

    :param places: 4x4 each, any frame from the joint at zero.
    """
    placed = [[place @ part for part in joint.parts] for joint, place in zip(joints, places)]
    return np.array(placed).reshape(-1, 3, 4, 4).transpose(1, 0, 2, 3)


def read_joints(urdf: str) -> Dict[str, Joint]:
    """The joints of a URDF by the link that each of them carries.

    They are shared by all who ask for those of the same text: leave their arrays as they are.

    :raises ValueError: for text that is no URDF, or has no joints.
    """
    return dict(_joints_of(urdf))


@lru_cache(maxsize=4)
def _joints_of(urdf: str) -> Mapping[str, Joint]:
    """Return the joints of a description. They are kept, since planners ask for them repeatedly."""
    try:
        root = ElementTree.fromstring(urdf)
        joints = [_joint(element) for element in root.findall('joint')]
    except (ElementTree.ParseError, TypeError, ValueError) as err:
        raise ValueError('robot description: not a URDF: {}'.format(err)) from err
    if not joints:
        raise ValueError('robot description: it has no joints')
    return {joint.child: joint for joint in joints}


def origin_of(element: ElementTree.Element) -> np.ndarray:
    """4x4 of the <origin> of a joint, a shape or an inertia. The identity where it has none.

    :raises ValueError: where its place or its angles are not three numbers.
    """
    origin = element.find('origin')
    return from_rpy(_three_numbers(origin, 'xyz'), *_three_numbers(origin, 'rpy'))


def _joint(element: ElementTree.Element) -> Joint:
    axis, limit = element.find('axis'), element.find('limit')
    direction = np.array(_three_numbers(axis, 'xyz') if axis is not None else [1.0, 0.0, 0.0])
    direction = direction / max(float(np.linalg.norm(direction)), 1e-12)
    kind = element.get('type', '')
    lower, upper = (
        float(limit.get(end, 0.0)) if limit is not None else 0.0 for end in ('lower', 'upper')
    )
    velocity = float(limit.get('velocity', np.inf)) if limit is not None else np.inf
    if kind == 'continuous':
        lower, upper = -np.inf, np.inf
    return Joint(
        element.get('name', ''),
        kind,
        _link(element, 'parent'),
        _link(element, 'child'),
        origin_of(element),
        direction,
        lower,
        upper,
        velocity,
        _parts(kind, direction),
        _mimic(element),
    )


def _mimic(joint: ElementTree.Element) -> Optional[Mimic]:
    element = joint.find('mimic')
    if element is None:
        return None
    return Mimic(
        element.get('joint', ''),
        _number(element, 'multiplier', 1.0),
        _number(element, 'offset', 0.0),
    )


def _number(element: ElementTree.Element, name: str, default: float) -> float:
    text = element.get(name)
    try:
        return float(text) if text else default
    except ValueError:
        raise ValueError('{}="{}" is no number'.format(name, text)) from None


def _link(joint: ElementTree.Element, end: str) -> str:
    element = joint.find(end)
    if element is None:
        raise ValueError('joint {!r} has no <{}>'.format(joint.get('name', '')[:100], end))
    return element.get('link', '')


def _three_numbers(element: Optional[ElementTree.Element], name: str) -> List[float]:
    text = element.get(name) if element is not None else None
    numbers = [float(word) for word in text.split()] if text else [0.0, 0.0, 0.0]
    if len(numbers) != 3:
        raise ValueError('{}="{}" has not three numbers'.format(name, text))
    return numbers


def _parts(kind: str, axis: np.ndarray) -> np.ndarray:
    """(3, 4, 4), see Joint."""
    still, sine, cosine = np.eye(4), np.zeros((4, 4)), np.zeros((4, 4))
    if kind == 'prismatic':
        sine[:3, 3] = axis
    elif kind in TURNING:
        cross = skew(axis)
        sine[:3, :3] = cross
        cosine[:3, :3] = -cross @ cross
        still[:3, :3] += cross @ cross
    return np.array([still, sine, cosine])
