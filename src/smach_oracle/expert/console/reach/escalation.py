"""Finds whom to call for which question, and when. Pure.

Time counts while nobody works on a question. A claim stops it, and it goes on once the question is
released, or its holder presses nothing any more.
"""

from datetime import datetime
from typing import Dict, List, Mapping, NamedTuple, Optional, Set

from .on_call import OnCallList


class DueCall(NamedTuple):
    """A person who is to be called for a question now."""

    key: str
    person: str


class NextCall(NamedTuple):
    """The people who come next if nobody answers."""

    people: List[str]
    in_s: float


class _WaitingQuestion:
    """The time that a question has waited, and the people who were called for it."""

    def __init__(self, seen_s: float) -> None:
        self.seen_s = seen_s
        self.waited_s = 0.0
        self.step = 0  # the next one
        self.called: Set[str] = set()
        self.passed_over: List[str] = []  # in their quiet hours
        self.again: List[str] = []  # whose call was not made
        self.unreached: Set[str] = set()

    @property
    def nobody_was_reached(self) -> bool:
        """Whether all that were called could not be."""
        return bool(self.called) and self.called <= self.unreached

    def count(self, now_s: float, waits: bool) -> None:
        """Let the time go on."""
        if waits:
            self.waited_s += now_s - self.seen_s
        self.seen_s = now_s


class Escalation:
    """The calls for all open questions."""

    def __init__(self, on_call: OnCallList) -> None:
        self._on_call = on_call
        self._waiting: Dict[str, _WaitingQuestion] = {}

    def due(self, now_s: float, moment: datetime, questions: Mapping[str, bool]) -> List[DueCall]:
        """Return the calls that are due.

        :param now_s: monotonic.
        :param moment: local time, for quiet hours.
        :param questions: all open ones by key, each with whether it waits for somebody.
        """
        self._waiting = {key: each for key, each in self._waiting.items() if key in questions}
        found = []
        for key, waits in questions.items():
            waiting = self._waiting.setdefault(key, _WaitingQuestion(now_s))
            waiting.count(now_s, waits)
            if waits:
                found += [DueCall(key, person) for person in self._call(waiting, moment)]
        return found

    def take_back(self, due: DueCall) -> None:
        """A call was not made, since somebody had come. The next wait makes it."""
        waiting = self._waiting.get(due.key)
        if waiting is not None and due.person not in waiting.again:
            waiting.again.append(due.person)

    def not_reached(self, due: DueCall) -> None:
        """A person could not be reached. Where nobody was, the next step is taken at once."""
        waiting = self._waiting.get(due.key)
        if waiting is not None:
            waiting.unreached.add(due.person)

    def next_call(self, key: str, moment: datetime) -> Optional[NextCall]:
        """Return who comes next for a question, None where nobody does."""
        waiting = self._waiting.get(key)
        if waiting is None or waiting.step >= len(self._on_call.steps):
            return None
        step = self._on_call.steps[waiting.step]
        people = [each for each in step.people if self._may_call(each, moment)]
        return NextCall(people or list(step.people), max(0.0, step.after_s - waiting.waited_s))

    def _call(self, waiting: _WaitingQuestion, moment: datetime) -> List[str]:
        """Take the steps that are due. One in which nobody can be called takes no time."""
        found = [each for each in waiting.again if self._may_call(each, moment)]
        waiting.again.clear()
        steps = self._on_call.steps
        skips = waiting.nobody_was_reached
        while waiting.step < len(steps):
            step = steps[waiting.step]
            if step.after_s > waiting.waited_s and not skips:
                break
            waiting.step += 1
            people = [each for each in step.people if each not in waiting.called]
            now = [each for each in people if self._may_call(each, moment)]
            waiting.passed_over += [each for each in people if each not in now]
            waiting.called.update(now)
            found += now
            skips = not now and bool(people)
        if not waiting.called and waiting.passed_over:  # all were passed over
            found = [each for each in waiting.passed_over if self._may_call(each, moment)][:1]
            waiting.called.update(found)
        return found

    def _may_call(self, person: str, moment: datetime) -> bool:
        return not self._on_call.people[person].quiet.covers(moment)
