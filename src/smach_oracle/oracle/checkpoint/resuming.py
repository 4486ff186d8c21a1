"""Sets a tree to where a stored trial stood, so that its execution goes on from there."""

import time
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple, cast

import smach
from smach_oracle.store.names import BEFORE, ENDED, FAILED, IN
from smach_oracle.store.rows import StoredTrial

from ..branches.wrapper import wrapper_of, wrappers_in
from ..errors import SettingsError
from ..machine.items import can_be_indexed
from ..machine.nesting import branching_below, children_of, nodes_of
from ..machine.places import JumpPath, TreePlace, jump_path_to, place_named, places_of
from ..machine.repeats import begin_once_more, leave_unconfirmed, why_held_back
from ..machine.resumed import NOT_BEGUN, Unfinished
from ..machine.site import outcome_told
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode, node_of
from ..records.events import FailureKind
from ..records.facts import LAST_SEQ
from ..records.running_goals import GOALS
from ..settings.failure_rule import RULE, FailureRule
from ..settings.settings import ALLOW, GROUPS
from ..smach_private import data_of, initial_label_of, set_current_label, states_of, transitions_of
from .checkpointer import SEQ_RESERVE, must_stop
from .stored_marks import Marks
from .stored_tree import StoredContainer, StoredTree
from .structure import ChangedScript

STOPPED = 'the program was stopped while it ran: nobody knows whether it was done'
PAUSED = '{}: is paused, as before its program was stopped'
GONE = 'the program was stopped at {}, which is not there any more'


class Resumption(NamedTuple):
    """A trial that goes on."""

    trial: StoredTrial
    tree: StoredTree
    moment: int  # number of the one that it goes on from
    seq: int  # of the last event that is stored
    at: float  # s since the epoch, when that was
    asks: bool  # a person is asked before anything moves
    script: ChangedScript  # how the script differs from the one that was stopped
    marks: Marks  # of the states that have begun
    is_in_doubt: bool  # whether states may have run that are not stored
    is_earlier: bool  # whether later moments of the trial are stored
    rule: Optional[FailureRule]  # by which its failures were told, None: not known
    begins_at: str = ''  # path of a state to which it is sent, '': it goes on where it was

    @property
    def age_s(self) -> float:
        """Return how long ago that was, s."""
        return max(0.0, time.time() - self.at)


def tell_resumed(top: TreeNode, resumption: Resumption) -> Dict[str, object]:
    """Say that a trial goes on, and return what its RESUMED has.

    What has run until its program was stopped is ended before.
    """
    smach.logwarn(
        '{}: trial {} goes on{}; its program was stopped {:.0f} s ago'.format(
            top.path,
            resumption.trial.trial_id,
            ' from moment {}'.format(resumption.moment) if resumption.is_earlier else '',
            resumption.age_s,
        )
    )
    rule = top.in_force.rule
    if resumption.rule not in (None, rule):
        smach.logwarn(
            '{}: failures are told {} from now on, and were told {} before'.format(
                top.path, rule, resumption.rule
            )
        )
    for change in resumption.script.changes:
        smach.logwarn('{}: the script has changed: {}'.format(top.path, change))
    for old, new in resumption.script.names.items():
        smach.logwarn('{}: goes on with {} as {}'.format(top.path, old, new))
    if top.tree.control.paused:
        smach.logwarn(PAUSED.format(top.path))
    _end_goals(top, resumption)
    return {
        LAST_SEQ: resumption.seq,
        'moment': resumption.moment,
        'stopped_s': round(resumption.age_s, 3),
        'changes': resumption.script.changes,
        RULE: rule.as_data(),
    }


def _end_goals(top: TreeNode, resumption: Resumption) -> None:
    """End what the program that was killed has left running, before anything is sent."""
    goals = resumption.tree.goals
    if not goals:
        return
    smach.logwarn(
        '{}: the program was killed while {} ran: cancelled, and waited for'.format(
            top.path, ', '.join('a goal of {}'.format(server) for server in sorted(goals.values()))
        )
    )
    for goal_id, server in GOALS.end_goals(goals, lambda: must_stop(top)).items():
        smach.logwarn('{}: a goal of {} may still run'.format(top.path, server))
        GOALS.keep(goal_id, server)


