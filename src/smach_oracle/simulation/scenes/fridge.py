"""The refrigerator as a URDF model of our own: a body with shelves, and a door with a handle.

Many a real one's door falls shut from where it is not open far enough: a cam in the hinge, or feet
that tilt the whole, pull it. Past a stop it stays.
"""

import xml.etree.ElementTree as ElementTree
from typing import Optional, Tuple

import numpy as np

from smach_oracle.pr2.kitchen import Kitchen

from .scene import Body, ClosingHinge

DOOR_JOINT = 'door_hinge'  # rad; 0 closed, positive open
DOOR_LIMIT = 1.75  # rad. A stop, as of a cabinet next to it
WHITE, GLASS, DARK = (0.93, 0.93, 0.95), (0.75, 0.82, 0.90), (0.20, 0.20, 0.22)
DOOR_MASS, BODY_MASS = 8.0, 60.0  # kg
GAP = 0.02  # m below and above the door

DOOR_FRICTION = 3.0  # N m, dry, of a door that stays where it is left
# N m: at the handle 7 to 11 N, which one hand does not mind
CLOSING_TORQUE = (4.0, 6.0)
CLOSING_STOP = (np.radians(50.0), np.radians(85.0))  # rad

Triple = Tuple[float, float, float]


def fridge(kitchen: Kitchen, closing: Optional[ClosingHinge] = None) -> Body:
    """The refrigerator of a kitchen, its door closed.

    :param closing: of its door. None means it stays where it is left.
    """
    x, y, yaw = kitchen.place
    hinges = () if closing is None else ((DOOR_JOINT, closing),)
    return Body(
        'fridge',
        'urdf',
        (0.0, 0.0, 0.0),
        (x, y, 0.0),
        yaw,
        urdf=fridge_urdf(kitchen),
        joints=((DOOR_JOINT, 0.0),),
        joint_friction=((DOOR_JOINT, DOOR_FRICTION),),
        joint_closing=hinges,
    )


def closing_hinge(generator: np.random.Generator) -> ClosingHinge:
    """One of a door that falls shut: no two makes have the same."""
    return ClosingHinge(
        float(generator.uniform(*CLOSING_TORQUE)), float(generator.uniform(*CLOSING_STOP))
    )


def fridge_urdf(kitchen: Kitchen) -> str:
    """Text of the model.

    Its root is the fridge's frame. The door is closed where its joint is 0.
    """
    robot = ElementTree.Element('robot', name='fridge')
    _body(robot, kitchen)
    _door(robot, kitchen)
    joint = ElementTree.SubElement(robot, 'joint', name=DOOR_JOINT, type='revolute')
    ElementTree.SubElement(joint, 'parent', link='body')
    ElementTree.SubElement(joint, 'child', link='door')
    ElementTree.SubElement(joint, 'origin', xyz=_text((0.0, kitchen.width / 2, 0.0)))
    ElementTree.SubElement(joint, 'axis', xyz='0 0 -1')
    ElementTree.SubElement(
        joint, 'limit', lower='0', upper=str(DOOR_LIMIT), effort='100', velocity='5'
    )
    ElementTree.SubElement(joint, 'dynamics', damping='0.5', friction='0')
    return ElementTree.tostring(robot, encoding='unicode')


def _body(robot: ElementTree.Element, kitchen: Kitchen) -> None:
    depth, width, height, wall = kitchen.depth, kitchen.width, kitchen.height, kitchen.wall
    link = _link(robot, 'body', BODY_MASS, (depth / 2, 0.0, height / 2), (10.0, 10.0, 10.0))
    for side in (-1, 1):
        _box(link, (depth, wall, height), (depth / 2, side * (width - wall) / 2, height / 2), WHITE)
    _box(link, (wall, width, height), (depth - wall / 2, 0.0, height / 2), WHITE)
    for centre in (0.05, height - wall / 2):
        _box(link, (depth, width, wall), (depth / 2, 0.0, centre), WHITE)
    inner = (depth - wall, width - 2 * wall, 0.012)
    for top in kitchen.shelves:
        _box(link, inner, (inner[0] / 2, 0.0, top - inner[2] / 2), GLASS)


def _door(robot: ElementTree.Element, kitchen: Kitchen) -> None:
    """Add the door.

    Its frame is at the hinge on the floor, turned as the fridge's: closed, it reaches towards -y,
    and outside is -x.
    """
    thick, width, height = kitchen.door_thickness, kitchen.width, kitchen.height - 2 * GAP
    link = _link(
        robot, 'door', DOOR_MASS, (-thick / 2, -width / 2, kitchen.height / 2), (1.5, 1.5, 0.3)
    )
    _box(link, (thick, width, height), (-thick / 2, -width / 2, kitchen.height / 2), WHITE)
    low, high = kitchen.handle_span
    axis = -(width - kitchen.handle_inset)
    bar = '<cylinder radius="{}" length="{}"/>'.format(kitchen.handle_radius, high - low)
    _shape(link, bar, (-thick - kitchen.handle_stand_off, axis, (low + high) / 2), DARK)
    for end in (low + 0.01, high - 0.01):
        _box(
            link,
            (kitchen.handle_stand_off, 0.02, 0.02),
            (-thick - kitchen.handle_stand_off / 2, axis, end),
            DARK,
        )


def _link(
    robot: ElementTree.Element, name: str, mass: float, centre: Triple, inertia: Triple
) -> ElementTree.Element:
    link = ElementTree.SubElement(robot, 'link', name=name)
    inertial = ElementTree.SubElement(link, 'inertial')
    ElementTree.SubElement(inertial, 'origin', xyz=_text(centre))
    ElementTree.SubElement(inertial, 'mass', value=str(mass))
    ElementTree.SubElement(
        inertial,
        'inertia',
        dict(
            zip(
                ('ixx', 'iyy', 'izz', 'ixy', 'ixz', 'iyz'),
                [str(value) for value in inertia + (0.0, 0.0, 0.0)],
            )
        ),
    )
    return link


def _box(link: ElementTree.Element, size: Triple, centre: Triple, colour: Triple) -> None:
    _shape(link, '<box size="{}"/>'.format(_text(size)), centre, colour)


def _shape(link: ElementTree.Element, geometry: str, centre: Triple, colour: Triple) -> None:
    for kind in ('visual', 'collision'):
        part = ElementTree.SubElement(link, kind)
        ElementTree.SubElement(part, 'origin', xyz=_text(centre))
        ElementTree.SubElement(part, 'geometry').append(ElementTree.fromstring(geometry))
        if kind == 'visual':
            material = ElementTree.SubElement(
                part, 'material', name='{:.2f}_{:.2f}_{:.2f}'.format(*colour)
            )
            ElementTree.SubElement(material, 'color', rgba=_text(colour + (1.0,)))


def _text(values: Tuple[float, ...]) -> str:
    return ' '.join('{:.6g}'.format(value) for value in values)
