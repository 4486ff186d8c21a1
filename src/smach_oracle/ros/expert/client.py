"""Asks the experts: sends questions as goals to an ExpertQuery server, own or shared."""

import math
import threading
import time
from typing import Dict, Optional, Sequence

import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus

from smach_oracle.msg import (
    ExpertQueryAction,
    ExpertQueryFeedback,
    ExpertQueryGoal,
    ExpertQueryResult,
    InterfaceOutput,
    SharedAutonomyAction,
    SharedAutonomyResult,
)
from smach_oracle.oracle.asking.question import (
    Answer,
    AnswerKind,
    Expert,
    Progress,
    Question,
)
from smach_oracle.oracle.errors import InterfaceError
from smach_oracle.oracle.settings.interfaces import InterfaceOffer

from ..goal_link import POLL_S, GoalEvent, GoalLink, SentGoal, lost
from ..interfaces.starting import InterfaceStarter, StartedInterface
from ..master_watch import timed_master
from ..userdata_codec import UserdataCodecError, decode_all
from .failure_images import FailureCameras
from .precondition_watch import PreconditionWatch
from .question_messages import to_answer, to_goal, to_interface_goal
from .server import ExpertQueryServer

OWN_SERVER = '~expert_query'
SERVER_WAIT_S = 5.0
# the server's word that nobody answered is better than our own clock's, where it comes soon
_EXPIRY_GRACE_S = 1.0
_RETRY_S = 0.3
_ENDED = {GoalStatus.REJECTED: 'refused it', GoalStatus.ABORTED: 'failed'}


