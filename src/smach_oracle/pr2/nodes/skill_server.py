"""Skills as actions: one at a time, each failure an aborted action with its reason."""

import threading
import traceback
from typing import Callable, List, Mapping, Tuple, Type

import actionlib
import genpy
import rospy

from ..planning.arm import SkillError
from ..planning.planner import PlanningError
from ..robot import RobotError

ReportStatus = Callable[[str], None]
Handler = Callable[[genpy.Message, ReportStatus], genpy.Message]


class PartResultError(SkillError):
    """A failure that fills some fields of the action's result."""

    def __init__(self, reason: str, fields: Mapping[str, object]) -> None:
        super().__init__(reason)
        self.fields = fields


class SkillServer:
    """Action servers that share one robot, which does one thing at a time."""

    def __init__(self, abort: Callable[[], None], resume: Callable[[], None]) -> None:
        """
        :param abort: makes what the robot does, now and until `resume`, end with a RobotError.
            It is called from any thread.
        """
        self._abort = abort
        self._resume = resume
        self._busy = threading.Lock()
        self._running = ''
        self._servers: List[actionlib.SimpleActionServer] = []

    def offer(
        self, name: str, spec: type, handler: Handler, errors: Tuple[Type[Exception], ...] = ()
    ) -> None:
        """Serve an action.

        :param spec: the Action type. Its feedback has a field `status`, its result a field
            `reason`.
        :param handler: takes the goal and a function that reports what is being done. It returns
            the result, or raises SkillError, RobotError, PlanningError or one of `errors`, whose
            text becomes the reason.
        """
        expected = (SkillError, RobotError, PlanningError) + errors
        server: actionlib.SimpleActionServer = actionlib.SimpleActionServer(
            name,
            spec,
            lambda goal: self._serve(name, spec, server, handler, goal, expected),
            auto_start=False,
        )
        server.register_preempt_callback(lambda: self._abort() if self._running == name else None)
        server.start()
        self._servers.append(server)

    def names(self) -> int:
        """Return how many actions are served."""
        return len(self._servers)

    def _serve(
        self,
        name: str,
        spec: type,
        server: actionlib.SimpleActionServer,
        handler: Handler,
        goal: genpy.Message,
        expected: Tuple[Type[Exception], ...],
    ) -> None:
        action = spec()
        feedback, result = action.action_feedback.feedback, action.action_result.result

        def report(text: str) -> None:
            feedback.status = text
            server.publish_feedback(feedback)

        with self._busy:
            self._running = name
            self._resume()
            if server.is_preempt_requested():
                self._running = ''
                result.reason = 'cancelled before it began'
                server.set_preempted(result, result.reason)
                return
            try:
                server_result = handler(goal, report)
            except expected as err:
                result.reason = str(err)
                if isinstance(err, PartResultError):
                    for field, value in err.fields.items():
                        setattr(result, field, value)
                if server.is_preempt_requested():
                    server.set_preempted(result, result.reason)
                else:
                    rospy.loginfo('%s: %s', name, result.reason)
                    server.set_aborted(result, result.reason)
                return
            except Exception as err:  # a goal must not stay open, whatever went wrong
                rospy.logerr('%s: %s', name, traceback.format_exc())
                result.reason = 'error in {}: {!r}'.format(name, err)
                server.set_aborted(result, result.reason)
                return
            finally:
                self._running = ''
            server.set_succeeded(server_result)
