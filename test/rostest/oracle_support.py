"""What the rostests of the ROS side share: scripts under oracle_run as real processes, masters of
their own.
"""

import glob
import os
import signal
import subprocess
import sys
import tempfile
import threading
import xmlrpc.client
from typing import Any, Dict, List, Optional

import rosbag
import rospy
from own_master import master_answers
from waiting import wait_for

from smach_oracle.experiment.launching import free_port
from smach_oracle.msg import OpenQueries, OracleEvent
from smach_oracle.srv import AnswerQuery, ClaimQuery

RUNNER = 'from smach_oracle.ros.oracle_run.script_runner import main; main()'


class Process:
    """A process with its output kept; killed at the end of the test at the latest."""

    def __init__(self, command: List[str], env: Optional[Dict[str, str]] = None) -> None:
        self._output = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            env=dict(os.environ, PYTHONUNBUFFERED='1', PYTHONFAULTHANDLER='1', **(env or {})),
        )

    def output(self) -> str:
        """What it has said so far."""
        return os.pread(self._output.fileno(), 1 << 20, 0).decode('utf-8', 'replace')

    def says(self, text: str, limit_s: float = 20.0) -> bool:
        """Wait until it has said this."""
        return (
            bool(wait_for(lambda: text in self.output() or not self.running(), limit_s))
            and text in self.output()
        )

    def go_on(self) -> None:
        """Let it go on that waits for a line of input."""
        self.process.stdin.write(b'\n')
        self.process.stdin.flush()

    def running(self) -> bool:
        return self.process.poll() is None

    def signal(self, number: int) -> None:
        self.process.send_signal(number)

    def wait(self, limit_s: float = 30.0) -> int:
        """Its exit code; raises subprocess.TimeoutExpired."""
        return self.process.wait(limit_s)

    def threads(self) -> str:
        """End it, and return what it has said, with where each of its threads stands."""
        self.signal(signal.SIGABRT)
        self.wait()
        return self.output()

    def stop(self) -> None:
        if self.running():
            self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self._output.close()


def oracle_run(test: Any, *args: str, env: Optional[Dict[str, str]] = None) -> Process:
    """Start oracle_run with these arguments; it ends with the test."""
    process = Process([sys.executable, '-c', RUNNER] + list(args), env)
    test.addCleanup(process.stop)
    return process


def script(test: Any, text: str, name: str = 'task.py') -> str:
    """Write a script into a folder of its own, which goes with the test."""
    folder = tempfile.TemporaryDirectory()
    test.addCleanup(folder.cleanup)
    path = os.path.join(folder.name, name)
    with open(path, 'w') as file:
        file.write(text)
    return path


class OwnMaster:
    """A ROS master on a port of its own that can be killed and started again."""

    def __init__(self, test: Any) -> None:
        self._port = free_port()
        self.uri = 'http://localhost:{}'.format(self._port)
        self.env = {'ROS_MASTER_URI': self.uri, 'ROS_HOSTNAME': 'localhost'}
        self._process: Optional[Process] = None
        self.start()
        test.addCleanup(self.kill)

    def start(self) -> None:
        """Start it and wait until it answers."""
        self._process = Process(['rosmaster', '--core', '-p', str(self._port)], self.env)
        if not wait_for(lambda: master_answers(self.uri)):
            raise RuntimeError('no master at ' + self.uri)

    def kill(self) -> None:
        if self._process is not None:
            self._process.stop()
            self._process = None

    def hang(self) -> None:
        """From now on it takes connections and answers nothing."""
        if self._process is not None:
            self._process.signal(signal.SIGSTOP)

    def system(self) -> Dict[str, List[str]]:
        """Publishers, subscribers and services, each by name."""
        with xmlrpc.client.ServerProxy(self.uri) as master:
            state = master.getSystemState('/test')[2]
        return {
            kind: [name for name, _ in entries]
            for kind, entries in zip(('publishers', 'subscribers', 'services'), state)
        }


def recorded_events(folder: str, node: str = 'task') -> List[List[OracleEvent]]:
    """The events in each of the bags in a folder, oldest first; raises where a bag is not
    closed.
    """
    trials = []
    for path in sorted(glob.glob(os.path.join(folder, '*.bag'))):
        with rosbag.Bag(path) as bag:
            trials.append(
                [event for _, event, _ in bag.read_messages('/{}/oracle/events'.format(node))]
            )
    return trials


class EventLog:
    """The events of one node, as any subscriber gets them."""

    def __init__(self, test: Any, node: str) -> None:
        self.events: List[OracleEvent] = []
        self._subscriber = rospy.Subscriber(
            '/{}/oracle/events'.format(node), OracleEvent, self.events.append
        )
        test.addCleanup(self._subscriber.unregister)

    def connected(self) -> bool:
        """Whether the node's events arrive here."""
        return bool(self._subscriber.get_num_connections())

    def of(self, kind: int) -> List[OracleEvent]:
        return [event for event in list(self.events) if event.kind == kind]

    def wait_for(self, kind: int, count: int = 1, limit_s: float = 20.0) -> List[OracleEvent]:
        wait_for(lambda: len(self.of(kind)) >= count, limit_s)
        return self.of(kind)


class FrontEnd:
    """An expert's front end that does what the test says."""

    def __init__(self, test: Any, server: str, expert: str = 'Ann') -> None:
        self.expert = expert
        self._server = server
        self._open: List[Any] = []
        self._changed = threading.Event()
        subscriber = rospy.Subscriber(server + '/open', OpenQueries, self._note)
        test.addCleanup(subscriber.unregister)
        self.claim = rospy.ServiceProxy(server + '/claim', ClaimQuery)
        self.answer = rospy.ServiceProxy(server + '/answer', AnswerQuery)

    def _note(self, message: OpenQueries) -> None:
        self._open = message.queries

    def question(self, limit_s: float = 20.0, state: str = '', other_than: str = '') -> Any:
        """Wait for an open question (of a state); None where there is none in time."""

        def find() -> Any:
            for entry in self._open:
                if state in ('', entry.query.failed_state) and entry.query.query_id != other_than:
                    return entry
            return None

        return wait_for(find, limit_s)


SIGNALS = (signal.SIGINT, signal.SIGTERM)
