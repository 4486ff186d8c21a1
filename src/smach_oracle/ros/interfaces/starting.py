"""Starts shared-autonomy interfaces, publishes what they print, and ends them.

An interface is ended with all that it has started.
"""

import os
import re
import subprocess
import sys
import threading
import time
from collections import deque
from pathlib import Path
from typing import Callable, Deque, Dict, List, Optional, Sequence

import roslib.packages
import rospkg
import rospy

from smach_oracle.forking import in_child, let_go_of
from smach_oracle.msg import InterfaceOutput
from smach_oracle.oracle.errors import InterfaceError
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.oracle.settings.interfaces import InterfaceOffer, InterfaceStart

from ..connections import quiet_at_shutdown
from ..signals.latch import start_thread

OUTPUT_TOPIC = '~interface_output'
MOST_LINES = 200
LONGEST_LINE = 500
INTERRUPT_S = 12.0  # how long its command has after SIGINT
TERMINATE_S = 3.0  # and all that is left after SIGTERM, before SIGKILL
END_LIMIT_S = 25.0  # longer than both
_PUBLISH_PERIOD_S = 0.2
_KEEPER = Path(__file__).with_name('process_keeper.py')
_ESCAPE_SEQUENCE = re.compile(r'\x1b(\[[0-9;?]*[ -/]*[@-~]|\][^\x07]*\x07|.)')


def command_of(start: InterfaceStart) -> List[str]:
    """Return the command line.

    :raises InterfaceError: where the package or the node is not there. Roslaunch itself reports a
        launch file that is not.
    """
    try:
        if start.kind == 'launch':
            rospkg.RosPack().get_path(start.package)
            # never a master of its own: it would be one that nobody else knows
            return [
                'roslaunch',
                '--wait',
                '--screen',
                '--disable-title',
                start.package,
                start.target,
                *start.args,
            ]
        found = roslib.packages.find_node(start.package, start.target)
    except (rospkg.ResourceNotFound, roslib.packages.ROSPkgException) as err:
        raise InterfaceError('there is no package {}'.format(start.package)) from err
    if not found:
        raise InterfaceError(
            'there is no node {} in package {}'.format(start.target, start.package)
        )
    return [found[0], *start.args]


