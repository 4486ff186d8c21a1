"""Looks whether the preconditions of the states that an expert may choose hold now, without bringing any of them about.

Only what is written as a look can be looked at: a callable, and the check of a pair where it is one. A state is never
run for it. Whoever looks may be kept waiting for ever by a user's callable, so it is done in threads that nobody waits
for.
"""
from typing import Any, List, NamedTuple, Optional

from .precondition_spec import PreconditionKind, PreconditionSpec
from .question import Look, Standing, VisitResult
from .userdata import Gate, behind

_LAST = {VisitResult.SUCCESS: 'succeeded', VisitResult.FAILURE: 'failed', VisitResult.SUPERSEDED: 'was superseded',
         VisitResult.PREEMPTED: 'was preempted'}


class _Item(NamedTuple):
    """One precondition of one state."""

    state: str
    spec: PreconditionSpec


class PreconditionLook(Look):
    """The preconditions of one question's choices.

    `look` may be called from any thread; what a callable writes into the userdata is dropped.
    """

    def __init__(self, machine: Any, ledger: Any) -> None:
        self._ledger = ledger
        self._gate = Gate(machine)
        self._gate.shut()
        self._items: List[_Item] = [_Item(label, spec) for label in ledger.labels()
                                    for spec in ledger.record(label).settings.preconditions]
        self.names = tuple((item.state, item.spec.name) for item in self._items)

    def look(self, number: int) -> Standing:
        """How the precondition of that number stands now. Calls a user's function: it may take for ever."""
        spec = self._items[number].spec
        if not self._ledger.settings.watch_preconditions:
            return Standing(None, 'watch_preconditions is off')
        if spec.kind is PreconditionKind.PAIR:
            check, achieve = spec.target
            found = self._of(check)
            return found._replace(text='{}; {} would bring it about'.format(
                found.text, achieve.name)) if found.holds is False else found
        return self._of(spec)

    def _of(self, spec: PreconditionSpec) -> Standing:
        if spec.kind is PreconditionKind.LABEL:
            return Standing(None, 'only running {} would tell{}'.format(spec.target, self._last(spec.target)))
        if spec.kind is not PreconditionKind.CALLABLE:
            return Standing(None, 'only running {} would tell'.format(spec.name))
        try:
            result = spec.target(behind(self._gate))
        except Exception as err:
            return Standing(None, '{} raised {!r}'.format(spec.name, err))
        if result is None:
            return Standing(None, '{} returned None; True is met'.format(spec.name))
        return Standing(bool(result), '{} returned {!r}'.format(spec.name, result)[:300])

    def _last(self, label: str) -> str:
        last: Optional[VisitResult] = next(
            (visit.result for visit in reversed(self._ledger.history.latest()) if visit.state == label), None)
        return '; its last visit ' + _LAST[last] if last is not None else ''
