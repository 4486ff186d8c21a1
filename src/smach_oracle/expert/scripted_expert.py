"""An expert without a person: follows the open lists and answers by rules (`rules.py`)."""

import threading
import time
from collections import OrderedDict
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

import rospy

from smach_oracle.msg import ExpertQueryGoal, OpenQuery
from smach_oracle.oracle.errors import OracleError, SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.expert.open_questions import REMEMBERED
from smach_oracle.ros.expert.question_messages import to_decision
from smach_oracle.ros.loaded_settings import LoadedSettings
from smach_oracle.ros.master_watch import start_master_watch
from smach_oracle.ros.parameters import name_of
from smach_oracle.ros.reading.yaml_files import read_yaml
from smach_oracle.ros.service_calls import CALL_LIMIT_S, ServerGoneError, ServiceCall
from smach_oracle.srv import ChargeTime, ChargeTimeRequest

from .followed_server import ListedQuestion
from .front_end import FrontEnd
from .rules import IGNORE, Rule, Rules
from .wording import still_runs

ALL_SERVERS = 'all'
NONE = 'none'
LONGEST_DELAY_S = 3600.0
_IDLE_S = 0.5
_RETRY_S = 0.2
_LOOK_S = 0.05  # at ROS time
_WORK = 'expert'  # to which its time is charged


class _PlannedAnswer(NamedTuple):
    """A question that will be answered."""

    listed: ListedQuestion
    rule: Rule
    due_s: float  # by the clock of delays, or infinity for a question left to others


