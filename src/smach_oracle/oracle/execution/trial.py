"""Trials: one execution of the top machine is one trial.

Also what one execution of any container begins and ends.
"""

import functools
import time
from typing import Any, Callable, Dict, List, Optional, Tuple

import smach
from smach_oracle.forking import in_child

from ..checkpoint.resuming import Resumption, tell_resumed
from ..checkpoint.trial_store import TrialStore, open_store
from ..machine.execution import Execution, ends_program, why_no_outcome
from ..machine.learned_rates import save_rates
from ..machine.nesting import nodes_of
from ..machine.repeats import begin_watching
from ..machine.tree_node import TreeNode, WrappedMachine
from ..machine.workers import recall_preempts
from ..records.events import EventKind
from ..records.facts import ENDED_BY, TrialEnd
from ..records.rates_file import learned_by
from ..records.running_goals import GOALS, RunningGoals
from ..recovery.failure import outcome_of_early_end
from .starting_over import may_start_over
from .wrapping import adopt, bring_up_to_date

_running: List[TreeNode] = []  # top nodes of the trials of this process


def run_container(
    machine: WrappedMachine,
    execute: Callable[..., Optional[str]],
    args: Tuple[Any, ...],
    kwargs: Dict[str, Any],
) -> Optional[str]:
    """Execute a container. Where no container above it runs, this is a trial.

    Containers that lie in each other take the frames of this function many times on the stack.

    :param execute: the engine's own. It gets `args` and `kwargs`.
    """
    node = machine._oracle
    is_top = not node.has_running_ancestor()
    if is_top:
        node.tree.early_end.begin_trial(is_stored=False)  # the one before may have ended early
    run = Execution(node)
    if not run.look_around():
        smach.logwarn('{}: does not begin, as {}'.format(node.path, node.why_left_behind()))
        return outcome_of_early_end(node, None)
    if is_top:
        return _begin_trial(machine, run, functools.partial(execute, *args, **kwargs))
    outcome = node.tree.resumed.take_outcome(node)
    if outcome is None:
        with run:
            outcome = run.outcome = execute(*args, **kwargs)
    return outcome_of_early_end(node, outcome)


def _begin_trial(
    machine: WrappedMachine, run: Execution, execute: Callable[[], Optional[str]]
) -> Optional[str]:
    node = machine._oracle
    adopt(machine)
    for each in nodes_of(machine):
        bring_up_to_date(each)
    if node.tree.recover:
        node.tree.health.use(node.settings.healthy, node.settings.health_settle_s)
    store = open_store(node)
    resumed = None if store is None else store.to_resume()
    node.tree.early_end.begin_trial(is_stored=store is not None)
    node.tree.begin_trial(machine.new_trial_id() if resumed is None else resumed.trial.trial_id)
    for each in nodes_of(machine):
        # one that still runs was abandoned in an earlier trial, and is left there
        if not each.machine.is_running():
            each.begin_trial(node.tree.trial_id)
    begin_watching(node)
    node.tree.restarts.begin_trial(may_start_over(node))
    node.tree.budget.begin(node.settings.budget)
    if store is not None:
        store.begin_trial(resumed)
    return _run_trial(node, run, execute, store, resumed)


def _run_trial(
    node: TreeNode,
    run: Execution,
    execute: Callable[[], Optional[str]],
    store: Optional[TrialStore],
    resumed: Optional[Resumption],
) -> Optional[str]:
    if resumed is None:
        node.emit(
            EventKind.TRIAL_START,
            data={
                'initial': [node.machine._initial_state_label or ''],
                'recovers': node.tree.recover,
                'settings': _settings(node),
            },
        )
    else:
        tell_resumed(node, resumed)
    node.tree.control.begin_trial()
    outcome: Optional[str] = None
    error: Optional[BaseException] = None
    try:
        _running.append(node)
        try:
            with run:
                outcome = run.outcome = execute()
        finally:
            _running.remove(node)
        return outcome
    except BaseException as err:
        error = err
        raise
    finally:
        if not node.tree.is_parents:
            _end_trial(node, outcome, error, store)


def _end_trial(
    node: TreeNode,
    outcome: Optional[str],
    error: Optional[BaseException],
    store: Optional[TrialStore],
) -> None:
    node.tree.control.end_trial()
    node.tree.workers.end_idle_threads()
    why = _trial_end(node, outcome, error)
    if why is TrialEnd.KEPT:
        node.machine.service_preempt()
        for state in node.machine._states.values():
            recall_preempts(state)
    node.emit(
        EventKind.TRIAL_END,
        outcome=outcome or '',
        text=why_no_outcome(outcome, error),
        data={ENDED_BY: why.value, **_learned(node)},
    )
    save_rates(node)
    if store is not None:
        store.end(why, outcome or '', time.time())


def _settings(node: TreeNode) -> Dict[str, Any]:
    """Return the settings by which the top oracle decides, without those of single states."""
    settings, defaults = node.settings, node.settings.defaults
    parameters = sorted(settings.policy_parameters.items())
    return {
        'policy': settings.policy,
        **{'policy.' + name: value for name, value in parameters},
        'memory': defaults.memory,
        'estimator': defaults.estimator,
        'prior': defaults.prior,
        'moderate_from': defaults.moderate_from,
        'high_from': defaults.high_from,
        'max_recoveries': defaults.max_recoveries,
    }


def _learned(node: TreeNode) -> Dict[str, Any]:
    """Return what was learned so far, where it is kept in a file.

    A record of the trial then has all that is needed to go on after it.
    """
    if not node.settings.rates_file:
        return {}
    return {'learned': learned_by(nodes_of(node.machine))}


def _trial_end(node: TreeNode, outcome: Optional[str], error: Optional[BaseException]) -> TrialEnd:
    if ends_program(error):
        return TrialEnd.STOPPED
    if node.tree.early_end.why is not None:
        return node.tree.early_end.why
    if error is not None:
        return TrialEnd.ERROR
    if outcome is not None:
        return TrialEnd.OUTCOME
    return TrialEnd.SHUTDOWN if node.engine.stepped else TrialEnd.INCONSISTENT


def _leave_to_parent() -> None:
    """Have no part in the trials that ran when this process was forked.

    Where the state that has forked returns in the child too, its machine goes on there and tells
    nobody.
    """
    for top in _running:
        tree = top.tree.silent_twin()
        for node in nodes_of(top.machine):
            node.join(tree)
            for record in node.records.by_label.values():
                record.__setstate__(record.__getstate__())  # nobody holds its lock
    GOALS.__dict__.update(RunningGoals().__dict__)


in_child(_leave_to_parent)
