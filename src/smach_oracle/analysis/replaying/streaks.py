"""Recorded streaks, and what another policy that goes by ways would have done in them. Pure.

A *streak* is the failures of one state, up to its next success, to a question, or to the end of
the execution of its container (doc/ways.md).
"""

from typing import Any, Dict, FrozenSet, List, Mapping, NamedTuple, Optional, Tuple

from smach_oracle.oracle.decision.by_ways import Escalating
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policy import Menu, Policy, Preconditions, Situation
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind

from ..trial_counter import TrialCounter, TrialEnding
from .followed import Decisions, Key, Visits, WorkTime, is_act_of_person, key_of
from .menus import chosen_way, order_of, prices_of, recorded_menu
from .replay import STAYS, ReplayedDecision

_NOTHING = Situation(FailureClass.LOW, Preconditions.NONE, False)
_PRICES = Escalating()  # by which what a streak costs is told, as in doc/ways.md


class StreakEnd(NamedTuple):
    """What a streak came to. `questions`: 0 or 1. `cost`: in minutes of the robot."""

    cured: float
    questions: float
    cost: float


class StreakStep(NamedTuple):
    """One recorded decision of a streak, and the chances of another policy at it.

    `chance`: of the recorded way, under the recorded policy. `follows`: the same under the other
    policy. `asks`: the chance that the other one would ask where the recorded one did not.
    `covered`: the chance that the other one does something that the recorded one could have done.
    `if_asks`: what the streak comes to then. `best`, `worst`: what it may come to if the other one
    goes another way.
    """

    chance: float = 1.0
    follows: float = 1.0
    asks: float = 0.0
    covered: float = 1.0
    if_asks: StreakEnd = StreakEnd(0.0, 0.0, 0.0)
    best: StreakEnd = StreakEnd(0.0, 0.0, 0.0)
    worst: StreakEnd = StreakEnd(0.0, 0.0, 0.0)


class RecordedStreak(NamedTuple):
    """One streak. `end`: None where nobody knows how it would have ended, as a person acted."""

    trial: int
    steps: Tuple[StreakStep, ...]
    end: Optional[StreakEnd]


def recorded_chance(event: Event) -> float:
    """Return the chance with which a DECISION has chosen its way, 1 where it tells none."""
    data: Mapping[str, Any] = event.data if isinstance(event.data, Mapping) else {}
    chance = data.get('chance')
    return float(chance) if isinstance(chance, (int, float)) and 0.0 < chance <= 1.0 else 1.0


def could_have_chosen(event: Event) -> FrozenSet[str]:
    """Return the keys of the ways that a DECISION may have chosen, '' for to ask.

    A policy that explores swaps the first two. The control draws from all.
    """
    chance, order = recorded_chance(event), order_of(event)
    if not order or chance == 1.0:
        return frozenset((chosen_way(event),))
    are_alike = abs(chance * len(order) - 1.0) < 1e-6
    return frozenset(order if are_alike else order[:2])


def _harm_of(decision: Event, key: str, settings: Mapping[str, Any]) -> float:
    """Return the price of the harm that a way of a menu may do."""
    recorded = recorded_menu(decision, settings)
    if recorded is None:
        return 0.0
    found = [way for way in recorded.menu.ways if way.key == key]
    return sum(_PRICES.price(way._replace(minutes=0.0), recorded.menu.prices) for way in found)


class _Open:
    """A streak that goes on."""

    def __init__(self, began_min: float) -> None:
        self.began_min = began_min
        self.steps: List[StreakStep] = []
        self.harm = 0.0  # in minutes of the robot, of the ways that were gone
        self.robot_minute = 1.0
        self.is_known = True
        self.asking: Optional[float] = None  # the price of asking, once that was decided

    def cost(self, now_min: float) -> float:
        return self.robot_minute * (now_min - self.began_min) + self.harm


