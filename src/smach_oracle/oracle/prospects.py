"""Lists what an oracle may do in each state of a wrapped machine, before anything runs."""

from typing import Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

import smach

from .decision.failure_rate import FailureClass
from .decision.policy import Action, Past, Policy, Preconditions, Situation
from .decision.ways import WayKind
from .machine.nesting import nodes_of
from .machine.places import TreePlace, direct_levels, links_to, name_of
from .machine.site import Route, failure_kind, route_of
from .machine.tree_node import TreeNode
from .records.events import FailureKind
from .recovery.guarding import may_stop_others
from .recovery.options import Drawn, leading_to
from .settings.failing_outcomes import PREEMPTED, FailingNames
from .settings.interfaces import InterfaceOffer
from .settings.settings import ALLOW, Settings, StateSettings
from .smach_private import initial_label_of, states_of, transitions_of

Actions = Tuple[Tuple[FailureClass, Tuple[Action, ...]], ...]


class OutcomeProspect(NamedTuple):
    """One outcome of a state: where it leads, and whether the oracle takes it up."""

    outcome: str
    route: Route
    is_failure: bool
    author_recovers: bool  # from this failure. The author's own transition is kept
    may_stop_others: bool  # of its Concurrence, which is known once it fails: then it ends so


class StateProspect(NamedTuple):
    """One state. `actions`: what the policy may do on its failure, by class of its rate.

    `before`: the states that may have run before it, the nearest first. A step back may run them
    again. `not_before`: those that may have, too, but to which no step back leads: behind each of
    them is a state that is not to be repeated (`on_retry`). `kinds`: of the ways on its menu,
    nothing where the policy goes by none.
    """

    label: str
    state: smach.State
    settings: StateSettings
    outcomes: Tuple[OutcomeProspect, ...]
    actions: Actions
    offers: Tuple[InterfaceOffer, ...]
    before: Tuple[str, ...]
    kinds: Tuple[WayKind, ...]
    not_before: Tuple[str, ...]


class ContainerProspect(NamedTuple):
    """One wrapped container, as `--check` shows it. `initial` is '' where it has no state.

    `guarded`: the states at or below it that the oracle repeats by no decision of its own. A
    Concurrence or an Iterator whose plain states have oracles `has_branches`: it is no wrapped
    container, and the oracle of each state knows that state alone. `unknown_ends`: those whose
    names say neither success nor failure. Of a nested container they are those in which a failure
    ends it, and that the container around it takes for none.
    """

    path: str
    machine: smach.Container
    initial: str
    outcomes: Tuple[str, ...]
    settings: Settings
    is_top: bool
    recovers: bool
    states: Tuple[StateProspect, ...]
    guarded: Tuple[str, ...]
    has_branches: bool
    unknown_ends: Tuple[str, ...]


# -- the ways on which no guarded state (`on_retry`) is executed, as they are drawn

_Place = Tuple[TreeNode, str]


class Unguarded:
    """The ways through one tree. It looks at each state once."""

    def __init__(self, top: TreeNode) -> None:
        self._ends: Dict[_Place, FrozenSet[str]] = {}
        self._within: Dict[_Place, List[TreeNode]] = {}
        for each in nodes_of(top.machine):
            # an Iterator may have no item, and then executes nothing
            if each.parent is not None and not any(
                isinstance(link.inner_container, smach.Iterator) for link in links_to(each)
            ):
                place = each.parent, each.labels_from_parent[0]
                self._within.setdefault(place, []).append(each)

    def transitions(self, node: TreeNode) -> Drawn:
        """Return the transitions that a container may take so, by state and outcome."""
        drawn = transitions_of(node.machine)
        return {
            label: {
                outcome: target
                for outcome, target in drawn.get(label, {}).items()
                if outcome in self.ends(node, label)
            }
            for label in node.labels()
        }

    def ends(self, node: TreeNode, label: str) -> FrozenSet[str]:
        """Return the outcomes with which a state may end so."""
        place = node, label
        if place not in self._ends:
            self._ends[place] = frozenset(self._ends_of(node, label))
        return self._ends[place]

    def _ends_of(self, node: TreeNode, label: str) -> Set[str]:
        if node.settings_of(label).on_retry != ALLOW:
            return set()
        state = states_of(node.machine)[label]
        found = set(state.get_registered_outcomes())
        for each in self._within.get((node, label), ()):
            ends = set(self._ends_within(each))
            if isinstance(state, smach.StateMachine):
                return ends
            if not ends:  # all branches of a Concurrence run
                return set()
        return found

    def _ends_within(self, node: TreeNode) -> Iterator[str]:
        """Yield the outcomes with which a container may end so, or the branch of a Concurrence."""
        if not node.site.is_container:
            for label in node.labels():
                yield from self.ends(node, label)
            return
        met = [initial_label_of(node.machine)]
        for label in met:
            for outcome in self.ends(node, label):
                route = route_of(node.machine, label, outcome)
                if not route.is_state:
                    yield route.target
                elif route.target not in met:
                    met.append(route.target)


