"""The model's StateMachines under an oracle: from state to state, and what is a failure."""

from typing import Any, Dict, List, Optional, Set, Tuple

from .ends import Failed, Goal, Way
from .memory import PREEMPTED, SUCCESS, Remembered
from .parts import OVERRUN, ConcurrencePart, Jumping, Part, Raised, View
from .plan import Machine
from .recovering import Recovering
from .scheduling import Course
from .words import failing_outcome_of, sounds_like_failure, sounds_like_success


class MachinePart(Part, Recovering):
    """A StateMachine, or a Sequence, with its oracle."""

    plan: Machine

    def __init__(self, run: Any, plan: Machine, path: str, parent: Any) -> None:
        super().__init__(run, plan, path, parent)
        self._children = [run.part_of(child, path, self) for child in plan.children]
        self.labels = [child.label for child in plan.children]
        self.userdata: Dict[str, Any] = {}
        self.snapshots: Dict[str, Dict[str, Any]] = {}
        self.memory = Remembered(run.plan, path, self.labels, self.labels[0])
        self.current: Optional[Part] = None
        self._preempted: Optional[Part] = None
        # what ran before a stop of the whole tree was obeyed. Empty once some of it runs again
        self.work: Optional[Set[str]] = None
        self.left_with = ''
        self._natural: Optional[Way] = None  # ending, of the failure that is being recovered from
        # of failures that the oracle has led elsewhere, by their states, which have not succeeded
        # since
        self._ends: Dict[str, Way] = {}
        self._has_failed = False  # in this execution, other than as its author has foreseen
        self.begins_in: Optional[str] = None  # its next execution

    def children(self) -> List[Part]:
        return self._children

    # -- one execution

    def execute(self, view: View) -> Course:
        """Run to the end; returns the outcome."""
        view.copy_to(self.keys, self.userdata)
        self.settled = False
        self.ended_as_meant = False
        self._natural = None
        self._ends.clear()
        self._has_failed = False
        self._preempted = None
        self.work = None
        self.snapshots.clear()
        self.memory.begin_execution()
        label = self.begins_in or self.labels[0]
        self.begins_in = None
        self.tell('CONTAINER_START', label)
        try:
            outcome = yield from self._run_from(label)
        except Raised:
            self.tell('CONTAINER_END', '')
            raise
        except Jumping:
            self.leave()
            view.copy_from(self.keys, self.userdata)
            raise
        finally:
            self.current = None
        view.copy_from(self.keys, self.userdata)
        self.tell('CONTAINER_END', '', outcome)
        return outcome

    def _run_from(self, label: str) -> Course:
        while True:
            way = yield from self._visit(label)
            if not way.is_state:
                break
            label = way.target
        if self.flag and self._preempted is not None and not self._preempted.flag:
            self.flag = False
        return way.target

    def own_places(self) -> Set[Tuple[str, str]]:
        """The places of its states."""
        return {(self.path, label) for label in self.labels}

    def holds_paths(self) -> bool:
        """Whether all below its path is in it."""
        return True

    def _held_back(self, label: str) -> Course:
        """The machine has come to a state that is not to be repeated: an expert is asked."""
        self.run.forget_begins(self.child(label))
        failing = failing_outcome_of(self.plan.outcomes)
        failed = Failed(label, 'HELD_BACK', '', None, failing and Way(failing, False))
        if self.flag:
            self._preempted.flag = False
        if self._winds_down():
            return self._end_preempted(failed)
        self._natural = failed.ending
        way = yield from self.recover(failed, False)
        self._natural = None
        return way

    def _visit(self, label: str) -> Course:
        """Execute one state; returns where the machine goes."""
        child = self.current = self.child(label)
        self.ended_as_meant = False
        if self.flag:
            self._heed_preempt()
        if label in (self.work or ()):
            self.work = set()
        if self.run.repeats.come((self.path, label)):
            self.snapshots[label] = dict(self.userdata)
            return (yield from self._held_back(label))
        self.snapshots[label] = dict(self.userdata)
        self.tell('STATE_START', label)
        outcome, raised = None, False
        try:
            outcome = yield from child.execute(
                View(self.userdata, self.plan.remappings.get(label, {}))
            )
        except Raised:
            raised = True
        except Jumping as jump:
            self.run.forget_begins(child)
            return (yield from self.arrive(label, jump.goal))
        self.run.forget_begins(child)
        return (yield from self._ended(label, outcome, raised))

    def _ended(self, label: str, outcome: Any, raised: bool) -> Course:
        failed = self.failure_of(label, outcome, raised)
        if self._is_meant(label, outcome):
            failed = None
        if (
            self.flag
            and self.run.top.flag
            and not self.work
            and (failed or outcome == 'preempted' or not self.child(label).flag)
        ):
            self.work = set(self.snapshots)
        reported = self._reported(label, outcome, failed)
        if reported is not None:
            self.memory.ended(label, SUCCESS)
            self.forget_end(label)
            self.memory.reports(label)
            return (yield from self._recover_from(reported, reported.continuous))
        if failed is None:
            is_success = not self.flag and outcome != 'preempted'
            self.memory.ended(label, SUCCESS if is_success else PREEMPTED)
            if is_success:
                self.forget_end(label)
            way = self.way_of(label, outcome)
            self.tell('TRANSITION', label, outcome, way.target)
            self.ended_as_meant = is_success and self._is_meant(label, outcome)
            return way
        if self._winds_down():
            self.memory.ended(label, PREEMPTED)
            return self._end_preempted(failed)
        return (yield from self._fails(failed))

    def _end_preempted(self, failed: Failed) -> Way:
        if failed.kind in ('TIME_LIMIT', 'HELD_BACK') and 'preempted' in self.plan.outcomes:
            return self.end_naturally(failed._replace(ending=Way('preempted', False)))
        return self.end_naturally(failed)

    def end_naturally(self, failed: Failed) -> Way:
        """Go as without an oracle."""
        if failed.ending is None:
            raise Raised
        self.tell('TRANSITION', failed.label, failed.outcome, failed.ending.target)
        return failed.ending

    def _fails(self, failed: Failed) -> Course:
        label, memory = failed.label, self.memory
        if failed.kind != 'TIME_LIMIT':
            self.child(label).recall_preempts()
        continuous = memory.is_continuous(self.run.plan.policy, label)
        self.count_failure(failed, continuous)
        if self.author_recovers(failed):
            memory.keep_failure(self.run.plan.policy, label, failed.outcome, continuous)
            return self.end_naturally(failed)
        self._has_failed = True
        self.note_end(failed)
        if failed.ending is None:
            failed = failed._replace(ending=next(iter(self._ends.values()), None))
        if self.child(label).settled:
            self.settled = failed.ending is None or not failed.ending.is_state
            return self.end_naturally(failed)
        return (yield from self._recover_from(failed, continuous))

    def note_end(self, failed: Failed) -> None:
        """Note how the container would have ended, for a later failure that raises."""
        if failed.outcome and failed.way is not None and failed.way.target:
            if failed.kind in ('FAILING_OUTCOME', 'FELL_THROUGH'):
                self._ends.setdefault(failed.label, failed.way)

    def forget_end(self, label: str) -> None:
        """A state has succeeded, or an expert has done its work."""
        self._ends.pop(label, None)

    def _recover_from(self, failed: Failed, continuous: bool) -> Course:
        self._natural = failed.ending
        way = yield from self.recover(failed, continuous)
        self._natural = None
        return way

    def count_failure(self, failed: Failed, continuous: bool) -> None:
        """Report a failure and remember it."""
        memory, label = self.memory, failed.label
        self.tell(
            'FAILURE',
            label,
            failed.outcome,
            '',
            failed.kind,
            memory.failure_class(label),
            float(memory.rate(label)),
            continuous,
        )
        memory.fails(label)

    # -- what an end of a state is

    def way_of(self, label: str, outcome: str) -> Way:
        """Where the author leads an outcome."""
        target = self.plan.transitions[label].get(outcome)
        if target in self.labels:
            return Way(target, True)
        return next(
            (Way(name, False) for name in (target, outcome) if name in self.plan.outcomes),
            Way('', False),
        )

    def failure_of(self, label: str, outcome: Any, raised: bool) -> Optional[Failed]:
        """What the end of a state is, None where it is no failure."""
        if raised:
            return Failed(label, 'EXCEPTION', '', None, None)
        if outcome is OVERRUN:
            failing = failing_outcome_of(self.plan.outcomes)
            return Failed(label, 'TIME_LIMIT', '', None, failing and Way(failing, False))
        if outcome not in self.child(label).plan.outcomes:
            return Failed(label, 'UNREGISTERED_OUTCOME', outcome or '', None, None)
        way = self.way_of(label, outcome)
        kind = self._kind_of(label, outcome, way)
        return kind and Failed(label, kind, outcome, way, way if way.target else None)

    def _kind_of(self, label: str, outcome: str, way: Way) -> Optional[str]:
        if way.target and outcome in self.settings_of(label).intended_outcomes:
            return None
        if outcome in self.settings_of(label).failure_outcomes:
            return 'FAILING_OUTCOME'
        if way.target and not way.is_state and sounds_like_failure(way.target):
            is_good = outcome == 'preempted' or sounds_like_success(outcome)
            return None if is_good else 'FELL_THROUGH'
        if not way.target:
            return 'UNREGISTERED_OUTCOME'
        return 'FAILING_OUTCOME' if sounds_like_failure(outcome) else None

    def _is_meant(self, label: str, outcome: Any) -> bool:
        """Whether a state has ended as its author means it, or a container has by such a state."""
        if outcome not in self.child(label).plan.outcomes or not self.way_of(label, outcome).target:
            return False
        intended = self.settings_of(label).intended_outcomes
        return outcome in intended or self.child(label).ended_as_meant

    def has_stopped_early(self, label: str, outcome: Optional[str]) -> bool:
        """Whether a state that has ended so, an Iterator, has failed or was left."""
        if outcome in (None, 'preempted'):
            return True
        failed = self.failure_of(label, outcome, False)
        return failed is not None and not self._is_meant(label, outcome)

    def _reported(self, label: str, outcome: Any, failed: Optional[Failed]) -> Optional[Failed]:
        """The earlier failure of another state that the end of this one reports."""
        if self._winds_down() or self.child(label).settled or self._is_meant(label, outcome):
            return None
        if failed is not None and failed.kind != 'FELL_THROUGH':
            return None
        way = self.way_of(label, outcome)
        if way.is_state or not sounds_like_failure(way.target):
            return None
        if outcome == 'preempted' or sounds_like_failure(outcome):
            return None
        kept = self.memory.reported_by(label)
        if kept is None:
            return None
        return Failed(
            kept.label,
            'FAILING_OUTCOME',
            kept.outcome,
            way,
            way,
            told_by=label,
            told_with=outcome,
            back_to=kept.back_to,
            continuous=kept.continuous,
        )

    def author_recovers(self, failed: Failed) -> bool:
        """Whether the author's own transition stays."""
        is_drawn = self.author_drew(failed) and not self.is_unnoticed(failed)
        return is_drawn or self.stops_others(failed)

    def stops_others(self, failed: Failed) -> bool:
        """Whether what runs beside this container has to stop, as its author has said."""
        own = self.settings_of(failed.label).author_recoveries
        is_override = (own or self.run.plan.author_recoveries) == 'override'
        if is_override or failed.kind == 'TIME_LIMIT' or not self.only_watches():
            return False
        if failed.way is None or not failed.way.target:
            return not self._has_failed and self.parent.would_stop(self.label, None)
        return not failed.way.is_state and self.parent.would_stop(self.label, failed.way.target)

    def only_watches(self) -> bool:
        """Whether it is a branch of a Concurrence that can end by failures alone."""
        ways = (
            self.way_of(child.label, end) for child in self._children for end in child.plan.outcomes
        )
        ends = {way.target for way in ways if not way.is_state and way.target} - {'preempted'}
        is_branch = isinstance(self.parent, ConcurrencePart)
        return is_branch and bool(ends) and all(sounds_like_failure(end) for end in ends)

    def is_unnoticed(self, failed: Failed) -> bool:
        """Whether it ends this container, which has no outcome by which a failure shows."""
        return (
            failed.way is not None
            and not failed.way.is_state
            and failing_outcome_of(self.plan.outcomes) is None
        )

    def author_drew(self, failed: Failed) -> bool:
        """Whether the author has drawn where a failure leads, and the user leaves it to him."""
        own = self.settings_of(failed.label).author_recoveries
        if (own or self.run.plan.author_recoveries) == 'override':
            return False
        return (
            failed.kind == 'FAILING_OUTCOME'
            and failed.way is not None
            and (
                failed.way.is_state
                or failed.outcome not in self.settings_of(failed.label).failure_outcomes
            )
        )

    def settings_of(self, label: str) -> Any:
        """The settings of a state."""
        return self.run.plan.of(self.path, label)

    # -- preempts

    def request_preempt(self) -> None:
        self.flag = True
        was_asked = self._preempted is not None and self._preempted is self.current
        if self.current is not None and not (was_asked and self.run.is_upstream):
            self._pass_preempt_on()  # upstream's engine asks a state once in a visit

    def preempt_up_to(self, level: Any) -> None:
        """A preempt has come to a level above while this oracle waited for its decision."""
        part = self
        while part is not level:
            part.flag = True
            part._preempted = part.current
            part.parent._preempted = part
            part = part.parent

    def _winds_down(self) -> bool:
        """Whether a preempt is under way, or who has obeyed one, the innermost, is to end."""
        part: Any = self
        while part is not None:
            if isinstance(part, MachinePart):
                if part.flag and (part is self or self.run.top.flag):
                    return True
                if part.work is not None:
                    return bool(part.work)
            part = part.parent
        return False

    def _heed_preempt(self) -> None:
        """Before a state runs: it is preempted, unless the one before has serviced the request."""
        if self._preempted is None or self._preempted.flag:
            if self._preempted is not None:
                self._preempted.flag = False
            self._pass_preempt_on()
        else:
            self.flag = False
            self._preempted = None

    def _pass_preempt_on(self) -> None:
        if self._preempted is not None and self._preempted is not self.current:
            self._preempted.flag = False
        self._preempted = self.current
        self.current.request_preempt()

    # -- leaving and arriving

    def arrive(self, label: str, goal: Goal) -> Course:
        """A jump has left the state of that label; a preempt of where it goes ends it."""
        if goal.machine.flag:
            self._preempt_left(goal)
            self._preempted = self.child(label)
            return (yield from self._ended(label, self.child(label).left_with, False))
        if goal.machine is not self:
            self.memory.ended(label, PREEMPTED)
            self.choose_left_with()
            self.tell('TRANSITION', label, self.child(label).left_with, self.left_with)
            raise Jumping(goal)
        return (yield from self.follow_from_below(label, goal))

    def _preempt_left(self, goal: Goal) -> None:
        """What is left is preempted, up to where the jump would have gone."""
        self.flag = True
        part: Part = self
        while part is not goal.machine:
            part.flag = True
            if isinstance(part, MachinePart) and part is not self:
                part._preempted = part.current
            part = part.parent

    def leave(self) -> None:
        """End at once, as preempted."""
        self.flag = False
        self.choose_left_with()
        self.tell('CONTAINER_END', '', self.left_with)

    def choose_left_with(self) -> None:
        """Find the outcome of a container that is left: as without an oracle, if not preempted."""
        outcomes, natural = self.plan.outcomes, self._natural
        if 'preempted' in outcomes:
            self.left_with = 'preempted'
        elif natural is not None and not natural.is_state:
            self.left_with = natural.target
        else:
            self.left_with = failing_outcome_of(outcomes) or ''

    def tell(self, kind: str, label: str, outcome: str = '', target: str = '', *more: Any) -> None:
        """Note an event."""
        self.run.tell(self.path, (kind, label, outcome or '', target) + more)
