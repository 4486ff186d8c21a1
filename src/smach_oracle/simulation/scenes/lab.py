"""A lab in which a robot goes on: what a trial finds is what the trial before has left, tidied.

What a person tidies in a lab, and when, is told in doc/protocol.md. A scene is made of the run, the
hour, the trial's seed, and how the world was left. So a run can go on from any trial.
"""

from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.transforms import apply, inverse
from smach_oracle.pr2.kitchen import Kitchen, odom_from_pose

from . import kitchen_scene, tabletop_scene
from .calibration import JOINTS, camera_error_of, encoder_errors_of
from .cause_draws import LASTING_SHARE
from .chance import generator_for
from .drafts import Draft, caused
from .kitchen_causes import EYE, STEADY
from .kitchen_causes import LOOKS_AT as INTO_FRIDGE
from .kitchen_causes import with_causes as with_kitchen_causes
from .lab_hours import Spell, Values, drifting, spells, worn
from .light_causes import dazzling
from .scene import Body, Disturbance, RobotStart, Scene, Vector
from .tabletop_causes import EYE_LOOKING, LOOKS_AT, TABLE_TOP, TORSO, TabletopDraft
from .tabletop_causes import with_causes as with_table_causes
from .unlike_the_map import localisation_error, true_kitchen, true_table

TIDYING_H = 1.0 / 60  # that a person takes from one trial to the next, at least
AHEAD_H = 10.0 / 60  # a light that comes later than that after a trial's begin is none of it
FEWEST = 3  # things on a table, before it is set out afresh
OVERLAP = 0.002  # m by which two things may seem to stand in each other
FROM_THE_HOUR = ('glare', 'dim_light')  # causes that are not drawn from a trial's seed
TRIES = 60  # at a place for what is put out
SECONDS = 3600.0

Joints = Tuple[Tuple[str, float], ...]


class LabRun(NamedTuple):
    """A run of trials in one lab."""

    seed: int  # of its first trial. The next has the next
    slot_h: float  # from the begin of one trial to that of the next, where none takes longer


class LabState(NamedTuple):
    """The lab as a trial has left it, after a person has put away what the task was about."""

    began: float  # h of the run
    ended: float
    things: Tuple[Body, ...]  # what stays, upright, at x and y of its position
    # of torso and head, rad or m by joint. () means the robot was set right, and stands as at the
    # begin
    joints: Joints = ()
    base: Vector = (0.0, 0.0, 0.0)  # x, y (m) and yaw (rad) of the robot in the world
    localisation: Vector = (0.0, 0.0, 0.0)  # of the world in odom_combined, likewise

    def as_data(self) -> Dict[str, Any]:
        """Return it as plain data, for JSON."""
        usual = Body._field_defaults
        things = [
            {
                name: value
                for name, value in thing._asdict().items()
                if name not in usual or value != usual[name]
            }
            for thing in self.things
        ]
        return dict(self._asdict(), things=things, joints=dict(self.joints))


def state_from(data: Mapping[str, Any]) -> LabState:
    """Return the state that was written.

    :raises KeyError, TypeError or ValueError: where it is not one.
    """
    given: List[Dict[str, Any]] = [
        {name: tuple(value) if isinstance(value, list) else value for name, value in thing.items()}
        for thing in data['things']
    ]
    things = tuple(Body(**each) for each in given)
    return LabState(
        float(data['began']),
        float(data['ended']),
        things,
        tuple((name, float(value)) for name, value in data['joints'].items()),
        _vector(data['base']),
        _vector(data['localisation']),
    )


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = (float(each) for each in values)
    return x, y, z


def begins_at(run: LabRun, seed: int, state: Optional[LabState]) -> float:
    """Return the hour of the run at which a trial begins."""
    return max((seed - run.seed) * run.slot_h, state.ended + TIDYING_H if state else 0.0)


def lab_scene(
    task: str,
    run: LabRun,
    seed: int,
    state: Optional[LabState],
    benign: bool,
    lasting: float = LASTING_SHARE,
) -> Scene:
    """Return what a trial finds.

    :param state: how the trial before left it. None means the run begins.
    :param benign: without any reason to fail that could be left out.
    :param lasting: the share of the causes that last, 0 to 1.
    """
    hour = begins_at(run, seed, state)
    robot = RobotStart(
        encoder_errors=encoder_errors_of(drifting(run.seed, 'encoder_errors', hour, len(JOINTS))),
        camera_error=camera_error_of(drifting(run.seed, 'camera_error', hour, 6)),
        tip_wear=worn(run.seed, hour),
    )
    return _SCENES[task](_Trial(run, seed, hour, state, benign, lasting), robot)