class StartedInterface:
    """One interface's processes, from their start to their end.

    Several questions may use it. It ends when the last one has left it.
    """

    def __init__(
        self, offer: InterfaceOffer, query_id: str, publish: Callable[[InterfaceOutput], None]
    ) -> None:
        """Start it.

        :raises InterfaceError: where it cannot be started.
        """
        self._offer = offer
        self._query_ids = [query_id]  # that use it
        self._publish = publish
        self._lines: Deque[str] = deque(maxlen=MOST_LINES)
        self._lock = threading.Lock()
        self._status, self._text = InterfaceOutput.STARTING, ''
        self._changed = threading.Event()
        self._stopping = False
        if offer.start is None:
            raise InterfaceError('nothing is said about how to start it')
        command = command_of(offer.start)
        # relative names mean the same in it as in this node's settings
        environment = dict(
            os.environ, ROS_NAMESPACE=rospy.get_namespace().rstrip('/') or '/', PYTHONUNBUFFERED='1'
        )
        try:
            self._process = subprocess.Popen(
                [sys.executable, '-I', str(_KEEPER), str(INTERRUPT_S), str(TERMINATE_S), *command],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=environment,
                start_new_session=True,
            )
        except OSError as err:
            raise InterfaceError('it cannot be started: {}'.format(err)) from err
        in_child(self._let_go)
        self.publish_status(InterfaceOutput.STARTING, 'started: ' + ' '.join(command))
        for target in (self._read, self._publish_changes):
            threading.Thread(target=target, name='output of ' + offer.name, daemon=True).start()

    def _let_go(self) -> None:
        # the end of this pipe tells the keeper that the program is gone
        if self._process.stdin is not None and not self._process.stdin.closed:
            let_go_of(self._process.stdin.fileno())

    @property
    def exit_code(self) -> Optional[int]:
        """Return the exit code of its command, None as long as it runs."""
        return self._process.poll()

    @property
    def last_lines(self) -> str:
        """Return the last lines that are not empty, for an error."""
        with self._lock:
            return ' / '.join([line for line in self._lines if line.strip()][-3:])

    def share(self, offer: InterfaceOffer, query_id: str) -> bool:
        """Have one more question use it. Return whether it can: it runs, and was started so."""
        with self._lock:
            if self._stopping or self.exit_code is not None or self._offer.start != offer.start:
                return False
            self._query_ids.append(query_id)
        self._changed.set()
        return True

    def leave(self, query_id: str, why: str = '') -> None:
        """Have a question use it no longer. Return at once, as `stop` does.

        :param why: it failed for this question. '' if it did not.
        """
        with self._lock:
            self._query_ids.remove(query_id)
            unused = not self._query_ids
            self._stopping = self._stopping or unused
            status = InterfaceOutput.FAILED if why else InterfaceOutput.STOPPED
            text = why or ('it is being stopped' if unused else 'it goes on, for another question')
            self._send([query_id], status, text)
        rospy.loginfo('Interface %s: %s', self._offer.name, text)
        if unused:
            self.stop()

    def publish_status(self, status: int, text: str) -> None:
        """Publish its status to all questions that use it."""
        with self._lock:
            self._status, self._text = status, text
            self._send(self._query_ids, status, text)
        rospy.loginfo('Interface %s: %s', self._offer.name, text)

    def stop(self) -> None:
        """Begin its end, and return at once.

        Nothing of it is left after some seconds, by force where needed.
        """
        if self._process.stdin is not None and not self._process.stdin.closed:
            self._process.stdin.close()
        self._stopping = True
        self._changed.set()

    def ended(self, limit_s: float) -> bool:
        """Wait until nothing of it is left. Return whether that is so."""
        try:
            self._process.wait(limit_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def _read(self) -> None:
        for line in self._process.stdout or ():
            text = shortened(
                _ESCAPE_SEQUENCE.sub('', line.decode('utf-8', 'replace')).rstrip(), LONGEST_LINE
            )
            with self._lock:
                self._lines.append(text)
            self._changed.set()

    def _publish_changes(self) -> None:
        while not self._stopping:
            self._changed.wait()
            self._changed.clear()
            with self._lock:
                self._send(self._query_ids, self._status, self._text)
            time.sleep(_PUBLISH_PERIOD_S)

    def _send(self, query_ids: Sequence[str], status: int, text: str) -> None:
        """Publish under the lock: what is older comes first."""
        for query_id in query_ids:
            self._publish(
                InterfaceOutput(
                    query_id=query_id,
                    interface=self._offer.name,
                    status=status,
                    text=text,
                    lines=list(self._lines),
                )
            )


class InterfaceStarter:
    """Starts interfaces for a node's questions. One at a time of each name."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher(OUTPUT_TOPIC, InterfaceOutput, latch=True, queue_size=5)
        self._last: Dict[str, StartedInterface] = {}
        self._turns: Dict[str, threading.Lock] = {}  # by name: one start after another
        self._lock = threading.Lock()
        rospy.on_shutdown(lambda: start_thread(self.stop))  # often in a signal's handler

    def runs(self, name: str) -> bool:
        """Whether anything is left of what was started under a name."""
        with self._lock:
            last = self._last.get(name)
        return last is not None and last.exit_code is None

    def start(self, offer: InterfaceOffer, query_id: str) -> StartedInterface:
        """Share what runs under its name, else start it once what was before has ended.

        :raises InterfaceError: where it cannot be started.
        """
        with self._lock:
            turn = self._turns.setdefault(offer.name, threading.Lock())
        with turn:
            with self._lock:
                before = self._last.get(offer.name)
            if before is not None and before.share(offer, query_id):
                return before
            if before is not None and not before.ended(END_LIMIT_S):
                raise InterfaceError(
                    'what was started for an earlier question has not ended within {:g} s'.format(
                        END_LIMIT_S
                    )
                )
            return self._start(offer, query_id)

    def _start(self, offer: InterfaceOffer, query_id: str) -> StartedInterface:
        try:
            started = StartedInterface(offer, query_id, self._publish)
        except InterfaceError as err:
            self._publish(
                InterfaceOutput(
                    query_id=query_id,
                    interface=offer.name,
                    status=InterfaceOutput.FAILED,
                    text=str(err),
                )
            )
            raise
        with self._lock:
            self._last[offer.name] = started
        return started

    def stop(self) -> None:
        """Begin the end of all that was started.

        Each has a keeper that sees to it, whether this node lives or not.
        """
        with self._lock:
            for started in self._last.values():
                started.stop()

    def _publish(self, message: InterfaceOutput) -> None:
        if not rospy.is_shutdown():
            with quiet_at_shutdown():
                self._publisher.publish(message)
