"""The tries of the states that failed in a trial: when each began, and when it failed."""

import json
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.records.events import Event, EventKind, FailureKind

RESTART = 'restart'  # a decision

Pause = Tuple[float, float]  # begin, length, s


class StateTry(NamedTuple):
    """One try of a state."""

    state: str  # path below the top machine
    began_s: float
    failed_s: Optional[float]  # None: it did not fail
    restarts: int  # how often the script had been started over before


class WorldClock(NamedTuple):
    """Tells times of the clock in the world's time. See doc/simulation.md."""

    trial_s: float  # at which the trial began
    pauses: Tuple[Pause, ...]  # times in which the world stood still

    def world_s(self, second: float) -> float:
        """Return s of the world's time since the trial began."""
        stood = sum(min(length, max(0.0, second - begin)) for begin, length in self.pauses)
        return max(0.0, second - self.trial_s - stood)


def tries_of(events: Sequence[Event], stamps: Sequence[float]) -> List[StateTry]:
    """Return the tries of each state that failed in a trial, in the order of their beginnings.

    :param events: of one trial.
    :param stamps: ROS time (s) of each of them. The times of tries are such.
    """
    tries: List[StateTry] = []
    running: Dict[Tuple[str, str], int] = {}  # number of the latest try, by container and state
    decided: Dict[str, str] = {}  # by container
    restarts, top = 0, ''
    for event, second in sorted(zip(events, stamps), key=lambda each: each[0].seq):
        place = (event.path, event.state)
        top = top or event.path
        if event.kind == EventKind.STATE_START:
            running[place] = len(tries)
            tries.append(StateTry(_below(top, place), second, None, restarts))
        elif event.kind == EventKind.FAILURE and place in running:
            if event.failure_kind != FailureKind.INTERRUPTED:
                number = running.pop(place)
                tries[number] = tries[number]._replace(failed_s=second)
        elif event.kind == EventKind.DECISION:
            decided[event.path] = event.outcome
        elif event.kind == EventKind.JUMP:
            restarts += decided.pop(event.path, '') == RESTART
    failed = {each.state for each in tries if each.failed_s is not None}
    return [each for each in tries if each.state in failed]


def _below(top: str, place: Tuple[str, str]) -> str:
    path = '/'.join(place)
    return path[len(top) + 1 :] if path.startswith(top + '/') else path


def in_world_time(tries: Sequence[StateTry], clock: WorldClock) -> List[StateTry]:
    """Return the tries with times of the world, s since the trial began."""

    def told(second: Optional[float]) -> Optional[float]:
        return None if second is None else round(clock.world_s(second), 2)

    return [
        each._replace(began_s=told(each.began_s) or 0.0, failed_s=told(each.failed_s))
        for each in tries
    ]


def tries_text(tries: Sequence[StateTry]) -> str:
    """Return the tries as they stand in a row."""
    return json.dumps([list(each) for each in tries], separators=(',', ':'))


def tries_in(text: str) -> List[StateTry]:
    """Return the tries of a row.

    :raises ValueError or TypeError: where the text is none of tries_text().
    """
    return [
        StateTry(str(state), float(began), _optional(failed), int(restarts))
        for state, began, failed, restarts in json.loads(text)
    ]


def _optional(value: object) -> Optional[float]:
    return None if value is None else float(str(value))
