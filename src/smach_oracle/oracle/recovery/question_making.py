"""Makes a question of a failure, with everything that an expert needs (paper, section V)."""

from typing import Collection, Dict, List, Mapping, Optional, Sequence, Tuple

import smach
from smach_common.foreign import repr_of

from ..asking.answer_rules import Target
from ..asking.question import (
    LevelOutcome,
    PreconditionProbe,
    PreconditionStatus,
    Question,
    StateChoice,
)
from ..decision.ways import Evidence, key_of, way_in_words
from ..identity import truth_of
from ..machine.places import (
    JumpPath,
    TreePlace,
    levels_above,
    links_to,
    missing_on,
    name_of,
    place_named,
)
from ..machine.userdata import UserdataGate, behind
from ..records.short_text import shortened
from ..records.visits import VisitResult
from ..settings.preconditions import PreconditionKind, PreconditionSpec
from ..settings.settings import GROUPS
from ..smach_private import data_of, remapping_of, states_of
from .falling_back import fallback_in_words
from .options import choices_on, places_on
from .recovery import Recovery
from .verdict import streak_of

RECOMMENDED = 'it has helped {} of {} times after such a failure'


def make_question(recovery: Recovery, deadline_s: float) -> Question:
    """Return a new question about a failure. `deadline_s`: seconds left. 0 waits without end.

    No interface can do the work of a state that still runs, and no function of a user's is called
    meanwhile.
    """
    node, record, failure = recovery.node, recovery.record, recovery.failure
    machine, still_runs = node.machine, failure.still_runs
    state, streak = states_of(machine)[record.label], streak_of(node, record)
    return Question(
        question_id=node.tree.resumed.take_question(record) or node.tree.next_question_id(),
        trial_id=node.tree.trial_id,
        container_path=node.path,
        failed_state=record.label,
        failure_kind=failure.kind,
        outcome=failure.outcome,
        text=failure.text,
        failure_class=int(record.failure_class),
        rate=record.rate,
        continuous=recovery.occasion.continuous,
        recoveries=record.recoveries,
        reason=recovery.cause,
        tried=(*map(way_in_words, () if streak is None else streak.tried), *recovery.tried),
        history=node.records.history.latest(),
        choices=tuple(_state_choices(recovery)),
        supersede_outcomes=node.site.choices(record.label),
        output_keys=tuple(sorted(state.get_registered_output_keys())),
        give_up_outcomes=_outcomes_of(machine),
        interfaces=() if still_runs else node.settings.offers_for(node.relative_path, record.label),
        userdata=dict(data_of(machine.userdata)),
        input_userdata=_inputs(machine, record.label, state),
        deadline_s=deadline_s,
        fallback=fallback_in_words(recovery),
        preconditions=None if still_runs else LivePreconditionProbe(recovery),
        give_up_above=tuple(
            LevelOutcome(level.path, outcome)
            for level in levels_above(node)
            for outcome in _outcomes_of(level.machine)
        ),
    )


def targets_of(recovery: Recovery) -> Mapping[Target, str]:
    """Return where the machine could go, and why it cannot go there now, '' where it can."""
    return {_target(recovery, each.jump_path.place): each.closed for each in places_on(recovery)}


def _target(recovery: Recovery, place: TreePlace) -> Target:
    return '' if place.node is recovery.node else place.node.path, place.label


def _state_choices(recovery: Recovery) -> Sequence[StateChoice]:
    """Return the choices, and recommend the one that has helped most of the time, if one has.

    That one can be entered now, repeats nothing that is not to be repeated, was tried twice or
    more, and was not in vain just before.
    """
    node, record = recovery.node, recovery.record
    written: Collection[str] = () if recovery.failure.still_runs else recovery.watch.written()
    evidence = Evidence(record.ways_so_far(), recovery.failure_key)
    streak = streak_of(node, record)
    choices: List[StateChoice] = []
    shares: List[float] = []  # by which one is recommended
    for each, way in choices_on(recovery):
        jump_path, place = each.jump_path, each.jump_path.place
        container, label = _target(recovery, place)
        there, key = place.node.record(label), key_of(name_of(place, node), record.label)
        known = evidence.of_way(key)
        choice = StateChoice(
            label,
            1.0 - there.rate,
            int(there.failure_class),
            there.visits,
            missing_on(jump_path, () if jump_path.left_containers else written),
            tuple(spec.name for spec in there.settings.preconditions),
            each.closed,
            each.repeats,
            container,
            _running_again(jump_path),
            '' if way is None else way.key,
            0.0 if way is None else way.minutes,
            known.helped,
            known.tried,
            60.0 * known.minutes,
        )
        is_in_vain = streak is not None and key in streak.tried
        has_helped = known.tried > 1 and 2 * known.helped > known.tried
        is_possible = has_helped and not (is_in_vain or each.closed or each.repeats)
        choices.append(choice)
        shares.append(known.share if is_possible else 0.0)
    if any(shares):
        best = shares.index(max(shares))
        text = RECOMMENDED.format(choices[best].helped, choices[best].tried)
        choices[best] = choices[best]._replace(recommended=text)
    return choices


