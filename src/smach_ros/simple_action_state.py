"""A state that sends one goal to an action server and ends as the goal does."""

import copy
import io
import time
import traceback
from typing import Any, Callable, Dict, Iterable, Optional

import rospy
from actionlib_msgs.msg import GoalStatus

import smach
from smach_ros.action_link import SEND_CANCEL_S, link_to
from smach_ros.goal_run import GoalRun
from smach_ros.server_watch import FROZEN_AFTER_S
from smach_ros.state_client import StateClient
from smach_ros.user_callback import UserCallback, checked_slots
from smach_ros.waiting import Signal, deadline_after, seconds, shutting_down

__all__ = ['SimpleActionState']

LOOK_FOR_SERVER_S = 0.01
WATCH_SERVER_S = 0.1


class SimpleActionState(smach.State):
    """Outcomes succeeded, aborted, preempted, and those in ``outcomes``.

    The goal starts from ``goal``, is replaced by the one in userdata under ``goal_key``, has its
    fields ``goal_slots`` filled from the userdata keys of the same names, and goes through
    ``goal_cb(userdata, goal, *args, **kwargs)``, which may change it or return another. The result
    goes to ``result_cb(userdata, status, result, *args, **kwargs)`` (an actionlib_msgs/GoalStatus
    constant, no result: None), which may return one of ``outcomes``, then to userdata as a whole
    (``result_key``) or by field (``result_slots``).

    A goal that ends in any other way than SUCCEEDED is 'aborted', or 'preempted' if we asked for
    its end. Limits (``rospy.Duration`` or seconds, of wall time): a server that has not come
    ``server_wait_timeout`` after ``execute`` began is 'aborted'. A goal not ended after
    ``exec_timeout`` (None or 0: no limit) is cancelled and 'aborted'. A server that has not ended a
    cancelled goal after ``preempt_timeout`` is left alone. A server that dies while it works on the
    goal is noticed. The goal is 'aborted', and the log says why.

    ``_goal_active_cb()``, ``_goal_feedback_cb(feedback)`` and ``_goal_done_cb(status, result)`` may
    be overridden.
    """

    WAITING_FOR_SERVER = 0
    INACTIVE = 1
    ACTIVE = 2
    PREEMPTING = 3
    COMPLETED = 4

    server_frozen_timeout_s = FROZEN_AFTER_S
    """A server whose node neither sends status nor answers for this long (s) is given up."""

    def __init__(
        self,
        action_name: str,
        action_spec: Any,
        goal: Any = None,
        goal_key: Optional[str] = None,
        goal_slots: Iterable[str] = (),
        goal_cb: Optional[Callable[..., Any]] = None,
        goal_cb_args: Iterable[Any] = (),
        goal_cb_kwargs: Optional[Dict[str, Any]] = None,
        result_key: Optional[str] = None,
        result_slots: Iterable[str] = (),
        result_cb: Optional[Callable[..., Any]] = None,
        result_cb_args: Iterable[Any] = (),
        result_cb_kwargs: Optional[Dict[str, Any]] = None,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
        exec_timeout: Any = None,
        preempt_timeout: Any = rospy.Duration(60.0),
        server_wait_timeout: Any = rospy.Duration(60.0),
    ) -> None:
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
        input_keys, output_keys = tuple(input_keys), tuple(output_keys)
        self.register_outcomes(list(outcomes))
        self.register_input_keys(input_keys)
        self.register_output_keys(output_keys)
        self._action_name = action_name
        self._action_spec = action_spec
        self._exec_timeout = exec_timeout
        self._preempt_timeout = preempt_timeout
        self._server_wait_timeout = server_wait_timeout
        self._set_goal(goal, goal_key, goal_slots)
        self._set_result(result_key, result_slots)
        self._goal_cb = self._adopt(
            'goal_cb', goal_cb, goal_cb_args, goal_cb_kwargs, input_keys, output_keys
        )
        self._result_cb = self._adopt(
            'result_cb', result_cb, result_cb_args, result_cb_kwargs, input_keys, output_keys
        )
        self._goal_status: Optional[int] = GoalStatus.PENDING
        self._goal_result: Any = None
        self._goal_status_text = ''  # why the latest goal ended as it did, for people
        self._signal = Signal()
        self._status = SimpleActionState.WAITING_FOR_SERVER
        self._client: Optional[StateClient] = None
        self._link = link_to(action_name, action_spec)

    def _set_goal(self, goal: Any, key: Optional[str], slots: Iterable[str]) -> None:
        template = self._action_spec().action_goal.goal
        if callable(goal):
            raise smach.InvalidStateError(
                'goal must be a goal message; a function that makes one goes to goal_cb'
            )
        self._goal = template if goal is None else goal
        self._goal_type = template._type
        self._goal_key = key
        # subclasses add to it
        self._goal_slots = list(checked_slots('goal_slots', slots, template))
        self.register_input_keys(self._goal_slots + ([] if key is None else [key]))

    def _set_result(self, key: Optional[str], slots: Iterable[str]) -> None:
        self._result_key = key
        self._result_slots = list(
            checked_slots('result_slots', slots, self._action_spec().action_result.result)
        )
        self.register_output_keys(self._result_slots + ([] if key is None else [key]))

    def _adopt(
        self, what: str, cb: Optional[Callable[..., Any]], *interface: Any
    ) -> Optional[UserCallback]:
        if cb is None:
            return None
        callback = UserCallback(what, cb, *interface)
        callback.register_with(self, decides=what == 'result_cb')
        return callback

    @property
    def _action_client(self) -> Optional[StateClient]:
        """A SimpleActionClient for the latest goal, for scripts, or None until the node is
        initialised.
        """
        if self._client is None and self._link.topics is not None:
            self._client = StateClient(self._link.topics.client)
        return self._client

    def request_preempt(self) -> None:
        """Ask to stop: the goal is cancelled, waiting for a server ends."""
        smach.loginfo("The state of action '%s' is to be preempted." % self._action_name)
        smach.State.request_preempt(self)
        self._signal.notify()

    def execute(self, ud: Any) -> str:
        """Send the goal, wait for its end, hand the result to userdata."""
        self._goal_status_text = ''
        if not self._await_server():
            if self._asked_to_stop():
                return self._preempted('before sending a goal')
            self._goal_status_text = "Action server '%s' did not come within %g s" % (
                self._action_name,
                seconds(self._server_wait_timeout) or 0.0,
            )
            smach.logerr(self._goal_status_text)
            return 'aborted'
        goal = self._make_goal(ud)
        if goal is None:
            return 'aborted'
        self._check_goal(goal)
        if self._asked_to_stop():
            return self._preempted('before sending a goal')
        run = GoalRun(self._link, self, self._signal)
        self._status = SimpleActionState.ACTIVE
        try:
            run.send(goal)
            client = self._action_client
            if client is not None:
                client.follow(run.handle)
            self._see_through(run)
        finally:
            run.close()
            if self._client is not None:
                self._client.ended()
            self._status = SimpleActionState.COMPLETED
        return self._conclude(ud)

    def _asked_to_stop(self) -> bool:
        return self.preempt_requested() or shutting_down()

    def _preempted(self, when: str) -> str:
        smach.loginfo("Action '%s' preempted %s" % (self._action_name, when))
        self.service_preempt()
        return 'preempted'

    def _await_server(self) -> bool:
        deadline = deadline_after(seconds(self._server_wait_timeout))
        while not self._asked_to_stop():
            if self._link.ready():
                self._status = SimpleActionState.INACTIVE
                return True
            if deadline is not None and time.monotonic() >= deadline:
                return False
            self._signal.wait(self.preempt_requested, deadline, LOOK_FOR_SERVER_S)
        return False

    def _make_goal(self, ud: Any) -> Any:
        """The goal to send, or None if ``goal_cb`` raised (logged). The script's own goal object is
        not changed.
        """
        goal = copy.deepcopy(self._goal if self._goal_key is None else ud[self._goal_key])
        for slot in self._goal_slots:
            setattr(goal, slot, ud[slot])
        if self._goal_cb is None:
            return goal
        try:
            update = self._goal_cb(ud, goal)
        except Exception:
            smach.logerr(
                "Could not execute goal callback of action '%s':\n%s"
                % (self._action_name, traceback.format_exc())
            )
            return None
        return goal if update is None else update

    def _check_goal(self, goal: Any) -> None:
        # rospy would send what it had written of a bad message ahead of the next good one, and
        # break the connection.
        try:
            goal.serialize(io.BytesIO())
        except Exception as err:
            raise smach.InvalidUserCodeError(
                "The goal for action '%s' is no valid %s: %r"
                % (self._action_name, self._goal_type, err)
            ) from err

    def _see_through(self, run: GoalRun) -> None:
        """Wait for the goal's end. After this the run is done, or abandoned with the reason in the
        log.
        """
        self._goal_status, self._goal_result = None, None
        problem = self._follow(
            run, deadline_after(seconds(self._exec_timeout) or None), self.preempt_requested
        )
        if not run.done:
            if problem is None:
                problem = self._cancel(run)
            elif not shutting_down():
                run.cancel()
        self._goal_status_text = run.text if run.done else problem or ''
        if not run.done:
            say = smach.loginfo if shutting_down() else smach.logerr
            say("Giving up the goal of action '%s': %s" % (self._action_name, problem))
            run.abandon()
        if self._goal_status is None:
            # A subclass took over _goal_done_cb, or there was no end to report.
            self._goal_status, self._goal_result = run.status, run.result

    def _follow(
        self, run: GoalRun, deadline: Optional[float], stop: Callable[[], bool]
    ) -> Optional[str]:
        """Wait for the goal's end, ``stop()``, the deadline or a shutdown (None), or a problem
        (what is wrong).
        """
        while not shutting_down():
            if self._signal.wait(lambda: run.done or stop(), deadline, WATCH_SERVER_S):
                return None
            if deadline is not None and time.monotonic() >= deadline:
                return None
            problem = run.problem(self.server_frozen_timeout_s)
            if problem is not None:
                return problem
        return None

    def _cancel(self, run: GoalRun) -> Optional[str]:
        """Cancel, and wait for the server to comply. Returns why it did not."""
        if not self._asked_to_stop():
            smach.logwarn(
                "Action '%s' timed out after %g s"
                % (self._action_name, seconds(self._exec_timeout) or 0.0)
            )
        smach.loginfo("Cancelling the goal of action '%s'" % self._action_name)
        self._status = SimpleActionState.PREEMPTING
        run.cancel()
        if shutting_down():
            time.sleep(SEND_CANCEL_S)
            return 'the node shuts down'
        limit_s = seconds(self._preempt_timeout)
        problem = self._follow(run, deadline_after(limit_s), lambda: False)
        return problem or (
            'the node shuts down'
            if shutting_down()
            else 'its server has not ended it %g s after the cancel' % (limit_s or 0.0)
        )

    def _conclude(self, ud: Any) -> str:
        """Userdata and outcome from the goal's status and result."""
        succeeded = self._goal_status == GoalStatus.SUCCEEDED
        stopped = self._asked_to_stop() and not succeeded
        outcome = self._ask_result_cb(ud)
        if self._goal_result is not None:
            self._store_result(ud)
        if stopped:
            self.service_preempt()
        if outcome is not None:
            return outcome
        if stopped:
            return 'preempted'
        return 'succeeded' if succeeded else 'aborted'

    def _store_result(self, ud: Any) -> None:
        if self._result_key is not None:
            ud[self._result_key] = self._goal_result
        for slot in self._result_slots:
            ud[slot] = getattr(self._goal_result, slot)

    def _ask_result_cb(self, ud: Any) -> Optional[str]:
        if self._result_cb is None:
            return None
        try:
            outcome = self._result_cb(ud, self._goal_status, self._goal_result)
        except Exception:
            smach.logerr(
                "Result callback of action '%s' raised:\n%s"
                % (self._action_name, traceback.format_exc())
            )
            return 'aborted'
        if outcome is None or outcome in self.get_registered_outcomes():
            return outcome
        smach.logerr(
            "Result callback of action '%s' returned %r, but the registered outcomes are %s"
            % (self._action_name, outcome, sorted(self.get_registered_outcomes()))
        )
        return 'aborted'

    def _goal_active_cb(self) -> None:
        """The server has taken up the goal. To be overridden."""
        smach.logdebug("Action '%s' has started its goal" % self._action_name)

    def _goal_feedback_cb(self, feedback: Any) -> None:
        """The server has sent feedback (the action's Feedback message). To be overridden."""

    def _goal_done_cb(self, result_state: int, result: Any) -> None:
        """The goal has ended with a GoalStatus constant and a Result message or None. To be
        overridden.

        What is handed to this base method decides the state's outcome.
        """
        self._goal_status, self._goal_result = result_state, result
