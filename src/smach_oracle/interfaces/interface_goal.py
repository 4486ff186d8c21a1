"""The SharedAutonomy action of an interface that one person uses at a time.

That person ends its one goal. A second goal is refused with a text. A preempt, and the loss of the
node that asked, end the goal.
"""

import time
import warnings
from typing import Any, Callable, Collection, Mapping, Optional, Protocol, Sequence

import actionlib
import rospy

from smach_oracle.msg import (
    SharedAutonomyAction,
    SharedAutonomyFeedback,
    SharedAutonomyGoal,
    SharedAutonomyResult,
    UserdataItem,
)
from smach_oracle.oracle.asking.answer_rules import check_outcome, check_output_keys
from smach_oracle.oracle.asking.question import names
from smach_oracle.oracle.errors import AnswerError, OracleError
from smach_oracle.ros.expert.quiet_action_server import QuietActionServer
from smach_oracle.ros.userdata_codec import UserdataCodecError, decode, encode_all
from smach_oracle.srv import (
    FinishInterface,
    FinishInterfaceRequest,
    FinishInterfaceResponse,
    GiveUpInterface,
    GiveUpInterfaceRequest,
    GiveUpInterfaceResponse,
)

ASKER_GONE_S = 3.0
NO_GOAL = 'no goal is active: the oracle has not started this interface, or it has ended'


class _AskerConnection(Protocol):
    """A connection of a rospy topic."""

    endpoint_id: str  # name of the other node


class InterfaceGoalError(OracleError, ValueError):
    """A goal cannot be ended in that way. The text says what is allowed."""


class InterfaceGoal:
    """Hosts the action, and calls back at the beginning and the end of each goal.

    The callbacks hold the action server's lock and must not wait for anything.
    """

    def __init__(
        self, name: str, begun: Callable[[SharedAutonomyGoal], None], ended: Callable[[], None]
    ) -> None:
        """
        :param name: of the action, e.g. manipulation_interface.
        :param begun: called with each new goal. May raise ValueError, whose text refuses the goal.
        :param ended: called when a goal has ended.
        """
        self.name = rospy.resolve_name(name)
        self._begun = begun
        self._ended = ended
        self._handle: Optional[actionlib.ServerGoalHandle] = None
        self._asker: Optional[_AskerConnection] = None
        self._asker_seen_s = 0.0
        self._action = QuietActionServer(
            self.name, SharedAutonomyAction, self._on_goal, self._on_cancel, auto_start=False
        )
        # its callbacks come under it. A second lock would invite a deadlock
        self._lock = self._action.lock
        self._action.start()

    @property
    def goal(self) -> Optional[SharedAutonomyGoal]:
        """The goal that a person works on."""
        handle = self._handle
        return handle.get_goal() if handle is not None else None

    def tell(self, progress: float, text: str) -> None:
        """Publish feedback to the oracle: progress 0 to 1, -1 where unknown."""
        handle = self._handle
        if handle is not None:
            handle.publish_feedback(SharedAutonomyFeedback(progress, text))

    def finish(
        self,
        outcome: str,
        known: Mapping[str, Any],
        given: Sequence[UserdataItem] = (),
        text: str = '',
        query_id: str = '',
    ) -> None:
        """Supersede the state with `outcome`.

        :param known: outputs that the interface has. Keys that the state does not have are left
            out.
        :param given: outputs that the person gave, which override those.
        :param query_id: the question that is meant, or '' for whichever is active.
        :raises InterfaceGoalError: where no such goal is active, or the outcome or an output given
            does not fit it.
        """
        with self._lock:
            goal = self._meant(query_id)
            _check_result(outcome, given, goal)
            outputs = {item.key: item for item in encode_all(known) if item.key in goal.output_keys}
            outputs.update({item.key: item for item in given})
            result = SharedAutonomyResult(outcome, [outputs[key] for key in sorted(outputs)], text)
            self._end(lambda handle: handle.set_succeeded(result, text))

    def give_up(self, text: str, query_id: str = '') -> None:
        """End the goal without a result. The oracle asks again.

        :param query_id: the question that is meant, or '' for whichever is active.
        :raises InterfaceGoalError: where no such goal is active.
        """
        with self._lock:
            self._meant(query_id)
            self._end(lambda handle: handle.set_aborted(SharedAutonomyResult(text=text), text))

    def drop_if_asker_is_gone(self) -> None:
        """End a goal whose asker's connection has been gone for 3 s. Call it now and then."""
        with self._lock:
            handle = self._handle
            if handle is not None and self._asker_missing_s(handle) > ASKER_GONE_S:
                rospy.logwarn(
                    '%s: the asker is gone; its goal for %s ends',
                    self.name,
                    handle.get_goal().state,
                )
                self._end(
                    lambda handle: handle.set_aborted(SharedAutonomyResult(), 'the asker is gone')
                )

    def _meant(self, query_id: str) -> SharedAutonomyGoal:
        goal = self.goal
        if goal is None:
            raise InterfaceGoalError(NO_GOAL)
        if query_id and query_id != goal.query_id:
            raise InterfaceGoalError(
                'question {} is over; the interface now works on another one, {}'.format(
                    query_id, goal.query_id
                )
            )
        return goal

    def stop(self) -> None:
        """Take the action down."""
        if not rospy.is_shutdown():
            self._action.stop()

    def _asker_missing_s(self, handle: actionlib.ServerGoalHandle) -> float:
        """Return for how long (s, wall time) the asker's own connection has been gone.

        Another connection of the same name belongs to another process.
        """
        connections = self._action.result_pub.impl.connections
        if self._asker is None:
            name = handle.status_tracker.goal._connection_header['callerid']
            self._asker = next((each for each in connections if each.endpoint_id == name), None)
        if any(each is self._asker for each in connections):
            self._asker_seen_s = time.monotonic()
        return time.monotonic() - self._asker_seen_s

    def _on_goal(self, handle: actionlib.ServerGoalHandle) -> None:
        with self._lock:
            self.drop_if_asker_is_gone()
            goal = handle.get_goal()
            why = self._why_not(goal)
            if why:
                rospy.logwarn(
                    '%s: goal for %s refused: %s', self.name, goal.state or '(no state)', why
                )
                handle.set_rejected(SharedAutonomyResult(text=why), why)
                return
            self._handle, self._asker, self._asker_seen_s = handle, None, time.monotonic()
            handle.set_accepted()
            rospy.loginfo('%s: a person takes over %s', self.name, goal.state)

    def _why_not(self, goal: SharedAutonomyGoal) -> str:
        active = self.goal
        if active is not None:
            return 'busy with {} of question {}; one goal at a time'.format(
                active.state, active.query_id
            )
        if not goal.state or not goal.outcomes:
            return 'a goal needs a state and its outcomes; given: {!r}, {}'.format(
                goal.state, names(goal.outcomes)
            )
        try:
            self._begun(goal)
        except ValueError as err:
            return str(err)
        return ''

    def _on_cancel(self, handle: actionlib.ServerGoalHandle) -> None:
        with self._lock:
            mine_id = None if self._handle is None else self._handle.get_goal_id().id
            if handle.get_goal_id().id == mine_id:
                self._end(
                    lambda mine: mine.set_canceled(
                        SharedAutonomyResult(text='preempted'), 'preempted'
                    )
                )

    def _end(self, send: Callable[[actionlib.ServerGoalHandle], None]) -> None:
        """Forget the goal, and let `send` send its result."""
        handle, self._handle = self._handle, None
        self._ended()
        send(handle)


