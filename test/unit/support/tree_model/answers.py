"""What an expert answers, drawn from what a question offers."""

import random
from typing import NamedTuple, Optional, Tuple

from .ends import Reply
from .plan import TreePlan

MOST_ANSWERS = 6  # about one state; behind them the expert gives up


class Options(NamedTuple):
    """What a question offers, sorted."""

    places: Tuple[Tuple[str, str], ...]  # path and label
    missing: Tuple[Tuple[str, str, Tuple[str, ...]], ...]  # input keys, by place
    repeats: Tuple[Tuple[str, str, Tuple[str, ...]], ...]  # guarded states, by place
    supersede: Tuple[Tuple[str, str], ...]  # outcome, and where it leads
    give_up: Tuple[Tuple[str, str], ...]  # path and outcome
    outputs: Tuple[str, ...]


def draw_reply(
    plan: TreePlan, path: str, label: str, number: int, options: Options
) -> Optional[Reply]:
    """The answer to the question of that number about a state, None where there is none."""
    chance = random.Random('{} answer {}/{} {}'.format(plan.seed, path, label, number))
    drawn = chance.random()
    if number >= MOST_ANSWERS or drawn < 0.1:
        return Reply('give_up')
    if drawn < 0.2:
        return Reply('give_up', *chance.choice(options.give_up))
    if drawn < 0.3:
        return None
    if drawn < 0.55:
        outputs = {
            key: '{}/{} answer {}'.format(path, label, number)
            for key in options.outputs
            if chance.random() < 0.5
        }
        return Reply('supersede', '', chance.choice(options.supersede)[0], outputs)
    return Reply('goto', *chance.choice(options.places)) if options.places else None
