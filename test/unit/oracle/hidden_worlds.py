"""Small hidden worlds, for tests of what cures a failure in them and what it costs."""

from typing import Any, Dict, Iterable, Sequence, Tuple

from fake_clock import FakeClock
from hidden_causes.mix import MIX
from hidden_causes.plan import DONE, MACHINE, TOP, Box, Leaf
from hidden_causes.world import Causes, Condition, Disturbance, Work, World

EXACT = MIX._replace(spread=0.0, loops=0.0)


def causes_of(
    conditions: Iterable[Condition],
    works: Dict[str, Work],
    disturbances: Sequence[Disturbance] = (),
    seed: object = 'small',
) -> Causes:
    """Causes in which labels stand for states of the top machine."""
    return Causes(
        seed,
        {
            each.name: each._replace(
                makers={_path(label): chance for label, chance in each.makers.items()},
                used_up_by=_path(each.used_up_by) if each.used_up_by else '',
            )
            for each in conditions
        },
        [each._replace(before=_path(each.before)) for each in disturbances],
        {_path(label): work for label, work in works.items()},
    )


def world_of(*given: Any, **named: Any) -> World:
    """A world of such causes, in which no time is drawn."""
    return World(causes_of(*given, **named), EXACT, FakeClock())


def chain_of(*labels: str) -> Box:
    """The plan of states one after the other, which may fail."""
    onward = (*labels[1:], DONE)
    leaves: Tuple[Any, ...] = tuple(
        Leaf(_path(label), (DONE,), ('aborted',), False, {DONE: to, 'aborted': 'aborted'})
        for label, to in zip(labels, onward)
    )
    return Box(TOP, MACHINE, leaves, ('aborted',), {})


def does(world: World, label: str, **given: Any) -> bool:
    """Execute a state; whether it said success."""
    return world.execute(_path(label), **given).works


def _path(label: str) -> str:
    return '{}/{}'.format(TOP, label)
