"""The node `scripted_operator`: an expert by script who works with the interfaces of people."""

import math
import time
import zlib
from typing import Any, Dict, List, Set, Tuple

import numpy as np
import rospy

from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.expert.front_end import FrontEnd
from smach_oracle.msg import ExpertDecision, ExpertQueryGoal, OpenQuery, UserdataItem
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.master_watch import start_master_watch
from smach_oracle.ros.parameters import name_of, number_of
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.ros.userdata_codec import UserdataCodecError, decode

from .image_viewer import ImageViewer, ViewError, ViewerTopics
from .judging_by_eye import Impression, look_about
from .ladder import Asked, NextAct, Sight, TrialMemory, choose
from .manual_task import (
    BASE,
    InterfaceNames,
    ManualTask,
    OperatorInterfaces,
    carry_out,
    connect,
)
from .robot_means import MeansNames, RobotMeans
from .seen_scene import SeenScene
from .state_plans import StatePlan, StatePlans, missing
from .topic_hand import GoalEndedError

_PAUSE_S = 0.2
_ATTEMPTS = 3  # at one question, where the camera or its server does not answer


class OperatorSettings:
    """The operator's settings, from the node's parameters.

    :raises SettingsError: naming the parameter, its value and what is allowed.
    """

    def __init__(self) -> None:
        self.plans = StatePlans(rospy.get_param('~states', {}))
        self.seed = int(number_of('~seed', 0, 0, 2**31))
        self.median_s = number_of('~delay_median_s', 15.0, 0.0, 3600.0)
        self.sigma = number_of('~delay_sigma', 0.5, 0.0, 3.0)
        self.most_questions = int(number_of('~most_questions', 6, 1, 1000))
        self.rate_hz = number_of('~rate_hz', 30.0, 10.0, 500.0)
        self.perception = name_of('~perception', 'perception_interface')
        self.manipulation = name_of('~manipulation', 'manipulation_interface')
        self.image = (
            int(number_of('~image_width', 640, 1, 10000)),
            int(number_of('~image_height', 480, 1, 10000)),
        )
        self.eye = ViewerTopics(
            **{
                field: name_of('~' + field, default)
                for field, default in ViewerTopics._field_defaults.items()
            }
        )
        self.means = MeansNames(
            **{
                field: name_of('~' + field, default)
                for field, default in MeansNames._field_defaults.items()
            }
        )
        self.grippers = grippers_of(rospy.get_param('~grippers', {}))


def grippers_of(value: object) -> Dict[str, List[str]]:
    """The joints of the grippers by arm.

    :raises SettingsError: for anything but lists of names.
    """
    if not isinstance(value, dict) or not all(
        isinstance(joints, list) and all(isinstance(each, str) for each in joints)
        for joints in value.values()
    ):
        raise SettingsError('~grippers', value, 'a mapping from arms to lists of joints')
    return {str(arm): list(joints) for arm, joints in value.items()}


