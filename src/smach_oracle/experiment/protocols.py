"""Experiments of several parts, each of which is an experiment with a folder of its own."""
from typing import Callable, Dict, List, NamedTuple

from smach_oracle.oracle.decision.policy import POLICIES

from .plan import BARE, DEFAULT, TASKS, ExperimentPlan, named_variants

COMPARED = (BARE, DEFAULT, 'restart')  # variants with all replicates
REPLICATES = {'pick_and_place': 3, 'drink_retrieval': 4}
SWEPT = {'pick_and_place': 100, 'drink_retrieval': 60}  # trials of a point of a sweep
MEMORIES = (2, 5, 10, 20, 50)


class Part(NamedTuple):
    """One part; its name is that of its folder below the protocol's."""

    name: str
    plan: ExperimentPlan


def main_parts(seed: int, answer_delay: float) -> List[Part]:
    """Return the parts of the main protocol: the compared variants, the others, the memory."""
    others = [name for name in sorted(POLICIES) if name not in COMPARED + ('prose',)]
    parts: List[Part] = []
    for task in sorted(TASKS):
        trials = TASKS[task][1]
        for name, replicates, variants in (
                ('compared', REPLICATES[task], named_variants(COMPARED, {})),
                ('others', 1, named_variants(others, {}))):
            parts.append(Part('{}_{}'.format(task, name), ExperimentPlan(
                task, trials, seed, replicates, variants, answer_delay)))
        parts.append(Part('{}_memory'.format(task), ExperimentPlan(
            task, SWEPT[task], seed, 1, named_variants((DEFAULT,), {}, MEMORIES), answer_delay)))
    return parts


PROTOCOLS: Dict[str, Callable[[int, float], List[Part]]] = {'main': main_parts}
