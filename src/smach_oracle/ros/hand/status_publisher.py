"""The topic `~oracle/control`: how the machines of a node stand as operators see them."""

import threading
import time
from typing import Callable, Sequence, Tuple

import rospy

from smach_oracle.msg import ActiveState, ControlStatus, MachineControl
from smach_oracle.oracle.operator_hand import HandStatus, OperatorHand

from ..connections import quiet_at_shutdown

TOPIC = '~oracle/control'
_PERIOD_S = 0.05  # at most 20 Hz
_MOVES_PERIOD_S = 0.5  # how soon those who listen see which states are active

Hands = Callable[[], Sequence[Tuple[str, OperatorHand]]]


class ControlPublisher:
    """Publishes in a thread of its own, so that no machine waits for it."""

    def __init__(self, hands: Hands) -> None:
        self._hands = hands
        self._changed = threading.Event()
        self._has_moved = False

    def start(self) -> None:
        """Advertise the topic, and publish from now on."""
        self._topic = rospy.Publisher(TOPIC, ControlStatus, queue_size=1, latch=True)
        threading.Thread(target=self._run, name='operator status', daemon=True).start()

    def changed(self) -> None:
        """Publish soon."""
        self._changed.set()

    def moved(self) -> None:
        """Publish within half a second, if anybody listens: other states are active."""
        self._has_moved = True

    def _run(self) -> None:
        while not rospy.is_shutdown():
            has_changed = self._changed.wait(_MOVES_PERIOD_S)
            if not has_changed and not (self._has_moved and self._topic.get_num_connections()):
                continue
            self._changed.clear()
            self._has_moved = False
            with quiet_at_shutdown():
                self._topic.publish(self._message())
            time.sleep(_PERIOD_S)

    def _message(self) -> ControlStatus:
        message = ControlStatus(machines=[to_msg(hand.status()) for _, hand in self._hands()])
        message.header.stamp = rospy.get_rostime()
        return message


def to_msg(status: HandStatus) -> MachineControl:
    """Return a status as a message."""
    return MachineControl(
        path=status.path,
        running=status.running,
        paused=status.paused,
        paused_by=status.paused_by,
        active=[ActiveState(*each) for each in status.active],
        breakpoints=list(status.breakpoints),
        autonomy_patterns=list(status.autonomy),
        autonomy_levels=list(status.autonomy.values()),
        jump_containers=list(status.jumps),
        jump_states=list(status.jumps.values()),
    )
