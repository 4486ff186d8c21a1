"""A person's knowledge of a failed state when they decide, by looking about."""

from typing import Any, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .clearing import in_the_way, on_place, within_reach
from .ladder import Sight
from .manoeuvres import HELD, ManoeuvreError
from .manual_task import AHEAD, place_in_base, place_of, point_in_base
from .robot_means import RobotMeans
from .seen_scene import FLOOR, LEAST_LIMB, SeenScene, SeenThing
from .state_plans import PUT_DOWN, RETRY, SHOW, StatePlan

_MOVED = 0.035  # m: what is seen that far from where it was detected is elsewhere
_REACHED_INSIDE = 0.95  # m from the robot's middle, of a thing on a shelf
_FARTHEST = 1.25  # m from the robot's middle: no hand gets to what is further away
_AROUND = 0.25  # m about the thing, in which a person sees what else is there
_BESIDE = 0.12  # m beside the place where it should be put
# m, base_footprint: the floor before the robot, where a thing may have fallen
_FLOOR = tuple(np.array(each) for each in ((0.9, 0.1, 0.0), (0.65, 0.5, 0.0), (0.65, -0.5, 0.0)))


class Impression(NamedTuple):
    """A person's knowledge, and the place where they last saw the thing."""

    sight: Sight
    about: np.ndarray  # (3,) m, base_footprint


def look_about(
    plan: StatePlan, userdata: Mapping[str, Any], first: SeenScene, means: RobotMeans
) -> Impression:
    """Look about for what the failed state is about.

    :param first: what is seen before the head has moved.
    """
    if plan.means == RETRY:
        return Impression(Sight(place=means.stands()), AHEAD)
    holds = HELD[0] < means.gap(plan.arm) < HELD[1]
    if plan.means == PUT_DOWN and holds:
        return _about_place(plan, userdata, means)
    points = _where_to_look(plan, userdata)
    search = _search(points, first, means)
    if search.thing is None or search.thing.box is None:
        covered = search.thing is not None and search.scene.covered(search.thing)
        return Impression(
            Sight(
                seen=search.thing is not None,
                located=False,
                holds=holds,
                dazzled=search.before.dazzled(),
                dim=search.before.dim(),
                open=_shows_things(search.before, points[0]),
                covered=covered,
            ),
            AHEAD,
        )
    scene, thing, at = search.scene, search.thing, search.thing.box.centre
    reachable = plan.means == SHOW or _reaches(plan, at)
    lies = thing.lies(means.tall(thing.name))
    there = plan.means == PUT_DOWN and _is_there(plan, userdata, at, means)
    sight = Sight(
        holds=holds,
        crowded=in_the_way(scene, thing) is not None,
        covered=scene.covered(thing) and not holds,
        reachable=reachable,
        moved=_moved(detected_in(plan, userdata), at),
        dazzled=scene.dazzled(),
        dim=scene.dim(),
        lies=lies,
        shelf=plan.inside,
        lost=_is_lost(at),
        there=there,
        place=tuple(map(float, at)),
        around=_around(scene, thing.name, at),
    )
    return Impression(sight, at)


def _is_lost(at: np.ndarray) -> bool:
    """Whether a thing is where no hand gets: on the floor, or too far away."""
    return bool(at[2] < FLOOR or np.hypot(*at[:2]) > _FARTHEST)


def _around(scene: SeenScene, name: str, at: np.ndarray) -> Tuple[Tuple[float, ...], ...]:
    close = [
        box.centre for box in scene.boxes_but(name) if np.hypot(*(box.centre - at)[:2]) < _AROUND
    ]
    return tuple(sorted(tuple(map(float, each)) for each in close))


def _shows_things(scene: SeenScene, about: np.ndarray) -> bool:
    """Whether things are seen near a point (3,) m, and no limb. Then nothing hides it."""
    limbs = scene.limbs is not None and float(scene.limbs.mean()) > LEAST_LIMB
    return not limbs and any(
        np.linalg.norm(box.centre - about) < 2 * _AROUND for box in scene.boxes_but()
    )


def _is_there(
    plan: StatePlan, userdata: Mapping[str, Any], at: np.ndarray, means: RobotMeans
) -> bool:
    try:
        place, _ = place_of(plan, userdata, means)
    except ManoeuvreError:
        return False
    return bool(np.hypot(*(at - place)[:2]) < _BESIDE and abs(at[2] - place[2]) < 2 * _BESIDE)


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


class _Search(NamedTuple):
    """The result of a search: the thing, and what was seen with it."""

    scene: SeenScene
    thing: Optional[SeenThing]  # None: it is not seen anywhere
    before: SeenScene  # where it was looked for first


def _search(points: Sequence[np.ndarray], first: SeenScene, means: RobotMeans) -> _Search:
    """The thing, with the head turned to it, else it is looked for here and there.

    In the end that is on the floor, where nothing dazzles.
    """
    scene, thing, before = first, first.wanted(), None
    if thing is None or thing.box is None:
        for number, point in enumerate((*points, *_FLOOR)):
            if before is not None and number >= len(points) and (thing or before.dazzled()):
                break
            other = means.look_at(point)
            before = before or other
            found = other.wanted()
            if found is not None:
                scene, thing = other, found
            if found is not None and found.box is not None:
                break
    if thing is not None and thing.box is not None:
        closer = means.look_at(thing.box.centre)
        again = closer.wanted()
        if again is not None and again.box is not None:
            scene, thing = closer, again
    return _Search(scene, thing, before or scene)


def _about_place(plan: StatePlan, userdata: Mapping[str, Any], means: RobotMeans) -> Impression:
    place = place_in_base(userdata.get(plan.place), means) if plan.place else None
    if place is None:
        return Impression(Sight(holds=True), AHEAD)
    scene = means.look_at(place)
    return Impression(
        Sight(
            holds=True, blocked=on_place(scene, place) is not None, around=_around(scene, '', place)
        ),
        place,
    )


def _reaches(plan: StatePlan, point: np.ndarray) -> bool:
    if plan.inside:
        return bool(np.hypot(*point[:2]) < _REACHED_INSIDE)
    return within_reach(point, plan.arm)
