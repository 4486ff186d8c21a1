"""The node `scripted_operator`: an expert without a person who answers questions with the means that people have."""
import math
import time
import zlib
from typing import Any, Dict, List, Set, Tuple

import numpy as np
import rospy

from smach_oracle.expert.followed_server import Listed, ServerGoneError
from smach_oracle.expert.front_end import FrontEnd
from smach_oracle.msg import ExpertDecision, OpenQuery, UserdataItem
from smach_oracle.oracle.errors import ConfigError
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.master_watch import start_master_watch
from smach_oracle.ros.parameters import name_of, number_of
from smach_oracle.ros.userdata_codec import UserdataCodecError, decode

from .eye import Eye, EyeError
from .plans import PUT_DOWN, SHOW, Decision, Means, Plans, Situation, decide, missing
from .showing import what_to_show
from .sight import Sight
from .topic_hand import Interrupted
from .work import Interfaces, Job, connect, do, think

_PAUSE_S = 0.2
_ATTEMPTS = 3  # at one question, where the world or its server does not answer
_THINKING_S = 120.0  # wall time at most, where the clock stands


class Settings:
    """From the node's parameters.

    :raises ConfigError: naming the parameter, its value and what is allowed.
    """

    def __init__(self) -> None:
        self.plans = Plans(rospy.get_param('~states', {}))
        self.seed = int(number_of('~seed', 0, 0, 2 ** 31))
        self.median_s = number_of('~delay_median_s', 15.0, 0.0, 3600.0)
        self.sigma = number_of('~delay_sigma', 0.5, 0.0, 3.0)
        self.most_questions = int(number_of('~most_questions', 12, 1, 1000))
        self.rate_hz = number_of('~rate_hz', 30.0, 10.0, 500.0)
        self.perception = name_of('~perception', 'perception_interface')
        self.manipulation = name_of('~manipulation', 'manipulation_interface')
        self.image = (int(number_of('~image_width', 640, 1, 10000)), int(number_of('~image_height', 480, 1, 10000)))


