"""Trials: one execution of the top machine is one trial; and what one execution of any container begins and ends."""
from typing import Any, Callable, Dict, Optional

from .events import NO_OUTCOME, EventKind
from .rates_file import learned_by
from .reporting import ledgers_of
from .wrapping import adopt


def run_container(machine: Any, execute: Callable[[], Optional[str]]) -> Optional[str]:
    """Execute a container; where no container above it runs, this is a trial."""
    ledger = machine._oracle
    if ledger.has_running_ancestor():
        return _run(machine, execute)
    adopt(machine)
    for each in ledgers_of(machine):
        each.bring_up_to_date()
    ledger.tree.begin_trial(machine.new_trial_id())
    for each in ledgers_of(machine):
        if not each.machine.is_running():  # one that still runs was abandoned in an earlier trial, and is left there
            each.begin_trial(ledger.tree.trial_id)
    return _run_trial(machine, execute)


def _run_trial(machine: Any, execute: Callable[[], Optional[str]]) -> Optional[str]:
    ledger = machine._oracle
    ledger.emit(EventKind.TRIAL_START, data={'initial': [machine._initial_state_label or ''],
                                             'recovers': ledger.tree.recover, 'settings': _settings(ledger)})
    outcome, text = None, ''
    try:
        outcome = _run(machine, execute)
        return outcome
    except BaseException as err:
        text = '{}: {}'.format(type(err).__name__, err)
        raise
    finally:
        ledger.emit(EventKind.TRIAL_END, outcome=outcome or '', text=text or _why_none(outcome), data=_learned(machine))
        ledger.save_rates()


def _settings(ledger: Any) -> Dict[str, Any]:
    """What the oracle of the top machine decides by, but for what is set for single states."""
    settings, defaults = ledger.settings, ledger.settings.defaults
    return {'policy': settings.policy, 'memory': defaults.memory, 'estimator': defaults.estimator,
            'prior': defaults.prior, 'moderate_from': defaults.moderate_from, 'high_from': defaults.high_from,
            'max_recoveries': defaults.max_recoveries}


def _learned(machine: Any) -> Optional[Dict[str, Any]]:
    """What was learned so far, where it is kept across runs: a record of the trial tells how to go on after it."""
    if not machine._oracle.settings.rates_file:
        return None
    return {'learned': learned_by(ledgers_of(machine))}


def _run(machine: Any, execute: Callable[[], Optional[str]]) -> Optional[str]:
    ledger = machine._oracle
    ledger.begin_execution()
    ledger.emit(EventKind.CONTAINER_START, state=machine._initial_state_label or '')
    outcome, text = None, ''
    try:
        outcome = execute()
        return outcome
    except BaseException as err:
        machine._is_running = False  # also after what no engine cleans up after, such as Ctrl-C
        text = '{}: {}'.format(type(err).__name__, err)
        raise
    finally:
        ledger.emit(EventKind.CONTAINER_END, outcome=outcome or '', text=text or _why_none(outcome))
        ledger.drop_snapshots()


def _why_none(outcome: Optional[str]) -> str:
    return NO_OUTCOME if outcome is None else ''
