"""ROS without a master: what servers offer is kept, what they publish is made into bytes."""

import contextlib
import io
import threading
from typing import Any, Callable, Dict, Iterator, List
from unittest import mock

import actionlib
import genpy
import rospy

from smach_oracle.interfaces import interface_goal
from smach_oracle.ros.expert import server


class Offered:
    """Handlers of services and subscribers by name, and action servers in the order of coming."""

    def __init__(self) -> None:
        self.services: Dict[str, Callable[[Any], genpy.Message]] = {}
        self.topics: Dict[str, Callable[[Any], None]] = {}
        self.actions: List['FakeActionServer'] = []

    def call(self, name: str, request: genpy.Message) -> Any:
        """Call a service, through the wire both ways."""
        return as_bytes(self.services[name](request))


def as_bytes(message: genpy.Message) -> genpy.Message:
    """The message, which must fit on the wire."""
    message.serialize(io.BytesIO())
    return message


class SilentPublisher:
    """In place of what publishes how machines stand."""

    def __init__(self, *_: object) -> None:
        pass

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


class FakeActionServer:
    """Takes goals by hand."""

    def __init__(
        self,
        name: str,
        spec: type,
        on_goal: Callable[[Any], None],
        on_cancel: Callable[[Any], None],
        auto_start: bool,
    ) -> None:
        self.name, self.spec, self.on_goal, self.on_cancel = name, spec, on_goal, on_cancel
        self.lock = threading.RLock()
        self.status_timer = None
        self.status_pub = mock.Mock()
        self.status_pub.impl.connections = []
        self.result_pub = self.status_pub

    def start(self) -> None:
        pass

    def stop(self) -> None:
        pass

    def publish_status(self) -> None:
        pass


class FakeHandle:
    """A goal, and how it ended."""

    def __init__(self, goal: genpy.Message, goal_id: str = 'goal') -> None:
        self._goal, self._id = goal, goal_id
        self.status_tracker = mock.Mock()
        self.status_tracker.goal._connection_header = {'callerid': '/asker'}
        self.accepted = False
        self.end = ''
        self.text = ''

    def get_goal(self) -> genpy.Message:
        return self._goal

    def get_goal_id(self) -> Any:
        return mock.Mock(id=self._id)

    def set_accepted(self, text: str = '') -> None:
        self.accepted = True

    def publish_feedback(self, feedback: genpy.Message) -> None:
        as_bytes(feedback)

    def _note(self, end: str, result: genpy.Message, text: str) -> None:
        as_bytes(result)
        text.encode('utf-8')
        self.end, self.text = end, text

    def set_rejected(self, result: genpy.Message, text: str = '') -> None:
        self._note('rejected', result, text)

    def set_succeeded(self, result: genpy.Message, text: str = '') -> None:
        self._note('succeeded', result, text)

    def set_aborted(self, result: genpy.Message, text: str = '') -> None:
        self._note('aborted', result, text)

    def set_canceled(self, result: genpy.Message, text: str = '') -> None:
        self._note('canceled', result, text)


class _Publisher:
    def __init__(self, name: str, *_: object, **__: object) -> None:
        self.impl = mock.Mock(connections=[])
        self.resolved_name = name

    def get_num_connections(self) -> int:
        return 1

    def publish(self, message: genpy.Message) -> None:
        as_bytes(message)

    def unregister(self) -> None:
        pass


@contextlib.contextmanager
def fake_ros() -> Iterator[Offered]:
    """Have no master: servers that are made meanwhile are kept in what is yielded."""
    offered = Offered()

    def service(name: str, kind: type, handle: Any, **_: object) -> Any:
        offered.services[name] = handle
        return mock.Mock()

    def subscriber(name: str, kind: type, handle: Any, *args: Any, **_: object) -> Any:
        offered.topics[name] = handle
        return mock.Mock(resolved_name=name)

    def action(*args: Any, **given: Any) -> FakeActionServer:
        made = FakeActionServer(*args, **given)
        offered.actions.append(made)
        return made

    quiet = {
        name: (lambda *said: None)
        for name in (
            'logdebug',
            'loginfo',
            'logwarn',
            'logerr',
            'logwarn_throttle',
            'logerr_throttle',
            'on_shutdown',
        )
    }
    with mock.patch.multiple(
        rospy,
        Service=service,
        Subscriber=subscriber,
        Publisher=_Publisher,
        resolve_name=lambda name: name,
        get_name=lambda: '/node',
        is_shutdown=lambda: False,
        get_rostime=lambda: rospy.Time(7),
        **quiet,
    ), mock.patch.object(rospy.Time, 'now', lambda: rospy.Time(7)), mock.patch.object(
        actionlib, 'ActionServer', action
    ), mock.patch.object(interface_goal, 'QuietActionServer', action), mock.patch.object(
        server, 'QuietActionServer', action
    ):
        yield offered
