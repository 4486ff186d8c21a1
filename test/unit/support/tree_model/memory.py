"""What the model's oracle of one container remembers: results, visits, failures in a row."""

import copy
from fractions import Fraction
from typing import Any, Dict, List, NamedTuple, Optional

from .plan import TreePlan
from .words import class_of

SUCCESS, FAILURE, SUPERSEDED, PREEMPTED = 'success', 'failure', 'superseded', 'preempted'


class Visit(NamedTuple):
    """One visit of a state, by how it ended."""

    label: str
    result: str


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
        self._failures: List[str] = []  # labels, of this trial
        self._since: List[Visit] = []  # visits of this trial
        self._goal: Optional[str] = None
        self._goal_of: Optional[str] = None
        self.begin_execution()

    def begin_execution(self) -> None:
        """Forget the chain of visits."""
        self.chain: List[Visit] = []
        self._goal = None

    # -- visits

    def ended(self, label: str, result: str) -> None:
        """Add a visit."""
        visit = Visit(label, result)
        self.chain.append(visit)
        self._since.append(visit)
        self.visits_of[label] = self.visits_of.get(label, 0) + 1
        if result == SUCCESS:
            self._results[label].learn(False)

    def fails(self, label: str) -> None:
        """Count a failure, before its visit is added."""
        self._keep_goal(label)
        self._failures.append(label)
        self._results[label].learn(True)
        self.ended(label, FAILURE)

    def supersede(self, label: str) -> None:
        """Take the latest failure, of this state, back out."""
        self._results[label].take_back()
        self._failures.pop()
        for visits in (self.chain, self._since):
            visits[-1] = Visit(label, SUPERSEDED)

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
        if not self._failures or self._failures[-1] != label:
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
            return self._goal or self._initial
        for visit in reversed(self.chain[:-1]):
            if visit.label not in self._conditioned:
                return visit.label
        return self._initial

    def _keep_goal(self, label: str) -> None:
        """The prose's goal: it is kept while failures of a state are continuous."""
        if self._goal is not None and self._goal_of == label and self.is_continuous('prose', label):
            return
        self._goal_of = label
        self._goal = next(
            (
                visit.label
                for visit in reversed(self.chain)
                if visit.label != label and visit.result == SUCCESS
            ),
            self._initial,
        )