# -- what is told


def prospects_of(machine: smach.StateMachine) -> List[ContainerProspect]:
    """Return what the oracle may do in a wrapped machine, and in those nested in it."""
    nodes = nodes_of(machine)
    decides = nodes[0].settings.budget.recoveries != 0  # the budget is that of the top
    unguarded = Unguarded(nodes[0])
    found: List[ContainerProspect] = []
    for node in nodes:
        prospect = _container(node, decides, unguarded)
        if found and found[-1].machine is prospect.machine:  # branches of one container
            prospect = _joined(found.pop(), prospect)
        found.append(prospect)
    return found


def _joined(one: ContainerProspect, other: ContainerProspect) -> ContainerProspect:
    """Return the branches of one container as one."""
    return one._replace(
        initial='{}, {}'.format(one.initial, other.initial),
        states=one.states + other.states,
        guarded=one.guarded + other.guarded,
    )


def good_outcome(container: smach.Container, settings: Settings) -> Optional[str]:
    """Return an outcome of a container that is no failure, the first by name, or None if none is.

    `succeeded` comes before all others, a preempt after them.
    """
    failing = FailingNames(settings.failing_outcomes)
    names = sorted(
        (name for name in container.get_registered_outcomes() if name not in failing),
        key=lambda name: (name != 'succeeded', name == PREEMPTED, str(name)),
    )
    return names[0] if names else None


def _container(node: TreeNode, decides: bool, unguarded: Unguarded) -> ContainerProspect:
    shown = node.site.shown()
    states = tuple(_state(node, label, decides, unguarded) for label in node.labels())
    return ContainerProspect(
        node.path,
        shown,
        initial_label_of(node.machine),
        tuple(sorted(shown.get_registered_outcomes(), key=str)),
        node.settings,
        node.parent is None,
        node.tree.recover,
        states,
        tuple(_guarded(node)),
        not node.site.is_container,
        _unknown_ends(node, states),
    )


def _unknown_ends(node: TreeNode, states: Sequence[StateProspect]) -> Tuple[str, ...]:
    """Return the ends whose meaning is not known, of a nested container where that matters."""
    if not node.site.is_container:
        return ()
    unknown = node.in_force.rule.unknown(node.site.shown().get_registered_outcomes())
    if node.parent is None:
        return unknown
    if len(node.labels_from_parent) > 1:
        return ()  # it lies in a Concurrence or an Iterator, whose author says what its ends mean
    around, label = node.parent, node.labels_from_parent[0]
    settings = around.settings_of(label)
    return tuple(
        end
        for end in unknown
        if any(
            each.is_failure and each.route == Route(end, False)
            for state in states
            for each in state.outcomes
        )
        and not _outcome(around, label, end, settings).is_failure
    )


def _guarded(node: TreeNode) -> Iterator[str]:
    for each in nodes_of(node.machine):
        below = each.path[len(node.path) + 1 :]
        for label in each.labels():
            if each.settings_of(label).on_retry != ALLOW:
                yield '/'.join((below, label)) if below else label