def _outcomes_of(machine: smach.StateMachine) -> Tuple[str, ...]:
    return tuple(sorted(machine.get_registered_outcomes(), key=str))


def _inputs(machine: smach.StateMachine, label: str, state: smach.State) -> Dict[str, object]:
    data, remapping = dict(data_of(machine.userdata)), remapping_of(machine, label)
    return {
        key: data[remapping.get(key, key)]
        for key in state.get_registered_input_keys()
        if remapping.get(key, key) in data
    }


# -- Concurrences and Iterators


def _running_again(way: JumpPath) -> Tuple[str, ...]:
    """Return the branches that would all run again if the machine went a way.

    They are those of the outermost Concurrence that is entered, be it the place or on the way down.
    """
    last = way.place
    entered: List[smach.State] = [
        link.inner_container for below in way.entered_places[1:] for link in links_to(below.node)
    ]
    for each in (*entered, states_of(last.node.machine)[last.label]):
        if isinstance(each, smach.Concurrence):
            return tuple(map(str, each.get_children()))
    return ()


# -- how the preconditions of the choices stand


_LAST = {
    VisitResult.SUCCESS: 'succeeded',
    VisitResult.FAILURE: 'failed',
    VisitResult.SUPERSEDED: 'was superseded',
    VisitResult.PREEMPTED: 'was preempted',
}


class LivePreconditionProbe(PreconditionProbe):
    """The preconditions of one question's choices.

    Only a callable, and the check of a pair where it is one, can be asked without bringing anything
    about. A state is never run for it. A user's callable may take forever, so `status` is called in
    threads that nobody waits for. What a callable writes into the userdata is dropped.
    """

    def __init__(self, recovery: Recovery) -> None:
        node = self._node = recovery.node
        self._gate = UserdataGate(node.machine)
        self._gate.shut()
        self._specs: List[PreconditionSpec] = []
        names: List[Tuple[str, str]] = []
        for label in node.labels():
            for spec in node.record(label).settings.preconditions:
                self._specs.append(spec)
                names.append((label, spec.name))
        self.names = tuple(names)

    def status(self, number: int) -> PreconditionStatus:
        """Return how the precondition of that number stands now.

        It calls a user's function, which may take forever.
        """
        spec = self._specs[number]
        if not self._node.settings.watch_preconditions:
            return PreconditionStatus(None, GROUPS.key_of('watch_preconditions') + ' is off')
        if spec.kind is not PreconditionKind.PAIR:
            return self._of(spec)
        check, achieve = spec.target
        found = self._of(check)
        if found.holds is not False:
            return found
        return found._replace(text='{}; {} would bring it about'.format(found.text, achieve.name))

    def _of(self, spec: PreconditionSpec) -> PreconditionStatus:
        name = spec.name
        if spec.kind is PreconditionKind.LABEL:
            return PreconditionStatus(
                None, 'only running {} would tell{}'.format(spec.target, self._last(spec.target))
            )
        if spec.kind is not PreconditionKind.CALLABLE:
            return PreconditionStatus(None, 'only running {} would tell'.format(name))
        try:
            result = spec.target(behind(self._gate))
        except Exception as err:
            return PreconditionStatus(None, '{} raised {}'.format(name, repr_of(err)))
        if result is None:
            return PreconditionStatus(None, '{} returned None; True is met'.format(name))
        text = shortened('{} returned {}'.format(name, repr_of(result)), 300)
        return PreconditionStatus(truth_of(result), text)

    def _last(self, name: str) -> str:
        place = place_named(self._node, name)
        if place is None:
            return ''
        visits = reversed(place.node.records.history.latest())
        last: Optional[VisitResult] = next(
            (visit.result for visit in visits if visit.state == place.label), None
        )
        return '; its last visit ' + _LAST[last] if last is not None else ''
