"""The robot's knowledge of its kitchen: the map of a refrigerator, which may differ from the truth.

The fridge's frame: origin on the floor in the middle of the front opening, x into the fridge, y to
the left of whoever faces it, z up. Its door hangs on the left and opens towards that side. Lengths
in m, angles in rad.
"""

from typing import Any, List, NamedTuple, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.transforms import apply, from_rpy, inverse, yaw_of
from smach_oracle.oracle.number_checks import is_number


class Kitchen(NamedTuple):
    """The map of the kitchen."""

    # x, y, yaw of the fridge's frame in odom_combined
    place: Tuple[float, float, float] = (1.60, 0.0, 0.0)
    width: float = 0.60  # outer
    depth: float = 0.50  # of the body, without the door
    height: float = 1.50
    wall: float = 0.02
    shelves: Tuple[float, ...] = (0.45, 0.80, 1.25)  # heights of their upper faces
    drinks_shelf: int = 1  # which of them has the drinks
    door_thickness: float = 0.04
    handle_radius: float = 0.011
    handle_inset: float = 0.05  # its axis, from the free edge of the door
    handle_stand_off: float = 0.085  # its axis, from the outer face of the door
    handle_span: Tuple[float, float] = (0.725, 1.175)  # heights of its ends


class MapBox(NamedTuple):
    """A box of the map, or what is round in it, in the frame of the base."""

    centre: np.ndarray  # (3,)
    half: np.ndarray  # (3,)
    yaw: float
    upright_cylinder: bool = False  # of the wider side's diameter, in place of the box

    def beyond(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) m by which points (..., 3) lie beyond its sides, below 0 between them."""
        turn = from_rpy((0, 0, 0), yaw=self.yaw)[:2, :2]
        found: np.ndarray = np.abs((points - self.centre)[..., :2] @ turn) - self.half[:2]
        return found


def kitchen_from(settings: object) -> Kitchen:
    """The map with some of its values given, as from a parameter.

    :raises ValueError: for a name that is not there, or a value of another form than its default.
    """
    if not isinstance(settings, dict):
        raise ValueError('kitchen: a dictionary is needed, not {!r}'.format(settings))
    unknown = sorted(str(name) for name in settings if name not in Kitchen._fields)
    if unknown:
        raise ValueError(
            'kitchen: unknown {}; allowed: {}'.format(
                ', '.join(unknown), ', '.join(Kitchen._fields)
            )
        )
    kitchen = Kitchen(**{name: _like(name, value) for name, value in settings.items()})
    if not 0 <= kitchen.drinks_shelf < len(kitchen.shelves):
        raise ValueError(
            'kitchen: drinks_shelf is {}, shelves there are {}'.format(
                kitchen.drinks_shelf, len(kitchen.shelves)
            )
        )
    return kitchen


def base_from_fridge(kitchen: Kitchen, odom_from_base: np.ndarray) -> np.ndarray:
    """4x4: where the fridge is, by the map and the robot's odometry.

    :param odom_from_base: 4x4, where the robot believes to stand.
    """
    x, y, yaw = kitchen.place
    return inverse(odom_from_base) @ from_rpy((x, y, 0.0), yaw=yaw)


def odom_from_pose(kitchen: Kitchen, x: float, y: float, yaw: float) -> np.ndarray:
    """4x4 in odom_combined of a pose on the floor given in the fridge's frame."""
    return from_rpy((kitchen.place[0], kitchen.place[1], 0.0), yaw=kitchen.place[2]) @ from_rpy(
        (x, y, 0.0), yaw=yaw
    )


def door_frame(kitchen: Kitchen, angle: float) -> np.ndarray:
    """4x4, fridge from door, with the door open by `angle` (rad).

    The door's frame: origin at the hinge on the floor, x along the outer normal, y towards the free
    edge.
    """
    # closed, the outer normal is -x of the fridge and the free edge lies towards -y: a turn by half
    # a circle
    return from_rpy((0.0, kitchen.width / 2, 0.0), yaw=np.pi - angle)


def handle_point(kitchen: Kitchen, angle: float, height: float) -> np.ndarray:
    """(3,) of the handle's axis in the fridge's frame, with the door open by `angle`.

    :param height: m above the floor.
    """
    out = kitchen.door_thickness + kitchen.handle_stand_off
    return apply(
        door_frame(kitchen, angle), np.array([out, kitchen.width - kitchen.handle_inset, height])
    )