class EntryPoint:
    """The place where one container goes on. It is used up when that begins to execute."""

    def __init__(
        self, node: TreeNode, stored: StoredContainer, down: Sequence[TreePlace] = ()
    ) -> None:
        """`down`: the states in which the containers below begin, where it is sent to one."""
        self._node, self._stored, self._down = node, stored, tuple(down)

    @property
    def label(self) -> str:
        """Return the state in which it goes on."""
        return self._stored.label

    def take_over_records(self) -> None:
        """Have the visits of the execution that was stopped."""
        node, stored = self._node, self._stored
        if stored.history:
            visits, states = stored.visits, states_of(node.machine)
            for number, visit in enumerate(visits):
                if node.has(visit.state):
                    outcomes = states[visit.state].get_registered_outcomes()
                    visits[number] = visit._replace(outcome=outcome_told(outcomes, visit.outcome))
            node.records.history.take_over(
                visits, stored.visits_of_execution, stored.history, node.has
            )

    def enter(self) -> None:
        """Have the userdata as it was, and the state in which it goes on as the current one."""
        node, stored = self._node, self._stored
        data = data_of(node.machine.userdata)
        stored.put_into(data)
        for key, why in sorted(stored.missing.items()):
            node.warn(
                'userdata key {!r} {}'.format(
                    key,
                    'has the value that the script gives it, as {}'.format(why)
                    if key in data
                    else 'is missing, as ' + why,
                )
            )
        for label, snapshot in stored.snapshots.items():
            if node.has(label):
                node.record(label).snapshot = snapshot
        set_current_label(node.machine, stored.label)
        if self._down:
            node.record(stored.label).go_down(self._down)


def forget_resumed(node: TreeNode) -> None:
    """Let all that is in a container begin from the start.

    To be called as the container is sent elsewhere. What was to go on there may not have begun.
    """
    if node.tree.is_resumed:
        _forget(node)


def _forget(node: TreeNode) -> None:
    resumed = node.tree.resumed
    for each in nodes_of(node.machine):
        if each is not node:
            resumed.forget(each.records)
        resumed.forget_states(each.records)
        for _, container in branching_below(each.machine):
            wrapper = wrapper_of(container)
            if wrapper is not None:
                wrapper.forget_resumed()


def go_on(top: TreeNode, resumption: Resumption) -> None:
    """Set every container of the tree to where it was.

    It is to be called once the trial has begun.
    """
    _forget(top)  # of an execution before that has ended early
    nodes = nodes_of(top.machine)
    for node in nodes:
        stored = resumption.tree.container(node.key)
        for label, told in stored.states.items():
            if node.has(label):
                record = node.record(label)
                record.restore({**told['learned'], **stored.ways.get(label, {})})
                record.shared = told.get('shared', record.shared)
                record.go_on(told['counts'], told['longest_s'])
        if stored.history:
            node.records.history.take_over((), 0, stored.history, node.has)
        node.records.streaks.take_over(stored.streaks)
    _keep_start(top, nodes, resumption.tree)
    latest = take_over_marks(nodes, resumption.marks, resumption.is_in_doubt)
    top.tree.go_on_counting(latest, resumption.tree.whole)
    top.events.go_on_behind(resumption.seq + SEQ_RESERVE)
    stood = resumption.tree.container(top.key)
    way = _jump_path_named(top, resumption.begins_at) if resumption.begins_at else None
    if way is not None:
        stood.at = [way.first_label, BEFORE]
    elif stood.sent is not None:
        sent_to = stood.moved_to or stood.jumped_to
        way = jump_path_to(top, place_named(top, sent_to[len(top.path) + 1 :] or stood.label))
    if way is not None:
        leave_unconfirmed(top, way.first_label)
    let_repeat(top, top.settings.resume_repeat, stood.sent)
    setting = _Setting(resumption, nodes)
    if resumption.begins_at and way is not None:
        top.tree.resumed.enter_at(top.records, EntryPoint(top, stood, way.entered_places[1:]))
        setting.ask_at(way.entered_places)
    elif stood.sent is not None and way is None:  # where it was sent to is gone
        setting.ask_at_beginning(top, stood, stood.jumped_to or stood.label)
    else:
        setting.set_container(top)


