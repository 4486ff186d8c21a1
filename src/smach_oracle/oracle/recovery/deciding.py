"""Decides about a failure of a state, for the oracle of one level (paper, Algorithm 1)."""

from typing import Optional, Sequence, Tuple, cast

from ..decision.by_ways import action_of
from ..decision.failure_rate import FailureClass
from ..decision.policy import Action, Menu, Past, Preconditions, Situation
from ..decision.sentence import goes
from ..decision.ways import Evidence, StreakSoFar, WayKind
from ..machine.nesting import records_of
from ..machine.places import JumpPath, TreePlace, jump_path_to, levels_above, place_named
from ..records.events import EventKind
from ..records.facts import Decider
from ..records.streaks import OpenStreak
from ..records.way_results import counts_of_kinds
from ..settings.preconditions import PreconditionSpec
from ..settings.settings import ALLOW
from ..smach_private import initial_label_of
from .options import (
    OpenWay,
    WhyNotAbove,
    function_that_runs,
    named,
    option_on,
    visited_on,
    ways_on,
    why_closed,
    why_repeats,
)
from .preconditions import why_not_met
from .recovery import Decided, Recovery
from .verdict import streak_of


def decide_on_level(recovery: Recovery, why_not_above: WhyNotAbove) -> Decided:
    """Run the preconditions that the policy wants, and say what it does.

    `recovery.jump_path` is the way to the place where it goes then, None where it goes nowhere.
    """
    decider, facts = _ask_at_once(recovery) or _follow_policy(recovery, why_not_above)
    if facts.action is Action.ASK and not recovery.may_ask:
        return decider, facts._replace(action=Action.GIVE_UP)
    return decider, facts


def _ask_at_once(recovery: Recovery) -> Optional[Decided]:
    """Return the decision where no policy has a say, and no precondition is run."""
    record, settings, ask = recovery.record, recovery.record.settings, Action.ASK
    if recovery.failure.is_held_back:
        return Decider.HELD_BACK, recovery.facts(ask)
    if record.recoveries >= settings.max_recoveries:
        return Decider.MAX_RECOVERIES, recovery.facts(ask, spent=record.recoveries)
    spent = recovery.budget.why_no_recovery()
    if spent:
        return Decider.BUDGET, recovery.facts(ask, blocked=spent)
    if settings.on_retry != ALLOW:
        here = JumpPath((), recovery.node, (TreePlace(recovery.node, record.label),))
        return Decider.ON_RETRY, recovery.facts(
            ask, blocked=why_repeats(recovery, option_on(recovery, here))
        )
    return None


def _follow_policy(recovery: Recovery, why_not_above: WhyNotAbove) -> Decided:
    node, record, policy = recovery.node, recovery.record, recovery.node.in_force.policy
    reading = recovery.reading = recovery.reading or record.read_rate()
    drawn = '{}/{} {}'.format(node.path, record.label, record.visits) if policy.draws else ''
    situation = Situation(
        reading.failure_class,
        _run_preconditions(recovery, reading.failure_class),
        recovery.occasion.continuous,
        Past(record.recoveries, node.tree.restarts.count, drawn, node.tree.trials - 1),
    )
    if policy.goes_by_ways:
        return _choose(recovery, situation, why_not_above)
    action = policy.decide(situation)
    if action in (Action.ASK, Action.GIVE_UP):
        return Decider.POLICY, recovery.facts(action, blocked=policy.why(situation))
    name, place = _place_of(recovery, action)
    way = jump_path_to(node, place) if place is not None else None
    if way is None:
        blocked = 'there is no state {!r} to go back to'.format(name)
        return Decider.POLICY, recovery.facts(Action.ASK, blocked=blocked)
    foreseen = why_not_above(None) if action is Action.RESTART else None
    decider, why_not = (
        (Decider.AUTHOR, foreseen.text) if foreseen else _what_prevents(recovery, way)
    )
    if why_not:
        return decider, recovery.facts(Action.ASK, blocked=why_not)
    recovery.jump_path = way
    facts = recovery.facts(action, target=named(recovery, way), wait_s=policy.wait_s(situation))
    record.note_tried(goes(facts), reading.successes)
    return decider, facts


def _choose(recovery: Recovery, situation: Situation, why_not_above: WhyNotAbove) -> Decided:
    """Go the first way of the policy's order, or ask where none is left."""
    record, policy, budget = recovery.record, recovery.node.in_force.policy, recovery.budget
    streak = _streak(recovery)
    chosen = _first_way(recovery, situation, ways_on(recovery, why_not_above), streak)
    if chosen is None:
        why = policy.why(cast('Situation', recovery.situation))
        return Decider.POLICY, recovery.facts(Action.ASK, blocked=why)
    spent = recovery.take_recovery(policy.most_of_trial)
    if spent:  # by others meanwhile
        recovery.choice = None
        decider = Decider.BUDGET if budget.why_no_recovery() else Decider.POLICY
        return decider, recovery.facts(Action.ASK, blocked=spent)
    recovery.jump_path = chosen.option.jump_path
    streak.leaves = bool(chosen.option.jump_path.left_containers)
    facts = recovery.facts(
        action_of((chosen.way,)),
        target=named(recovery, chosen.option.jump_path),
        wait_s=chosen.way.wait_s,
    )
    record.note_tried(goes(facts), streak.successes)
    return Decider.POLICY, facts