class FinishServices:
    """The services `~finish` and `~give_up` of an interface, for the front end of its person."""

    def __init__(
        self, goal: InterfaceGoal, outputs: Callable[[str, Collection[str]], Mapping[str, Any]]
    ) -> None:
        """
        :param outputs: returns, for an outcome and the keys that the person gives, the other
            outputs that the interface has.
        """
        self._goal = goal
        self._outputs = outputs
        self._services = [
            rospy.Service('~finish', FinishInterface, self._finish),
            rospy.Service('~give_up', GiveUpInterface, self._give_up),
        ]

    def _finish(self, request: FinishInterfaceRequest) -> FinishInterfaceResponse:
        try:
            known = self._outputs(request.outcome, {item.key for item in request.outputs})
            self._goal.finish(
                request.outcome, known, request.outputs, request.text, request.query_id
            )
        except (InterfaceGoalError, UserdataCodecError) as err:
            return FinishInterfaceResponse(False, str(err))
        return FinishInterfaceResponse(True, '')

    def _give_up(self, request: GiveUpInterfaceRequest) -> GiveUpInterfaceResponse:
        try:
            self._goal.give_up(request.text, request.query_id)
        except InterfaceGoalError as err:
            return GiveUpInterfaceResponse(False, str(err))
        return GiveUpInterfaceResponse(True, '')


def _check_result(outcome: str, given: Sequence[UserdataItem], goal: SharedAutonomyGoal) -> None:
    """Check what a person gave against the rules of every answer.

    :raises InterfaceGoalError: where it does not fit the goal's state, or cannot be decoded.
    """
    try:
        check_outcome(goal.state, outcome, goal.outcomes)
        check_output_keys(goal.state, [item.key for item in given], goal.output_keys)
        for item in given:
            decode(item)
    except (AnswerError, UserdataCodecError) as err:
        raise InterfaceGoalError(str(err)) from err


def __getattr__(name: str) -> Any:
    """Give the class that had another name under its old one, with a warning."""
    if name != 'SettlingServices':
        raise AttributeError('module {!r} has no attribute {!r}'.format(__name__, name))
    warnings.warn(
        'smach_oracle.interfaces.interface_goal.SettlingServices is now called FinishServices',
        FutureWarning,
        stacklevel=2,
    )
    return FinishServices
