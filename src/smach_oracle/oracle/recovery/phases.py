"""A recovery, phase by phase: the first that comes to a verdict ends it (paper, Algorithm 1).

Each phase is a function of the recovery. It returns a verdict, or None to leave it to the next. A
new way to recover is one more function here, and its place in `PHASES`. Which phases do anything on
which occasion is in a table of doc/inside/executive_inside.md.
"""

import threading
from functools import partial
from typing import Callable, Dict, Optional, Tuple

import smach

from ..asking.question import Answer, AnswerKind, Expert
from ..decision.policy import Action
from ..decision.sentence import DecisionFacts, cause_of
from ..errors import TrialError
from ..machine.health_watch import FAILED
from ..machine.nesting import items_under_way, settle_ways
from ..machine.places import (
    JumpPath,
    TreePlace,
    jump_path_to,
    levels_above,
    place_at,
    why_closed_on,
)
from ..machine.repeats import repeated_by_going_to
from ..records.events import EventKind, FailureKind
from ..scope.scope import standing_still
from ..smach_private import Labels, Transitions, remapping_of
from .deciding import decide_on_level
from .falling_back import fall_back, fallback_in_words
from .inquiry import Inquiry
from .levels import (
    decided_above,
    foreseen_above,
    levels_that_may_decide,
    runs_as_precondition,
    tell_decision,
    unnoticed,
)
from .occasions import FirstStep
from .recovery import Recovery
from .stop import preempt_beside
from .verdict import (
    Foreseen,
    GiveUp,
    JumpTo,
    Supersede,
    Verdict,
    leads_to,
)

# -- what comes before a decision


def obey_given(recovery: Recovery) -> Optional[Verdict]:
    """Go as was decided before: by an answer, or in a container below."""
    answer, lower = recovery.occasion.answer, recovery.occasion.departure
    if answer is not None:
        return _obey_answer(recovery, answer)
    if lower is None:
        return None
    why_not = lower.why_not()
    return _ask_since(recovery, why_not) if why_not else lower.verdict


def _obey_answer(recovery: Recovery, answer: Answer) -> Optional[Verdict]:
    """Obey an answer about a state that still ran, unless what it names has closed meanwhile."""
    if recovery.stopped():
        return recovery.preempted()
    verdict = _obey(recovery, answer)
    closed = why_closed_on(verdict.jump_path) if isinstance(verdict, JumpTo) else ''
    if not closed:
        return verdict
    recovery.ask_at_once(
        'cannot go to {}, as was answered: {} {}'.format(answer.state, answer.state, closed)
    )
    # it does not run any more
    recovery.failure = recovery.failure._replace(
        kind=FailureKind.TIME_LIMIT, text='was taken out while it still ran'
    )
    return recovery.end_unaided() if recovery.budget.why_over() else None


def _ask_since(recovery: Recovery, why: str) -> Optional[Verdict]:
    if recovery.is_over():
        return recovery.end_early()
    recovery.ask_at_once(why)
    return None


def wait_until_well(recovery: Recovery) -> Optional[Verdict]:
    """Wait for a robot that was not well when the state failed. It may then enter it again."""
    first, why = recovery.occasion.first_step, recovery.occasion.why
    if first not in (FirstStep.ENTER_AGAIN, FirstStep.WAIT_AND_DECIDE):
        return None
    if not why:
        return recovery.preempted()
    again = first is FirstStep.ENTER_AGAIN
    if recovery.is_over() or not recovery.wait_until_well(FAILED if again else 'failed again', why):
        return recovery.end_early()
    node, record = recovery.node, recovery.record
    if not again:
        return None
    if not repeated_by_going_to(node, record.label):
        record.unwell_repeats += 1
        return recovery.jump(JumpPath((), node, (TreePlace(node, record.label),)))
    recovery.failure = recovery.failure._replace(
        kind=FailureKind.HELD_BACK,
        text='failed while the robot was not well, and is not repeated by itself',
    )
    return None


def ask_first(recovery: Recovery) -> Optional[Verdict]:
    """Leave the decision to a person where the machine is not to move by itself."""
    occasion = recovery.occasion
    return _ask_since(recovery, occasion.why) if occasion.first_step is FirstStep.ASK else None


# -- the decision


def decide(recovery: Recovery) -> Optional[Verdict]:
    """Decide as the policy does, and go there. Leave it to the next phases where that is to ask."""
    if recovery.asks_at_once:
        return None
    if recovery.budget.why_over():
        return recovery.end_unaided()
    decided = decide_on_level(recovery, partial(_left_to_others, recovery))
    if recovery.is_over():
        return recovery.end_early()
    _, facts = decided
    recovery.cause = cause_of(facts)
    if facts.action is Action.ASK:
        recovery.decided_to_ask = decided
        return None
    tell_decision(recovery, decided)
    return _carry_out(recovery, facts)