class ExpertQueryClient(Expert):
    """Asks the experts behind an ExpertQuery server. May be used from several threads at once.

    A server that dies while a question waits is waited for, and asked again under the same query
    id, until the deadline.
    """

    def __init__(
        self,
        server: str = '',
        robot: str = '',
        server_wait_s: float = SERVER_WAIT_S,
        cameras: Sequence[str] = (),
    ) -> None:
        """
        :param server: name of a shared server. '' hosts one of this node's own, `~expert_query`,
            and asks that.
        :param robot: who asks. '' is the node's name.
        :param server_wait_s: how long to wait for a shared-autonomy interface that an expert chose.
        :param cameras: topics whose newest images are published with each question.
        """
        self.robot = robot or rospy.get_name()
        self.server: Optional[ExpertQueryServer] = None if server else ExpertQueryServer(OWN_SERVER)
        self._link = GoalLink(rospy.resolve_name(server or OWN_SERVER), ExpertQueryAction)
        self._server_wait_s = server_wait_s
        self._starter = InterfaceStarter()
        self._watch = PreconditionWatch()
        self._cameras = FailureCameras(cameras)
        self._interfaces: Dict[str, GoalLink] = {}
        self._interfaces_lock = threading.Lock()

    def ask(
        self, question: Question, cancelled: threading.Event, progress: Progress
    ) -> Optional[Answer]:
        """Return the answer, or None where there is none by the deadline or `cancelled` was set.

        :raises AnswerError: if the answer cannot be used here, such as outputs of a message type
            that is not installed.
        """
        self._cameras.publish_for(question)
        with self._watch.while_open(question):
            return _SentQuestion(self._link, to_goal(question, self.robot), progress).run(cancelled)

    def run_interface(
        self,
        offer: InterfaceOffer,
        question: Question,
        cancelled: threading.Event,
        progress: Progress,
    ) -> Optional[Answer]:
        """Run a shared-autonomy interface. Return None where it is cancelled.

        It is started where it is not there.

        :raises InterfaceError: where it is not there, and cannot be started or does not come up,
            where it ends without a result, and where its outputs cannot be read.
        """
        progress('interface_start', offer.name, '')
        ended = threading.Event()
        announcing = threading.Thread(
            target=self._announce, args=(offer, question, ended), name='announce', daemon=True
        )
        announcing.start()
        answer = None
        try:
            result = self._run(offer, question, cancelled)
            answer = None if result is None else _to_supersede(result)
        finally:
            ended.set()
            announcing.join()
            progress('interface_end', offer.name, answer.outcome if answer else '')
        return answer

    def close(self) -> None:
        """Take down the connections, and the own server where there is one."""
        self._starter.stop()
        self._cameras.stop()
        for link in [self._link] + list(self._interfaces.values()):
            link.stop()
        if self.server is not None:
            self.server.stop()

    def _announce(self, offer: InterfaceOffer, question: Question, ended: threading.Event) -> None:
        """Show the front ends that an interface runs for the question, until it has ended.

        A server that comes later, or is restarted, is told as well.
        """
        goal = to_goal(question, self.robot)
        goal.interface = offer.name
        goal.deadline = 0.0
        _SentQuestion(self._link, goal, lambda *_: None).run(ended)

    def _run(
        self, offer: InterfaceOffer, question: Question, cancelled: threading.Event
    ) -> Optional[SharedAutonomyResult]:
        link = self._interface(offer.action)
        started = self._provide(offer, link, question.question_id, cancelled)
        try:
            return self._result(offer, link, question, cancelled)
        finally:
            if started is not None:
                started.leave(question.question_id)

    def _provide(
        self, offer: InterfaceOffer, link: GoalLink, query_id: str, cancelled: threading.Event
    ) -> Optional[StartedInterface]:
        """Wait for the action server. Start it where it can be started and nobody else has.

        One that was started here is shared.
        """
        there = (offer.start is None or _advertised(link)) and _wait_until_ready(
            link, self._server_wait_s, cancelled
        )
        if there and (offer.start is None or not self._starter.runs(offer.name)):
            return None
        if offer.start is None or cancelled.is_set():
            raise InterfaceError(
                'taken back'
                if cancelled.is_set()
                else 'no action server at {} within {:g} s'.format(link.name, self._server_wait_s)
            )
        started = self._starter.start(offer, query_id)
        until_s = time.monotonic() + offer.start.limit_s
        while not link.ready():
            why = ''
            if started.exit_code is not None:
                why = 'it ended by itself with exit code {}: {}'.format(
                    started.exit_code, started.last_lines
                )
            elif cancelled.is_set() or rospy.is_shutdown():
                why = 'taken back'
            elif time.monotonic() > until_s:
                why = 'it brought up no action server {} within {:g} s'.format(
                    link.name, offer.start.limit_s
                )
            if why:
                started.leave(query_id, why)
                raise InterfaceError(why)
            cancelled.wait(POLL_S)
        started.publish_status(
            InterfaceOutput.RUNNING, 'its action server {} is there'.format(link.name)
        )
        return started

    def _result(
        self, offer: InterfaceOffer, link: GoalLink, question: Question, cancelled: threading.Event
    ) -> Optional[SharedAutonomyResult]:
        if not _wait_until_ready(link, self._server_wait_s, cancelled):
            return None
        sent = link.send(to_interface_goal(offer, question))
        while not (cancelled.is_set() or rospy.is_shutdown()):
            event = sent.poll()
            if event is not None and event.status:
                return _interface_result(event)
            if event is None and _server_lost(link, sent, time.monotonic()):
                raise InterfaceError('its action server {} is gone'.format(link.name))
        sent.cancel()
        return None

    def _interface(self, action: str) -> GoalLink:
        name = rospy.resolve_name(action)
        with self._interfaces_lock:
            if name not in self._interfaces:
                self._interfaces[name] = GoalLink(name, SharedAutonomyAction)
            return self._interfaces[name]


