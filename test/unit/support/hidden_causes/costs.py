"""What trials cost, by prices that may be doubled and halved, and what a policy comes to."""

import statistics
from typing import Dict, List, NamedTuple, Sequence, Tuple

from .running import Trial


class Prices(NamedTuple):
    """Prices in minutes of the robot."""

    robot_minute: float = 1.0
    expert_minute: float = 5.0
    lost_trial: float = 60.0
    harm: float = 30.0

    def cost(self, trial: Trial) -> float:
        """Return what a trial cost."""
        return (
            self.robot_minute * trial.robot_min
            + self.expert_minute * trial.expert_min
            + self.lost_trial * trial.is_lost
            + self.harm * trial.harm
        )

    def changed(self) -> Dict[str, 'Prices']:
        """Return these prices, and those with each of them halved and doubled."""
        found = {'as given': self}
        for name in self._fields:
            for word, factor in (('half', 0.5), ('double', 2.0)):
                found['{} {}'.format(word, name)] = self._replace(
                    **{name: getattr(self, name) * factor}
                )
        return found


class Summary(NamedTuple):
    """What all trials of a policy came to. Shares are of the trials, other figures for each."""

    trials: int
    failing: float
    true_success: float
    false_success: float
    lost: float
    person: float
    questions: float
    attempts: float
    robot_min: float
    expert_min: float
    harm: float
    cost: float
    error: float  # standard error of the cost, over machines


def summarise(machines: Sequence[Sequence[Trial]], prices: Prices) -> Summary:
    """Sum up the trials of several machines under one policy. Each machine has as many."""
    trials = [trial for machine in machines for trial in machine]
    count = len(trials)
    costs = [mean_cost(machine, prices) for machine in machines]
    return Summary(
        count,
        sum(each.is_failing for each in trials) / count,
        sum(not each.is_lost for each in trials) / count,
        sum(each.ended == 'false success' for each in trials) / count,
        sum(each.is_lost for each in trials) / count,
        sum(each.needed_person for each in trials) / count,
        sum(each.questions for each in trials) / count,
        sum(each.attempts for each in trials) / count,
        sum(each.robot_min for each in trials) / count,
        sum(each.expert_min for each in trials) / count,
        sum(each.harm for each in trials) / count,
        statistics.mean(costs),
        standard_error(costs),
    )


def mean_cost(trials: Sequence[Trial], prices: Prices) -> float:
    """Return what a trial cost on the average."""
    return statistics.mean(prices.cost(each) for each in trials)


def standard_error(values: Sequence[float]) -> float:
    """Return the standard error of their mean, 0 for one value."""
    return statistics.stdev(values) / len(values) ** 0.5 if len(values) > 1 else 0.0


def difference(
    machines: Sequence[Sequence[Trial]], others: Sequence[Sequence[Trial]], prices: Prices
) -> Tuple[float, float]:
    """Return how much dearer the first are than the others, machine by machine, and the error."""
    each: List[float] = [
        mean_cost(these, prices) - mean_cost(those, prices)
        for these, those in zip(machines, others)
    ]
    return statistics.mean(each), standard_error(each)