class Operator:
    """Answers one question after the other."""

    def __init__(self, settings: Settings, front_end: FrontEnd, eye: Eye, interfaces: Interfaces) -> None:
        self._settings = settings
        self._front_end = front_end
        self._eye = eye
        self._interfaces = interfaces
        self._trial: Tuple[str, str] = ('', '')
        self._asked: Dict[str, int] = {}
        self._done: List[str] = []  # keys of questions that were attended to
        self._spoilt: List[str] = []  # of those that came to nothing, once for each time
        self._warned: Set[str] = set()  # states whose interface was not offered

    def run(self) -> None:
        """Until the node ends."""
        version = 0
        while not rospy.is_shutdown():
            version = self._front_end.wait_for_change(version, _PAUSE_S)
            for listed in self._front_end.questions():
                if listed.status == OpenQuery.PENDING and listed.key not in self._done:
                    self._done = self._done[-99:] + [listed.key]
                    self._attend_to(listed)

    def _attend_to(self, listed: Listed) -> None:
        try:
            self._answer(listed)
        except (ServerGoneError, EyeError, Interrupted, rospy.ServiceException) as err:
            rospy.logwarn('%s of %s: %s', listed.goal.failed_state, listed.goal.container_path, err)
            self._front_end.release(listed)
            self._spoilt = self._spoilt[-99:] + [listed.key]
            if self._spoilt.count(listed.key) < _ATTEMPTS:
                self._done.remove(listed.key)

    def _answer(self, listed: Listed) -> None:
        goal = listed.goal
        number = self._count(listed)
        sight = self._eye.look()
        generator = np.random.default_rng([self._settings.seed, sight.seed, zlib.crc32(goal.failed_state.encode()),
                                           sum(self._asked.values())])
        if not self._front_end.claim(listed).ok:
            return
        think(float(generator.lognormal(math.log(max(self._settings.median_s, 1e-6)), self._settings.sigma)),
              _THINKING_S if self._settings.median_s > 0 else 0.0)
        decision = self._decide(listed, number, sight)
        if not self._say(listed, decision) or not decision.interface:
            return
        means = self._settings.plans.of(goal.failed_state)
        job = Job(goal.query_id, means, userdata_of(goal.userdata), number, generator)
        begun_s = time.monotonic()
        wrong = do(job, self._interfaces, self._eye)
        rospy.loginfo('%s by hand: %s (%.1f s)', goal.failed_state, wrong or 'done', time.monotonic() - begun_s)

    def _count(self, listed: Listed) -> int:
        """How often this state was asked about in this trial before."""
        goal = listed.goal
        if (goal.robot, goal.trial_id) != self._trial:
            self._trial, self._asked = (goal.robot, goal.trial_id), {}
        number = self._asked.get(goal.failed_state, 0)
        self._asked[goal.failed_state] = number + 1
        return number

    def _decide(self, listed: Listed, number: int, sight: Sight) -> Decision:
        """What to answer; a decision for nothing gives up."""
        goal = listed.goal
        if sum(self._asked.values()) > self._settings.most_questions:
            return Decision(why='{} questions in one trial are enough'.format(self._settings.most_questions))
        means = self._settings.plans.of(goal.failed_state)
        offered = [offer.name for offer in goal.interfaces]
        self._warn(goal.failed_state, means, offered)
        situation = Situation(
            goal.failed_state, [choice.state for choice in goal.choices if not choice.blocked], offered, number,
            means.means != PUT_DOWN or sight.held_by(means.arm) is not None,
            means.means != SHOW or what_to_show(sight) is not None)
        return decide(means, situation)

    def _warn(self, state: str, means: Means, offered: List[str]) -> None:
        """Say, once for each state, that it cannot be done as the settings have it."""
        lacking = missing(means, offered)
        if lacking and state not in self._warned:
            self._warned.add(state)
            rospy.logwarn('%s: means %s needs an interface offered under the name %r; offered: %s. It is tried again '
                          'without.', state, means.means, lacking, ', '.join(offered) or 'none')

    def _say(self, listed: Listed, decision: Decision) -> bool:
        kind = (ExpertDecision.INTERFACE if decision.interface
                else ExpertDecision.GOTO if decision.goto else ExpertDecision.GIVE_UP)
        rospy.loginfo('%s failed (%s): %s', listed.goal.failed_state, listed.goal.text or listed.goal.outcome,
                      decision.interface or decision.goto or 'given up')
        answer = self._front_end.answer(listed, ExpertDecision(
            kind=kind, state=decision.goto, interface=decision.interface, why=decision.why))
        if not answer.ok:
            rospy.logwarn('Answer for %s refused: %s', listed.goal.failed_state, answer.message)
            self._front_end.release(listed)
        return bool(answer.ok)


def userdata_of(items: List[UserdataItem]) -> Dict[str, Any]:
    """What of a question's userdata came along."""
    found = {}
    for item in items:
        try:
            found[item.key] = decode(item)
        except UserdataCodecError:
            continue
    return found


def main() -> None:
    """Entry point of the node."""
    parameters_only('Node: a scripted operator who works with the interfaces of people. Parameters: ~states, ~seed, '
                    '~delay_median_s, ~delay_sigma and more; see doc/shared_autonomy.md.')
    rospy.init_node('scripted_operator')
    start_master_watch()
    try:
        settings = Settings()
    except ConfigError as err:
        rospy.logfatal('scripted_operator: %s', err)
        raise SystemExit(2) from err
    name = rospy.get_name().strip('/')
    front_end = FrontEnd(name)
    rospy.on_shutdown(front_end.stop)
    interfaces = connect(settings.perception, settings.manipulation, name, settings.image, settings.rate_hz)
    Operator(settings, front_end, Eye(), interfaces).run()
