"""The model's threads: one at a time, each up to its next turn."""

import random
from typing import Any, Dict, Generator, List, NamedTuple, Optional, Tuple

Course = Generator[Any, Any, Any]  # yields a Turn or a Fork


class Turn(NamedTuple):
    """A leaf waits until it is its turn."""

    key: str


class Fork(NamedTuple):
    """A Concurrence waits for its branches."""

    owner: Any  # has child_ended(label, outcome, error)
    branches: List[Tuple[str, Course]]


class _Thread:
    def __init__(self, course: Course, parent: Optional['_Thread'], owner: Any, label: str) -> None:
        self.course = course
        self.parent = parent
        self.owner = owner
        self.label = label
        self.children_left = 0


class Scheduler:
    """Grants turns by chance, once every thread waits; the executive's side draws the same."""

    def __init__(self, seed: str) -> None:
        self._chance = random.Random('turns ' + seed)
        self._waiting: Dict[str, _Thread] = {}

    def run(self, course: Course) -> Any:
        """Run a course to its end; returns what it returns, raises what it raises."""
        main = _Thread(course, None, None, '')
        ready = [main]
        while True:
            while ready:
                thread = ready.pop(0)
                try:
                    said = next(thread.course)
                except StopIteration as end:
                    if thread is main:
                        return end.value
                    self._ended(thread, end.value, None, ready)
                except Exception as err:
                    if thread is main:
                        raise
                    self._ended(thread, None, err, ready)
                else:
                    self._go_on(thread, said, ready)
            key = draw_turn(self._chance, list(self._waiting))
            ready.append(self._waiting.pop(key))

    def _go_on(self, thread: _Thread, said: Any, ready: List[_Thread]) -> None:
        if isinstance(said, Turn):
            self._waiting[said.key] = thread
            return
        thread.children_left = len(said.branches)
        ready.extend(_Thread(course, thread, said.owner, label) for label, course in said.branches)

    def _ended(
        self, thread: _Thread, outcome: Any, error: Optional[Exception], ready: List[_Thread]
    ) -> None:
        thread.owner.child_ended(thread.label, outcome, error)
        parent = thread.parent
        if parent is not None:
            parent.children_left -= 1
            if not parent.children_left:
                ready.append(parent)


def draw_turn(chance: random.Random, waiting: List[str]) -> str:
    """Whose turn it is, of those who wait."""
    return chance.choice(sorted(waiting))
