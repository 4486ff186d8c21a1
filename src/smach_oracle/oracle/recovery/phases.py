"""A recovery, phase by phase: the first that comes to a verdict ends it (paper, Algorithm 1).

Each phase is a function of the recovery. It returns a verdict, or None to leave it to the next. A
new way to recover is one more function here, and its place in `OracleState.execute`. Which phases
do anything on which occasion is in a table of doc/executive_inside.md.
"""

import threading
from typing import Dict, FrozenSet, List, Optional, Tuple

import smach

from ..asking.inquiry import Inquiry
from ..asking.question import Answer, AnswerKind, Expert
from ..decision.failure_rate import FailureClass
from ..decision.policy import Action
from ..decision.sentence import DecisionFacts, cause_of, decision_sentence
from ..errors import TrialError
from ..machine.health_watch import FAILED
from ..machine.jump_path import JumpPath, why_closed_on
from ..machine.places import TreePlace
from ..machine.repeats import repeated_by_going_to
from ..machine.tree_node import TreeNode
from ..records.events import EventKind, FailureKind
from ..records.facts import Decider
from ..scope.scope import standing_still
from ..smach_private import Labels, Transitions
from .deciding import Decided
from .endings import natural_ending
from .falling_back import fall_back, fallback_in_words
from .levels import (
    Foreseen,
    decide_above,
    failure_above,
    foreseen_above,
    levels_that_may_decide,
    runs_as_precondition,
    tell_decision,
)
from .occasions import FirstStep, FromBelow
from .recovering import Recovering
from .stop import in_words, preempt_beside
from .verdict import JumpTo, Verdict, leads_to, verdict_of

# -- what comes before a decision


def obey_given(recovering: Recovering) -> Optional[Verdict]:
    """Go as was decided before: by an answer, or in a container below."""
    occasion = recovering.occasion
    if occasion.answer is not None:
        return _obey_answer(recovering, occasion.answer)
    return None if occasion.below is None else _follow(recovering, occasion.below)


def _obey_answer(recovering: Recovering, answer: Answer) -> Optional[Verdict]:
    """Obey an answer about a state that still ran, unless what it names has closed meanwhile."""
    if recovering.stopped():
        return recovering.preempted()
    verdict = _obey(recovering, answer)
    closed = ''
    if answer.kind is AnswerKind.GOTO and isinstance(verdict, JumpTo):
        closed = why_closed_on(verdict.way)
    if not closed:
        return verdict
    recovering.ask_at_once(
        'cannot go to {}, as was answered: {} {}'.format(answer.state, answer.state, closed)
    )
    # it does not run any more
    recovering.judge_anew(
        recovering.failure._replace(
            kind=FailureKind.TIME_LIMIT, text='was taken out while it still ran'
        )
    )
    return recovering.end_unaided() if recovering.budget.why_over() else None


def _follow(recovering: Recovering, below: FromBelow) -> Optional[Verdict]:
    why_not = below.why_not()
    return _ask_since(recovering, why_not) if why_not else below.verdict


def _ask_since(recovering: Recovering, why: str) -> Optional[Verdict]:
    if recovering.stop.is_over():
        return recovering.end_early()
    recovering.ask_at_once(why)
    return None


def wait_until_well(recovering: Recovering) -> Optional[Verdict]:
    """Wait for a robot that was not well when the state failed. It may then enter it again."""
    first, why = recovering.occasion.first, recovering.occasion.why
    if first not in (FirstStep.ENTER_AGAIN, FirstStep.WAIT_AND_DECIDE):
        return None
    if not why:
        return recovering.preempted()
    again = first is FirstStep.ENTER_AGAIN
    if recovering.stop.is_over() or not recovering.stop.wait_until_well(
        FAILED if again else 'failed again', why
    ):
        return recovering.end_early()
    return _enter_again(recovering) if again else None


def _enter_again(recovering: Recovering) -> Optional[Verdict]:
    """Enter the failed state again, now that the robot is well, unless that may repeat it."""
    node, label = recovering.node, recovering.record.label
    if not repeated_by_going_to(node, label):
        recovering.record.unwell_repeats += 1
        return recovering.jump(JumpPath((), node, (TreePlace(node, label),)))
    recovering.judge_anew(
        recovering.failure._replace(
            kind=FailureKind.HELD_BACK,
            text='failed while the robot was not well, and is not repeated by itself',
        )
    )
    return None


def ask_first(recovering: Recovering) -> Optional[Verdict]:
    """Leave the decision to a person where the machine is not to move by itself."""
    occasion = recovering.occasion
    return _ask_since(recovering, occasion.why) if occasion.first is FirstStep.ASK else None


# -- the decision


def decide(recovering: Recovering) -> Optional[Verdict]:
    """Decide as the policy does, and go there. Leave it to the next phases where that is to ask."""
    if recovering.asks_at_once:
        return None
    if recovering.budget.why_over():
        return recovering.end_unaided()
    decided = recovering.deciding.decide(lambda: _why_left_to_others(recovering))
    if recovering.stop.is_over():
        return recovering.end_early()
    _, facts = decided
    recovering.cause = cause_of(facts)
    if facts.action is Action.ASK:
        recovering.decided = decided
        return None
    _tell_decision(recovering, decided)
    return _follow_policy(recovering, facts)