class _Trial(NamedTuple):
    run: LabRun
    seed: int
    hour: float
    state: Optional[LabState]
    benign: bool
    lasting: float

    @property
    def as_it_was(self) -> Optional[LabState]:
        """The lab as it was left. None where it is set out afresh: at first, and once an hour."""
        passed = self.state is None or int(self.hour) > int(self.state.began)
        return None if passed else self.state


def _table(trial: _Trial, robot: RobotStart) -> Scene:
    draft = TabletopDraft(_nearest_first(_things_on_table(trial)))
    if not trial.benign:
        draft = _lit(
            draft,
            trial,
            lambda generator: dazzling(
                EYE_LOOKING,
                LOOKS_AT,
                np.array(
                    [
                        generator.uniform(*tabletop_scene.NEAREST_X),
                        generator.uniform(*tabletop_scene.NEAREST_Y),
                        TABLE_TOP + 0.06,
                    ]
                ),
                generator,
            ),
        )
        draft = with_table_causes(draft, trial.seed, trial.lasting, FROM_THE_HOUR)
    robot = robot._replace(
        joints=_start_joints((('torso_lift_joint', TORSO),), trial.state),
        drive_error=_drive_error(robot),
    )
    table = true_table(trial.run.seed, TABLE_TOP, tabletop_scene.TABLE_X, tabletop_scene.TABLE_SIZE)
    return tabletop_scene.composed(trial.seed, draft, table, robot)


def _things_on_table(trial: _Trial) -> Tuple[Body, ...]:
    fresh, state = tabletop_scene.fresh_things(trial.seed), trial.as_it_was
    if state is None:
        return fresh
    stayed = [_upright(thing, TABLE_TOP) for thing in state.things]
    generator = generator_for(trial.seed, 'put_out')
    spots = [fresh[0].position[:2]] + [
        (
            float(generator.uniform(*tabletop_scene.NEAREST_X)),
            float(generator.uniform(*tabletop_scene.NEAREST_Y)),
        )
        for _ in range(TRIES)
    ]
    spot = _free(spots, stayed, tabletop_scene.CLEAR)
    if spot is None or len(stayed) < FEWEST - 1 or not _stand_apart(stayed):
        return fresh
    put = fresh[0]._replace(name=_unused(stayed), position=(*spot, fresh[0].position[2]))
    colours = [each.colour for each in stayed]
    others = [each for each in tabletop_scene.COLOURS if each not in colours]
    if put.colour in colours and others:
        put = put._replace(colour=others[0])
    return (put, *stayed)


def _drive_error(robot: RobotStart) -> Vector:
    return _vector([each * (1.0 + robot.tip_wear) for each in STEADY])


def _kitchen(trial: _Trial, robot: RobotStart) -> Scene:
    kitchen, state = true_kitchen(trial.run.seed), trial.state
    stays = state if state and state.joints else None  # how the robot stands
    draft = kitchen_scene.drafted(kitchen, _drinks_in_fridge(trial, kitchen))
    draft = draft._replace(
        drive_error=_drive_error(robot),
        localisation_error=stays.localisation if stays else localisation_error(trial.seed),
    )
    if not trial.benign:
        draft = _lit(
            draft,
            trial,
            lambda generator: dazzling(
                EYE,
                INTO_FRIDGE,
                np.array(
                    _on_shelf(
                        kitchen,
                        (
                            float(generator.uniform(*kitchen_scene.DEPTHS)),
                            float(generator.uniform(*kitchen_scene.SIDES)),
                        ),
                        0.06,
                    )
                ),
                generator,
            ),
        )
        draft = with_kitchen_causes(draft, trial.seed, trial.lasting, FROM_THE_HOUR)
    robot = robot._replace(
        joints=_start_joints(kitchen_scene.posture(), state),
        base=stays.base if stays else robot.base,
    )
    return kitchen_scene.composed(trial.seed, draft, kitchen, robot)


