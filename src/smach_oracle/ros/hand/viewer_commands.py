"""A viewer's "set as initial state" for machines that run under an oracle.

Our introspection server hands it over. One that a program has made with upstream's smach_ros sets
the initial state, which does nothing to a machine that runs: its topic is listened to as well.
"""

import threading
import time
import types
import weakref
from typing import Any, Collection, Dict, Iterator, List, Optional, Tuple, cast

import rospy

import smach
from smach_common.connections import sender_of
from smach_common.introspection.plain_pickle import RefusedDataError, decode_userdata
from smach_common.introspection.viewer_jump import add_sender
from smach_msgs.msg import SmachContainerInitialStatusCmd
from smach_oracle.oracle.errors import TrialError
from smach_oracle.oracle.identity import own_mark
from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.oracle.under_way import is_stepping

_SAME_S = 1.0
"""Clients repeat a command several times a second until a status shows it; that is one wish."""
_Wish = Tuple[int, str]  # id of a machine, and a state
_Shown = Tuple[str, str]  # topic and path of a container there


class ViewerCommands:
    """Sends machines where viewers want them. It listens for those that it is told of."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._shown: Dict[_Shown, 'weakref.ref[smach.Container]'] = {}
        self._subscribers: Dict[str, rospy.Subscriber] = {}
        self._sending = threading.Lock()  # the second of two equal wishes waits for the first
        self._heard: Dict[_Wish, Tuple[float, bool]] = {}  # when, in s, whether it was sent
        add_sender(self.send)

    def listen_for(self, machine: smach.StateMachine) -> None:
        """Listen where upstream's servers listen for a machine and the containers in it."""
        with self._lock:
            for container in _containers_in(machine, []):
                for shown in _shown_by_upstream(container):
                    self._shown[shown] = weakref.ref(container)
                    if shown[0] not in self._subscribers:
                        self._subscribers[shown[0]] = rospy.Subscriber(
                            shown[0], SmachContainerInitialStatusCmd, self._on_command, shown[0]
                        )

    def _on_command(self, command: SmachContainerInitialStatusCmd, topic: str) -> None:
        known = self._shown.get((topic, command.path))
        container = known() if known is not None else None
        if container is None:
            return
        try:
            written = decode_userdata(command.local_data)
        except RefusedDataError as err:
            smach.logerr("'%s' is not sent anywhere: %s" % (command.path, err))
            return
        for label in list(command.initial_states)[:1]:
            self.send(container, label, written, sender_of(command))

    def send(self, container: Any, label: str, written: Collection[str], by: str) -> Optional[bool]:
        """Send a machine that runs under an oracle to a state, as an operator would.

        :param written: userdata keys that come with the command.
        :param by: who wants it.
        :returns: None where the container is no such machine, or does not run and begins there,
            False where it cannot go there.
        """
        if not isinstance(container, smach.StateMachine):
            return None
        try:
            hand = OperatorHand(container)
        except TrialError:
            return None
        if not is_stepping(container):
            hand.begins_in(label)
            return None
        wish = (id(container), label)
        with self._sending:
            known = self._answered(wish)
            sent = hand.send(label, by, tuple(written)) if known is None else known
            self._heard[wish] = (time.monotonic(), sent)
        return sent

    def _answered(self, wish: _Wish) -> Optional[bool]:
        """Whether an equal wish that was just heard was sent. It is None where there was none."""
        now_s = time.monotonic()
        self._heard = {
            each: heard for each, heard in self._heard.items() if now_s - heard[0] < _SAME_S
        }
        return self._heard[wish][1] if wish in self._heard else None


def _containers_in(container: Any, above: List[object]) -> Iterator[smach.Container]:
    if not isinstance(container, smach.Container) or any(container is each for each in above):
        return
    yield container
    for child in list(container.get_children().values()):
        yield from _containers_in(child, above + [container])


def _shown_by_upstream(container: smach.Container) -> Iterator[_Shown]:
    """Topics and paths by which upstream's introspection listens for a container."""
    callbacks = cast('List[Tuple[object, ...]]', own_mark(container, '_transition_cbs') or [])
    for callback in callbacks:
        if not isinstance(callback[0], types.MethodType):
            continue
        proxy: Any = callback[0].__self__
        if type(proxy).__module__ == 'smach_ros.introspection' and hasattr(proxy, '_init_cmd'):
            yield proxy._init_cmd.resolved_name, proxy._path