class _SentQuestion:
    """One question on its way: sent, sent again after a loss, until it is settled."""

    def __init__(self, link: GoalLink, goal: ExpertQueryGoal, progress: Progress) -> None:
        self._link = link
        self._goal = goal
        self._progress = progress
        self._deadline_s = time.monotonic() + goal.deadline if goal.deadline > 0 else math.inf
        self._sent: Optional[SentGoal] = None
        self._retry_s = -math.inf
        self._times_sent = 0
        self._holder = ''

    def run(self, cancelled: threading.Event) -> Optional[Answer]:
        """Block until the question is settled, taken back or too old."""
        while not (cancelled.is_set() or rospy.is_shutdown()):
            now_s = time.monotonic()
            if now_s >= self._deadline_s + (_EXPIRY_GRACE_S if self._sent else 0.0):
                break
            event = self._next_event(now_s, cancelled)
            if event is None:
                continue
            if event.feedback is not None:
                self._note_feedback(event.feedback)
            elif self._settled(event):
                return _answer_of(event)
        if self._sent is not None:
            self._sent.cancel()
        return None

    def _next_event(self, now_s: float, cancelled: threading.Event) -> Optional[GoalEvent]:
        if self._sent is None:
            if now_s >= self._retry_s and self._link.ready():
                self._send(now_s)
            else:
                cancelled.wait(POLL_S)
            return None
        event = self._sent.poll()
        if event is None and _server_lost(self._link, self._sent, now_s):
            self._lose('is gone')
        return event

    def _send(self, now_s: float) -> None:
        """Send the question. The deadline does not begin again."""
        if self._deadline_s < math.inf:
            self._goal.deadline = max(self._deadline_s - now_s, 1e-3)
        self._sent = self._link.send(self._goal)
        self._times_sent += 1
        if self._times_sent > 1:
            rospy.loginfo(
                'Question %s is %s again at %s',
                self._goal.query_id,
                'shown with its interface' if self._goal.interface else 'asked',
                self._link.name,
            )

    def _lose(self, what: str) -> None:
        rospy.logwarn(
            'The expert query server %s %s; question %s waits for it to come back',
            self._link.name,
            what,
            self._goal.query_id,
        )
        self._sent = None
        self._retry_s = time.monotonic() + _RETRY_S
        self._released('the expert query server {}'.format(what))

    def _settled(self, event: GoalEvent) -> bool:
        """Whether the end of the goal is the end of the question."""
        if lost(event):
            self._lose('was restarted')
            return False
        # not by us: we would not be here
        if event.status in (GoalStatus.PREEMPTED, GoalStatus.RECALLED):
            self._lose('dropped the question')
            return False
        return True

    def _note_feedback(self, feedback: ExpertQueryFeedback) -> None:
        if feedback.status == ExpertQueryFeedback.CLAIMED and feedback.by != self._holder:
            self._holder = feedback.by
            self._progress('claimed', feedback.by, feedback.text)
        elif feedback.status == ExpertQueryFeedback.PENDING:
            self._released(feedback.text)

    def _released(self, text: str) -> None:
        if self._holder:
            holder, self._holder = self._holder, ''
            self._progress('released', holder, text)


def _server_lost(link: GoalLink, sent: SentGoal, now_s: float) -> bool:
    """Whether the server is gone. At a shutdown it goes down with this node, and is not missed."""
    return not rospy.core.is_shutdown_requested() and (not link.alive() or sent.unheard(now_s))


def _answer_of(event: GoalEvent) -> Optional[Answer]:
    result: Optional[ExpertQueryResult] = event.result
    if (
        event.status == GoalStatus.SUCCEEDED
        and result is not None
        and result.status == ExpertQueryResult.ANSWERED
    ):
        return to_answer(result.decision)
    if event.status == GoalStatus.REJECTED:
        rospy.logerr('The expert query server refused a question; nobody was asked')
    return None


def _wait_until_ready(link: GoalLink, timeout_s: float, cancelled: threading.Event) -> bool:
    until_s = time.monotonic() + timeout_s
    while not link.ready():
        if time.monotonic() >= until_s or rospy.is_shutdown() or cancelled.wait(POLL_S):
            return False
    return True


def _advertised(link: GoalLink) -> bool:
    """Whether the master knows of an action server there. One that has died may still be listed."""
    try:
        published = timed_master().getPublishedTopics('')
    except (OSError, rosgraph.MasterException):
        return link.ready()
    return any(topic == link.name + '/status' for topic, _ in published)


def _interface_result(event: GoalEvent) -> SharedAutonomyResult:
    result: Optional[SharedAutonomyResult] = event.result
    if event.status == GoalStatus.SUCCEEDED and result is not None:
        return result
    ended = _ENDED.get(event.status) or 'ended as ' + GoalStatus.to_string(event.status)
    why = ('' if result is None else result.text) or event.text
    raise InterfaceError('{}: {}'.format(ended, why) if why else ended)


def _to_supersede(result: SharedAutonomyResult) -> Answer:
    """Return the interface's result as an answer.

    The caller checks whether it fits the question.
    """
    try:
        outputs = decode_all(result.outputs)
    except UserdataCodecError as err:
        raise InterfaceError(str(err)) from err
    # no `by`: the decision was that of the expert who started the interface
    return Answer(
        AnswerKind.SUPERSEDE, outcome=result.outcome, outputs=outputs or None, why=result.text
    )
