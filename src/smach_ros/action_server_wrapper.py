"""An action server whose goals are executions of a SMACH container."""

import _thread
import traceback
from typing import Any, Dict, Iterable, List, Optional

import actionlib
import rospy

import smach
from smach_ros.waiting import shutting_down

__all__ = ['ActionServerWrapper']


class ActionServerWrapper(object):
    """Serves ``server_name`` by executing ``wrapped_container`` once per goal, after
    ``run_server()``.

    Each goal is put into a parent userdata: the goal under ``goal_key``, a fresh feedback under
    ``feedback_key`` and a fresh result under ``result_key``. ``goal_slots_map`` {goal field:
    userdata key} adds single fields, ``expand_goal_slots`` all of them by their own names. The
    container sees the keys it declares. At each of its transitions the feedback is published, with
    the fields in ``feedback_slots_map`` {feedback field: userdata key} set. At its end the result,
    with ``result_slots_map`` {result field: userdata key}, or with ``pack_result_slots`` every
    field, taken from userdata. The container's outcome, by the list it stands in, ends the goal as
    succeeded, aborted or preempted. An unlisted outcome or an exception aborts it. A cancel, a
    newer goal or a shutdown of the node preempts the container.
    """

    def __init__(
        self,
        server_name: str,
        action_spec: Any,
        wrapped_container: Any,
        succeeded_outcomes: Iterable[str] = (),
        aborted_outcomes: Iterable[str] = (),
        preempted_outcomes: Iterable[str] = (),
        goal_key: str = 'action_goal',
        feedback_key: str = 'action_feedback',
        result_key: str = 'action_result',
        goal_slots_map: Optional[Dict[str, str]] = None,
        feedback_slots_map: Optional[Dict[str, str]] = None,
        result_slots_map: Optional[Dict[str, str]] = None,
        expand_goal_slots: bool = False,
        pack_result_slots: bool = False,
    ) -> None:
        self.wrapped_container = wrapped_container
        self.userdata = smach.UserData()
        self._server_name = server_name
        self._action_spec = action_spec
        self._succeeded_outcomes = set(succeeded_outcomes)
        self._aborted_outcomes = set(aborted_outcomes)
        self._preempted_outcomes = set(preempted_outcomes)
        self._goal_key, self._feedback_key, self._result_key = goal_key, feedback_key, result_key
        self._goal_slots_map = dict(goal_slots_map or {})
        self._feedback_slots_map = dict(feedback_slots_map or {})
        self._result_slots_map = dict(result_slots_map or {})
        self._expand_goal_slots = expand_goal_slots
        self._pack_result_slots = pack_result_slots
        spec = action_spec()
        self._goal_type = type(spec.action_goal.goal)
        self._feedback_type = type(spec.action_feedback.feedback)
        self._result_type = type(spec.action_result.result)
        self._warn_of_mistakes()
        self._action_server: Optional[actionlib.SimpleActionServer] = None
        wrapped_container.register_transition_cb(self.transition_cb, [])
        wrapped_container.register_termination_cb(self.termination_cb, [])

    def _warn_of_mistakes(self) -> None:
        lists = (self._succeeded_outcomes, self._aborted_outcomes, self._preempted_outcomes)
        if len(set().union(*lists)) < sum(len(outcomes) for outcomes in lists):
            smach.logerr(
                "Action '%s': an outcome is listed as more than one of succeeded, aborted and "
                'preempted' % self._server_name
            )
        for what, slots, message in (
            ('goal', self._goal_slots_map, self._goal_type),
            ('feedback', self._feedback_slots_map, self._feedback_type),
            ('result', self._result_slots_map, self._result_type),
        ):
            unknown = sorted(set(slots) - set(message.__slots__))
            if unknown:
                smach.logerr(
                    "Action '%s': %s_slots_map names %s, but %s has only %s"
                    % (self._server_name, what, unknown, message._type, list(message.__slots__))
                )

    def run_server(self) -> None:
        """Start serving, in the background."""
        server = actionlib.SimpleActionServer(
            self._server_name, self._action_spec, execute_cb=self.execute_cb, auto_start=False
        )
        server.register_preempt_callback(self.preempt_cb)
        self._action_server = server
        rospy.on_shutdown(self.preempt_cb)
        server.start()
        smach.loginfo("Started SMACH action server '%s'" % self._server_name)

    def transition_cb(self, userdata: Any, active_states: List[str], *args: Any) -> None:
        """Publish feedback: the container has made a transition."""
        self.publish_feedback(userdata)

    def termination_cb(
        self, userdata: Any, terminal_states: List[str], container_outcome: str, *args: Any
    ) -> None:
        """Note that the container has ended with ``container_outcome``. Override it."""

    def publish_feedback(self, userdata: Any) -> None:
        """Publish the feedback found in ``userdata``, if a goal is active and there is any."""
        server = self._action_server
        if server is None or not server.is_active():
            return
        fields = {
            field: key
            for field, key in self._feedback_slots_map.items()
            if key in userdata and field in self._feedback_type.__slots__
        }
        if self._feedback_key not in userdata and not fields:
            return
        key_is_set = self._feedback_key in userdata
        feedback = userdata[self._feedback_key] if key_is_set else self._feedback_type()
        for field, key in fields.items():
            setattr(feedback, field, userdata[key])
        server.publish_feedback(feedback)

    def execute_cb(self, goal: Any) -> None:
        """Execute the container for ``goal`` and end it as the container does. Called by the
        server's thread.
        """
        server = self._action_server
        if server is None:
            raise smach.InvalidStateError(
                "Action '%s' is not served yet: call run_server() first" % self._server_name
            )
        self._fill_userdata(goal)
        if not server.is_preempt_requested():
            _recall_preempts(self.wrapped_container)
        try:
            outcome = self.wrapped_container.execute(self.userdata)
        except Exception:
            smach.logerr(
                "Action '%s': the container raised:\n%s"
                % (self._server_name, traceback.format_exc())
            )
            server.set_aborted(self._result_type(), traceback.format_exc().strip().splitlines()[-1])
            return
        self._end_goal(server, outcome)

    def _fill_userdata(self, goal: Any) -> None:
        self.userdata[self._goal_key] = goal
        self.userdata[self._feedback_key] = self._feedback_type()
        self.userdata[self._result_key] = self._result_type()
        if self._expand_goal_slots:
            for field in goal.__slots__:
                self.userdata[field] = getattr(goal, field)
        for field, key in self._goal_slots_map.items():
            self.userdata[key] = getattr(goal, field)

    def _make_result(self) -> Any:
        result = self.userdata[self._result_key]
        if self._pack_result_slots:
            for field in result.__slots__:
                if field in self.userdata:
                    setattr(result, field, self.userdata[field])
        for field, key in self._result_slots_map.items():
            if key not in self.userdata:
                raise KeyError("no key '%s' for the result's field '%s'" % (key, field))
            setattr(result, field, self.userdata[key])
        return result

    def _end_goal(self, server: Any, outcome: Optional[str]) -> None:
        try:
            result = self._make_result()
        except (KeyError, AttributeError) as err:
            smach.logerr(
                "Action '%s': no result could be made from userdata: %r" % (self._server_name, err)
            )
            server.set_aborted(self._result_type(), 'no result could be made: %r' % (err,))
            return
        text = 'container outcome: %s' % outcome
        if outcome in self._succeeded_outcomes:
            server.set_succeeded(result, text)
        elif outcome in self._preempted_outcomes:
            server.set_preempted(result, text)
        else:
            if outcome not in self._aborted_outcomes:
                smach.logerr(
                    "Action '%s': the container ended with outcome %r, which is listed neither as "
                    'succeeded, '
                    'aborted nor preempted; the goal is aborted' % (self._server_name, outcome)
                )
            server.set_aborted(result, text)

    def preempt_cb(self) -> None:
        """Preempt the container: the goal was cancelled, a newer one came, or the node shuts
        down.
        """
        # Not in this thread: it holds the server's lock, which the executing one may want while it
        # holds the machine's.
        # Not a Thread either: at a shutdown Ctrl-C may have interrupted threading, too.
        _thread.start_new_thread(self._preempt_container, ())

    def _preempt_container(self) -> None:
        server = self._action_server
        if (
            server is not None
            and server.is_active()
            and (server.is_preempt_requested() or shutting_down())
        ):
            self.wrapped_container.request_preempt()


def _recall_preempts(state: Any) -> None:
    """Take back, here and in all states inside, what an earlier goal's cancel asked for and nobody
    serviced.
    """
    if state.preempt_requested():
        state.recall_preempt()
    if isinstance(state, smach.Container):
        for child in state.get_children().values():
            _recall_preempts(child)
