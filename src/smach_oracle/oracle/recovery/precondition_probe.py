"""Tells how the preconditions of the states that an expert may choose stand now.

Only a callable, and the check of a pair where it is one, can be asked without bringing anything
about. A state is never run for it. A user's callable may take forever, so it is called in threads
that nobody waits for.
"""

from typing import List, NamedTuple, Optional

from smach_common.foreign import repr_of

from ..asking.question import PreconditionProbe, PreconditionStatus
from ..identity import truth_of
from ..machine.places import place_named
from ..machine.snapshots import UserdataGate, behind
from ..machine.tree_node import TreeNode
from ..records.short_text import shortened
from ..records.visits import VisitResult
from ..settings.preconditions import PreconditionKind, PreconditionSpec

_LAST = {
    VisitResult.SUCCESS: 'succeeded',
    VisitResult.FAILURE: 'failed',
    VisitResult.SUPERSEDED: 'was superseded',
    VisitResult.PREEMPTED: 'was preempted',
}


class _StatePrecondition(NamedTuple):
    """One precondition of one state."""

    state: str
    spec: PreconditionSpec


class LivePreconditionProbe(PreconditionProbe):
    """The preconditions of one question's choices.

    `status` may be called from any thread. What a callable writes into the userdata is dropped.
    """

    def __init__(self, node: TreeNode) -> None:
        self._node = node
        self._gate = UserdataGate(node.machine)
        self._gate.shut()
        self._items: List[_StatePrecondition] = [
            _StatePrecondition(label, spec)
            for label in node.labels()
            for spec in node.record(label).settings.preconditions
        ]
        self.names = tuple((item.state, item.spec.name) for item in self._items)

    def status(self, number: int) -> PreconditionStatus:
        """Return how the precondition of that number stands now.

        It calls a user's function, which may take forever.
        """
        spec = self._items[number].spec
        if not self._node.settings.watch_preconditions:
            return PreconditionStatus(None, 'watch_preconditions is off')
        if spec.kind is PreconditionKind.PAIR:
            check, achieve = spec.target
            found = self._of(check)
            return (
                found._replace(text='{}; {} would bring it about'.format(found.text, achieve.name))
                if found.holds is False
                else found
            )
        return self._of(spec)

    def _of(self, spec: PreconditionSpec) -> PreconditionStatus:
        if spec.kind is PreconditionKind.LABEL:
            return PreconditionStatus(
                None, 'only running {} would tell{}'.format(spec.target, self._last(spec.target))
            )
        if spec.kind is not PreconditionKind.CALLABLE:
            return PreconditionStatus(None, 'only running {} would tell'.format(spec.name))
        try:
            result = spec.target(behind(self._gate))
        except Exception as err:
            return PreconditionStatus(None, '{} raised {}'.format(spec.name, repr_of(err)))
        if result is None:
            return PreconditionStatus(None, '{} returned None; True is met'.format(spec.name))
        return PreconditionStatus(
            truth_of(result), shortened('{} returned {}'.format(spec.name, repr_of(result)), 300)
        )

    def _last(self, name: str) -> str:
        place = place_named(self._node, name)
        visits = place.node.records.history.latest() if place is not None else ()
        last: Optional[VisitResult] = next(
            (
                visit.result
                for visit in reversed(visits)
                if place is not None and visit.state == place.label
            ),
            None,
        )
        return '; its last visit ' + _LAST[last] if last is not None else ''
