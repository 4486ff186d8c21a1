"""The ExpertQuery action server: questions wait here, side by side, until an expert settles them.

It hosts, under its name: the action, `open` (latched list of open questions), `claim` and `answer`
(services). It runs in the node of the robot that asks, or as a node of its own that many robots
share.
"""

import math
import threading
import time
from typing import Dict, List, Optional, Tuple

import actionlib
import rosgraph.names
import rospy

from smach_common.connections import Connection
from smach_oracle.msg import (
    ExpertQueryAction,
    ExpertQueryFeedback,
    ExpertQueryGoal,
    ExpertQueryResult,
    OpenQueries,
    OpenQuery,
)
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.srv import (
    AnswerQuery,
    AnswerQueryRequest,
    AnswerQueryResponse,
    ClaimQuery,
    ClaimQueryRequest,
    ClaimQueryResponse,
)

from ..command_line import parameters_only
from ..connections import quiet_at_shutdown
from ..master_watch import start_master_watch
from ..parameters import name_of, number_of
from ..senders.own_messages import others_listen
from .open_questions import (
    LEASE_S,
    LONGEST_LEASE_S,
    OpenQuestions,
    QuestionNotice,
    QuestionRefusedError,
    SettledQuestion,
)
from .quiet_action_server import QuietActionServer

SERVER_NAME = '~expert_query'
ASKER_GONE_S = 3.0
_LIST_PERIOD_S = 1.0
_WATCH_PERIOD_S = 0.25


class _AskingGoal:
    """A goal that waits for the end of its question, and the connection of its node."""

    def __init__(self, handle: actionlib.ServerGoalHandle) -> None:
        self.handle = handle
        self._node = handle.status_tracker.goal._connection_header['callerid']
        self._connection: Optional[Connection] = None
        self._seen_s = time.monotonic()

    def missing_s(self, connections: List[Connection], now_s: float) -> float:
        """Return for how long its own connection has been gone, in s.

        Another one of the same name is another process.
        """
        if self._connection is None:
            self._connection = next(
                (each for each in connections if each.endpoint_id == self._node), None
            )
        if any(each is self._connection for each in connections):
            self._seen_s = now_s
        return now_s - self._seen_s


HOW_TO_ANSWER = (
    'No front end shows the question. Answer it in a terminal with `rosrun smach_oracle '
    'expert_terminal`, or on a web page with `rosrun smach_oracle expert_console`'
)