def _streak(recovery: Recovery) -> OpenStreak:
    """Return the streak of the failed state, which begins with this failure if none goes on."""
    node, record = recovery.node, recovery.record
    streak = streak_of(node, record)
    if streak is None:
        now_s = recovery.budget.work_time.now()
        streak = OpenStreak(record.totals[0], now_s, visited_on(recovery))
        node.records.streaks[record.label] = streak
    return streak


def _first_way(
    recovery: Recovery, situation: Situation, ways: Sequence[OpenWay], streak: OpenStreak
) -> Optional[OpenWay]:
    """Return the first way of the policy's order whose preconditions, where it has any, are met.

    None means that no way is left, or that the recovery is stopped.
    """
    while True:
        recovery.situation = _with_menu(recovery, situation, ways, streak)
        choice = recovery.node.in_force.policy.choose(recovery.situation)
        if choice.remark:
            recovery.node.warn_once('ways', choice.remark, recovery.record.label)
        if not choice.ways:
            return None
        chosen = next(each for each in ways if each.way == choice.ways[0])
        if chosen.way.kind is not WayKind.PREPARE or _are_brought_about(recovery):
            recovery.choice = choice
            return chosen
        if recovery.stopped():
            return None
        why = recovery.not_met + ' did not help'
        ways = [each.blocked_by(why) if each is chosen else each for each in ways]


def _with_menu(
    recovery: Recovery, situation: Situation, ways: Sequence[OpenWay], streak: OpenStreak
) -> Situation:
    node, budget = recovery.node, recovery.budget
    so_far = StreakSoFar()
    if recovery.failure.is_counted:  # else it has not failed, and is entered again after a crash
        so_far = streak.so_far(budget.work_time.now())
    has_expert = node.tree.expert is not None and not budget.why_no_question()
    past = situation.past._replace(attempts=budget.recoveries, usual_minutes=budget.usual_minutes)
    evidence = Evidence()
    if node.in_force.policy.learns:
        of_kinds = counts_of_kinds(each.ways_of_kinds() for each in records_of(node))
        evidence = Evidence(recovery.record.ways_so_far(), recovery.failure_key, of_kinds)
    menu = Menu(tuple(each.way for each in ways), so_far, node.settings.cost, has_expert, evidence)
    return situation._replace(past=past, menu=menu)


def _place_of(recovery: Recovery, action: Action) -> Tuple[str, Optional[TreePlace]]:
    """Return where a decision leads, by name and as a place.

    None means there is no such state.
    """
    node = recovery.node
    if action is Action.RESTART:
        top = [node, *levels_above(node)][-1]
        label = initial_label_of(top.machine)
        return label, TreePlace(top, label)
    name = recovery.record.label
    if action is not Action.REVISIT:
        name = node.in_force.policy.step_back_target(recovery.occasion.context)
    return name, place_named(node, name)


def _what_prevents(recovery: Recovery, way: JumpPath) -> Tuple[Decider, str]:
    """Set a recovery aside for going to a place, or return what prevents it, and why."""
    option = option_on(recovery, way)
    reason = why_repeats(recovery, option)
    if reason:
        return Decider.ON_RETRY, reason
    reason = why_closed(recovery, option) or function_that_runs(recovery)
    if reason:
        return Decider.POLICY, reason
    spent = recovery.take_recovery()
    return (Decider.BUDGET, spent) if spent else (Decider.POLICY, '')


# -- preconditions


def _run_preconditions(recovery: Recovery, failure_class: FailureClass) -> Preconditions:
    record, policy = recovery.record, recovery.node.in_force.policy
    specs = record.settings.preconditions
    if not specs:
        return Preconditions.NONE
    if not policy.runs_preconditions(failure_class):
        return Preconditions.NOT_MET
    return Preconditions.MET if _are_brought_about(recovery) else Preconditions.NOT_MET


def _are_brought_about(recovery: Recovery) -> bool:
    """Run the preconditions up to one that cannot be met. Return whether there is none."""
    specs = recovery.record.settings.preconditions
    return all(not recovery.stopped() and _run_precondition(recovery, spec) for spec in specs)


def _run_precondition(recovery: Recovery, spec: PreconditionSpec) -> bool:
    name = spec.name
    recovery.tell(EventKind.PRECONDITION_START, target=name)
    why_not = why_not_met(recovery, spec)
    for _ in range(recovery.record.most_repeats):
        waits = recovery.origin.has_waited_after
        if not why_not or not waits('did not get its precondition ' + name):
            break
        why_not = why_not_met(recovery, spec)
    outcome = 'not met' if why_not else 'met'
    recovery.tell(EventKind.PRECONDITION_END, outcome=outcome, target=name, text=why_not)
    if why_not:
        recovery.not_met = name
    else:
        recovery.met.append(name)
    told = '{} ({})'.format(outcome, why_not) if why_not else outcome
    recovery.tried.append('precondition {}: {}'.format(name, told))
    return not why_not
