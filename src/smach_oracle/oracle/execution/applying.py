"""Carries out a verdict: the one place that moves a machine from the meta state."""

from typing import Dict, Optional, cast

from ..machine.repeats import note_superseded
from ..machine.site import route_of
from ..records.events import EventKind, in_event
from ..records.facts import JUMPED_FROM, JUMPED_TO
from ..records.visits import VisitResult
from ..recovery.levels import unnoticed
from ..recovery.occasions import FirstStep, Superseding
from ..recovery.phases import OracleState
from ..recovery.recovery import Recovery
from ..recovery.verdict import (
    ContainerEnding,
    GiveUp,
    JumpTo,
    Preempted,
    Supersede,
    Verdict,
    arrives_at,
    leaving_outcome,
)
from .jump_entry import plain_entry, prepare_entry, start_over
from .transitions import be_back, go_to, message_of, obey_preempt, stop_left_behind, terminate


class Applying:
    """One verdict on its way out of the meta state.

    Its methods return the container's outcome, or None where the machine goes on. `last_label`: of
    the state that ran last. It may report the failure of an earlier one.
    """

    def __init__(self, recovery: Recovery, meta: OracleState, last_label: str) -> None:
        self._node = recovery.node
        self._machine = recovery.node.machine
        self._record = recovery.record
        self._occasion = recovery.occasion
        self._meta = meta
        self._last_label = last_label

    def apply(self, verdict: Verdict) -> Optional[str]:
        """Go as a verdict says.

        :raises Exception: what the machine would raise without an oracle, where that gives up.
        """
        if isinstance(verdict, Supersede):
            self._count_superseded(verdict.outcome)
        if self._node.tree.early_end.why is not None:
            be_back(self._node, self._record.label)
            stop_left_behind(self._node)
            return None
        if arrives_at(verdict) not in (None, self._node):
            self._service_preempt()  # the container is left for a level above
            return self._terminate(leaving_outcome(self._node, self._occasion.failure))
        if isinstance(verdict, JumpTo):
            self._jump(verdict)
            return None
        if isinstance(verdict, Supersede):
            return self._supersede(verdict)
        if isinstance(verdict, GiveUp):
            return self._give_up(verdict)
        return self._preempted(verdict)

    def _count_superseded(self, outcome: str) -> None:
        node, record = self._node, self._record
        if self._occasion.superseding is Superseding.TAKES_BACK:
            record.take_back_failure()
            node.records.history.supersede(record.label, outcome, record.has_preconditions)
        elif self._occasion.superseding is Superseding.COUNTS:
            node.records.visit_ended(record, outcome, VisitResult.SUPERSEDED)
            note_superseded(node, record.label)
        else:
            node.records.history.count_superseded(record.label, outcome, record.has_preconditions)

    def _jump(self, jump: JumpTo) -> None:
        node, way = self._node, jump.jump_path
        if jump.chosen is not None:
            jump.chosen.note()
        elif jump.asked is not None:
            jump.asked.go()
        target = way.first_label
        if jump.restarts:  # with the userdata of the start in all containers
            told = start_over(node, target)
        else:
            told = prepare_entry(way, jump.written, 'jumping')
        self._note_entry(target)
        lower = self._occasion.departure
        # of a jump by a way of the menu, or across containers
        if jump.chosen is not None:
            told['way'] = jump.chosen.gone.way
        if lower is not None:
            told[JUMPED_FROM] = lower.failed_path
        if len(way.entered_places) > 1:
            told[JUMPED_TO] = way.place.path
        self._go_on(target, jump.by, jump.text, told)

    def _supersede(self, verdict: Supersede) -> Optional[str]:
        route = route_of(self._machine, self._record.label, verdict.outcome)
        told = {'by': verdict.by, 'text': verdict.text}
        label = self._record.label
        self._node.emit(EventKind.SUPERSEDE, label, verdict.outcome, route.target, **told)
        if not route.is_state:
            return self._terminate(route.target)
        self._note_entry(route.target)
        self._go_on(route.target, verdict.by)
        return None

    def _note_entry(self, label: str) -> None:
        """Note that the machine comes to this state by the oracle alone."""
        if self._node.settings.still_running_s:
            self._node.record(label).enter_by_oracle()

    def _give_up(self, verdict: GiveUp) -> Optional[str]:
        ending, text, node = verdict.ending, verdict.text, self._node
        told = '{}; {}'.format(text, ending.error) if ending.error is not None else text
        if ending.state is None and unnoticed(node, self._occasion.failure) is None:
            node.execution.give_up()
        outcome, target = in_event(ending.outcome), ending.state or ''
        node.emit(EventKind.GIVE_UP, self._record.label, outcome, target, by=verdict.by, text=told)
        return self._end(ending, verdict.by, text)

    def _preempted(self, verdict: Preempted) -> Optional[str]:
        ending = verdict.ending
        if self._machine.preempt_requested():
            self._node.execution.tell_preempt()
        if ending.obeys:  # the author's own transition: the request goes on with it
            obey_preempt(self._node, self._meta)
        elif ending.state is None:
            self._service_preempt()
        return self._end(ending)

    def _end(self, ending: ContainerEnding, by: str = '', text: str = '') -> Optional[str]:
        """End the container, or go on, as an ending says."""
        if ending.error is not None:  # SMACH has logged it where it was made
            raise ending.error
        if ending.state is not None:
            self._go_on(ending.state, by, text)
            return None
        return self._terminate(cast('str', ending.outcome))

    def _service_preempt(self) -> None:
        self._meta.service_preempt()
        self._machine.service_preempt()

    def _go_on(
        self, target: str, by: str = '', text: str = '', told: Optional[Dict[str, object]] = None
    ) -> None:
        """Leave the meta state for a state. `told`: of its entry. None: nothing was done for it."""
        node, label = self._node, self._record.label
        again = self._occasion.first_step is FirstStep.ENTER_AGAIN and target == label
        if by or not again:
            data = told or plain_entry(node, target)
            node.emit(EventKind.JUMP, label, target=target, by=by, text=text, data=data)
            node.records.oracle_edges[target] += 1
        go_to(node, message_of(node.settings.oracle_label, target, target), target)

    def _terminate(self, outcome: str) -> str:
        """Leave the meta state for a container outcome."""
        node = self._node
        node.records.oracle_edges[outcome] += 1
        return terminate(node, node.settings.oracle_label, outcome, outcome, self._last_label)
