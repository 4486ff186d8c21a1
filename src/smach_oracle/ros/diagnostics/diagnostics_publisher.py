"""Publishes on /diagnostics how the oracle of this node fares, once a second."""

import threading
import time
from typing import List, Optional

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from smach_oracle.msg import OpenQueries, OpenQuery, RecorderStatus
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.identity import WeakIdentityMap
from smach_oracle.store.store_writer import running_writers

from ..connections import quiet_at_shutdown
from ..senders.own_messages import subscribe_to_owner
from .statuses import questions_status, recorder_status, states_status, store_status

TOPIC = '/diagnostics'
PERIOD_S = 1.0  # the aggregator takes a status for stale after 5 s


class DiagnosticsPublisher:
    """A thread that looks at the machines of this node, and at its latched topics."""

    def __init__(self, server: str, period_s: float = PERIOD_S) -> None:
        """`server`: the expert query server that the node asks."""
        self._machines: WeakIdentityMap[OracleContainer, bool] = WeakIdentityMap()
        self._queries: List[OpenQuery] = []
        self._recorder: Optional[RecorderStatus] = None
        self._listens = False  # to a recorder
        self._publisher = rospy.Publisher(TOPIC, DiagnosticArray, queue_size=1)
        subscribe_to_owner(server + '/open', OpenQueries, self._take_queries)
        self._period_s = period_s
        threading.Thread(target=self._run, name='diagnostics', daemon=True).start()

    def listen_to_recorder(self) -> None:
        """Report the recorder of this node from now on."""
        if not self._listens:
            self._listens = True
            subscribe_to_owner('~record/status', RecorderStatus, self._take_recorder)

    def watch(self, machine: OracleContainer) -> None:
        """Report the states of a machine from now on."""
        self._machines[machine] = True

    def forget(self, machine: OracleContainer) -> None:
        """Report it no longer."""
        self._machines.forget(machine)

    def statuses(self) -> List[DiagnosticStatus]:
        """Return the statuses of this moment."""
        node = rospy.get_name()
        rows = [row for machine in self._machines for row in oracle_of(machine).rates()]
        writers = running_writers()
        behind = {writer.path: writer.error for writer in writers if writer.is_behind}
        return [
            questions_status(node, self._queries),
            states_status(node, rows),
            recorder_status(node, self._recorder),
            store_status(node, behind, len(writers)),
        ]

    def _take_queries(self, message: OpenQueries) -> None:
        self._queries = list(message.queries)

    def _take_recorder(self, message: RecorderStatus) -> None:
        self._recorder = message

    def _run(self) -> None:
        while not rospy.is_shutdown():
            message = DiagnosticArray(status=self.statuses())
            message.header.stamp = rospy.Time.now()
            with quiet_at_shutdown():
                self._publisher.publish(message)
            time.sleep(self._period_s)