def _keep_start(top: TreeNode, nodes: Sequence[TreeNode], tree: StoredTree) -> None:
    """Have the userdata of the start, to which a policy may put the machine back.

    A key that is not stored has the value that the script gives it now.
    """
    restarts = top.tree.restarts
    if restarts.is_due and tree.container(top.key).begun:
        restarts.keep(
            {
                node: node.snapshot(
                    {**data_of(node.machine.userdata), **tree.start.get(node.key, {})}
                )
                for node in nodes
                if node.site.is_container
            }
        )


def take_over_marks(nodes: Sequence[TreeNode], marks: Marks, in_doubt: bool) -> int:
    """Have the marks of a stored trial, and return the number of the latest visit.

    `in_doubt`: any guarded state may have run that the store does not know of.
    """
    by_key = {node.key: node for node in nodes}
    for (path, label), mark in marks.items():
        node = by_key.get(path)
        if node is not None and (mark.done or mark.reached) and label in node.labels():
            node.record(label)  # of a state that only a precondition has run, too
            node.records.marks[label] = mark
    for place in (TreePlace(node, label) for node in nodes if in_doubt for label in node.labels()):
        if place.node.settings_of(place.label).on_retry != ALLOW:
            place.node.record(place.label)
            unknown = place.node.records.marks[place.label]
            unknown.done = unknown.spent = True
    return max((max(mark.reached, mark.executed) for mark in marks.values()), default=0)


def let_repeat(top: TreeNode, paths: Sequence[str], by_command: Optional[Sequence[str]]) -> None:
    """Let states begin once more, as a person has said, in the settings or by oracle_state.

    :raises SettingsError: for a state of the settings that is not there.
    """
    for path in [*paths, *(by_command or ())]:
        place = place_named(top, path, at_rest=True)
        if place is None and path in paths:
            raise _names_no_state('resume_repeat', path, top)
        if place is not None:
            begin_once_more(place.node, place.label)
            smach.logwarn(
                '{}: may be repeated once, as somebody has said (--repeat {})'.format(
                    place.path, path
                )
            )


def _jump_path_named(top: TreeNode, path: str) -> JumpPath:
    """Return the way to a state that the settings, or oracle_state, name.

    :raises SettingsError: where there is no such state.
    """
    way = jump_path_to(top, place_named(top, path))
    if way is None:
        raise _names_no_state('on_resume', 'state:' + path, top)
    return way


def _names_no_state(setting: str, value: str, top: TreeNode) -> SettingsError:
    allowed = 'the label of a state of {}, or the path of one below it'.format(top.path)
    return SettingsError(GROUPS.key_of(setting), value, allowed)