class StreakReader:
    """Follows trials of a replicate, and puts their streaks to a policy that goes by ways."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self.found: List[RecordedStreak] = []
        self._trial = -1
        self._begin()

    def _begin(self) -> None:
        self._trial += 1
        self._time = WorkTime()
        self._visits = Visits()
        self._decisions = Decisions()
        self._counter = TrialCounter()
        self._open: Dict[Key, _Open] = {}
        self._failed_at: Dict[Key, float] = {}

    def take(
        self, event: Event, tried: Optional[ReplayedDecision], settings: Mapping[str, Any]
    ) -> None:
        """Follow one event. `tried`: what the policy would do, at a DECISION."""
        if event.kind == EventKind.TRIAL_START:
            self._begin()
        self._time.take(event)
        self._counter.add(event)
        key = key_of(event)
        ends, succeeded = self._visits.take(event)
        if ends and succeeded is not False:
            self._close(key, 1.0 if succeeded else None)
        if event.kind == EventKind.FAILURE:
            self._failed_at[key] = self._time.minutes
            if event.failure_kind == FailureKind.INTERRUPTED:
                self._close(key, None)
        elif event.kind == EventKind.DECISION:
            self._decided(event, tried, settings)
        elif event.kind == EventKind.QUERY_OPENED:
            self._close(key, 0.0, asked=True)
        elif event.kind == EventKind.PREEMPT:
            self._close_all(None, event.path)
        elif event.kind == EventKind.RESUMED:
            self._open.clear()
        elif event.kind == EventKind.TRIAL_END:
            ended_badly = self._counter.ending is TrialEnding.FAILURE
            self._close_all(0.0 if ended_badly else None)
        elif is_act_of_person(event):
            self._close_all(None)
        gone = self._decisions.take(event)
        if gone is not None and gone.decision is not None and gone.key in self._open:
            self._open[gone.key].harm += _harm_of(gone.decision, gone.way, settings)

    def _decided(
        self, event: Event, tried: Optional[ReplayedDecision], settings: Mapping[str, Any]
    ) -> None:
        key = key_of(event)
        recorded = recorded_menu(event, settings)
        if recorded is not None and not recorded.menu.streak.tried:
            self._close(key, 0.0)  # a new one begins
        if key not in self._open:
            self._open[key] = _Open(self._failed_at.get(key, self._time.minutes))
        streak = self._open[key]
        situation = tried.situation if tried is not None else None
        if situation is not None:
            streak.robot_minute = situation.menu.prices.robot_minute
            streak.steps.append(self._step(event, situation, streak.cost(self._time.minutes)))
        elif tried is None or tried.lacks_menu or event.outcome not in STAYS:
            streak.is_known = False
        if event.outcome in STAYS:
            streak.asking = _PRICES.price_of_asking(
                situation or _NOTHING._replace(menu=Menu(prices=prices_of(settings)))
            )

    def _step(self, event: Event, situation: Situation, cost: float) -> StreakStep:
        policy, chosen = self._policy, chosen_way(event)
        asks = policy.chance_of(situation, '')
        price = _PRICES.price_of_asking(situation)
        prices = sorted(
            _PRICES.price(way, situation.menu.prices) for way in policy.order(situation)
        )
        left = max(1, (policy.most_of_streak or 1) - situation.menu.streak.attempts)
        has_expert = float(situation.menu.has_expert)
        return StreakStep(
            recorded_chance(event),
            policy.chance_of(situation, chosen),
            asks if chosen else 0.0,
            sum(policy.chance_of(situation, each) for each in could_have_chosen(event))
            + (asks if chosen else 0.0),
            StreakEnd(0.0, has_expert, cost + price),
            StreakEnd(1.0, 0.0, cost + sum(prices[:1])),
            StreakEnd(0.0, has_expert, cost + sum(prices[-left:]) + price),
        )

    def _close(self, key: Key, cured: Optional[float], asked: bool = False) -> None:
        """End a streak. `cured`: None is not known."""
        streak = self._open.pop(key, None)
        if streak is None or not (streak.steps or not streak.is_known):
            return
        end = None
        if streak.asking is not None:  # what comes after that is not of its own ways
            cured = 0.0
        if cured is not None and streak.is_known:
            cost = streak.cost(self._time.minutes) + (streak.asking or 0.0)
            end = StreakEnd(cured, float(asked), cost)
        self.found.append(RecordedStreak(self._trial, tuple(streak.steps), end))

    def _close_all(self, cured: Optional[float], path: str = '') -> None:
        """End those in a container, and below it. '': everywhere."""
        for key in list(self._open):
            if not path or (key[0] + '/').startswith(path + '/'):
                self._close(key, cured)