class ScriptedExpert:
    """Answers every question of a front end by rules, in a thread of its own.

    Questions wait side by side.

    A question that another expert has claimed is left alone until it is free again.
    """

    def __init__(
        self,
        front_end: FrontEnd,
        rules: Rules,
        answer_delay_s: Optional[float] = None,
        charge_time: str = '',
    ) -> None:
        """
        :param answer_delay_s: of ROS time, in place of the delays of the rules. None means theirs,
            which are of the machine's time.
        :param charge_time: resolved name of a ChargeTime service that counts the time of its work.
            '' means nobody does.
        """
        self._front_end = front_end
        self._rules = rules
        self._delay_s = answer_delay_s
        self._now: Callable[[], float] = (
            time.monotonic if answer_delay_s is None else rospy.get_time
        )
        self._charge_time = charge_time
        self._charged = False  # its work has begun there
        self._planned: Dict[str, _PlannedAnswer] = {}
        self._chosen: 'OrderedDict[str, Rule]' = OrderedDict()  # by question, also of settled ones
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name='scripted expert', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Answer nothing any more. The front end is stopped too."""
        self._stopped = True
        self._front_end.stop()
        self._thread.join(0.5)  # it may be waiting for a server that does not answer

    def _run(self) -> None:
        version = 0
        while not (self._stopped or rospy.is_shutdown()):
            version = self._front_end.wait_for_change(version, self._pause_s())
            self.look()

    def look(self) -> None:
        """Take in what is open now, and answer what is due. Its own thread calls this."""
        self._take_in()
        self._charge()
        now_s = self._now()
        for key, planned in dict(self._planned).items():
            latest_s = now_s + max(planned.rule.delay_s, _RETRY_S)
            if planned.due_s <= now_s:
                self._answer(key, planned)
            elif latest_s < planned.due_s < float('inf'):  # ROS time has jumped back
                self._planned[key] = planned._replace(due_s=latest_s)
        self._charge()

    def _pause_s(self) -> float:
        due_s = min((planned.due_s for planned in self._planned.values()), default=float('inf'))
        if self._delay_s is not None:  # ROS time may pass faster
            return _IDLE_S if due_s == float('inf') else _LOOK_S
        return max(0.0, min(_IDLE_S, due_s - time.monotonic()))

    def _take_in(self) -> None:
        """Plan an answer for each question that others leave to it, and for no other one."""
        free = {
            listed.key: listed
            for listed in self._front_end.questions()
            if listed.status == OpenQuery.PENDING
            or (listed.status == OpenQuery.CLAIMED and listed.holder == self._front_end.expert)
        }
        for key in set(self._planned) - set(free):
            del self._planned[key]
        for key, listed in free.items():
            if key not in self._planned:
                self._begin(key, listed)

    def _begin(self, key: str, listed: ListedQuestion) -> None:
        goal = listed.goal
        rule = self._chosen_rule(key, goal)
        why_not = rule.why_not(goal.choices)
        if why_not:
            rospy.logwarn('The rule for %s does not answer: %s', goal.failed_state, why_not)
        if self._delay_s is not None:
            rule = rule._replace(delay_s=self._delay_s)
        ignores = rule.kind == IGNORE or bool(why_not)
        due_s = float('inf') if ignores else self._now() + rule.delay_s
        self._planned[key] = _PlannedAnswer(listed, rule, due_s)
        if rule.delay_s > 0 and not ignores:
            try:
                self._front_end.claim(listed)
            except ServerGoneError as err:
                rospy.logwarn('%s', err)

    def _chosen_rule(self, key: str, goal: ExpertQueryGoal) -> Rule:
        """Return the rule for a question, the same one when it comes again."""
        if key not in self._chosen:
            rule = Rule(IGNORE)  # of a state that still runs: rules are for failures
            if not still_runs(goal):
                rule = self._rules.next(
                    goal.robot, goal.trial_id, goal.container_path, goal.failed_state
                )
            self._chosen[key] = rule
        self._chosen.move_to_end(key)
        while len(self._chosen) > REMEMBERED:
            self._chosen.popitem(last=False)
        return self._chosen[key]

    def _answer(self, key: str, planned: _PlannedAnswer) -> None:
        try:
            decision = to_decision(planned.rule.answer(self._front_end.expert))
            response = self._front_end.answer(planned.listed, decision)
        except ServerGoneError as err:
            rospy.logwarn('%s', err)
            self._planned[key] = planned._replace(due_s=self._now() + _RETRY_S)
            return
        except OracleError as err:
            rospy.logerr(
                'The rule for %s cannot be sent: %s', planned.listed.goal.failed_state, err
            )
            self._leave(key, planned)
            return
        if not response.ok:
            rospy.logwarn(
                'Answer for %s refused: %s', planned.listed.goal.failed_state, response.message
            )
        self._leave(key, planned)

    def _leave(self, key: str, planned: _PlannedAnswer) -> None:
        """Done with it: answered, or to be left to others."""
        self._front_end.release(planned.listed)
        self._planned[key] = planned._replace(due_s=float('inf'))

    def _charge(self) -> None:
        """Tell a world that counts its time when work begins, or ends."""
        on = any(planned.due_s < float('inf') for planned in self._planned.values())
        if on == self._charged or not self._charge_time:
            return
        self._charged, request = on, ChargeTimeRequest(_WORK, on)
        try:
            ServiceCall(self._charge_time, ChargeTime, request).result(CALL_LIMIT_S)
        except (ServerGoneError, rospy.ServiceException) as err:
            rospy.logwarn('Nobody counts the time of the expert: %s', err)


def load_rules(rules: Optional[Mapping[str, Any]], path: str) -> Rules:
    """Make rules from a dictionary, else from a YAML file.

    :raises SettingsError: naming what is wrong with them, or with the file.
    """
    if rules:
        return Rules.parse(rules)
    if not checks.text('~rules_file', path):
        raise SettingsError(
            '~rules', rules, 'rules in the parameter ~rules, or a YAML file in ~rules_file'
        )
    given = LoadedSettings()
    allowed = 'a YAML file of rules'
    try:
        given.put(*_read(path))
    except SettingsError as err:
        raise SettingsError(
            '~rules_file', path, allowed, '~rules_file: {}; needed: {}'.format(err, allowed)
        ) from err
    if not given:
        raise SettingsError('~rules_file', path, allowed + ', and not an empty one')
    try:
        return Rules.parse(given)
    except SettingsError as err:
        raise given.located(err) from err


def _read(path: str) -> Tuple[Mapping[str, Any], str, Mapping[str, int]]:
    """Return the rules in a file, its name, and the lines of the keys."""
    values, lines = read_yaml(path_of(path), 'file of rules')
    return values, path, lines


def servers_of(value: object) -> List[str]:
    """Return the names of servers from a text, separated by spaces, or from a list.

    None means all that there are.

    :raises SettingsError: for anything else.
    """
    names = list(checks.words('~servers', value.split() if isinstance(value, str) else value))
    return [] if names == [ALL_SERVERS] else names


def delay_of(value: object) -> Optional[float]:
    """Return the delay (s) that a parameter gives to every answer, None where it is NONE.

    :raises SettingsError: for anything else than NONE or a number from 0 to 3600.
    """
    if value == NONE:
        return None
    try:
        seconds = float(str(value))
    except ValueError:
        seconds = float('nan')
    if not 0.0 <= seconds <= LONGEST_DELAY_S:
        raise SettingsError(
            '~answer_delay', value, '{}, or s from 0 to {:g}'.format(NONE, LONGEST_DELAY_S)
        )
    return seconds


def main() -> None:
    """Entry point of the node `scripted_expert`.

    Parameters: ~rules or ~rules_file, ~servers, ~expert, ~answer_delay, ~charge_time.
    """
    parameters_only(
        'Node: an expert who answers by rules. Parameters: ~rules or ~rules_file, ~servers, '
        '~expert, ~answer_delay, ~charge_time; '
        'see doc/expert.md.'
    )
    rospy.init_node('scripted_expert')
    start_master_watch()
    try:
        rules = load_rules(rospy.get_param('~rules', None), rospy.get_param('~rules_file', ''))
        servers = servers_of(rospy.get_param('~servers', ALL_SERVERS))
        name = name_of('~expert', rospy.get_name().strip('/'))
        delay_s = delay_of(rospy.get_param('~answer_delay', NONE))
        charge_time = name_of('~charge_time', NONE)
    except SettingsError as err:
        rospy.logfatal('scripted_expert: %s', err)
        raise SystemExit(2) from err
    counted = '' if charge_time == NONE else rospy.resolve_name(charge_time)
    expert = ScriptedExpert(FrontEnd(name, servers), rules, delay_s, counted)
    rospy.on_shutdown(expert.stop)
    rospy.spin()