def _follow_policy(recovering: Recovering, facts: DecisionFacts) -> Verdict:
    """Carry out a decision that asks nobody."""
    way = recovering.deciding.way
    if way is None:
        return _give_way(
            recovering, _why_nobody_is_asked(recovering) or Foreseen('the policy asks nobody')
        )
    recovering.record.recoveries += 1
    restarts = facts.action is Action.RESTART
    written: FrozenSet[str] = frozenset() if restarts else way.kept(recovering.deciding.watch)
    return _wait_and_jump(recovering, facts.wait_s, JumpTo(way, written=written, restarts=restarts))


def _wait_and_jump(recovering: Recovering, wait_s: float, jump: JumpTo) -> Verdict:
    if wait_s and not recovering.stop.has_waited(wait_s):
        return recovering.end_early()
    return recovering.when_well(jump)


def _tell_decision(recovering: Recovering, decided: Decided) -> None:
    node, sentence = recovering.node, decision_sentence(decided[1], recovering.cause)
    smach.loginfo('{}/{}'.format(node.path, sentence))
    tell_decision(node, recovering.record, decided, recovering.occasion.continuous, sentence)


# -- the levels above


def escalate(recovering: Recovering) -> Optional[Verdict]:
    """Have the levels above decide before a person is asked, or end where it is left to them."""
    if recovering.decided is None:
        return None
    decider, facts = recovering.decided
    nobody = _why_nobody_is_asked(recovering)
    levels = [] if nobody else _levels_that_may_decide(recovering, decider)
    asked = (
        'the oracle above'
        if levels
        else 'nobody, since ' + nobody.text
        if nobody
        else _asked_in_words(recovering)
    )
    _tell_decision(recovering, (decider, facts._replace(asked=asked)))
    outer = _decided_above(recovering, levels)
    if recovering.stop.is_over():
        return recovering.end_early()
    if outer is not None:
        recovering.record.recoveries += 1
        jump, wait_s = outer
        return _wait_and_jump(recovering, wait_s, jump)
    return _give_way(recovering, nobody) if nobody else None


def _why_nobody_is_asked(recovering: Recovering) -> Optional[Foreseen]:
    """Return why the end of the container is left to a level above, or None where it is not."""
    node = recovering.node
    if runs_as_precondition(node):
        return Foreseen('it runs as a precondition')
    if recovering.failure.is_held_back:  # no other oracle can confirm that it is repeated
        return None
    foreseen = foreseen_above(node, recovering.natural_ending())
    return foreseen and foreseen._replace(
        text='its author goes on from there ({})'.format(foreseen.text)
    )


def _why_left_to_others(recovering: Recovering) -> str:
    nobody = _why_nobody_is_asked(recovering)
    return nobody.text if nobody is not None else ''


def _give_way(recovering: Recovering, why: Foreseen) -> Verdict:
    """End the container, and leave all else to who is above it."""
    if why.passed_over:
        recovering.warn('its item is passed over with {}'.format(why.passed_over))
    return recovering.give_up('{}: {}'.format(recovering.cause, why.text))


def _levels_that_may_decide(recovering: Recovering, decider: Decider) -> List[TreeNode]:
    """Return them, innermost first. None where the failure is to be asked about at once."""
    if decider is not Decider.POLICY or (recovering.record.failure_class is FailureClass.HIGH):
        return []
    return levels_that_may_decide(recovering.node)


def _decided_above(
    recovering: Recovering, levels: List[TreeNode]
) -> Optional[Tuple[JumpTo, float]]:
    """Return what the innermost level decides that does not ask, or None where all ask."""
    below, ending = recovering.node, recovering.natural_ending()
    for level in levels:
        failure = failure_above(
            level, below.below[0], ending, '{}: {}'.format(below.path, recovering.cause)
        )
        if failure is None or recovering.stop.is_over():
            return None
        decision = decide_above(recovering, level, failure)
        if decision is not None:
            return decision
        below = level
        ending = natural_ending(level, failure)
    return None


# -- the expert


def ask_expert(recovering: Recovering) -> Optional[Verdict]:
    """Ask the expert, and do as answered. None where nobody answers."""
    node = recovering.node
    expert = node.tree.expert
    if not node.in_force.policy.asks:
        return recovering.give_up('{}: the policy asks nobody'.format(recovering.cause))
    if expert is None:
        recovering.why_no_answer = 'no expert is there to ask'
        return None
    recovering.why_no_answer = recovering.budget.take_question()
    return None if recovering.why_no_answer else _ask(recovering, expert)