def _drinks_in_fridge(trial: _Trial, kitchen: Kitchen) -> Tuple[Body, ...]:
    fresh, state = kitchen_scene.fresh_drinks(trial.seed, kitchen), trial.as_it_was
    if state is None:
        return fresh
    floor = kitchen.shelves[kitchen.drinks_shelf]
    stayed = [_upright(drink, floor) for drink in state.things]
    generator = generator_for(trial.seed, 'put_out')
    places = [
        (
            float(generator.uniform(*kitchen_scene.DEPTHS)),
            float(generator.uniform(*kitchen_scene.SIDES)),
        )
        for _ in range(TRIES)
    ]
    spots = [fresh[0].position[:2]] + [_on_shelf(kitchen, each, 0.0)[:2] for each in places]
    others = [_in_fridge(kitchen, drink.position) for drink in stayed]
    spot = _free(
        [each for each in spots if kitchen_scene.is_in_reach(_in_fridge(kitchen, each), others)],
        stayed,
        kitchen_scene.CLEAR,
    )
    if spot is None or len(stayed) < len(fresh) - 1 or not _stand_apart(stayed):
        return fresh
    return (fresh[0]._replace(position=(*spot, fresh[0].position[2])), *stayed)


def _on_shelf(kitchen: Kitchen, place: Tuple[float, float], lift: float) -> Vector:
    """Return a place (m) in the fridge's frame, so high (m) above the shelf, in the world."""
    x, y = odom_from_pose(kitchen, place[0], place[1], 0.0)[:2, 3]
    return float(x), float(y), kitchen.shelves[kitchen.drinks_shelf] + lift


def _in_fridge(kitchen: Kitchen, place: Sequence[float]) -> Tuple[float, float]:
    """Return a place (m) in the world, in the fridge's frame."""
    x, y = apply(
        inverse(odom_from_pose(kitchen, 0.0, 0.0, 0.0)), np.array([place[0], place[1], 0.0])
    )[:2]
    return float(x), float(y)


_SCENES: Dict[str, Callable[[_Trial, RobotStart], Scene]] = {
    tabletop_scene.TASK: _table,
    kitchen_scene.TASK: _kitchen,
}


def _lit(draft: Draft, trial: _Trial, dazzle: Callable[[np.random.Generator], Values]) -> Draft:
    """Return the draft in the light of its hour."""
    for spell in spells(trial.run.seed, trial.hour, trial.hour + AHEAD_H, dazzle):
        begins = max(trial.hour, spell.begins)
        times = (
            ('delay', SECONDS * (begins - trial.hour)),
            ('duration', SECONDS * (spell.ends - begins)),
        )
        draft = caused(
            draft,
            spell.kind,
            _told(spell),
            Disturbance(
                'dim' if spell.kind == 'dim_light' else spell.kind, 'start', spell.values + times
            ),
        )
    return draft


def _told(spell: Spell) -> str:
    what = 'the low sun dazzles the camera' if spell.kind == 'glare' else 'a cloud dims the room'
    return '{} from hour {:.2f} to {:.2f}'.format(what, spell.begins, spell.ends)


def _start_joints(start: Joints, state: Optional[LabState]) -> Joints:
    """Return where the joints are: arms and grippers as at the begin, torso and head as left."""
    return tuple({**dict(start), **dict(state.joints if state else ())}.items())


def _nearest_first(things: Tuple[Body, ...]) -> Tuple[Body, ...]:
    return tuple(sorted(things, key=lambda each: float(np.hypot(*each.position[:2]))))


def _upright(thing: Body, floor: float) -> Body:
    x, y, _ = thing.position
    return thing._replace(position=(x, y, floor + thing.size[2] / 2 + 0.001), roll=0.0, pitch=0.0)


def _free(
    spots: Sequence[Tuple[float, float]], things: Sequence[Body], clear: float
) -> Optional[Tuple[float, float]]:
    """Return the first spot that is so far (m) from the middles of all things."""
    return next(
        (
            spot
            for spot in spots
            if all(
                np.hypot(spot[0] - each.position[0], spot[1] - each.position[1]) > clear
                for each in things
            )
        ),
        None,
    )


def _stand_apart(things: Sequence[Body]) -> bool:
    """Return whether no thing stands in another."""
    return all(
        np.hypot(one.position[0] - other.position[0], one.position[1] - other.position[1])
        > _slim(one) + _slim(other) - OVERLAP
        for number, one in enumerate(things)
        for other in things[number + 1 :]
    )


def _slim(thing: Body) -> float:
    """Return half of what a thing measures across at the least, m."""
    return thing.size[0] if thing.shape == 'cylinder' else min(thing.size[:2]) / 2


def _unused(things: List[Body]) -> str:
    names = [each.name for each in things]
    return next(
        name for name in map('object_{}'.format, range(len(things) + 1)) if name not in names
    )