class ExpertQueryServer:
    """Hosts the questions of one robot or many.

    Every access is serialised by the action server's own lock, under which its callbacks come
    anyway.
    """

    def __init__(
        self, name: str = SERVER_NAME, lease_s: float = LEASE_S, asker_gone_s: float = ASKER_GONE_S
    ) -> None:
        """
        :param name: resolved relative to the node.
        :param lease_s: how long a claim holds that asks for no other lease.
        :param asker_gone_s: a question is closed when the connection of its asker has been gone for
            so long.
        """
        self.name = rospy.resolve_name(name)
        self._questions = OpenQuestions(lease_s)
        self._asker_gone_s = asker_gone_s
        self._askers: Dict[str, List[_AskingGoal]] = {}
        self._listed_s = -math.inf
        self._wake = threading.Event()
        self._stopped = self._has_said_how = False
        self._open_publisher = rospy.Publisher(
            self.name + '/open', OpenQueries, latch=True, queue_size=2
        )
        self._action = QuietActionServer(
            self.name, ExpertQueryAction, self._on_goal, self._on_cancel, auto_start=False
        )
        self._lock = self._action.lock
        self._services = [
            rospy.Service(self.name + '/claim', ClaimQuery, self._on_claim),
            rospy.Service(self.name + '/answer', AnswerQuery, self._on_answer),
        ]
        self._start()

    def stop(self) -> None:
        """Take the server down. Who still asks notices it and waits for another."""
        self._end_watch()
        if rospy.is_shutdown():
            return
        for service in self._services:
            service.shutdown('the expert query server stops')
        self._action.stop()
        self._open_publisher.unregister()

    def _start(self) -> None:
        self._action.start()
        with self._lock:
            self._publish_list()
        threading.Thread(target=self._watch_time, name='expert query watch', daemon=True).start()
        # the topics are left to rospy: a question that is taken back now is published on them
        rospy.on_shutdown(self._go_down)

    def _go_down(self) -> None:
        self._end_watch()
        timer = self._action.status_timer
        if timer is not None:  # it would publish on a closed topic
            timer.shutdown()

    def _end_watch(self) -> None:
        self._stopped = True
        self._wake.set()

    def _on_goal(self, handle: actionlib.ServerGoalHandle) -> None:
        goal = handle.get_goal()
        try:
            settled = self._questions.open(goal)
        except QuestionRefusedError as err:
            rospy.logerr('Question refused: %s', err)
            handle.set_rejected(ExpertQueryResult(), str(err))
            return
        handle.set_accepted()
        if settled is not None:
            _end(handle, settled)
            return
        if not goal.interface:
            still_runs = goal.failure_kind == ExpertQueryGoal.STILL_RUNNING
            rospy.loginfo(
                'Question %s of %s: %s in %s %s',
                goal.query_id,
                goal.robot,
                goal.failed_state,
                goal.container_path,
                'still runs' if still_runs else 'failed',
            )
            self._say_how_to_answer()
        self._askers.setdefault(goal.query_id, []).append(_AskingGoal(handle))
        self._send_claim(goal.query_id, handle)
        self._changed()

    def _say_how_to_answer(self) -> None:
        """Say once how questions are answered, where no front end listens."""
        if not (self._has_said_how or others_listen(self._open_publisher)):
            self._has_said_how = True
            rospy.logwarn(HOW_TO_ANSWER)

    def _send_claim(self, query_id: str, handle: actionlib.ServerGoalHandle) -> None:
        """A goal that joins a question learns at once who works on it."""
        for entry in self._questions.listing():
            if entry.query.query_id == query_id and entry.status == OpenQuery.CLAIMED:
                handle.publish_feedback(ExpertQueryFeedback(entry.status, entry.claimed_by, ''))

    def _on_cancel(self, handle: actionlib.ServerGoalHandle) -> None:
        goal = handle.get_goal()
        self._questions.close(
            goal.query_id,
            'interface {} ended'.format(goal.interface)
            if goal.interface
            else 'taken back by the asker',
        )
        self._changed()

    def _on_claim(self, request: ClaimQueryRequest) -> ClaimQueryResponse:
        with self._lock:
            reply = self._questions.claim(
                request.action, request.query_id, request.expert, request.lease
            )
            self._changed()
        return ClaimQueryResponse(*reply)

    def _on_answer(self, request: AnswerQueryRequest) -> AnswerQueryResponse:
        with self._lock:
            reply = self._questions.answer(request.query_id, request.decision)
            self._changed()
        if not reply.ok:
            rospy.logwarn(
                'Answer of %s refused: %s', request.decision.by or 'nobody', reply.message
            )
        return AnswerQueryResponse(*reply)

    def _changed(self) -> None:
        """Inform the askers first, who wait for it. Then the front ends."""
        self._dispatch()
        self._publish_list()
        self._wake.set()

    def _dispatch(self) -> bool:
        """Send out the notices. Return whether there were any."""
        notices = self._questions.take_notices()
        for notice in notices:
            if notice.text:  # a new question has been logged already
                rospy.loginfo('Question %s: %s', notice.query_id, _sentence(notice))
            if notice.settled is not None:
                for asker in self._askers.pop(notice.query_id, ()):
                    _end(asker.handle, notice.settled)
                continue
            for asker in self._askers.get(notice.query_id, ()):
                asker.handle.publish_feedback(
                    ExpertQueryFeedback(notice.status, notice.by, notice.text)
                )
        return bool(notices)

    def _publish_list(self) -> None:
        message = OpenQueries(queries=self._questions.listing())
        message.header.stamp = rospy.Time.now()
        self._listed_s = time.monotonic()
        if not self._stopped and not rospy.is_shutdown():
            with quiet_at_shutdown():
                self._open_publisher.publish(message)

    def _watch_time(self) -> None:
        """Watch deadlines, leases and askers that vanish.

        Sleeps as long as no question is open.
        """
        while not self._stopped and not rospy.is_shutdown():
            self._wake.wait(self._pause_s())
            self._wake.clear()
            if self._stopped or rospy.is_shutdown():
                return
            with self._lock:
                self._check_time(time.monotonic())

    def _pause_s(self) -> Optional[float]:
        with self._lock:
            if not len(self._questions):
                return None
            return min(_WATCH_PERIOD_S, max(0.0, self._questions.next_due_s() - time.monotonic()))

    def _check_time(self, now_s: float) -> None:
        self._questions.tick()
        self._close_abandoned(now_s)
        changed = self._dispatch()
        if len(self._questions):
            # actionlib's own timer stops with a paused simulation, also finds the dead
            self._action.publish_status()
        if changed or (len(self._questions) and now_s - self._listed_s >= _LIST_PERIOD_S):
            self._publish_list()

    def _close_abandoned(self, now_s: float) -> None:
        connections = self._action.status_pub.impl.connections
        for query_id, askers in dict(self._askers).items():
            if all([asker.missing_s(connections, now_s) >= self._asker_gone_s for asker in askers]):
                self._questions.close(query_id, 'the asker is gone')