def _state(node: TreeNode, label: str, decides: bool, unguarded: Unguarded) -> StateProspect:
    state, settings = states_of(node.machine)[label], node.settings_of(label)
    before = dict(_before(node, label, unguarded))
    allowed = tuple(name for name, is_allowed in before.items() if is_allowed)
    return StateProspect(
        label,
        state,
        settings,
        tuple(
            _outcome(node, label, outcome, settings)
            for outcome in sorted(state.get_registered_outcomes(), key=str)
        ),
        tuple(_actions(node.in_force.policy, settings, decides)),
        node.settings.offers_for(node.relative_path, label),
        allowed,
        tuple(_kinds(node, settings, allowed)),
        tuple(name for name, is_allowed in before.items() if not is_allowed),
    )


def _before(node: TreeNode, label: str, unguarded: Unguarded) -> Iterator[Tuple[str, bool]]:
    """Yield the states from which the author's transitions lead to a state, the nearest first.

    Those of the containers around it come last, where a step back may go there. With each comes
    whether they may do so without a state that is not to be repeated.
    """
    crosses = node.in_force.policy.goes_by_ways or node.settings.step_back_across
    is_allowed = True
    for level in direct_levels(node, at_rest=True) if crosses else (node,):
        is_allowed = is_allowed and level.settings_of(label).on_retry == ALLOW
        drawn = unguarded.transitions(level) if is_allowed else {}
        allowed = leading_to(level, (label,), drawn=drawn)
        for each in leading_to(level, (label,)):
            yield name_of(TreePlace(level, each), node), each in allowed
        is_allowed = is_allowed and initial_label_of(level.machine) in (label, *allowed)
        label = next(iter(level.labels_from_parent), '')  # of the state around, on the next level


def _kinds(node: TreeNode, settings: StateSettings, before: Sequence[str]) -> Iterator[WayKind]:
    """Yield the kinds of ways that may be on the menu of a state."""
    if not node.in_force.policy.goes_by_ways:
        return
    yield WayKind.AGAIN
    yield WayKind.WAIT
    if settings.preconditions:
        yield WayKind.PREPARE
    if before:
        yield WayKind.STEP_BACK
    levels = direct_levels(node, at_rest=True)
    for kind, level in ((WayKind.START, node), (WayKind.TOP, levels[-1])):
        start = name_of(TreePlace(level, initial_label_of(level.machine)), node)
        if start in before and (kind is WayKind.START or len(levels) > 1):
            yield kind


def _outcome(node: TreeNode, label: str, outcome: str, settings: StateSettings) -> OutcomeProspect:
    route = route_of(node.machine, label, outcome)
    kind = failure_kind(outcome, route, settings, node.in_force.failing)
    fails = kind is not FailureKind.NOT_A_FAILURE
    return OutcomeProspect(
        outcome,
        node.site.shown_route(route, outcome),
        fails,
        fails and node.site.foresees(outcome, route, kind, settings),
        fails and not route.is_state and may_stop_others(node, settings),
    )


def _actions(
    policy: Policy, settings: StateSettings, decides: bool
) -> Iterator[Tuple[FailureClass, Tuple[Action, ...]]]:
    """Yield each class of the failure rate with what the policy may do in it, mildest first.

    `decides`: whether the budget of the trial lets the oracle go anywhere by itself.
    """
    only_asks = not (decides and settings.max_recoveries and settings.on_retry == ALLOW)
    for failure_class in (FailureClass.LOW, FailureClass.MODERATE, FailureClass.HIGH):
        possible: Dict[Action, None] = {}
        for situation in _situations(policy, failure_class, bool(settings.preconditions)):
            for recoveries in range(settings.max_recoveries + 1):
                past = Past(recoveries, recoveries)
                possible.update(dict.fromkeys(policy.may_do(situation._replace(past=past))))
        if only_asks:
            possible = {Action.ASK if policy.asks else Action.GIVE_UP: None}
        yield failure_class, tuple(action for action in Action if action in possible)


def _situations(
    policy: Policy, failure_class: FailureClass, conditioned: bool
) -> Iterator[Situation]:
    standing: Tuple[Preconditions, ...] = (Preconditions.NONE,)
    if conditioned:
        runs = policy.runs_preconditions(failure_class)
        standing = (Preconditions.MET, Preconditions.NOT_MET) if runs else (Preconditions.NOT_MET,)
    for preconditions in standing:
        for continuous in (False, True):
            yield Situation(failure_class, preconditions, continuous)
