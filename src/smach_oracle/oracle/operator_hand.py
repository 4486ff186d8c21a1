"""The operator's hand on a running machine: the commands of a person, and the replies.

Stopping, pausing and letting go are never refused. Whatever lets a machine go on says what will
run.
"""

from typing import List, Mapping, NamedTuple, Sequence, Tuple

import smach
from smach_common.foreign import repr_of

from .control.control import Control, HeldPlace, Hold, Jump
from .errors import OperatorError, SettingsError, TrialError
from .execution.jump_entry import Prospect, jump_path_for, prospect_of
from .machine.nesting import nodes_of
from .machine.places import TreePlace
from .machine.repeats import note_initial
from .machine.tree_node import TreeNode, node_of
from .records.events import EventKind
from .recovery.stop import is_asked_around
from .settings.names import PathPattern
from .settings.settings import AUTONOMY_LEVELS
from .smach_private import current_label_of, is_executing


class ActiveState(NamedTuple):
    """A state that runs, or that a running container is about to enter."""

    path: str  # of the container
    state: str
    held_by: str  # 'paused', 'breakpoint' or 'confirm' where the container waits before it, else ''
    waits_for_confirmation: bool


class HandStatus(NamedTuple):
    """The status of a machine under an operator's hand: where it stands, and what is set."""

    path: str  # of the top machine
    running: bool
    paused: bool
    paused_by: str
    active: Tuple[ActiveState, ...]
    breakpoints: Tuple[str, ...]  # patterns
    autonomy: Mapping[str, str]  # that was set at run time: level by pattern
    # still to be made: state, with its path where that is another one, by path of the container
    jumps: Mapping[str, str]


