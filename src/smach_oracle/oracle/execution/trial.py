"""Trials: one execution of the top machine is one trial.

Also what one execution of any container begins and ends.
"""

import time
from contextlib import ExitStack, nullcontext
from functools import lru_cache
from typing import Callable, ContextManager, Dict, Iterable, List, Optional, Tuple

import smach
from smach_oracle.forking import in_child

from ..checkpoint.resuming import tell_resumed
from ..checkpoint.trial_store import TrialStore, open_store
from ..machine.execution import Execution, ends_program, why_no_outcome
from ..machine.nesting import nodes_of, settle_ways
from ..machine.oracle import load_rates, save_rates
from ..machine.repeats import begin_watching
from ..machine.tree_node import TreeNode
from ..machine.workers import recall_preempts
from ..records.events import EventKind, in_event
from ..records.facts import CAN_GO_ON, ENDED_BY, INPUTS, ORIGIN, TrialEnd
from ..records.rates_file import learned_by
from ..records.running_goals import GOALS, RunningGoals
from ..recovery.verdict import outcome_of_early_end
from ..settings.failure_rule import RULE, FailureRule
from ..smach_private import initial_label_of, is_executing, states_of
from ..under_way import under_way
from .origin import inputs_of, origin_of
from .wrapping import adopt, bring_up_to_date

_running: List[TreeNode] = []  # top nodes of the trials of this process


class ContainerRun(Execution):
    """One execution of a container by its engine: a trial where no container above it runs.

    It is no function around the engine's `execute`, for containers that lie in each other take its
    frames many times.

    `outcome`, `error`: with which it ends.
    """

    outcome: Optional[str] = None
    error: Optional[BaseException] = None
    _around: ContextManager[object] = nullcontext()
    _is_executed = _is_trial = False
    _store: Optional[TrialStore] = None

    def begins(self, new_trial_id: Callable[[], str]) -> bool:
        """Begin. Return whether the engine is to execute the machine."""
        node = self._node
        is_top = not node.has_running_ancestor()
        if is_top:
            around = self._around = ExitStack()
            around.enter_context(under_way(node.machine))
            if node.parent is not None:
                around.enter_context(node.tree.around_nested_trial(node.machine))
            node.tree.early_end.begin_trial(is_stored=False)  # the one before may have ended early
        if not self.look_around():
            smach.logwarn('{}: does not begin, as {}'.format(node.path, node.why_left_behind()))
            return False
        if is_top:
            self._begin_trial(new_trial_id)
        elif node.tree.is_resumed:
            self.outcome = node.tree.resumed.take_outcome(node.records)
            if self.outcome is not None:
                return False
        self._is_executed = True
        self.begin()
        return True

    def _begin_trial(self, new_trial_id: Callable[[], str]) -> None:
        node = self._node
        nodes = adopt(node.machine)
        for each in nodes:
            bring_up_to_date(each)
        load_rates(node)
        if node.tree.recover:
            node.tree.health.use(node.settings.healthy, node.settings.health_settle_s)
        store = self._store = open_store(node)
        resumed = None if store is None else store.to_resume()
        node.tree.early_end.begin_trial(is_stored=store is not None)
        node.tree.begin_trial(new_trial_id() if resumed is None else resumed.trial.trial_id)
        for each in nodes:
            # one that still runs was abandoned in an earlier trial, and is left there
            if not is_executing(each.machine):
                each.begin_trial(node.tree.trial_id)
        begin_watching(node.tree, nodes)
        node.tree.restarts.begin_trial(
            node.tree.recover and any(each.in_force.policy.restarts for each in nodes)
        )
        node.tree.budget.begin(node.settings.budget)
        if store is not None:
            store.begin_trial(resumed)
        if resumed is None:
            first, data = EventKind.TRIAL_START, _beginning(node)
        else:
            first, data = EventKind.RESUMED, tell_resumed(node, resumed)
        self._is_trial = True  # from its first event on it has a last one, too
        _running.append(node)
        node.events.emit_first(first, node.path, data=data)
        tell_unknown_ends(node.path, node.machine.get_registered_outcomes(), node.in_force.rule)
        node.tree.control.begin_trial()

    def is_over(self) -> None:
        """End, with what is noted."""
        node, error, self.error = self._node, self.error, None  # which refers to the caller's frame
        try:
            if self._is_executed:
                self.end(self.outcome, error)
        finally:
            if self._is_trial:
                with self._around:
                    _running.remove(node)
                    if not node.tree.is_parents():
                        self._end_trial(error)
            elif self.outcome is None:
                with self._around:  # it may not have come as far as its trial
                    self.outcome = outcome_of_early_end(node)
                    if self._store is not None:
                        self._store.let_go()

    def _end_trial(self, error: Optional[BaseException]) -> None:
        node, outcome, store = self._node, self.outcome, self._store
        node.tree.control.end_trial()
        node.tree.workers.end_idle_threads()
        node.tree.alarms.rest()
        why = self._why_over(error)
        if why is TrialEnd.OUTCOME:
            node.tree.budget.end()
        if why is TrialEnd.KEPT:
            node.machine.service_preempt()
            for state in states_of(node.machine).values():
                recall_preempts(state)
        if node.tree.budget.is_spent_from:  # else it has gone no way
            is_lost = why is TrialEnd.ERROR or (
                why is TrialEnd.OUTCOME and outcome in node.in_force.failing
            )
            settle_ways(node, False if is_lost and not node.execution.was_preempted else None)
        goes_on = {CAN_GO_ON: True} if store is not None and store.can_go_on(why) else {}
        with_rates = bool(node.settings.rates_file)
        learned = {'learned': learned_by(nodes_of(node.machine))} if with_rates else {}
        node.emit(
            EventKind.TRIAL_END,
            outcome=in_event(outcome),
            text=why_no_outcome(outcome, error),
            data={ENDED_BY: why.value, **goes_on, **learned},
        )
        save_rates(node)
        if store is not None:
            store.end(why, in_event(outcome), time.time())

    def _why_over(self, error: Optional[BaseException]) -> TrialEnd:
        node = self._node
        if ends_program(error):
            return TrialEnd.STOPPED
        if node.tree.early_end.why is not None:
            return node.tree.early_end.why
        if error is not None:
            return TrialEnd.ERROR
        if self.outcome is not None:
            return TrialEnd.OUTCOME
        if node.engine.stepped or smach.is_shutdown():  # it may come before the first state
            return TrialEnd.SHUTDOWN
        return TrialEnd.INCONSISTENT


