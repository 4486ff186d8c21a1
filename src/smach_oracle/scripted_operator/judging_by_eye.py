"""A person's knowledge of a failed state when they decide, by looking about."""
from typing import Any, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .clearing import in_the_way, on_place, within_reach
from .ladder import Sight
from .manoeuvres import HELD
from .manual_task import AHEAD, place_in_base, point_in_base
from .robot_means import RobotMeans
from .seen_scene import SeenScene, SeenThing
from .state_plans import PUT_DOWN, RETRY, TAKE, StatePlan

_MOVED = 0.035  # m: what is seen that far from where it was detected is elsewhere
_REACHED_INSIDE = 0.95  # m from the robot's middle, of a thing on a shelf


class Impression(NamedTuple):
    """A person's knowledge, and the place where they last saw the thing."""

    sight: Sight
    about: np.ndarray  # (3,) m, base_footprint


def look_about(plan: StatePlan, userdata: Mapping[str, Any], first: SeenScene,
               means: RobotMeans) -> Impression:
    """Look about for what the failed state is about.

    :param first: what is seen before the head has moved.
    """
    if plan.means == RETRY:
        return Impression(Sight(), AHEAD)
    holds = HELD[0] < means.gap(plan.arm) < HELD[1]
    if plan.means == PUT_DOWN:
        return _about_place(plan, userdata, means, holds)
    points = _where_to_look(plan, userdata)
    scene, thing = _search(points, first, means)
    if thing is None or thing.box is None:
        return Impression(Sight(seen=thing is not None, located=False, holds=holds,
                                dazzled=means.look_at(points[0]).dazzled(),
                                covered=thing is not None and scene.covered(thing)), AHEAD)
    reachable = plan.means != TAKE or _reaches(plan, thing.box.centre)
    sight = Sight(holds=holds, crowded=in_the_way(scene, thing) is not None,
                  covered=scene.covered(thing) and not holds, reachable=reachable,
                  moved=_moved(detected_in(plan, userdata), thing.box.centre))
    return Impression(sight, thing.box.centre)


def _where_to_look(plan: StatePlan, userdata: Mapping[str, Any]) -> List[np.ndarray]:
    """Points (3,) m: where the robot has detected the thing, and those of the settings."""
    point = detected_in(plan, userdata)
    points = [np.array(each) for each in plan.look] or [AHEAD]
    return points if point is None else [point] + points


def detected_in(plan: StatePlan, userdata: Mapping[str, Any]) -> Optional[np.ndarray]:
    """(3,) m: where the robot has detected the thing, or None."""
    detected = userdata.get(plan.what)
    return point_in_base(detected[0] if isinstance(detected, list) and detected else detected)


def _moved(detected: Optional[np.ndarray], seen: np.ndarray) -> bool:
    return detected is not None and float(np.hypot(*(detected - seen)[:2])) > _MOVED


def _search(points: Sequence[np.ndarray], first: SeenScene,
            means: RobotMeans) -> Tuple[SeenScene, Optional[SeenThing]]:
    """The thing, with the head turned to it, else it is looked for here and there."""
    scene, thing = first, first.wanted()
    if thing is not None and thing.box is not None:
        closer = means.look_at(thing.box.centre)
        again = closer.wanted()
        return (closer, again) if again is not None and again.box is not None else (scene, thing)
    for point in points:
        other = means.look_at(point)
        found = other.wanted()
        if found is not None:
            scene, thing = other, found
        if found is not None and found.box is not None:
            break
    return scene, thing


def _about_place(plan: StatePlan, userdata: Mapping[str, Any], means: RobotMeans,
                 holds: bool) -> Impression:
    place = place_in_base(userdata.get(plan.place), means) if plan.place else None
    if place is None or not holds:
        return Impression(Sight(holds=holds), AHEAD)
    return Impression(Sight(holds=True, blocked=on_place(means.look_at(place), place) is not None),
                      place)


def _reaches(plan: StatePlan, point: np.ndarray) -> bool:
    if plan.inside:
        return bool(np.hypot(*point[:2]) < _REACHED_INSIDE)
    return within_reach(point, plan.arm)