class OperatorHand:
    """A person's commands for one tree of machines. Safe to use from several threads.

    Each command returns its effect as a sentence, and publishes it as an event. `by` is the name
    of the operator. A machine that was unwrapped meanwhile obeys none: each raises OperatorError.
    Wrapped once more it obeys again.

    >>> import smach
    >>> from smach_oracle.oracle import OperatorHand, OracleContainer
    >>> sm = smach.StateMachine(['succeeded'])
    >>> with sm:
    ...     _ = smach.StateMachine.add(
    ...         'PICK', smach.CBState(lambda userdata: 'succeeded', outcomes=['succeeded'])
    ...     )
    >>> hand = OperatorHand(OracleContainer.wrap(sm, name='task'))
    >>> hand.pause(by='eva')
    'task does not run; it will wait before its first state'
    >>> hand.status().paused, hand.status().paused_by
    (True, 'eva')
    >>> hand.resume(by='eva')
    'task does not run; it will not wait'
    >>> hand.set_breakpoint('PICK', by='eva')
    'task pauses before task/PICK'
    """

    def __init__(self, machine: object) -> None:
        """Be the hand on the tree to which a wrapped machine belongs.

        :raises TrialError: for a machine that is not under an oracle.
        """
        if node_of(machine) is None:
            raise TrialError('{!r} is not under an oracle'.format(machine))
        self._machine = machine

    @property
    def _node(self) -> TreeNode:
        """Return the node of the machine, which may have been unwrapped and wrapped since.

        :raises OperatorError: where it has no oracle any more.
        """
        node = node_of(self._machine)
        if node is None:
            raise OperatorError(
                '{!r} is not under an oracle any more: it obeys no command'.format(self._machine)
            )
        return node

    @property
    def _top(self) -> TreeNode:
        return self._node.top()

    @property
    def control(self) -> Control:
        """Return what is asked of the tree."""
        return self._top.tree.control

    # -- what is never refused

    def pause(self, by: str = '') -> str:
        """Hold every container at its next state boundary. What runs now runs to its end."""
        self.control.pause(by)
        return self._told('pause', self._how_it_pauses(), by)

    def resume(self, by: str = '') -> str:
        """Lift the pause."""
        held = self.control.resume()
        return self._told('resume', self._what_goes_on(held), by)

    def preempt(self, by: str = '') -> str:
        """Ask the machine to stop, and lift the pause: what waits ends at once, preempted."""
        top = self._top
        running = self._running()
        text = '{} is asked to stop'.format(', '.join(each.path for each in running))
        with top.tree.control.stop():
            if not running:
                text = '{} does not run'.format(top.path)
                if top.tree.control.paused:
                    text += '; its pause is lifted'
            for each in running:
                try:
                    each.machine.request_preempt()
                except Exception as err:  # it is the user's
                    text += ', and its request_preempt failed: {}'.format(repr_of(err))
        return self._told('preempt', text, by)

    # -- one state at a time

    def step(self, path: str = '', by: str = '') -> str:
        """Let what waits enter one state each, also what waits for a confirmation.

        The machine is paused from now on.

        :param path: of the container, as in events. '' means every one.
        :raises OperatorError: where nothing waits there. The machine is paused nevertheless, but
            not where there is no such container.
        """
        self._nodes_at(path)
        control = self.control
        was_paused = control.paused
        control.pause(by)
        held = control.step(path)
        if held:
            return self._told('step', _runs(held), by, path)
        where = ' in ' + path if path else ''
        text = 'nothing waits{}. {}'.format(where, self._how_it_pauses())
        raise OperatorError(text if was_paused else self._told('pause', text, by))

    def confirm(self, path: str = '', by: str = '') -> str:
        """Confirm the states before which containers wait for that.

        :param path: of the container, as in events. '' means every one.
        :raises OperatorError: where none waits for it.
        """
        held = self.control.confirm(path)
        if not held:
            raise OperatorError(
                '{} waits for a confirmation'.format('nothing in ' + path if path else 'nothing')
            )
        text = _runs(held)
        if self.control.paused:
            text += ' once it is resumed'
        return self._told('confirm', text, by, path)

    # -- elsewhere

    def go_to(
        self,
        path: str,
        state: str,
        by: str = '',
        confirm_repeats: bool = False,
        written: Sequence[str] = (),
    ) -> str:
        """Send the machine to a state, at the next state boundary of the state's container.

        Where that does not run, the innermost container around it that runs goes to it, and those
        below begin in the states that lead there. Where none runs, the state's container begins
        there from now on.

        :param path: of the container, as in events. '' means the top machine.
        :param confirm_repeats: states that are not to be repeated by themselves may be.
        :param written: userdata keys that were written for it.
        :raises OperatorError: where there is no such container or state, where it cannot be
            entered now, and where an unconfirmed state may be repeated.
        """
        found = self._nodes_at(path)
        node = next((each for each in found if state in each.labels()), found[0])
        place = TreePlace(node, state)
        prospect = prospect_of(place, tuple(written))
        if prospect.why_not:
            raise OperatorError(prospect.why_not)
        if prospect.repeats and not confirm_repeats:
            raise OperatorError(
                'going to {} may repeat {}: confirm that it may'.format(
                    state, ', '.join(prospect.repeats)
                )
            )
        sent = jump_path_for(place).meeting_node
        if is_executing(sent.machine):
            text = self._ask_jump(
                sent,
                Jump(
                    state,
                    by,
                    '',
                    prospect.repeats,
                    tuple(written),
                    '' if sent is node else node.path,
                    sent.machine.preempt_requested() or is_asked_around(sent),
                ),
            )
        else:
            node.machine.set_initial_state([state])
            text = '{} does not run; it will begin in {}'.format(node.path, state)
        return self._told('go_to', text + _in_spite_of(prospect), by, '/'.join((node.path, state)))

    def send(self, state: str, by: str, written: Sequence[str] = ()) -> bool:
        """Send this machine to a state for somebody who hears no answer, such as a viewer.

        A refusal is logged as a warning. `state`, `by` and `written` are those of `go_to`.
        """
        try:
            self.go_to(self._node.path, state, by, written=written)
        except OperatorError as err:
            text = 'is not sent to {} as {} wants: {}'.format(state, by or 'a viewer', err)
            node = node_of(self._machine)
            if node is None:
                smach.logwarn(text)
            else:
                node.warn(text)
            return False
        return True

    def begins_in(self, state: str) -> None:
        """Note that a viewer has this machine, which does not run, begin in a state.

        A state that is not repeated by itself is then asked about. Between two trials that changes
        nothing: what was done is forgotten as a trial begins.
        """
        note_initial(self._node, state)

    def _ask_jump(self, node: TreeNode, jump: Jump) -> str:
        control = self.control
        label = current_label_of(node.machine)
        is_held = any(hold.may_be_sent and hold.key == node.key for hold in control.holds())
        control.ask_jump(node.key, jump)
        if is_held:
            return '{} goes to {} instead of {}{}'.format(
                node.path, jump.named(), label, ', where it waits' if control.paused else ''
            )
        return '{} goes to {} once {} has ended'.format(node.path, jump.named(), label)

    # -- what is set

    def set_breakpoint(self, pattern: str, by: str = '') -> str:
        """Pause the tree before each state that is meant.

        :param pattern: LABEL or PATH/LABEL, with `*` and `**`.
        :raises OperatorError: where it cannot be read.
        """
        meant = _pattern(pattern)
        self.control.set_breakpoint(meant)
        return self._told(
            'set_breakpoint',
            '{} pauses before {}'.format(self._top.path, self._states_meant(meant)),
            by,
            meant.text,
        )

    def remove_breakpoint(self, pattern: str, by: str = '') -> str:
        """Remove a breakpoint. A pause that it caused stays.

        :raises OperatorError: where there is none of this pattern.
        """
        meant, control = _pattern(pattern), self.control
        if not control.remove_breakpoint(meant):
            raise OperatorError(
                'there is no breakpoint {}; there are: {}'.format(
                    meant.text, ', '.join(control.breakpoints()) or 'none'
                )
            )
        return self._told(
            'remove_breakpoint', 'the breakpoint {} is gone'.format(meant.text), by, meant.text
        )

    def set_autonomy(self, pattern: str, level: str, by: str = '') -> str:
        """Set the autonomy of states. The latest setting for a state applies.

        :param pattern: LABEL or PATH/LABEL, with `*` and `**`.
        :param level: 'run', 'announce' or 'confirm'. '' means as the settings say.
        :raises OperatorError: for another level, or a pattern that cannot be read.
        """
        meant = _pattern(pattern)
        if level and level not in AUTONOMY_LEVELS:
            raise OperatorError(
                'there is no autonomy {!r}; allowed: {}'.format(level, ', '.join(AUTONOMY_LEVELS))
            )
        self.control.set_level(meant, level)
        return self._told(
            'set_autonomy',
            'autonomy {} for {}'.format(level or 'as the settings say', self._states_meant(meant)),
            by,
            meant.text,
        )

    def _states_meant(self, pattern: PathPattern) -> str:
        found = [
            '/'.join((node.path, label))
            for node in nodes_of(self._top.machine)
            for label in node.labels()
            if pattern.matches(node.path, label)
        ]
        more = ', ...' if len(found) > 10 else ''
        return (
            ', '.join(found[:10]) + more
            if found
            else '{}, which is no state there now'.format(pattern.text)
        )

    # -- status

    def status(self) -> HandStatus:
        """Return how the machine stands, and what is set."""
        top, control = self._top, self.control
        jumps = {path: jump.named() for path, jump in control.jumps().items()}
        return HandStatus(
            top.path,
            bool(self._running()),
            control.paused,
            control.paused_by,
            tuple(self._active()),
            control.breakpoints(),
            control.levels(),
            jumps,
        )

    def _running(self) -> List[TreeNode]:
        """Return the containers whose trials run: the top machine, or nested ones by themselves."""
        return [
            node
            for node in nodes_of(self._top.machine)
            if node.machine.is_running() and not node.has_running_ancestor()
        ]

    def _active(self) -> List[ActiveState]:
        held = self.control.holds()
        at_boundary = {hold.key for hold in held if hold.may_be_sent}
        found = []
        for node in nodes_of(self._top.machine):
            label = current_label_of(node.machine)
            if is_executing(node.machine) and label and node.key not in at_boundary:
                found.append(ActiveState(node.path, label, '', False))
        return found + [
            ActiveState(
                hold.place.path, hold.place.state, hold.held_by.value, hold.waits_for_confirmation
            )
            for hold in held
        ]

    # -- words

    def _told(self, command: str, text: str, by: str, target: str = '') -> str:
        top = self._top
        smach.loginfo('{}: {}{}: {}'.format(top.path, command, ' by ' + by if by else '', text))
        if top.tree.trial_id:  # no event comes before the first one of a trial, nor behind its last
            top.emit(EventKind.OPERATOR_COMMAND, outcome=command, target=target, by=by, text=text)
        return text

    def _how_it_pauses(self) -> str:
        top = self._top
        if not self._running():
            return '{} does not run; it will wait before its first state'.format(top.path)
        waits = [_in_words(each) for each in self._active() if each.held_by]
        runs = self._what_runs()
        asks = [each.path for each in self._active() if self._is_oracle(each)]
        told = ['waits before ' + ', '.join(waits)] if waits else []
        if asks:
            told.append('the oracle is at work in ' + ', '.join(asks))
        if runs:
            told.append('runs to its end: ' + ', '.join(runs))
        return '{} is paused; {}'.format(top.path, '; '.join(told) or 'it waits at the next state')

    def _what_runs(self) -> List[str]:
        """Return the states that run, in words, except those within which others are active.

        A Concurrence or an Iterator is such a state too, the oracle's own is not.
        """
        active = self._active()
        around = [each.path + '/' for each in active]
        return [
            _in_words(each)
            for each in active
            if not each.held_by
            and not any(path.startswith('{}/{}/'.format(each.path, each.state)) for path in around)
            and not self._is_oracle(each)
        ]

    def _is_oracle(self, active: ActiveState) -> bool:
        return any(
            node.path == active.path and node.is_oracle(active.state)
            for node in nodes_of(self._top.machine)
        )

    def _what_goes_on(self, held: Sequence[Hold]) -> str:
        top = self._top
        free = [hold for hold in held if not hold.waits_for_confirmation]
        asks = [hold.place.in_words() for hold in held if hold.waits_for_confirmation]
        if free:
            text = _runs(free)
        elif not self._running():
            text = '{} does not run; it will not wait'.format(top.path)
        else:
            text = '{} goes on; nothing has waited for that'.format(top.path)
            runs = self._what_runs()
            text += ', and this runs on: ' + ', '.join(runs) if runs else ''
        return text + ('; still to be confirmed: ' + ', '.join(asks) if asks else '')

    def _nodes_at(self, path: str) -> List[TreeNode]:
        """Return the containers at a path, '': the top machine.

        :raises OperatorError: where there is none.
        """
        top = self._top
        nodes = nodes_of(top.machine)
        found = [node for node in nodes if node.path == (path.strip('/') or top.path)]
        if not found:
            raise OperatorError(
                'there is no container {!r}; there are: {}'.format(
                    path, ', '.join(sorted({node.path for node in nodes}))
                )
            )
        return found


def _pattern(text: str) -> PathPattern:
    try:
        return PathPattern(text)
    except SettingsError as err:
        raise OperatorError(str(err)) from err


def _in_words(active: ActiveState) -> str:
    return HeldPlace(active.path, active.state).in_words()


def _runs(held: Sequence[Hold]) -> str:
    return 'runs now: ' + ', '.join(hold.place.in_words() for hold in held)


def _in_spite_of(prospect: Prospect) -> str:
    told = []
    if prospect.missing:
        told.append('without its input keys ' + ', '.join(prospect.missing))
    if prospect.repeats:
        told.append('it may repeat ' + ', '.join(prospect.repeats))
    return ''.join('; ' + each for each in told)