class ScriptedOperator:
    """Answers one question after the other."""

    def __init__(
        self,
        settings: OperatorSettings,
        front_end: FrontEnd,
        eye: ImageViewer,
        interfaces: OperatorInterfaces,
    ) -> None:
        self._settings = settings
        self._front_end = front_end
        self._eye = eye
        self._interfaces = interfaces
        self._trial: Tuple[str, str] = ('', '')
        self._memory = TrialMemory()
        self._questions = 0  # of this trial
        self._done: List[str] = []  # keys of questions that were attended to
        # of these, the ones that came to nothing, once for each time
        self._failed_attempts: List[str] = []
        self._warned: Set[str] = set()  # states whose interface was not offered

    def run(self) -> None:
        """Until the node ends."""
        version = 0
        while not rospy.is_shutdown():
            version = self._front_end.wait_for_change(version, _PAUSE_S)
            for listed in self._front_end.questions():
                still_runs = listed.goal.failure_kind == ExpertQueryGoal.STILL_RUNNING
                if (
                    listed.status == OpenQuery.PENDING
                    and not still_runs
                    and listed.key not in self._done
                ):
                    self._done = self._done[-99:] + [listed.key]
                    self._attend_to(listed)

    def _attend_to(self, listed: ListedQuestion) -> None:
        try:
            try:
                self._interfaces.means.begin_work()
                self._answer(listed)
            finally:
                self._interfaces.means.end_work()
        except (ServerGoneError, ViewError, GoalEndedError, rospy.ServiceException) as err:
            rospy.logwarn('%s of %s: %s', listed.goal.failed_state, listed.goal.container_path, err)
            self._front_end.release(listed)
            self._failed_attempts = self._failed_attempts[-99:] + [listed.key]
            if self._failed_attempts.count(listed.key) < _ATTEMPTS:
                self._done.remove(listed.key)

    def _answer(self, listed: ListedQuestion) -> None:
        goal = listed.goal
        self._begin(listed)
        scene = self._eye.look()
        generator = np.random.default_rng(
            [
                self._settings.seed,
                self._eye.chance,
                zlib.crc32(goal.failed_state.encode()),
                self._questions,
            ]
        )
        if not self._front_end.claim(listed).ok:
            return
        means = self._interfaces.means
        means.pass_time(
            float(
                generator.lognormal(
                    math.log(max(self._settings.median_s, 1e-6)), self._settings.sigma
                )
            )
        )
        userdata = userdata_of(goal.userdata)
        choice, impression = self._decide(listed, userdata, scene)
        self._prepare(choice)
        if not self._send_answer(listed, choice):
            return
        number = self._memory.times(goal.failed_state, choice.act)
        if not choice.interface:
            self._memory.note(goal.failed_state, choice, impression.sight)
            return
        plan = self._settings.plans.of(goal.failed_state)
        task = ManualTask(
            goal.query_id, choice, plan, userdata, number, generator, impression.about
        )
        begun_s = time.monotonic()
        result = carry_out(task, self._interfaces)
        self._memory.note(goal.failed_state, choice, impression.sight, result.worked)
        rospy.loginfo(
            '%s, %s: %s (%.1f s)',
            goal.failed_state,
            choice.act,
            result.text or 'done',
            time.monotonic() - begun_s,
        )

    def _begin(self, listed: ListedQuestion) -> None:
        """Count the question. A new trial is begun with an empty memory."""
        goal = listed.goal
        if (goal.robot, goal.trial_id) != self._trial:
            self._trial = (goal.robot, goal.trial_id)
            self._memory, self._questions = TrialMemory(), 0
            self._interfaces.means.forget()
        self._questions += 1

    def _decide(
        self, listed: ListedQuestion, userdata: Dict[str, Any], scene: SeenScene
    ) -> Tuple[NextAct, Impression]:
        """Decide what to do about a question, after a look about."""
        goal = listed.goal
        plan = self._settings.plans.of(goal.failed_state)
        offered = [offer.name for offer in goal.interfaces]
        self._warn(goal.failed_state, plan, offered)
        if self._questions > self._settings.most_questions:
            return NextAct(
                'give up',
                why='{} questions in one trial are enough'.format(self._settings.most_questions),
            ), Impression(Sight(), np.zeros(3))
        impression = look_about(plan, userdata, scene, self._interfaces.means)
        impression = impression._replace(
            sight=impression.sight._replace(repeated=goal.recoveries > 0)
        )
        asked = Asked(
            goal.failed_state,
            [choice.state for choice in goal.choices if not (choice.blocked or choice.container)],
            offered,
        )
        return choose(plan, asked, impression.sight, self._memory), impression

    def _prepare(self, choice: NextAct) -> None:
        """Do what comes before the machine goes on: wait, or drive the base."""
        self._interfaces.means.pass_time(choice.wait_s)
        if any(choice.base):
            wrong = self._interfaces.means.drive(*choice.base)
            if wrong:
                rospy.logwarn('the base does not drive: %s', wrong)

    def _warn(self, state: str, plan: StatePlan, offered: List[str]) -> None:
        """Warn, once for each state, that it cannot be done as the settings want it."""
        lacking = missing(plan, offered)
        if lacking and state not in self._warned:
            self._warned.add(state)
            rospy.logwarn(
                '%s: means %s needs an interface offered under the name %r; offered: %s. It is '
                'tried again '
                'without.',
                state,
                plan.means,
                lacking,
                ', '.join(offered) or 'none',
            )

    def _send_answer(self, listed: ListedQuestion, planned: NextAct) -> bool:
        kind = (
            ExpertDecision.INTERFACE
            if planned.interface
            else ExpertDecision.GOTO
            if planned.goto
            else ExpertDecision.GIVE_UP
        )
        rospy.loginfo(
            '%s failed (%s): %s %s',
            listed.goal.failed_state,
            listed.goal.text or listed.goal.outcome,
            planned.act,
            planned.interface or planned.goto,
        )
        if not planned.interface:
            self._interfaces.means.end_work()
        answer = self._front_end.answer(
            listed,
            ExpertDecision(
                kind=kind, state=planned.goto, interface=planned.interface, why=planned.why
            ),
        )
        if not answer.ok:
            rospy.logwarn('Answer for %s refused: %s', listed.goal.failed_state, answer.message)
            self._front_end.release(listed)
        return bool(answer.ok)


def userdata_of(items: List[UserdataItem]) -> Dict[str, Any]:
    """The items of a question's userdata that can be decoded."""
    found = {}
    for item in items:
        try:
            found[item.key] = decode(item)
        except UserdataCodecError:
            continue
    return found


def main() -> None:
    """Entry point of the node."""
    parameters_only(
        'Node: a scripted operator who works with the interfaces of people. Parameters: ~states, '
        '~seed, ~delay_median_s, ~delay_sigma and more; see doc/shared_autonomy.md.'
    )
    rospy.init_node('scripted_operator')
    start_master_watch()
    try:
        settings = OperatorSettings()
    except SettingsError as err:
        rospy.logfatal('scripted_operator: %s', err)
        raise SystemExit(2) from err
    name = rospy.get_name().strip('/')
    front_end = FrontEnd(name)
    rospy.on_shutdown(front_end.stop)
    eye = ImageViewer(settings.eye, BASE)
    means = RobotMeans(settings.means, settings.grippers, eye)
    names = InterfaceNames(settings.perception, settings.manipulation, name)
    interfaces = connect(names, eye, means, settings.image, settings.rate_hz)
    ScriptedOperator(settings, front_end, eye, interfaces).run()
