"""The levels above a failed state: what its author foresaw there, and what their oracles decide."""

from functools import partial
from typing import Dict, List, Optional

import smach

from ..decision.failure_rate import FailureClass
from ..decision.policy import Action
from ..decision.sentence import cause_of, decision_sentence
from ..decision.ways import ChosenOrder
from ..machine.places import (
    JumpPath,
    TreePlace,
    direct_levels,
    failure_context,
    jump_path_to,
    levels_above,
    links_to,
)
from ..machine.site import author_recovers, goes_unnoticed, judged_at, leads_to_next_item
from ..machine.tree_node import TreeNode
from ..records.events import EventKind, FailureKind
from ..records.facts import DECIDED_BY, Decider
from ..smach_private import (
    current_label_of,
    is_executing,
    states_of,
)
from .deciding import decide_on_level
from .failure import Failure, tell_failure
from .occasions import failed
from .recovery import Decided, Recovery
from .verdict import ContainerEnding, Foreseen, JumpTo, natural_ending


def _is_item_passed_over(node: TreeNode, above: TreeNode, outcome: str) -> bool:
    """Whether an Iterator around a container goes on after it has ended with an outcome."""
    if not node.site.is_container:
        return False
    labels, path = node.labels_from_parent, above.relative_path
    around = [*links_to(node)][-1].outer_container
    settings = above.in_force.of_state('/'.join(filter(None, (path, *labels[:-1]))), labels[-1])
    # what only the settings call a failure its author has not foreseen
    return (
        leads_to_next_item(around, outcome)
        and settings.author_recoveries != 'override'
        and outcome in node.in_force.failing
    )


def foreseen_above(
    node: TreeNode, ending: ContainerEnding, way: Optional[JumpPath]
) -> Optional[Foreseen]:
    """Return what the author has drawn after the end of a container, None where that is nothing.

    It may be one of any level above: a failing outcome falls through from one to the next. Where a
    Concurrence lies between, nobody knows before it has ended.

    :param way: the ends of the containers that it leaves alone count. None: of all.
    """
    outcome, below = ending.outcome, None if way is None else way.meeting_node
    while outcome is not None and node.parent is not None and node is not below:
        above = node.parent
        if above is not next(levels_above(node), None):
            return None
        if node.runs_in_branch:
            return (
                Foreseen('{} {} -> the next item'.format(node.path, outcome), outcome)
                if _is_item_passed_over(node, above, outcome)
                else None
            )
        label = node.labels_from_parent[0]
        route, kind = judged_at(above, label, outcome)
        if kind is FailureKind.NOT_A_FAILURE or not route.leads_on:
            return None
        if author_recovers(outcome, route, kind, above.settings_of(label)):
            path = '/'.join((above.path, label))
            return Foreseen('{} {} -> {}'.format(path, outcome, route.target))
        if route.is_state:  # `author_recoveries: override`
            return None
        node, outcome = above, route.target
    return None


def unnoticed(node: TreeNode, failure: Failure) -> Optional[Foreseen]:
    """Return that a failure is one only as its container has no failing outcome, None otherwise.

    Nobody is asked about it, and a level above is free to recover from what it leads to.
    """
    route, settings = failure.route, node.settings_of(failure.state)
    if (
        route is None
        or not author_recovers(failure.outcome, route, failure.kind, settings)
        or not goes_unnoticed(node, route)
    ):
        return None
    return Foreseen('its author ends {} with {} there'.format(node.path, route.target))


def _failure_above(
    above: TreeNode, label: str, ending: ContainerEnding, text: str
) -> Optional[Failure]:
    """Return the failure that the end of a container is on the level above, else None.

    :param label: of the state there that holds the container.
    """
    if ending.error is not None:
        error = ending.error
        return Failure(label, FailureKind.EXCEPTION, '', text, None, lambda: error)
    if ending.outcome is None:
        return None
    route, kind = judged_at(above, label, ending.outcome)
    if kind is FailureKind.NOT_A_FAILURE:
        return None
    return Failure(label, kind, ending.outcome, text, route)


def runs_as_precondition(node: TreeNode) -> bool:
    """Whether a container is executed as a precondition, while a level above recovers."""
    for child, above in zip((node, *levels_above(node)), node.around()):
        state = states_of(above.machine).get(child.labels_from_parent[0])
        if above.tree.is_precondition(above, state):
            return True
        if is_executing(above.machine) and above.is_oracle(current_label_of(above.machine)):
            return True
    return False