def _carry_out(recovery: Recovery, facts: DecisionFacts) -> Verdict:
    """Carry out a decision that asks nobody."""
    way = recovery.jump_path
    if way is None:
        return _give_way(
            recovery, _why_nobody_is_asked(recovery) or Foreseen('the policy asks nobody')
        )
    recovery.recovered.append(recovery.record)
    kept, restarts = way.kept(recovery.watch), facts.action is Action.RESTART
    jump = JumpTo(way, written=kept, restarts=restarts, wait_s=facts.wait_s, chosen=recovery.chosen)
    return recovery.after_waits(jump)


# -- the levels above


def escalate(recovery: Recovery) -> Optional[Verdict]:
    """Have the levels above decide before a person is asked, or end where it is left to them."""
    if recovery.decided_to_ask is None:
        return None
    decider, facts = recovery.decided_to_ask
    nobody = _why_nobody_is_asked(recovery)
    levels = [] if nobody else levels_that_may_decide(recovery, decider)
    asked = (
        'the oracle above'
        if levels
        else 'nobody, since ' + nobody.text
        if nobody
        else _asked_in_words(recovery)
    )
    tell_decision(recovery, (decider, facts._replace(asked=asked)))
    jump = decided_above(recovery, levels)
    if recovery.is_over():
        return recovery.end_early()
    if jump is not None:
        recovery.recovered.append(recovery.record)
        return recovery.after_waits(jump)
    return _give_way(recovery, nobody) if nobody else None


def _why_nobody_is_asked(recovery: Recovery) -> Optional[Foreseen]:
    """Return why a person is not asked about the failure, or None where one is."""
    return _left_to_others(recovery) or unnoticed(recovery.node, recovery.failure)


def _left_to_others(recovery: Recovery, way: Optional[JumpPath] = None) -> Optional[Foreseen]:
    """Return why the end of the container is left to a level above, or None where it is not.

    :param way: the containers that it leaves alone are looked at. None: all.
    """
    node = recovery.node
    if runs_as_precondition(node):
        return Foreseen('it runs as a precondition')
    if recovery.failure.is_held_back:  # no other oracle can confirm that it is repeated
        return None
    foreseen = foreseen_above(node, recovery.ending(), way)
    return foreseen and foreseen._replace(
        text='its author goes on from there ({})'.format(foreseen.text)
    )


def _give_way(recovery: Recovery, why: Foreseen) -> Verdict:
    """End the container, and leave all else to who is above it."""
    if why.item_outcome:
        item = items_under_way(recovery.node) or 'its item'
        recovery.warn('{} is passed over with {}'.format(item, why.item_outcome))
    return recovery.give_up('{}: {}'.format(recovery.cause, why.text))


# -- the expert


def ask_expert(recovery: Recovery) -> Optional[Verdict]:
    """Ask the expert, and do as answered. None where nobody answers."""
    node = recovery.node
    expert = node.tree.expert
    if not recovery.may_ask:
        return recovery.give_up('{}: the policy asks nobody'.format(recovery.cause))
    if expert is None:
        recovery.why_no_answer = 'no expert is there to ask'
        return None
    recovery.why_no_answer = recovery.take_question()
    return None if recovery.why_no_answer else _ask(recovery, expert)


def _ask(recovery: Recovery, expert: Expert) -> Optional[Verdict]:
    node, budget = recovery.node, recovery.budget
    deadline_s, recovery.ends_budget = budget.within(node.settings.deadline_s)
    early_end = node.tree.early_end
    around = node.execution.runs_around
    with standing_still(around), early_end.asking(), budget.work_time.paused():
        answer = Inquiry(recovery, expert, deadline_s).run()
    node.records.streaks.pop(recovery.record.label, None)
    question_id = recovery.question_id
    if recovery.stopped():
        if early_end.end_at_shutdown():
            preempt_beside(node)
        if question_id:
            why = recovery.why_taken_back()
            recovery.tell(EventKind.QUERY_CANCELLED, text=why, query_id=question_id)
        return recovery.preempted()
    if answer is not None:
        return _obey(recovery, answer)
    why = '; '.join(filter(None, (recovery.why_no_answer, budget.why_over())))
    recovery.why_no_answer = why
    text = '{}; fallback: {}'.format(why, fallback_in_words(recovery))
    recovery.tell(EventKind.QUERY_EXPIRED, text=text, query_id=question_id)
    return None


