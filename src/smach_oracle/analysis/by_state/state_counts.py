"""Counts of what happened in states, of one trial or of several. Definitions: doc/statistics.md."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Dict, List, Optional, Tuple

# kind of failure, the outcome that was returned, and both with the text without its numbers
Reason = Tuple[str, str, str]
ANSWERS = ('goto', 'supersede', 'interface', 'give_up')
NO_ANSWERS = ('expired', 'cancelled', 'open')  # `open`: nobody has closed it in this record


@dataclass
class WayCount:
    """The times that the machine went on from a state in one way, and what came of it."""

    helped: int = 0
    in_vain: int = 0
    not_known: int = 0
    seconds: float = 0.0  # until that was clear, in all

    @property
    def gone(self) -> int:
        """Return how often it was gone."""
        return self.helped + self.in_vain + self.not_known

    def note(self, helped: Optional[bool], seconds: float) -> None:
        """Count one time. `helped`: None where it is not known."""
        self.helped += helped is True
        self.in_vain += helped is False
        self.not_known += helped is None
        self.seconds += seconds

    def add(self, other: 'WayCount') -> None:
        """Add what other trials had."""
        self.helped += other.helped
        self.in_vain += other.in_vain
        self.not_known += other.not_known
        self.seconds += other.seconds


@dataclass
class StateCounts:
    """What happened in one state."""

    visits: int = 0
    seconds: float = 0.0  # in it, the states inside included
    reasons: Dict[Reason, int] = field(default_factory=Counter)
    ways: Dict[str, WayCount] = field(default_factory=dict)  # by words
    not_recovered: int = 0  # failures after which nothing was tried
    answers: Dict[str, int] = field(default_factory=Counter)  # by ANSWERS and NO_ANSWERS
    lost_s: float = 0.0  # from failures of it until it succeeded
    lost_visits: int = 0  # that were begun in this time, those of other states among them

    @property
    def failures(self) -> int:
        """Return how often it failed."""
        return sum(self.reasons.values())

    @property
    def questions(self) -> int:
        """Return how many questions were about it."""
        return sum(self.answers.values())

    def way(self, words: str) -> WayCount:
        """Return the count of one way."""
        return self.ways.setdefault(words, WayCount())

    def add(self, other: 'StateCounts') -> None:
        """Add what other trials had."""
        self.visits += other.visits
        self.seconds += other.seconds
        self.not_recovered += other.not_recovered
        self.lost_s += other.lost_s
        self.lost_visits += other.lost_visits
        for reason, number in other.reasons.items():
            self.reasons[reason] = self.reasons.get(reason, 0) + number
        for answer, number in other.answers.items():
            self.answers[answer] = self.answers.get(answer, 0) + number
        for words, count in other.ways.items():
            self.way(words).add(count)


@dataclass
class ExpertTimes:
    """The times that questions took, in s from their opening. Each list has an entry a question."""

    to_claim: List[float] = field(default_factory=list)
    to_answer: List[float] = field(default_factory=list)
    to_resume: List[float] = field(default_factory=list)


@dataclass
class StatesOfTrials:
    """What happened in the states of some trials, by `PATH/STATE`, and what it cost."""

    trials: int = 0
    states: Dict[str, StateCounts] = field(default_factory=dict)
    robot_s: float = 0.0  # in which the trials ran
    extra_s: float = 0.0  # in which a state had failed, and not yet succeeded
    extra_visits: int = 0  # that were begun in this time
    expert_s: float = 0.0  # in which the expert worked
    times: ExpertTimes = field(default_factory=ExpertTimes)
    choices: WayCount = field(default_factory=WayCount)  # of the expert: whether they led on

    def of(self, name: str) -> StateCounts:
        """Return the counts of one state."""
        return self.states.setdefault(name, StateCounts())

    def add(self, other: 'StatesOfTrials') -> None:
        """Add what other trials had."""
        self.trials += other.trials
        self.robot_s += other.robot_s
        self.extra_s += other.extra_s
        self.extra_visits += other.extra_visits
        self.expert_s += other.expert_s
        self.times.to_claim += other.times.to_claim
        self.times.to_answer += other.times.to_answer
        self.times.to_resume += other.times.to_resume
        self.choices.add(other.choices)
        for name, counts in other.states.items():
            self.of(name).add(counts)
