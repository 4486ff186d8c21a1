"""A robot's looks, from its URDF: the shapes of its links, and how the links connect.

Anybody on the robot's network may have set a robot description. So its size, its number of parts
and its numbers are checked, and document types (with them entities) and circles of links are
refused.
"""

import math
import xml.etree.ElementTree as ElementTree
from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from .joints import Joint, Mimic, read_joints
from .links import link_poses
from .transforms import from_rpy
from .xml_text import read_xml

MOST_CHARACTERS = 8000000
MOST_LINKS = 2000
MOST_SHAPES = 2000
FURTHEST = 1e4  # m, of any part from its parent
GREY = (168, 174, 184)

Colour = Tuple[int, int, int]


class Shape(NamedTuple):
    """A part of a link."""

    link: str
    kind: str  # box, cylinder, sphere or mesh
    origin: np.ndarray  # 4x4, link from shape
    size: np.ndarray  # (3,): m, extents. Of a mesh the factors by which it is scaled
    mesh: str  # file name as the URDF has it, or '' for others
    colour: Colour


class RobotShapes(NamedTuple):
    """A robot to draw."""

    name: str
    root: str  # the link on which all others hang
    joints: List[Joint]  # every link's after that of the link that it hangs on
    shapes: List[Shape]  # as the robot looks. Where a link has no looks, what it collides with
    # of links that have looks: what may stand for a mesh that cannot be had
    collisions: List[Shape]

    @property
    def links(self) -> List[str]:
        """The root first, the others in the order of `joints`."""
        return [self.root] + [joint.child for joint in self.joints]

    def poses(self, positions: Mapping[str, float]) -> Dict[str, np.ndarray]:
        """4x4 by link: the root from it.

        :param positions: rad or m by joint. Joints that are missing go with those that they mimic,
            or stand at zero.
        """
        return link_poses(self.joints, self.root, positions)


def read_shapes(urdf: str) -> RobotShapes:
    """A robot to draw, from its URDF.

    :raises ValueError: for text that is not a URDF, or too large a one, with what is wrong with it.
    """
    root = read_xml(urdf, 'robot description', MOST_CHARACTERS)
    elements = root.findall('link')
    if root.tag != 'robot' or not elements:
        raise ValueError(
            'robot description: a URDF begins with <robot> and has a <link>; this one with <{}> '
            'and {} '
            'links'.format(root.tag[:40], len(elements))
        )
    if max(len(elements), len(root.findall('joint'))) > MOST_LINKS:
        raise ValueError('robot description: more than {} links or joints'.format(MOST_LINKS))
    by_child = read_joints(urdf) if root.find('joint') is not None else {}
    names = [element.get('name', '') for element in elements]
    joints, base = _ordered(by_child, names)
    known = _materials(root)
    try:
        shapes, collisions = _all_shapes(elements, known)
    except (TypeError, AttributeError) as err:
        raise ValueError('robot description: not a URDF: {}'.format(err)) from err
    return RobotShapes(root.get('name', '')[:200], base, joints, shapes, collisions)


def _ordered(by_child: Mapping[str, Joint], names: List[str]) -> Tuple[List[Joint], str]:
    """The joints from the root outwards, and the root."""
    below: Dict[str, List[Joint]] = {}
    for joint in by_child.values():
        if not (
            np.isfinite(joint.origin).all()
            and np.isfinite(joint.axis).all()
            and np.abs(joint.origin).max() < FURTHEST
        ):
            raise ValueError(
                'robot description: joint {!r} has an invalid place or axis'.format(
                    joint.name[:100]
                )
            )
        if joint.mimic is not None and not _is_finite(joint.mimic):
            raise ValueError(
                'robot description: joint {!r} mimics another by a number that is not finite, '
                'or not below {:g}'.format(joint.name[:100], FURTHEST)
            )
        below.setdefault(joint.parent, []).append(joint)
    roots = [name for name in names if name not in by_child]
    if len(roots) != 1:
        raise ValueError(
            'robot description: {}; exactly one link must hang on no other'.format(
                'the links go round in a circle'
                if not roots
                else '{} links hang on no other: {}'.format(len(roots), ', '.join(roots)[:200])
            )
        )
    ordered: List[Joint] = []
    waiting = list(below.get(roots[0], []))
    while waiting:
        joint = waiting.pop(0)
        ordered.append(joint)
        waiting.extend(below.get(joint.child, []))
    lost = sorted(set(by_child) - {joint.child for joint in ordered})
    if lost:
        raise ValueError(
            'robot description: {} does not hang on {}, by whatever way'.format(
                ', '.join(lost)[:200], roots[0][:100]
            )
        )
    return ordered, roots[0]