def levels_that_may_decide(recovery: Recovery, decider: Decider) -> List[TreeNode]:
    """Return the levels above to which `escalate` hands a failure, innermost first.

    None where the failure is to be asked about at once.
    """
    found: List[TreeNode] = []
    goes_by_ways = recovery.node.in_force.policy.goes_by_ways
    is_high = recovery.record.failure_class is FailureClass.HIGH
    if decider is not Decider.POLICY or (is_high and not goes_by_ways):
        return found
    levels = direct_levels(recovery.node)
    for child, above in zip(levels, levels[1:]):
        if not child.settings.escalate:
            break
        found.append(above)
    return found


def decided_above(recovery: Recovery, levels: List[TreeNode]) -> Optional[JumpTo]:
    """Return what the innermost level decides that does not ask, or None where all ask."""
    below, ending = recovery.node, recovery.ending()
    for level in levels:
        failure = _failure_above(
            level, below.labels_from_parent[0], ending, '{}: {}'.format(below.path, recovery.cause)
        )
        if failure is None or recovery.is_over():
            return None
        decision = _decide_above(recovery, level, failure)
        if decision is not None:
            return decision
        below = level
        ending = natural_ending(level, failure)
    return None


def _decide_above(recovery: Recovery, level: TreeNode, failure: Failure) -> Optional[JumpTo]:
    """Have a level above decide about its own state, as if that had failed.

    That is a failure of the state only where the oracle does not ask.

    :param failure: the end of the level below, as it would be judged here.
    :returns: the jump. None where this level asks too, or has been left meanwhile.
    """
    record, below = level.record(failure.state), recovery.node
    if jump_path_to(below, TreePlace(level, record.label)) is None:
        return None
    context = failure_context(level, record)
    continuous = level.in_force.policy.is_continuous(context)
    above = Recovery(level, record, failed(failure, context, continuous), recovery)
    above.reading = record.read_rate(and_failure=True)
    decided = decide_on_level(above, partial(foreseen_above, level, natural_ending(level, failure)))
    facts = decided[1]
    above.cause = cause_of(facts)
    recovery.tried += ['{}: {}'.format(level.path, each) for each in above.tried]
    way = jump_path_to(below, above.jump_path.place) if above.jump_path is not None else None
    if recovery.is_over():  # by a preempt while its preconditions ran
        return None
    if above.jump_path is None or way is None:
        recovery.settle(None)
        recovery.tried.append('{}: {}: asks too'.format(level.path, above.cause))
        return None
    level.records.note_failure(record)
    tell_failure(level, record, failure, continuous)
    record.learn(True)
    sentence = tell_decision(above, decided)
    recovery.recovered.append(record)
    kept, restarts = above.jump_path.kept(above.watch), facts.action is Action.RESTART
    return JumpTo(way, '', sentence, kept, level, restarts, facts.wait_s, above.chosen)


def tell_decision(recovery: Recovery, decided: Decided) -> str:
    """Log what the oracle of a level has decided, and tell the observers. Return the sentence."""
    node, (decider, facts) = recovery.node, decided
    sentence = decision_sentence(facts, recovery.cause)
    smach.loginfo('{}/{}'.format(node.path, sentence))
    if node.events.observers:
        node.emit_rated(
            EventKind.DECISION,
            recovery.record,
            outcome=facts.action.value,
            target=facts.target,
            continuous=recovery.occasion.continuous,
            text=sentence,
            data={DECIDED_BY: decider.value, **_menu_facts(recovery)},
        )
    return sentence


def _menu_facts(recovery: Recovery) -> Dict[str, object]:
    """Return what is recorded of a menu, and of the order in which the policy would go its ways."""
    situation = recovery.situation
    if situation is None:
        return {}
    menu, past, choice = situation.menu, situation.past, recovery.choice or ChosenOrder(())
    return {
        'order': [way.key for way in choice.ways],
        'chance': choice.chance,
        **({} if choice.hoped is None else {'hoped': choice.hoped}),
        'menu': [way._asdict() for way in menu.ways],
        'streak': menu.streak._asdict(),
        'has_expert': menu.has_expert,
        'attempts': past.attempts,
        'usual_minutes': past.usual_minutes,
    }