def door_angle_at(kitchen: Kitchen, handle: np.ndarray) -> float:
    """Return the door's angle, rad, with its handle at a point (3,) of the fridge's frame."""
    hinge = np.array([0.0, kitchen.width / 2])
    shut, now = (
        np.arctan2(*(point[:2] - hinge)[::-1])
        for point in (handle_point(kitchen, 0.0, 0.0), handle)
    )
    return float((shut - now + np.pi) % (2 * np.pi) - np.pi)


def fridge_boxes(kitchen: Kitchen, base_from_fridge: np.ndarray, door_angle: float) -> List[MapBox]:
    """The fridge as boxes for a collision map: walls, shelves, the door and, last, its handle.

    :param base_from_fridge: 4x4.
    :param door_angle: rad.
    """
    wall, half_width = kitchen.wall, kitchen.width / 2
    middle = kitchen.depth / 2
    parts = [
        (
            (middle, side * (half_width - wall / 2), kitchen.height / 2),
            (middle, wall / 2, kitchen.height / 2),
        )
        for side in (-1, 1)
    ]
    parts.append(
        (
            (kitchen.depth - wall / 2, 0.0, kitchen.height / 2),
            (wall / 2, half_width, kitchen.height / 2),
        )
    )
    parts += [
        ((middle, 0.0, top - 0.01), (middle, half_width, 0.01))
        for top in kitchen.shelves + (kitchen.height,)
    ]
    boxes = [_placed(base_from_fridge, centre, half) for centre, half in parts]
    base_from_door = base_from_fridge @ door_frame(kitchen, door_angle)
    thick, low, high = kitchen.door_thickness, kitchen.handle_span[0], kitchen.handle_span[1]
    boxes.append(
        _placed(
            base_from_door,
            (thick / 2, half_width, kitchen.height / 2),
            (thick / 2, half_width, kitchen.height / 2),
        )
    )
    out = (thick + kitchen.handle_stand_off + kitchen.handle_radius) / 2
    boxes.append(
        _placed(
            base_from_door,
            (out, kitchen.width - kitchen.handle_inset, (low + high) / 2),
            (out, kitchen.handle_radius, (high - low) / 2),
        )
    )
    return boxes


def shelf_region(kitchen: Kitchen) -> Tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner (3,) of the space above the drinks' shelf.

    They are in the fridge's frame.
    """
    floor = kitchen.shelves[kitchen.drinks_shelf]
    ceiling = min([top for top in kitchen.shelves if top > floor] + [kitchen.height]) - kitchen.wall
    side = kitchen.width / 2 - kitchen.wall
    return np.array([0.0, -side, floor]), np.array([kitchen.depth - kitchen.wall, side, ceiling])


def look_point(kitchen: Kitchen, base_from_fridge: np.ndarray) -> np.ndarray:
    """(3,) in the frame of the base: where to point the camera to see the drinks."""
    return apply(base_from_fridge, shelf_point(kitchen))


def shelf_point(kitchen: Kitchen) -> np.ndarray:
    """(3,) in the fridge's frame: the middle of where drinks stand."""
    return np.array([0.15, 0.0, kitchen.shelves[kitchen.drinks_shelf] + 0.05])


def _placed(
    base_from_part: np.ndarray, centre: Tuple[float, float, float], half: Tuple[float, float, float]
) -> MapBox:
    return MapBox(apply(base_from_part, np.array(centre)), np.array(half), yaw_of(base_from_part))


def _like(name: str, value: Any) -> Any:
    """`value` in the type of this name's default: an int, a float, or a tuple of floats.

    :raises ValueError: for other values. A tuple has as many numbers as its default. There may be
        any number of shelves.
    """
    default = Kitchen._field_defaults[name]
    try:
        if isinstance(default, tuple):
            return _floats(value, 0 if name == 'shelves' else len(default))
        return _number(value, type(default))
    except (TypeError, ValueError, OverflowError) as err:
        raise ValueError(
            'kitchen: {} is {!r}; needed is something like {!r}'.format(name, value, default)
        ) from err


def _floats(values: Sequence[float], count: int) -> Tuple[float, ...]:
    """The values as floats. `count` of them, or for 0 any number from 1."""
    made = tuple(float(value) for value in values)
    if not all(is_number(each) for each in made) or (len(made) != count if count else not made):
        raise ValueError('{} numbers, not all finite'.format(len(made)))
    return made


def _number(value: float, kind: type) -> float:
    """The value as an int, or as a float above 0."""
    made: float = kind(value)
    if made != float(value) or not is_number(made) or (made <= 0 and kind is not int):
        raise ValueError('not a number of this kind')
    return made
