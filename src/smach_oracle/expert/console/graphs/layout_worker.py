"""Runs dot, in a thread of its own, for graphs that have not been laid out yet."""

import queue
import shutil
import threading
from collections import OrderedDict
from typing import Callable, Dict, List, Optional

import rospy

from smach_oracle.analysis.graphs.container_graph import GraphLayout
from smach_oracle.analysis.graphs.dot import DOT_LIMIT_S, LayoutError, lay_out
from smach_oracle.ros.log.said_once import warn_once

_REMEMBERED = 200

Done = Callable[[], None]


class LayoutWorker:
    """Layouts by the text that dot is given.

    The same graph is laid out once, however many robots have it.
    """

    def __init__(self, command: str = 'dot', limit_s: float = DOT_LIMIT_S) -> None:
        """`command`: found in PATH. Without it there are no layouts, and the page shows lists."""
        self._command = shutil.which(command)
        self._limit_s = limit_s
        self._layouts: 'OrderedDict[str, Optional[GraphLayout]]' = OrderedDict()
        self._waiting: 'queue.Queue[str]' = queue.Queue()
        self._asked: Dict[str, List[Done]] = {}  # who waits for it
        self._lock = threading.Lock()
        if self._command is None:
            rospy.logwarn(
                'Graphviz is not installed (no %s in PATH): state graphs are shown as lists.',
                command,
            )
        else:
            threading.Thread(target=self._run, name='layout', daemon=True).start()

    def find(self, text: str, done: Done) -> Optional[GraphLayout]:
        """Return the layout of a graph, or None where it cannot be had, or not yet.

        :param done: called when it is there.
        """
        with self._lock:
            if text in self._layouts:
                self._layouts.move_to_end(text)
                if text in self._asked:
                    self._asked[text].append(done)
                return self._layouts[text]
            if self._command is not None:
                self._layouts[text] = None
                self._asked[text] = [done]
                self._waiting.put(text)
        return None

    def wait(self, text: str, limit_s: float) -> Optional[GraphLayout]:
        """Return the layout of a graph, or None where there is none within `limit_s`."""
        there = threading.Event()
        found = self.find(text, there.set)
        if found is None and text in self._asked:
            there.wait(limit_s)
            found = self._layouts.get(text)
        return found

    def _run(self) -> None:
        while not rospy.is_shutdown():
            text = self._waiting.get()
            layout = self._lay_out(text)
            with self._lock:
                self._layouts[text] = layout
                waiting = self._asked.pop(text)
                for old in [each for each in self._layouts if each not in self._asked][
                    :-_REMEMBERED
                ]:
                    del self._layouts[old]
            for done in waiting:
                done()

    def _lay_out(self, text: str) -> Optional[GraphLayout]:
        try:
            return lay_out(text, str(self._command), self._limit_s)
        except LayoutError as err:
            warn_once('dot could not lay a state graph out; it is shown as a list: {}'.format(err))
            return None