def _asked_in_words(recovery: Recovery) -> str:
    node, budget = recovery.node, recovery.budget
    if node.tree.expert is None:
        return 'nobody, since there is no expert'
    spent = recovery.why_no_question()
    if spent:
        return 'nobody, since ' + spent
    limit_s, is_cut = budget.within(node.settings.deadline_s)
    if is_cut:
        return "an expert, {:.0f} s, which are the trial's last".format(limit_s)
    return 'an expert, {:g} s'.format(limit_s) if limit_s else 'an expert'


def _obey(recovery: Recovery, answer: Answer) -> Verdict:
    """Write the outputs of an answer, and go as it says."""
    node, watch = recovery.node, recovery.watch
    settle_ways(node, None)  # what helps from now on does so with the help of a person
    remapping = remapping_of(node.machine, recovery.record.label)
    for key, value in (answer.outputs or {}).items():
        watch.gate[remapping.get(key, key)] = value
    if answer.kind is AnswerKind.GOTO:
        way = jump_path_to(node, place_at(node, answer.container, answer.state))
        if way is None:  # an answer that was checked has one
            named = '{}/{}'.format(answer.container or node.path, answer.state)
            raise smach.InvalidStateError('there is no way to ' + named)
        kept, asked = way.kept(watch), recovery.asked_for(way)
        return recovery.after_waits(JumpTo(way, answer.by, answer.why, kept, asked=asked))
    if answer.kind is AnswerKind.SUPERSEDE:
        return Supersede(answer.outcome, answer.by, answer.why)
    ending = recovery.ending(answer.outcome)
    above = next((each for each in levels_above(node) if each.path == answer.container), None)
    return GiveUp(ending, answer.by, answer.why, above)


# in this order. The last one comes to a verdict in any case
PHASES: Tuple[Callable[[Recovery], Optional[Verdict]], ...] = (
    obey_given,
    wait_until_well,
    ask_first,
    decide,
    escalate,
    ask_expert,
    fall_back,
)

_Led = Tuple[Labels, Labels, Transitions, int]
_NOTHING: _Led = ((), (), {}, 0)


class OracleState(smach.State):
    """The ORACLE state of one container.

    Its outcomes are the labels of all states and all container outcomes.
    """

    def __init__(self) -> None:
        smach.State.__init__(self, outcomes=[])
        self._lock = threading.Lock()
        self._recovery: Optional[Recovery] = None
        self._verdict: Optional[Verdict] = None
        self._led: _Led = _NOTHING

    def lead_to(self, labels: Tuple[str, ...]) -> Dict[str, Optional[str]]:
        """Have these outcomes and no others, and return the transitions, each to its own name."""
        self._outcomes = set(labels)
        return {label: label for label in labels}

    def note_led(self, states: Labels, outcomes: Labels, drawn: Transitions) -> None:
        """Note the states and outcomes of the container to all of which these transitions lead."""
        self._led = states, outcomes, drawn, len(drawn)

    def leads_on(self, states: Labels, outcomes: Labels, drawn: Transitions) -> bool:
        """Whether nothing of that has changed since."""
        return drawn is self._led[2] and self._led == (states, outcomes, drawn, len(drawn))

    def begin(self, recovery: Recovery) -> None:
        """Be ready to recover from a failure.

        From now on a preempt request reaches the recovery.
        """
        with self._lock:
            self._preempt_requested = False
            self._recovery = recovery

    def execute(self, ud: smach.UserData) -> str:
        """Recover from the failure handed to `begin`.

        :returns: where the machine goes, '' where it raises. It follows the verdict itself.
        :raises TrialError: where no failure was handed over.
        """
        recovery = self._recovery
        if recovery is None:
            raise TrialError('the meta state is entered by failures alone')
        try:
            for phase in PHASES:
                verdict = phase(recovery)
                if verdict is not None:
                    self._verdict = verdict
                    return leads_to(verdict)
            raise TrialError('no phase of the recovery has come to a verdict')
        finally:
            with self._lock:
                self._recovery = None

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
            recovery = self._recovery
        if recovery is not None:
            recovery.cancel()

    def __getstate__(self) -> Dict[str, object]:
        """Leave out what belongs to a recovery: neither that nor a lock travels with a machine."""
        state = dict(self.__dict__)
        state.update(_lock=None, _recovery=None, _verdict=None, _led=_NOTHING)
        return state

    def __setstate__(self, state: Dict[str, object]) -> None:
        self.__dict__.update(state)
        self._lock = threading.Lock()
