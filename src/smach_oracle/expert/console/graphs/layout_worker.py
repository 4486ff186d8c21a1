"""Runs dot, in threads of its own, for graphs that have not been laid out yet.

A graph that takes too long is tried again, with twice the time, when no other one waits.
"""

import itertools
import os
import queue
import shutil
import threading
from collections import OrderedDict
from typing import Callable, Dict, List, NamedTuple, Optional

import rospy

from smach_oracle.analysis.graphs.container_graph import ContainerGraph, GraphLayout, dot_text
from smach_oracle.analysis.graphs.dot import DOT_LIMIT_S, LayoutError, lay_out
from smach_oracle.ros.log.said_once import warn_once

_REMEMBERED = 200
TRIES = 3  # the last one has four times the time of the first
_MOST_THREADS = 4

Done = Callable[[], None]


class _WaitingGraph(NamedTuple):
    """A graph that waits. Those that were tried less often come first."""

    tries: int  # before
    number: int
    text: str


class LayoutWorker:
    """Layouts by the text that dot is given.

    The same graph is laid out once, however many robots have it.
    """

    def __init__(self, command: str = 'dot', limit_s: float = DOT_LIMIT_S) -> None:
        """`command`: found in PATH. Without it there are no layouts, and the page shows lists."""
        self._command = shutil.which(command)
        self._limit_s = limit_s
        self._layouts: 'OrderedDict[str, Optional[GraphLayout]]' = OrderedDict()
        self._waiting: 'queue.PriorityQueue[_WaitingGraph]' = queue.PriorityQueue()
        self._numbers = itertools.count()
        self._asked: Dict[str, List[Done]] = {}  # who waits for it
        self._lock = threading.Lock()
        if self._command is None:
            rospy.logwarn(
                'Graphviz is not installed (no %s in PATH): state graphs are shown as lists.',
                command,
            )
        else:
            for _ in range(min(_MOST_THREADS, os.cpu_count() or 1)):
                threading.Thread(target=self._run, name='layout', daemon=True).start()

    def find(self, graph: ContainerGraph, done: Done) -> Optional[GraphLayout]:
        """Return the layout of a graph, or None where it cannot be had, or not yet.

        A large graph is not laid out.

        :param done: called when it is there.
        """
        if not graph.is_small:
            return None
        text = dot_text(graph)
        with self._lock:
            if text in self._layouts:
                self._layouts.move_to_end(text)
                if text in self._asked:
                    self._asked[text].append(done)
                return self._layouts[text]
            if self._command is not None:
                self._layouts[text] = None
                self._asked[text] = [done]
                self._waiting.put(_WaitingGraph(0, next(self._numbers), text))
        return None

    def wait(self, graph: ContainerGraph, limit_s: float) -> Optional[GraphLayout]:
        """Return the layout of a graph, or None where there is none within `limit_s`."""
        there = threading.Event()
        found = self.find(graph, there.set)
        text = dot_text(graph) if found is None and graph.is_small else ''
        if text in self._asked:
            there.wait(limit_s)
            found = self._layouts.get(text)
        return found

    def _run(self) -> None:
        while not rospy.is_shutdown():
            tries, _, text = self._waiting.get()
            try:
                layout: Optional[GraphLayout] = self._lay_out(text, tries)
            except LayoutError as err:
                if tries + 1 < TRIES:
                    self._waiting.put(_WaitingGraph(tries + 1, next(self._numbers), text))
                    continue
                warn_once(
                    'dot could not lay a state graph out; it is shown without: {}'.format(err)
                )
                layout = None
            self._note(text, layout)

    def _lay_out(self, text: str, tries: int) -> GraphLayout:
        return lay_out(text, str(self._command), self._limit_s * 2**tries)

    def _note(self, text: str, layout: Optional[GraphLayout]) -> None:
        with self._lock:
            self._layouts[text] = layout
            waiting = self._asked.pop(text)
            for old in [each for each in self._layouts if each not in self._asked][:-_REMEMBERED]:
                del self._layouts[old]
        for done in waiting:
            done()
