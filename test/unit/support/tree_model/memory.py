"""What the model's oracle of one container remembers: results, visits, failures in a row."""

import copy
from fractions import Fraction
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from .plan import TreePlan
from .words import class_of

SUCCESS, FAILURE, SUPERSEDED, PREEMPTED = 'success', 'failure', 'superseded', 'preempted'


class Visit(NamedTuple):
    """One visit of a state, by how it ended."""

    label: str
    result: str


class Failure(NamedTuple):
    """One failure of a state, and the prose's goal of a step back from it."""

    label: str
    goal: Optional[str]  # None: the container is executed again since


class Kept(NamedTuple):
    """A failure after which the author's own way was kept."""

    label: str
    outcome: str
    continuous: bool
    back_to: str  # where a step back would have gone
    told_by: Tuple[str, ...] = ()  # states that have reported it, from whom the oracle went on


class Results:
    """All results of one state, the latest last; True: it failed."""

    def __init__(self, memory: int, prior: float, estimator: str) -> None:
        self._memory = memory
        self._prior = Fraction(str(prior))  # exact: a rate may be just that from which it is HIGH
        self._estimator = estimator
        self._failed: List[bool] = []

    def rate(self) -> Fraction:
        """The failure rate: of a window that starts out filled with the prior, or exponential."""
        size = self._memory
        if self._estimator == 'window':
            window = self._failed[-size:]
            return (sum(window) + self._prior * (size - len(window))) / size
        believed = self._prior
        for failed in self._failed:
            believed += (int(failed) - believed) / size
        return believed

    def learn(self, failed: bool) -> None:
        """Add a result."""
        self._failed.append(failed)

    def take_back(self) -> None:
        """Drop the latest."""
        self._failed.pop()


class Remembered:
    """The memory of one container's oracle."""

    def __init__(self, plan: TreePlan, path: str, labels: List[str], initial: str) -> None:
        self._initial = initial
        self._results: Dict[str, Results] = {}
        self._conditioned = set()
        for label in labels:
            own = plan.of(path, label)
            self._results[label] = Results(
                plan.memory if own.memory is None else own.memory,
                plan.prior if own.prior is None else own.prior,
                plan.estimator,
            )
            if own.preconditions:
                self._conditioned.add(label)
        self.begin_trial()

    def begin_trial(self) -> None:
        """Forget what holds for one trial."""
        self.recoveries: Dict[str, int] = {}
        self.fallbacks: Dict[str, int] = {}
        self.visits_of: Dict[str, int] = {}
        self._failures: List[Failure] = []  # of this trial
        self._since: List[Visit] = []  # visits of this trial
        self.begin_execution()

    def begin_execution(self) -> None:
        """Forget the chain of visits."""
        self.chain: List[Visit] = []
        self._kept: List[Kept] = []
        self._failures = [failure._replace(goal=None) for failure in self._failures]

    # -- visits

    def ended(self, label: str, result: str) -> None:
        """Add a visit."""
        visit = Visit(label, result)
        self.chain.append(visit)
        self._since.append(visit)
        self.visits_of[label] = self.visits_of.get(label, 0) + 1
        if result in (SUCCESS, SUPERSEDED):
            self._overcome(label)
        if result == SUCCESS:
            self._results[label].learn(False)

    def fails(self, label: str) -> None:
        """Count a failure, before its visit is added."""
        goal = self._goal_of(label)
        self._overcome(label)
        self._failures.append(Failure(label, goal))
        self._results[label].learn(True)
        self.ended(label, FAILURE)

    def supersede(self, label: str) -> None:
        """Take the latest failure, of this state, back out."""
        self._results[label].take_back()
        latest = max(place for place, each in enumerate(self._failures) if each.label == label)
        del self._failures[latest]
        self._overcome(label)
        for visits in (self.chain, self._since):
            latest = max(place for place, visit in enumerate(visits) if visit.label == label)
            visits[latest] = Visit(label, SUPERSEDED)
            if latest + 1 < len(visits):  # a later state has reported it
                visits.append(Visit(label, SUPERSEDED))

    # -- failures that a later state may report

    def keep_failure(self, policy: str, label: str, outcome: str, continuous: bool) -> None:
        """The failure that was counted last has gone its author's way."""
        self._kept.append(Kept(label, outcome, continuous, self.step_back_target(policy, label)))

    def _overcome(self, label: str) -> None:
        self._kept = [kept for kept in self._kept if kept.label != label]

    def reported_by(self, label: str) -> Optional[Kept]:
        """The latest such failure, where this state reports one of another state."""
        if not self._kept or self._kept[-1].label == label:
            return None
        latest = self._kept[-1]
        if any(teller != label for teller in latest.told_by):
            return None
        is_latest = self._failures[-1].label == latest.label
        return latest._replace(continuous=latest.continuous and is_latest)

    def reports(self, label: str) -> None:
        """The oracle goes on from what this state has reported."""
        self._kept = [kept._replace(told_by=(*kept.told_by, label)) for kept in self._kept]

    def keep(self) -> Any:
        """All of it, for `put_back`."""
        return copy.deepcopy(self.__dict__)

    def put_back(self, kept: Any) -> None:
        """Remember what was remembered then."""
        self.__dict__.update(kept)

    # -- what a policy asks

    def rate(self, label: str) -> Fraction:
        """The failure rate of a state."""
        return self._results[label].rate()

    def failure_class(self, label: str) -> str:
        """LOW, MODERATE or HIGH."""
        return class_of(self.rate(label))

    def is_continuous(self, policy: str, label: str) -> bool:
        """Whether a failure of `label` now would be a continuous one."""
        if not self._failures or self._failures[-1].label != label:
            return False
        return policy == 'algorithm1' or not self._succeeded_since_it_failed(label)

    def _succeeded_since_it_failed(self, label: str) -> bool:
        for visit in reversed(self._since):
            if visit.label == label and visit.result in (SUCCESS, FAILURE):
                return visit.result == SUCCESS
        return False

    def step_back_target(self, policy: str, label: str) -> str:
        """Where a step back from the failure that was counted last goes to."""
        if policy == 'prose':
            return self._failures[-1].goal or self._initial
        for visit in reversed(self.chain[:-1]):
            if visit.label not in self._conditioned:
                return visit.label
        return self._initial

    def _goal_of(self, label: str) -> str:
        """The prose's goal: it is kept while failures of a state are continuous."""
        if self.is_continuous('prose', label) and self._failures[-1].goal is not None:
            return self._failures[-1].goal
        return next(
            (
                visit.label
                for visit in reversed(self.chain)
                if visit.label != label and visit.result == SUCCESS
            ),
            self._initial,
        )