def _is_finite(mimic: Mimic) -> bool:
    return all(abs(number) < FURTHEST for number in (mimic.multiplier, mimic.offset))


def _all_shapes(
    elements: List[ElementTree.Element], known: Mapping[str, Colour]
) -> Tuple[List[Shape], List[Shape]]:
    looks: List[Shape] = []
    spare: List[Shape] = []
    for link in elements:
        seen = [_shape(link, each, known) for each in link.findall('visual')]
        solid = [_shape(link, each, known) for each in link.findall('collision')]
        looks += seen or solid
        spare += solid if seen else []
        if len(looks) + len(spare) > MOST_SHAPES:
            raise ValueError('robot description: more than {} shapes'.format(MOST_SHAPES))
    return looks, spare


def _shape(
    link: ElementTree.Element, element: ElementTree.Element, known: Mapping[str, Colour]
) -> Shape:
    name = link.get('name', '')
    geometry = element.find('geometry')
    kind = next((each.tag for each in geometry), '') if geometry is not None else ''
    where = 'robot description: link {!r}'.format(name[:100])
    if geometry is None or kind not in ('box', 'cylinder', 'sphere', 'mesh', 'capsule'):
        raise ValueError(
            '{}: a shape is a box, cylinder, sphere or mesh, not {!r}'.format(where, kind[:40])
        )
    found = geometry[0]
    origin = element.find('origin')
    place = from_rpy(_numbers(where, origin, 'xyz'), *_numbers(where, origin, 'rpy'))
    if kind == 'box':
        size = _numbers(where, found, 'size')
    elif kind == 'mesh':
        size = _numbers(where, found, 'scale', '1 1 1')
    else:
        radius = _numbers(where, found, 'radius', count=1)[0]
        size = (
            [2 * radius] * 3
            if kind == 'sphere'
            else [2 * radius, 2 * radius, _numbers(where, found, 'length', count=1)[0]]
        )
    return Shape(
        name,
        'cylinder' if kind == 'capsule' else kind,
        place,
        np.array(size),
        found.get('filename', '') if kind == 'mesh' else '',
        _colour(element.find('material'), known),
    )


def _numbers(
    where: str,
    element: Optional[ElementTree.Element],
    name: str,
    default: str = '0 0 0',
    count: int = 3,
) -> List[float]:
    text = (element.get(name) if element is not None else None) or default
    try:
        numbers = [float(word) for word in text.split()[: count + 1]]
    except ValueError:
        numbers = []
    if element is not None and name in ('radius', 'length') and not element.get(name):
        numbers = []
    if len(numbers) != count or not all(
        math.isfinite(each) and abs(each) < FURTHEST for each in numbers
    ):
        raise ValueError(
            '{}: {}="{}"; it takes {} finite number{}, below {:g}'.format(
                where, name, text[:60], count, 's' * (count > 1), FURTHEST
            )
        )
    return numbers


def _materials(root: ElementTree.Element) -> Dict[str, Colour]:
    """Colours by name. The first definition counts."""
    known: Dict[str, Colour] = {}
    for material in root.iter('material'):
        if material.find('color') is not None and material.get('name'):
            known.setdefault(material.get('name', ''), _colour(material, {}))
    return known


def _colour(material: Optional[ElementTree.Element], known: Mapping[str, Colour]) -> Colour:
    if material is None:
        return GREY
    element = material.find('color')
    words = element.get('rgba', '').split()[:3] if element is not None else []
    try:
        levels = [float(word) for word in words]
    except ValueError:
        levels = []
    if len(levels) != 3 or not all(math.isfinite(level) for level in levels):
        return known.get(material.get('name', ''), GREY)
    red, green, blue = (round(255 * min(max(level, 0.0), 1.0)) for level in levels)
    return red, green, blue