def _ask(recovering: Recovering, expert: Expert) -> Optional[Verdict]:
    node, budget = recovering.node, recovering.budget
    deadline_s, recovering.ends_budget = budget.within(node.settings.deadline_s)
    early_end = node.tree.early_end
    with standing_still(node.execution.runs_around), early_end.asking():
        reply = Inquiry(recovering, expert, deadline_s).run()
    if recovering.stopped():
        if early_end.end_at_shutdown():
            preempt_beside(node)
        if reply.question_id:
            recovering.emit(
                EventKind.QUERY_CANCELLED,
                query_id=reply.question_id,
                text=in_words(recovering.scope.reason, node),
            )
        return recovering.preempted()
    if reply.answer is not None:
        return _obey(recovering, reply.answer)
    why = '; '.join(filter(None, (reply.why_none, budget.why_over())))
    recovering.emit(
        EventKind.QUERY_EXPIRED,
        query_id=reply.question_id,
        text='{}; fallback: {}'.format(why, fallback_in_words(recovering)),
    )
    recovering.why_no_answer = why
    return None


def _asked_in_words(recovering: Recovering) -> str:
    node, budget = recovering.node, recovering.budget
    if node.tree.expert is None:
        return 'nobody, since there is no expert'
    spent = budget.why_no_question()
    if spent:
        return 'nobody, since ' + spent
    limit_s, is_cut = budget.within(node.settings.deadline_s)
    if is_cut:
        return "an expert, {:.0f} s, which are the trial's last".format(limit_s)
    return 'an expert, {:g} s'.format(limit_s) if limit_s else 'an expert'


def _obey(recovering: Recovering, answer: Answer) -> Verdict:
    return recovering.when_well(
        verdict_of(
            answer,
            recovering.node,
            recovering.record.label,
            recovering.deciding.watch,
            recovering.natural_ending,
        )
    )


_Led = Tuple[Labels, Labels, Optional[Transitions], int]
_NOTHING: _Led = ((), (), None, 0)


class OracleState(smach.State):
    """The ORACLE state of one container.

    Its outcomes are the labels of all states and all container outcomes.
    """

    def __init__(self) -> None:
        smach.State.__init__(self, outcomes=[])
        self._lock = threading.Lock()
        self._recovering: Optional[Recovering] = None
        self._verdict: Optional[Verdict] = None
        self._led: _Led = _NOTHING

    def lead_to(self, labels: Tuple[str, ...]) -> Dict[str, Optional[str]]:
        """Have these outcomes and no others, and return the transitions, each to its own name."""
        self._outcomes = set(labels)
        return {label: label for label in labels}

    def note_led(self, machine: smach.StateMachine, label: str, outcomes: Labels) -> None:
        """Note for what of the container, where it is `label`, it leads to all that there is."""
        transitions = machine._transitions[label]
        self._led = tuple(machine._states), outcomes, transitions, len(transitions)

    def leads_on(self, machine: smach.StateMachine, label: str, outcomes: Labels) -> bool:
        """Whether nothing of that has changed since."""
        states, ends, drawn, count = self._led
        return (
            drawn is not None
            and machine._transitions.get(label) is drawn
            and len(drawn) == count
            and ends == outcomes
            and states == tuple(machine._states)
        )

    def begin(self, recovering: Recovering) -> None:
        """Be ready to recover from a failure.

        From now on a preempt request reaches the recovery.
        """
        with self._lock:
            self._preempt_requested = False
            self._recovering = recovering
            self._verdict = None

    def execute(self, ud: smach.UserData) -> str:
        """Recover from the failure handed to `begin`.

        :returns: where the machine goes, '' where it raises. It follows the verdict itself.
        :raises TrialError: where no failure was handed over.
        """
        recovering = self._recovering
        if recovering is None:
            raise TrialError('the meta state is entered by failures alone')
        try:
            self._verdict = (
                obey_given(recovering)
                or wait_until_well(recovering)
                or ask_first(recovering)
                or decide(recovering)
                or escalate(recovering)
                or ask_expert(recovering)
                or fall_back(recovering)
            )  # every verdict counts as true, and the last phase has one
            return leads_to(self._verdict)
        finally:
            with self._lock:
                self._recovering = None

    def take_verdict(self) -> Verdict:
        """Return what the recovery that `execute` ran has come to, once.

        :raises TrialError: where `execute` has run none.
        """
        verdict, self._verdict = self._verdict, None
        if verdict is None:
            raise TrialError('the meta state has executed without a recovery')
        return verdict

    def request_preempt(self) -> None:
        """End the recovery: a precondition that runs is preempted, an open question taken back."""
        smach.State.request_preempt(self)
        with self._lock:
            recovering = self._recovering
        if recovering is not None:
            recovering.cancel()

    def __getstate__(self) -> Dict[str, object]:
        """Leave out what belongs to a recovery: neither that nor a lock travels with a machine."""
        state = dict(self.__dict__)
        state.update(_lock=None, _recovering=None, _verdict=None, _led=_NOTHING)
        return state

    def __setstate__(self, state: Dict[str, object]) -> None:
        self.__dict__.update(state)
        self._lock = threading.Lock()