class _Setting:
    """Sets the containers that ran to where they were."""

    def __init__(self, resumption: Resumption, nodes: List[TreeNode]) -> None:
        self._resumption, self._nodes = resumption, nodes
        self._resumed = nodes[0].tree.resumed

    def activate(self, node: TreeNode) -> None:
        """Set a container that was under way, and what is in its state."""
        stored = self._resumption.tree.container(node.key)
        key = '/'.join((node.key, stored.label))
        if stored.phase == IN and all(one.key != key for one in self._nodes):
            moved = self._resumption.tree.container(key)  # the container that was left is gone
        else:
            moved = stored
        if moved.moved_to:
            self._go_on_elsewhere(node, moved)
            return
        if not node.has(stored.label):
            self.ask_at_beginning(node, stored, stored.label)
            return
        if node.site.is_container:
            self._resumed.enter_at(
                node.records, EntryPoint(node, stored, self._way_down(node, stored))
            )
        record = node.record(stored.label)
        self._reopen(record, stored)
        if stored.phase == FAILED or self._resumed.has_question(record):
            self._resumed.go_on_with(record, self._unfinished(node, stored))
        elif stored.phase == IN:
            self._go_on_in(node, stored, record)
        else:
            self.ask_at([TreePlace(node, stored.label)])

    def _reopen(self, record: StateRecord, stored: StoredContainer) -> None:
        """Have the question about a state, if one was open, go on as the same one."""
        asked = stored.asked
        if asked and asked[0] == record.label:
            # one of an earlier moment may have been answered since: it is asked again
            self._resumed.reopen(record, '' if self._resumption.is_earlier else asked[1])

    def _go_on_in(self, node: TreeNode, stored: StoredContainer, record: StateRecord) -> None:
        """Set what is in a state that was under way, or say that it is in doubt."""
        inside = self._inside(node, stored.label)
        if inside is None:
            self._resumed.go_on_with(record, self._unfinished(node, stored))
            return
        for path, wrapper in wrappers_in(node, stored.label):
            if self._has_begun(path):
                wrapper.resume(self._resumption.tree.container(path))
        asked = [self.set_container(each) for each in inside]
        if self._resumption.asks and not any(asked):
            # before the next item of an Iterator, or a state of the container or of one above it
            around = [node, *node.around()]
            passes = [TreePlace(node, stored.label)]
            passes += (
                TreePlace(each.parent, each.labels_from_parent[0])
                for each in around
                if each.parent is not None
            )
            self._resumed.ask_before_next(
                [each.records for each in around + inside],
                _why(self._resumption),
                [each.node.record(each.label) for each in passes],
            )

    def _way_down(self, node: TreeNode, stored: StoredContainer) -> Sequence[TreePlace]:
        """Return the rest of a jump: below, nothing has begun yet. Empty for no jump."""
        tree, state = self._resumption.tree, '{}/{}/'.format(node.key, stored.label)
        jumped_to = next((each for each in places_of(node) if each.path == stored.jumped_to), None)
        way = jump_path_to(node, jumped_to)
        down = way.entered_places[1:] if way is not None else ()
        # the jump led to the first item of an Iterator
        has_begun = any(tree.container(place.node.key).phase for place in down) or any(
            told.item > 1 for key, told in tree.containers.items() if (key + '/').startswith(state)
        )
        return () if stored.phase == IN and has_begun else down

    def _has_begun(self, path: str) -> bool:
        """Whether anything has run in a Concurrence or Iterator, in its present execution."""
        tree = self._resumption.tree
        return bool(tree.container(path).item) or any(
            told.phase for key, told in tree.containers.items() if key.startswith(path + '/')
        )

    def set_container(self, node: TreeNode) -> bool:
        """Set the machine, or a container in a state that was under way.

        :returns: whether a person is asked in it before anything moves, where that is wanted.
        """
        stored = self._resumption.tree.container(node.key)
        if stored.phase == ENDED:
            outcomes = node.machine.get_registered_outcomes()
            outcome = outcome_told(outcomes, stored.label)
            if outcome in outcomes:
                self._resumed.had_ended(node.records, outcome)
                return False
            self.ask_at_beginning(node, stored, 'outcome ' + stored.label)
        elif stored.phase:
            self.activate(node)
        else:
            self._ask_before(node, initial_label_of(node.machine))
        return True

    def _go_on_elsewhere(self, node: TreeNode, stored: StoredContainer) -> None:
        """Send the machine to where the state stands now that was under way in a container."""
        top = node.top()
        moved_to = next((each for each in places_of(top) if each.path == stored.moved_to), None)
        way = jump_path_to(top, moved_to)
        # others may run next to it, which would be left
        if way is None or node.runs_beside_others():
            self.ask_at_beginning(node, stored, stored.label)
            return
        stood = self._resumption.tree.container(top.key)
        stood.at, at = [way.first_label, BEFORE], stored.at_there
        self._resumed.enter_at(top.records, EntryPoint(top, stood, way.entered_places[1:]))
        there, place = StoredContainer(at), way.place
        record = place.node.record(place.label)
        self._reopen(record, stored)
        if there.phase == IN:
            self._go_on_in(place.node, there, record)
        elif there.phase == FAILED or self._resumption.asks:
            self._resumed.go_on_with(record, self._unfinished(place.node, there))

    def ask_at_beginning(self, node: TreeNode, stored: StoredContainer, gone: str) -> None:
        """Have a person asked before a container begins that stood where it cannot go on."""
        labels, initial = list(node.labels()), initial_label_of(node.machine)
        if not labels:
            return  # it may add them as it is executed
        label = initial if initial in labels else labels[0]
        stored.at, stored.asked = [label, BEFORE], []
        if node.site.is_container:
            self._resumed.enter_at(node.records, EntryPoint(node, stored))
        self._interrupt(node, label, GONE.format(gone))

    def ask_at(self, down: Sequence[TreePlace]) -> None:
        """Have a person asked at states that are not to come again, or where nothing is to move."""
        for node, label in down:
            why = why_held_back(node, node.record(label))
            if why and node.tree.numbers_visits:
                self._resumed.go_on_with(
                    node.record(label), Unfinished(FailureKind.HELD_BACK, '', why, why, keeps=True)
                )
        self._ask_before(*down[-1])

    def _ask_before(self, node: TreeNode, label: str) -> None:
        """Have a person asked before a state that had not begun, where nothing is to move."""
        if self._resumption.asks and node.has(label):
            self._interrupt(node, label, NOT_BEGUN)

    def _interrupt(self, node: TreeNode, label: str, text: str) -> None:
        """Have a person asked in place of the coming visit of a state."""
        self._resumed.go_on_with(
            node.record(label),
            Unfinished(FailureKind.INTERRUPTED, '', text, _why(self._resumption), keeps=True),
        )

    def _unfinished(self, node: TreeNode, stored: StoredContainer) -> Unfinished:
        is_open = self._resumed.has_question(node.record(stored.label))
        why = _why(self._resumption) if self._resumption.asks or is_open else ''
        # a branch has the userdata of the Concurrence or Iterator that holds it
        snapshots = self._resumption.tree.container(node.path).snapshots
        kind, outcome, text = FailureKind.INTERRUPTED, '', STOPPED
        if stored.phase == FAILED:
            number, told, text = cast('Tuple[int, str, str]', stored.at[2:5])
            drawn = transitions_of(node.machine).get(stored.label, {})
            outcome = outcome_told(drawn, told)
            if outcome != '' and outcome not in drawn:
                outcome, text = '', GONE.format('outcome ' + outcome)
            else:
                kind = FailureKind(number)
        else:
            node.records.marks[stored.label].spent = True  # it may have been done
        snapshot = snapshots.get(stored.label)
        return Unfinished(kind, outcome, text, why, snapshot, self._resumption.asks)

    def _inside(self, node: TreeNode, label: str) -> Optional[List[TreeNode]]:
        """Return the containers directly in a state, or None where it can only go on as a whole."""
        inside = [
            each
            for each in self._nodes
            if each.parent is node and each.labels_from_parent[0] == label
        ]
        state = states_of(node.machine).get(label)
        return inside if inside and _is_wrapped_through(state) else None


def _is_wrapped_through(state: object) -> bool:
    """Whether each plain state in it has an oracle of its own, so that each is told of."""
    if isinstance(state, smach.StateMachine):
        return node_of(state) is not None
    wrapper = wrapper_of(state)
    return (
        wrapper is not None
        and all(
            label in wrapper.branches or _is_wrapped_through(inner)
            for label, inner in children_of(wrapper.container).items()
        )
        and (not isinstance(state, smach.Iterator) or can_be_indexed(state))
    )


def _why(resumption: Resumption) -> str:
    told = 'the program was stopped {:.0f} s ago'.format(resumption.age_s)
    changes = resumption.script.changes
    if changes:
        told += ', and the script has changed since: ' + '; '.join(changes)
    return told
