"""One failure in the model: decided, asked about, obeyed (doc/executive.md, policies.md, trees)."""

from typing import Any, Dict, List, NamedTuple, Optional, Set, Tuple

from .ends import Failed, Goal, Reply, Way
from .parts import Part, Raised, View
from .scheduling import Course, Turn
from .words import decided, failing_outcome_of

ORACLE = 'ORACLE'


class Decision(NamedTuple):
    """What a container's oracle decides by itself."""

    action: str  # revisit, step_back, ask
    target: str
    by: str  # policy, max_recoveries, budget
    written: Set[str] = frozenset()


class Recovering:
    """The oracle's part of a MachinePart."""

    run: Any
    path: str
    memory: Any
    userdata: Dict[str, Any]
    snapshots: Dict[str, Dict[str, Any]]

    def recover(self: Any, failed: Failed, continuous: bool) -> Course:
        """Recover from a failure that was counted; returns where the machine goes."""
        if failed.told_by:
            self.tell('TRANSITION', failed.told_by, failed.told_with, ORACLE)
        else:
            self.tell('TRANSITION', failed.label, failed.outcome, ORACLE)
        if failed.kind == 'HELD_BACK':
            yield Turn('{}/{}'.format(self.path, failed.label))
        decision = yield from self.decide(
            failed.label, continuous, failed.kind == 'HELD_BACK', failed.back_to
        )
        if self.flag:
            return self._preempted_ending(failed)
        self._tell_decision(failed.label, decision)
        if decision.action != 'ask':
            return self._by_itself(failed.label, decision)
        return (yield from self._ask(failed, decision))

    def _preempted_ending(self: Any, failed: Failed) -> Way:
        """A preempt has ended the recovery."""
        self.flag = False
        self.child(failed.label).recall_preempts()  # it was asked of the oracle, not of the state
        if 'preempted' in self.child(failed.label).plan.outcomes:
            drawn = self.way_of(failed.label, 'preempted')
            if drawn.target:
                return drawn
        if 'preempted' in self.plan.outcomes:
            return Way('preempted', False)
        if failed.ending is None:
            raise Raised
        return failed.ending

    def _by_itself(self: Any, label: str, decision: Decision) -> Way:
        self._count_recovery(label)
        self.run.budget['recoveries'] += 1
        return self.jump(label, self._to(decision))

    def _to(self: Any, decision: Decision, failed: Optional[Failed] = None) -> Goal:
        return Goal(
            self,
            decision.target,
            failed=failed,
            written=decision.written,
            place=(self.path, decision.target),
        )

    def _count_recovery(self: Any, label: str) -> None:
        recoveries = self.memory.recoveries
        recoveries[label] = recoveries.get(label, 0) + 1

    def limit_of(self: Any, label: str) -> int:
        """How many recoveries of a state there may be."""
        own = self.settings_of(label).max_recoveries
        return self.run.plan.max_recoveries if own is None else own

    # -- deciding

    def _tell_decision(self: Any, label: str, decision: Decision) -> None:
        self.tell('DECISION', label, decision.action, decision.target, decision.by)

    def decide(
        self: Any, label: str, continuous: bool, held_back: bool = False, back_to: str = ''
    ) -> Course:
        """What the oracle decides about a failure of its state that was counted."""
        if held_back:
            return Decision('ask', '', 'held_back')
        spent = ''
        if self.memory.recoveries.get(label, 0) >= self.limit_of(label):
            spent = 'max_recoveries'
        elif self.run.is_spent('recoveries'):
            spent = 'budget'
        elif self.settings_of(label).on_retry != 'allow':
            spent = 'on_retry'
        written: Set[str] = set()
        action, by = 'ask', spent
        if not spent:
            rate_class = self.memory.failure_class(label)
            checks = self.settings_of(label).preconditions
            state = 'none'
            if checks and rate_class == 'HIGH':
                state = 'not met'
            elif checks:
                is_met = yield from self._run_checks(label, checks, written)
                state = 'met' if is_met else 'not met'
            action = decided(self.run.plan.policy, rate_class, state, continuous)
            by = 'policy'
        action = action.replace(' ', '_')
        target = {'revisit': label, 'ask': ''}.get(action)
        if target is None:
            target = back_to or self.memory.step_back_target(self.run.plan.policy, label)
        if target and self.run.repeats.repeated_by(self, target):
            action, target, by = 'ask', '', 'on_retry'
        elif target and self.run.is_spent('recoveries'):
            action, target, by = 'ask', '', 'budget'  # by a branch beside, meanwhile
        return Decision(action, target, by, written)

    def _run_checks(self: Any, label: str, checks: Any, written: Set[str]) -> Course:
        for check in checks:
            before = dict(self.userdata)
            self.tell('PRECONDITION_START', label, '', check.name)
            is_met = yield from self._check(label, check)
            self.tell('PRECONDITION_END', label, 'met' if is_met else 'not met', check.name)
            if not is_met or self.flag:
                self.userdata.clear()
                self.userdata.update(before)
                return False
            written.update(self._wrote(check))
        return True

    def _check(self: Any, label: str, check: Any) -> Course:
        if not check.is_label:
            number = self.run.number_of('check', self.path, label, check.name)
            if check.writes:
                self.userdata[check.writes] = '{}/{} {}#{}'.format(
                    self.path, label, check.name, number
                )
            return self.run.plan.holds(self.path, label, check, number)
        place = (self.path, check.name)
        if self.run.repeats.blocks_precondition(place):
            return False
        self.run.repeats.runs_as_precondition(place)
        self.current = self.child(check.name)
        try:
            outcome = yield from self.current.execute(
                View(self.userdata, self.plan.remappings.get(check.name, {}))
            )
        except Raised:
            return False
        return outcome != 'preempted' and self.failure_of(check.name, outcome, False) is None

    def _wrote(self: Any, check: Any) -> Set[str]:
        if not check.is_label:
            return {check.writes} if check.writes else set()
        remapping = self.plan.remappings.get(check.name, {})
        return {remapping.get(key, key) for key in self.child(check.name).plan.writes}

    # -- where it asks

    def _ask(self: Any, failed: Failed, decision: Decision) -> Course:
        if self.author_drew(failed) and self.is_unnoticed(failed):
            return self.leave_to_author(failed)
        is_held_back = failed.kind == 'HELD_BACK'
        if (
            not is_held_back
            and failed.ending is not None
            and not (failed.ending.is_state)
            and self.run.is_foreseen(self, failed.ending.target)
        ):
            return self.give_up(failed, failed.ending)
        would_end = failed.ending is None or not failed.ending.is_state
        if (
            self.run.plan.escalate
            and would_end
            and decision.by == 'policy'
            and (self.memory.failure_class(failed.label) != 'HIGH')
        ):
            yield from self._ask_above(failed)
            if self.flag:
                return self._preempted_ending(failed)
        reply = self._ask_expert(failed, decision.written)
        if reply is None:
            return self._fall_back(failed, decision.written)
        return self._obey(failed, reply, decision.written)

    def _ask_above(self: Any, failed: Failed) -> Course:
        """Go where a level above decides to go by itself; return where none does."""
        level, inner, ending = self, self, failed.ending
        while self.run.is_machine(level.parent):
            level, inner = level.parent, level
            outer = level.failed_as(inner.label, ending)
            if outer is None:
                return
            was_asked = level.flag  # and has obeyed that
            decision = yield from level.decide_tentatively(outer)
            if level.flag and not was_asked:  # while a precondition ran
                self.preempt_up_to(level)
                return
            if decision.action != 'ask':
                self._count_recovery(failed.label)
                level._count_recovery(inner.label)
                self.run.budget['recoveries'] += 1
                level.count_failure(
                    outer, level.memory.is_continuous(self.run.plan.policy, inner.label)
                )
                level._tell_decision(inner.label, decision)
                raise self.run.depart(self, level._to(decision, outer))
            ending = outer.ending
            if ending is not None and ending.is_state:
                return

    def _ask_expert(self: Any, failed: Failed, written: Set[str]) -> Optional[Reply]:
        if not self.run.plan.has_expert or self.run.is_spent('questions'):
            return None
        self.run.budget['questions'] += 1
        self.tell('QUERY_OPENED', failed.label)
        reply = self.run.ask(self, failed, written)
        if reply is None:
            self.tell('QUERY_EXPIRED', failed.label)
            return None
        name = '{}/{}'.format(reply.path, reply.name)
        is_own = reply.path in ('', self.path) and (
            reply.kind != 'goto' or reply.name in self.labels
        )  # not that of a branch beside
        self.tell('QUERY_ANSWERED', failed.label, reply.kind, reply.name if is_own else name)
        return reply

    def _fall_back(self: Any, failed: Failed, written: Set[str]) -> Way:
        kind, name = self.run.plan.on_no_answer
        if kind == 'give_up' and name in self.plan.outcomes:
            return self.give_up(failed, Way(name, False))
        gone = self.memory.fallbacks.get(failed.label, 0)
        if (
            kind == 'goto'
            and gone < max(1, self.limit_of(failed.label))
            and (not self.run.is_spent('recoveries'))
        ):
            path, label = self.run.place(name)
            goal = self.run.goal_of(self, path, label)
            if not (
                self.run.is_closed(goal) or self.run.repeats.repeated_by(goal.machine, goal.label)
            ):
                self.memory.fallbacks[failed.label] = gone + 1
                self.run.budget['recoveries'] += 1
                return self.go_to_place(failed.label, path, label, written)
        return self.give_up(failed, failed.ending)

    def _obey(self: Any, failed: Failed, reply: Reply, written: Set[str]) -> Way:
        label = failed.label
        if reply.kind == 'goto':
            return self.go_to_place(label, reply.path, reply.name, written)
        if reply.kind == 'supersede':
            remapping = self.plan.remappings.get(label, {})
            self.userdata.update(
                {remapping.get(key, key): value for key, value in reply.outputs.items()}
            )
            self.forget_end(label)
            if failed.kind == 'HELD_BACK':
                self.memory.ended(label, 'superseded')
                self.run.repeats.superseded((self.path, label))
            elif not failed.was_left:
                self.memory.supersede(label)
            way = self.way_of(label, reply.name)
            self.tell('SUPERSEDE', label, reply.name, way.target)
            if way.is_state:
                self.tell('JUMP', label, '', way.target, self.missing(way.target), 'keep')
            return way
        if reply.path in ('', self.path):
            return self.give_up(failed, Way(reply.name, False) if reply.name else failed.ending)
        raise self.run.depart(self, Goal(self.run.machine(reply.path), gives_up=reply.name))

    def leave_to_author(self: Any, failed: Failed) -> Way:
        """End as the author has drawn it, as if there were no oracle: nothing is settled."""
        self.tell('GIVE_UP', failed.label, failed.ending.target, '')
        return failed.ending

    def give_up(self: Any, failed: Failed, ending: Optional[Way]) -> Way:
        """End as settled, or go the author's way."""
        self.tell(
            'GIVE_UP',
            failed.label,
            '' if ending is None or ending.is_state else ending.target,
            ending.target if ending and ending.is_state else '',
        )
        if ending is None:
            self.settled = True
            raise Raised
        if ending.is_state:
            self.tell('JUMP', failed.label, '', ending.target, self.missing(ending.target), 'keep')
        else:
            self.settled = True
        return ending

    # -- going

    def jump(self: Any, label: str, goal: Goal) -> Way:
        """Go to a state of this container, from the one of that label."""
        restores = self.restores(goal.label)
        after = self.after_jump(goal.label, goal.written)
        self.userdata.clear()
        self.userdata.update(after)
        self.run.repeats.leave_for(self, goal.label, self.run.places_on(goal))
        self._note_begins(goal)
        self.tell(
            'JUMP',
            label,
            '',
            goal.label,
            self.run.missing_at(goal, self.userdata),
            'restore' if restores else 'keep',
        )
        self.run.cross_jumps += bool(goal.begins or goal.crosses)
        return Way(goal.label, True)

    def restores(self: Any, target: str) -> bool:
        """Whether a jump to a state puts the userdata back."""
        return self.run.plan.userdata == 'restore' and target in self.snapshots

    def after_jump(self: Any, target: str, written: Set[str]) -> Dict[str, Any]:
        """The userdata that a jump to a state leaves."""
        if not self.restores(target):
            return dict(self.userdata)
        changed = self.keys_of_states()
        survives = {
            key: value
            for key, value in self.userdata.items()
            if key in written or key not in changed
        }
        return {**self.snapshots[target], **survives}

    def keys_of_states(self: Any) -> Set[str]:
        """The keys of this container that its states may change."""
        found: Set[str] = set()
        for part in self.children():
            remapping = self.plan.remappings.get(part.label, {})
            found.update(remapping.get(key, key) for key in getattr(part.plan, 'writes', part.keys))
        return found

    def missing(self: Any, label: str) -> Tuple[str, ...]:
        """Input keys of a state that are not there."""
        part: Part = self.child(label)
        keys: List[str] = list(getattr(part.plan, 'reads', part.keys))
        remapping = self.plan.remappings.get(label, {})
        return tuple(sorted(key for key in keys if remapping.get(key, key) not in self.userdata))

    def go_to_place(self: Any, failed: str, path: str, label: str, written: Set[str]) -> Way:
        """Go to a place of the tree."""
        goal = self.run.goal_of(self, path, label)
        if goal.machine is not self:
            raise self.run.depart(self, goal)
        return self.jump(failed, goal._replace(written=written))

    def _note_begins(self: Any, goal: Goal) -> None:
        self.run.let_go_on(self, goal.label)
        for path, label in goal.begins.items():
            machine = self.run.machine(path)
            machine.begins_in = label
            self.run.let_go_on(machine, label)

    def failed_as(self: Any, label: str, ending: Optional[Way]) -> Optional[Failed]:
        """The failure of its own state that ends so, None where it has none."""
        if ending is None:
            return Failed(label, 'EXCEPTION', '', None, None)
        return self.failure_of(label, ending.target, False)

    def decide_tentatively(self: Any, outer: Failed) -> Course:
        """What this oracle would decide if its state, the container below, had failed."""
        memory = self.memory
        continuous = memory.is_continuous(self.run.plan.policy, outer.label)
        kept = memory.keep()
        memory.fails(outer.label)
        decision = yield from self.decide(outer.label, continuous)
        memory.put_back(kept)
        return decision

    def follow_from_below(self: Any, label: str, goal: Goal) -> Course:
        """A jump has left the state of that label and has come here."""
        yield from ()
        self.child(label).recall_preempts()
        if goal.gives_up is not None:
            self.memory.ended(label, 'preempted')
            self.tell('TRANSITION', label, self.child(label).left_with, ORACLE)
            self.tell('GIVE_UP', label, goal.gives_up)
            self.settled = True
            return Way(goal.gives_up, False)
        if goal.failed is None:
            self.memory.ended(label, 'preempted')
        else:
            failed = self.failure_of(label, self.child(label).left_with, False)
            if failed is not None and not self.author_recovers(failed):
                self.note_end(failed)
        self.tell('TRANSITION', label, self.child(label).left_with, ORACLE)
        told = set(goal.repeats)
        if self.run.is_closed(goal) or (set(self.run.repeats.repeated_by(self, goal.label)) - told):
            return self._ask_on_arrival(label)
        return self.jump(label, goal._replace(crosses=True))

    def _ask_on_arrival(self: Any, label: str) -> Way:
        """The place has closed, or something was done meanwhile: ask again, here."""
        failing = failing_outcome_of(self.plan.outcomes)
        failed = Failed(
            label, 'TIME_LIMIT', '', None, failing and Way(failing, False), was_left=True
        )
        reply = self._ask_expert(failed, set())
        return self._fall_back(failed, set()) if reply is None else self._obey(failed, reply, set())