def _end(handle: actionlib.ServerGoalHandle, settled: SettledQuestion) -> None:
    result = ExpertQueryResult(settled.status, settled.decision)
    if settled.status == ExpertQueryResult.ANSWERED:
        handle.set_succeeded(result, settled.text)
    elif settled.status == ExpertQueryResult.EXPIRED:
        handle.set_aborted(result, settled.text)
    else:
        handle.set_canceled(result, settled.text)


def _sentence(notice: QuestionNotice) -> str:
    if notice.settled is not None:
        return '{} ({})'.format(notice.text, notice.by) if notice.by else notice.text
    if notice.status == ExpertQueryFeedback.PENDING:
        return 'pending; {}'.format(notice.text)
    if notice.status == ExpertQueryFeedback.CLAIMED:
        return '{} by {}'.format(notice.text, notice.by)
    return 'interface {} runs'.format(notice.text)


def settings_from_parameters() -> Tuple[str, float, float]:
    """Name, lease (s) and patience with a missing asker (s) of a server of many robots.

    :raises SettingsError: naming the parameter, its value and what is allowed.
    """
    name = name_of('~server_name', SERVER_NAME)
    if not rosgraph.names.is_legal_name(name):
        raise SettingsError(
            rospy.resolve_name('~server_name'), name, 'a ROS name: letters, digits, _ and /'
        )
    return (
        name,
        number_of('~lease_s', LEASE_S, 1.0, LONGEST_LEASE_S),
        number_of('~asker_gone_s', ASKER_GONE_S, 0.5, LONGEST_LEASE_S),
    )


def main() -> None:
    """Entry point of the node `expert_query_server`: one server for many robots."""
    parameters_only(
        'Node: one query server for many robots. Parameters: ~server_name, ~lease_s, '
        '~asker_gone_s; '
        'see doc/expert.md.'
    )
    rospy.init_node('expert_query_server')
    try:
        settings = settings_from_parameters()
    except SettingsError as err:
        rospy.logfatal('expert_query_server: %s', err)
        raise SystemExit(2) from err
    start_master_watch()
    server = ExpertQueryServer(*settings)
    rospy.loginfo('Experts are asked at %s', server.name)
    rospy.spin()
