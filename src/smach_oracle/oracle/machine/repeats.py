"""States that are not repeated by themselves: `on_retry: confirm` or `never`.

A repeat is a state that was executed in this trial and that the oracle leads the machine to again,
at once or by the author's transitions from where it has jumped to. The author's own loops
are not repeats.
"""

from typing import Iterable, Iterator, NamedTuple, Sequence, Set, Tuple

from ..records.visits import VisitMark
from ..settings.settings import ALLOW, NEVER
from ..smach_private import states_of, transitions_of
from .nesting import nodes_of
from .state_record import StateRecord
from .tree import Tree
from .tree_node import TreeNode


class _Done(NamedTuple):
    """A guarded state that was executed in this trial."""

    name: str  # its label, behind the path from the container that asks
    mark: VisitMark


def begin_watching(tree: Tree, nodes: Sequence[TreeNode]) -> None:
    """Begin a trial: number the visits where a state of the tree is guarded."""
    numbers_visits = tree.recover and any(each.in_force.guards_states for each in nodes)
    if tree.numbers_visits == numbers_visits:
        return  # a record is made, and configured, by what holds then
    tree.numbers_visits = numbers_visits
    for each in nodes:
        is_special = each.is_special()
        for record in list(each.records.by_label.values()):
            record.be_special(is_special)


def note_visit(node: TreeNode, record: StateRecord) -> str:
    """Note that the machine has come to a state. Return why it is not executed, or ''."""
    mark = node.records.marks[record.label]
    mark.reached = node.tree.next_visit()
    why_not = why_held_back(node, record)
    if not why_not:
        mark.executed = mark.reached
        mark.done = True
    return why_not


def why_held_back(node: TreeNode, record: StateRecord) -> str:
    """Return why a state is not executed when the machine comes to it, or '' where it is."""
    on_retry = record.settings.on_retry
    if on_retry == ALLOW or not node.records.marks[record.label].spent:
        return ''
    return 'was done in this trial and {}'.format(
        'must not be repeated' if on_retry == NEVER else 'is not repeated by itself'
    )


def has_visited(node: TreeNode, label: str) -> bool:
    """Whether the machine has come to a state in this trial."""
    return bool(node.records.marks[label].reached)


def repeated_by_going_to(node: TreeNode, target: str) -> Tuple[str, ...]:
    """Return the guarded states that may be repeated if the machine goes to a state.

    They are those that were executed since it came to `target` last, itself among them, and the
    spent ones to which the author's transitions lead from there, but not what only a precondition
    has done, until the machine has come to it once. If the machine has not been at the target in
    this trial, they are all to which the author's transitions lead.
    """
    if not node.tree.numbers_visits:
        return ()
    since = node.records.marks[target].reached
    done = list(_done_below(node))
    reached = _reached_from(node, target) if done else set()
    return tuple(
        each.name
        for each in done
        if (since and each.mark.executed >= since)
        or (
            (each.mark.spent and each.mark.reached or not since)
            and any(_is_at_or_below(each.name, label) for label in reached)
        )
    )


def _reached_from(node: TreeNode, target: str) -> Set[str]:
    """Return the states to which the author's transitions lead from a state, with that itself."""
    reached: Set[str] = set()
    waiting = {target}
    while waiting:
        label = waiting.pop()
        reached.add(label)
        following = set(transitions_of(node.machine).get(label, {}).values())
        states = states_of(node.machine)
        waiting.update(
            each for each in following - reached if each in states and not node.is_oracle(each)
        )
    return reached


def leave_for(node: TreeNode, target: str, below: Iterable[Tuple[TreeNode, str]] = ()) -> None:
    """Note that the oracle goes to a state: what may come again now is spent.

    Only an expert goes to a state that would be repeated itself, and has confirmed it so, and what
    is entered in the containers `below`.
    """
    if not node.tree.numbers_visits:
        return
    leave_unconfirmed(node, target)
    for each, label in ((node, target), *below):
        each.records.marks[label].spent = False


def leave_unconfirmed(node: TreeNode, target: str) -> None:
    """Note that the machine goes to a state as it is told to, and not by its author's transitions.

    What may come again now is spent, the state itself among it: nobody has confirmed anything.
    """
    since = node.records.marks[target].reached
    for done in _done_below(node):
        if done.mark.executed >= since:
            done.mark.spent = True


def note_initial(node: TreeNode, label: str) -> None:
    """Note that somebody has a container begin in a state, without a word on what that repeats."""
    if node.tree.numbers_visits:
        for done in _done_within(node, label):
            done.mark.spent = True


def begin_once_more(node: TreeNode, label: str) -> None:
    """Let a state, and all in it, come again as if it had not begun: a person wants it so."""
    node.records.marks[label] = VisitMark()
    for done in list(_done_within(node, label)):
        done.mark.done = done.mark.spent = False


def note_superseded(node: TreeNode, label: str) -> None:
    """Note that an expert has done the work of a state, now, if not by the machine.

    The author's loops are free again. The oracle does not lead to it again by itself.
    """
    if not node.tree.numbers_visits:
        return
    mark = node.records.marks[label]
    mark.reached = mark.executed = node.tree.next_visit()
    mark.done, mark.spent = True, False


def why_closed(node: TreeNode, label: str) -> str:
    """Return why a state cannot be entered now, whoever wants it, or '' where it can."""
    blocked = node.tree.workers.blocked(states_of(node.machine)[label])
    if blocked or not node.tree.numbers_visits:
        return blocked
    if node.records.marks[label].done and node.settings_of(label).on_retry == NEVER:
        return 'was done in this trial and must not be repeated (on_retry: never)'
    return ''


def repeated_by_running(node: TreeNode, label: str) -> Tuple[str, ...]:
    """Return the guarded states that would be repeated if a state were run as a precondition."""
    if not node.tree.numbers_visits:
        return ()  # nothing is guarded: the tree need not be looked through
    return tuple(done.name for done in _done_within(node, label))


def note_precondition(node: TreeNode, label: str) -> None:
    """Note that a state has begun as a precondition: that was no visit, and is not to come again.

    To be called before it runs, for what happens in the middle, and after, for what it holds.
    """
    if not node.tree.numbers_visits:
        return
    node.record(label)
    node.records.marks[label].done = True
    for done in _done_within(node, label):
        done.mark.spent = True
        done.mark.reached = done.mark.executed = 0
    if node.settings_of(label).on_retry != ALLOW:
        node.tree.keep_marks()


def _done_within(node: TreeNode, label: str) -> Iterator[_Done]:
    return (done for done in _done_below(node) if _is_at_or_below(done.name, label))


def _done_below(node: TreeNode) -> Iterator[_Done]:
    """Yield the guarded states at or below a container that were executed."""
    for each in nodes_of(node.machine):
        path = each.path[len(node.path) + 1 :]
        for label, record in dict(each.records.by_label).items():
            mark = each.records.marks[label]
            if mark.done and record.settings.on_retry != ALLOW:
                yield _Done('/'.join((path, label)) if path else label, mark)


def _is_at_or_below(name: str, label: str) -> bool:
    return name == label or name.startswith(label + '/')