def _beginning(node: TreeNode) -> Dict[str, object]:
    """Return what the TRIAL_START of a machine has."""
    return {
        'initial': [initial_label_of(node.machine)],
        'recovers': node.tree.recover,
        'settings': _settings(node),
        RULE: node.in_force.rule.as_data(),
        ORIGIN: origin_of(node.settings),
        INPUTS: inputs_of(node.machine.userdata),
    }


def _settings(node: TreeNode) -> Dict[str, object]:
    """Return the settings by which the top oracle decides, without those of single states."""
    settings, defaults = node.settings, node.settings.defaults
    told = ('memory', 'estimator', 'prior', 'moderate_from', 'high_from', 'max_recoveries')
    costs = settings.cost._asdict() if node.in_force.policy.goes_by_ways else {}
    return {
        'policy': settings.policy,
        **{'policy.' + name: value for name, value in sorted(settings.policy_parameters.items())},
        **{'cost.' + name: value for name, value in costs.items()},
        **{name: getattr(defaults, name) for name in told},
    }


def _leave_to_parent() -> None:
    """Have no part in the trials that ran when this process was forked.

    Where the state that has forked returns in the child too, its machine goes on there and tells
    nobody.
    """
    for top in _running:
        tree = top.tree.silent_twin()
        for node in nodes_of(top.machine):
            node.join(tree)
            for record in list(node.records.by_label.values()):
                record.begin_in_child()
    GOALS.__dict__.update(RunningGoals().__dict__)


in_child(_leave_to_parent)


UNKNOWN_ENDS = (
    '{}: nothing says whether an end in {} is a success or a failure. Statistics count it as '
    '"other end". To settle it, list all failing ends in failing_outcomes, or choose a name that '
    'says it, such as {}_succeeded'
)


def tell_unknown_ends(name: str, ends: Iterable[object], rule: FailureRule) -> None:
    """Name the ends of a top machine whose meaning is not known, once in a process."""
    unknown = rule.unknown(ends)
    if unknown:
        _tell_once(name, unknown)


@lru_cache(maxsize=1000)  # a program may make up machines without end
def _tell_once(name: str, unknown: Tuple[str, ...]) -> None:
    smach.loginfo(UNKNOWN_ENDS.format(name, ' or '.join(unknown), unknown[0]))
