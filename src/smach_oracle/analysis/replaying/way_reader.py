"""Derives the results of ways from the events of trials, as the executive notes them. Pure."""

from typing import Dict, Mapping, Optional, Tuple

from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.decision.ways import (
    BY_PERSON,
    FIRST,
    LATER,
    Evidence,
    WayKind,
    WayResult,
    kind_of_choice,
)
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import Decider, decided_by
from smach_oracle.oracle.records.way_results import WayLog, counts_of_kinds

from ..trial_counter import TrialCounter, TrialEnding
from .followed import Decisions, GoneWay, Key, Visits, WorkTime, is_act_of_person, key_of
from .menus import recorded_menu


class WayReader:
    """Follows the trials of one machine, in their order, and notes the results of its ways."""

    def __init__(self) -> None:
        self.logs: Dict[Key, WayLog] = {}
        self._begin()

    def _begin(self) -> None:
        self._time = WorkTime()
        self._visits = Visits()
        self._decisions = Decisions()
        self._counter = TrialCounter()
        self._failed: Dict[Key, Event] = {}  # in the latest visit
        self._decided_min: Dict[Key, float] = {}
        self._top = ''  # path of the top machine
        self._was_preempted = False

    def take(self, event: Event) -> None:
        """Follow one event."""
        if event.kind == EventKind.TRIAL_START:
            self._settle_all(None)
            self._begin()
            self._top = event.path
        self._was_preempted |= event.kind == EventKind.PREEMPT and event.path == self._top
        self._time.take(event)
        self._counter.add(event)
        key = key_of(event)
        ends, succeeded = self._visits.take(event)
        if ends and key in self.logs:
            self.logs[key].settle(succeeded)
        if event.kind == EventKind.FAILURE:
            self._failed[key] = event
        elif event.kind == EventKind.STATE_START:
            self._failed.pop(key, None)
        elif event.kind == EventKind.DECISION:
            self._decided_min[key] = self._time.minutes
            if decided_by(event) is Decider.HELD_BACK:  # the state has not run, so no failure
                self._failed.pop(key, None)
        elif event.kind == EventKind.RESUMED:  # the program has forgotten which ways were gone
            self._forget()
        elif event.kind == EventKind.TRIAL_END:
            is_lost = self._counter.ending is TrialEnding.FAILURE and not self._was_preempted
            self._settle_all(False if is_lost else None)
        elif is_act_of_person(event):
            self._settle_all(None)
        gone = self._decisions.take(event)
        if gone is not None:
            self._go(gone)

    def evidence(self, key: Key) -> Evidence:
        """Return what is known of the ways on from the present failure of a state."""
        log, failed = self.logs.get(key, WayLog()), self._failed.get(key)
        name = '' if failed is None else _name_in(log, failed)
        of_kinds = counts_of_kinds(each.of_kinds for each in self.logs.values())
        return Evidence(tuple(log.results), name, of_kinds)

    def _settle_all(self, helped: Optional[bool]) -> None:
        for log in self.logs.values():
            log.settle(helped)

    def _forget(self) -> None:
        self.logs = {key: log.twin() for key, log in self.logs.items()}

    def _go(self, gone: GoneWay) -> None:
        failed = self._failed.get(gone.key)
        place_and_kind = self._place_and_kind(gone)
        if failed is None or place_and_kind is None:
            return
        place, kind = place_and_kind
        log = self.logs.setdefault(gone.key, WayLog())
        since_min = self._time.minutes
        if gone.decision is not None:
            since_min = self._decided_min.get(gone.key, since_min)
        result = WayResult(
            gone.way, kind.value, place, _name_in(log, failed), None, 0.0, _hoped(gone.decision)
        )
        log.go(result, lambda: self._time.minutes - since_min)

    def _place_and_kind(self, gone: GoneWay) -> Optional[Tuple[int, WayKind]]:
        """Return them, None where no menu is known."""
        if gone.decision is None:
            if not self._goes_by_ways():
                return None
            return BY_PERSON, kind_of_choice(gone.way)
        recorded = recorded_menu(gone.decision, {})
        if recorded is None:
            return None
        kinds = [way.kind for way in recorded.menu.ways if way.key == gone.way]
        place = LATER if recorded.menu.streak.tried else FIRST
        return (place, kinds[0]) if kinds else None

    def _goes_by_ways(self) -> bool:
        policy = POLICIES.get(str(dict(self._counter.settings).get('policy')))
        return policy is not None and policy.goes_by_ways


def _name_in(log: WayLog, failed: Event) -> str:
    return log.failure_key(failed.failure_kind, failed.outcome, failed.text)


def _hoped(decision: Optional[Event]) -> Optional[float]:
    """Return the chance to help for which a way came before its turn."""
    data = decision.data if decision is not None else None
    hoped = data.get('hoped') if isinstance(data, Mapping) else None
    return float(hoped) if isinstance(hoped, (int, float)) else None
