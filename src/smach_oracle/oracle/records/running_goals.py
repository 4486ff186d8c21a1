"""Goals that this program has sent to others, and that run on where it is killed. Pure."""

import threading
from collections import OrderedDict
from typing import Callable, Dict, List, Mapping

MustStop = Callable[[], bool]
# takes servers by goal id, cancels the goals and waits. Returns those of which the end is not known
EndGoals = Callable[[Mapping[str, str], MustStop], Mapping[str, str]]
BeforeSending = Callable[[str, str], None]  # takes id and server
MOST = 1000  # goals. Of one that nobody follows the end is never heard


class RunningGoals:
    """The goals that run. Any thread may call it.

    `observers` are told of each goal before it is sent. `end_goals` ends those of a program that
    was killed. An adapter puts it there.
    """

    def __init__(self) -> None:
        self.observers: List[BeforeSending] = []
        self.end_goals: EndGoals = lambda goals, must_stop: goals  # nobody does
        self._lock = threading.Lock()
        self._servers: 'OrderedDict[str, str]' = OrderedDict()

    def begin(self, goal_id: str, server: str) -> None:
        """Note a goal that is about to be sent to a server."""
        self.keep(goal_id, server)
        for observer in list(self.observers):
            observer(goal_id, server)

    def keep(self, goal_id: str, server: str) -> None:
        """Note a goal that may run already."""
        with self._lock:
            self._servers[goal_id] = server
            while len(self._servers) > MOST:
                self._servers.popitem(last=False)

    def end(self, goal_id: str) -> None:
        """Note that a goal has ended."""
        with self._lock:
            self._servers.pop(goal_id, None)

    def running(self) -> Dict[str, str]:
        """Return servers by goal id."""
        with self._lock:
            return dict(self._servers)


GOALS = RunningGoals()  # those of this process
