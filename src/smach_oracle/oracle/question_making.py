"""Everything an expert is told about a failure (paper, section V)."""
from typing import Any, Dict, Iterator

from .conditions import PreconditionLook
from .failure import route_of
from .question import OutcomeChoice, Question, StateChoice
from .userdata import constants_of, keys_after_jump, missing_keys


def make_question(recovery: Any, query_id: str, deadline_s: float) -> Question:
    """Return the question about a failure. `deadline_s`: seconds left; 0 waits without end."""
    ledger, machine, record, failure = recovery.ledger, recovery.machine, recovery.record, recovery.failure
    state = machine._states[record.label]
    return Question(
        query_id=query_id, trial_id=ledger.tree.trial_id, container_path=ledger.path, failed_state=record.label,
        failure_kind=failure.kind, outcome=failure.outcome, text=failure.text,
        failure_class=int(record.failure_class), rate=record.rate, continuous=recovery.continuous,
        recoveries=record.recoveries, reason=recovery.reason, tried=tuple(recovery.tried),
        history=ledger.history.latest(), choices=tuple(state_choices(recovery)),
        supersede_outcomes=tuple(_supersede_outcomes(machine, record.label, state)),
        output_keys=tuple(sorted(state.get_registered_output_keys())),
        give_up_outcomes=tuple(sorted(machine.get_registered_outcomes(), key=str)),
        interfaces=ledger.settings.offers_for(ledger.relative_path, record.label),
        userdata=dict(machine.userdata._data), input_userdata=_inputs(machine, record.label, state),
        deadline_s=deadline_s, fallback=recovery.fallback_in_words(), preconditions=PreconditionLook(machine, ledger))


def state_choices(recovery: Any) -> Iterator[StateChoice]:
    """Yield the states the machine could be sent to, in the order in which they were added."""
    ledger = recovery.ledger
    written = recovery.watch.written()
    for label in ledger.labels():
        record = ledger.record(label)
        yield StateChoice(label, 1.0 - record.rate, int(record.failure_class), record.visits,
                          missing_keys(ledger.machine, label, keys_after_jump(ledger, label, written)),
                          tuple(spec.name for spec in record.settings.preconditions), recovery.blocked(label))


def _supersede_outcomes(machine: Any, label: str, state: Any) -> Iterator[OutcomeChoice]:
    for outcome in sorted(state.get_registered_outcomes(), key=str):
        route = route_of(machine, label, outcome)
        if route.target:
            yield OutcomeChoice(outcome, route.target)


def _inputs(machine: Any, label: str, state: Any) -> Dict[str, Any]:
    data = dict(machine.userdata._data)
    remapping = machine._remappings.get(label) or {}
    inputs = {key: data[remapping.get(key, key)] for key in state.get_registered_input_keys()
              if remapping.get(key, key) in data}
    return {**inputs, **constants_of(machine, label)}
