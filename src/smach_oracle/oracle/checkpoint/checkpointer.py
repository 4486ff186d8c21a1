"""Stores where every container of a tree stands, before each state begins."""

import time
from functools import lru_cache, partial, wraps
from typing import (
    Callable,
    Dict,
    FrozenSet,
    Iterator,
    List,
    Mapping,
    Optional,
    Sequence,
    Set,
    Tuple,
    cast,
)

import smach
from smach_common.foreign import ends_program, error_text
from smach_oracle.store.names import ASKED, AT, BEFORE, BROKEN, ENDED, FAILED, GOAL, IN, ITEMS
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_writer import StoreWriter

from ..asking.question import AnswerKind
from ..branches.wrapper import goes_on_inside, wrappers_around
from ..machine.nesting import nodes_of
from ..machine.places import TreePlace, direct_levels
from ..machine.tree_node import TreeNode
from ..records.events import Event, EventKind, FailureKind
from ..records.facts import JUMPED_FROM, JUMPED_TO, TAKEN_UP
from ..records.running_goals import GOALS
from ..scope.scope import Reason
from ..settings.failing_outcomes import name_text
from ..smach_private import data_of, states_of
from .container_facts import (
    ContainerFacts,
    KeptOut,
    UserdataFacts,
    WeakIds,
    fact_of,
    keys_of,
    start_facts,
)
from .stored_tree import StoredTree

SEQ_RESERVE = 1000  # event numbers behind the last stored one that may have been used
# after these the machine waits until the disk has it
# not SUPERSEDE: what it counts belongs to the move that follows. Stored without that, it would be
# counted again by the next program, which asks again. In a branch none follows: its line is over
_COMMITTED = {
    EventKind.TRIAL_START,
    EventKind.RESUMED,
    EventKind.STATE_START,
    EventKind.PRECONDITION_START,
    EventKind.DECISION,
    EventKind.QUERY_OPENED,
    EventKind.QUERY_ANSWERED,
    EventKind.QUERY_EXPIRED,
    EventKind.QUERY_CANCELLED,
    EventKind.JUMP,
    EventKind.GIVE_UP,
    EventKind.HOLD_START,
    EventKind.SENT,
    EventKind.TRIAL_END,
}
_CLOSES = frozenset((EventKind.QUERY_ANSWERED, EventKind.QUERY_EXPIRED, EventKind.QUERY_CANCELLED))
# after which another state is next
_LEADS = frozenset((EventKind.TRANSITION, EventKind.JUMP, EventKind.SENT))
# outcome of the event of an answer that starts an interface, which does the state's work
_INTERFACE = AnswerKind.INTERFACE.name.lower()
_HAS_RUN = frozenset((EventKind.TRANSITION, EventKind.FAILURE))


LOST = (
    '{0}: this trial is not stored any more, as a fault of the store kept it from being '
    'written: {1}. The machine goes on. If its program is stopped now, the next start asks a '
    'person before anything moves. Please report this fault'
)


def _while_it_works(store: Callable[..., None]) -> Callable[..., None]:
    """Have a method of a Checkpointer stop no machine, whatever fails in it.

    A moment that is stored in part would lead to a wrong place. So after a fault nothing is stored
    but that there was one.
    """

    @wraps(store)
    def stored(self: 'Checkpointer', *args: object) -> None:
        if self.is_broken:
            return
        try:
            store(self, *args)
        except BaseException as err:
            if ends_program(err):
                raise
            self.tell_broken(err)

    return stored


class Checkpointer:
    """An observer of a tree's events that commits a moment to a store where it is due.

    It is called by the thread in which the step happens, before the machine goes on.
    """

    def __init__(
        self,
        top: TreeNode,
        writer: StoreWriter,
        before: StoredTree,
        behind: Optional[int],
        first: Sequence[Fact],
    ) -> None:
        """`before`: what is stored of the trial, nothing where it is new.

        `behind`: the moment that it goes on from, where that is not the last one. `first`: what
        its first moment has besides.
        """
        self.is_broken = False
        self._before, self._behind = before, behind
        self._top, self._writer = top, writer
        self._nodes: Dict[str, TreeNode] = {}
        self._facts: Dict[str, ContainerFacts] = {}
        self._userdata: Dict[str, UserdataFacts] = {}
        # by where a line of steps begins: what one of them commits, the others may not yet have
        self._pending: Dict[str, List[Fact]] = {_begins_line(top): list(first)}
        # numbers, by path of the Iterator
        self._items = {path: told.item for path, told in before.containers.items() if told.item}
        self._ran: Dict[str, Set[str]] = {}  # labels by container, since its last commit
        self._entered: Dict[str, List[TreeNode]] = {}  # by line, since its last commit
        # most events ask it
        self._wrappers_around = lru_cache(None)(wrappers_around)
        self._wrote: Dict[str, str] = {}  # path of the state that ran last, by that of userdata
        self._spent_stored: Dict[str, object] = {}
        self._seq_stored = -1
        # paths and keys of what is named. Of a trial that goes on its first part has done so
        self._told = {
            (path, key) for path, told in before.containers.items() for key in told.missing
        }
        self._named = WeakIds()  # values that are named
        self._goals = set(before.goals)  # ids of stored ones

    @_while_it_works
    def __call__(self, event: Event) -> None:
        """Take one event. See EventSource."""
        if event.kind in (EventKind.TRIAL_START, EventKind.RESUMED):
            self._begin_trial()
        if event.kind is EventKind.OPERATOR_COMMAND:
            spent = tuple(self._spent())  # such as that it is paused, which must not be delayed
            if spent or event.seq >= self._seq_stored + SEQ_RESERVE:
                self._seq_stored = event.seq
                self._writer.commit(
                    NewMoment(
                        event.wall_time, event.seq, event.kind.name, self._top.key, '', spent
                    ),
                    lambda: True,
                )
            return
        node = self._node_of(event)
        if node is None:
            return
        pending = self._pending_of(node)
        items = list(self._items_around(event, node))
        pending += items
        pending += self._where(event, node)
        if event.state:
            self._ran.setdefault(node.key, set()).add(event.state)
            if event.kind in _HAS_RUN:
                self._wrote[node.path] = '/'.join((node.path, event.state))
        if event.kind is EventKind.CONTAINER_START and not self._enters_again(node):
            pending += self._facts_of(node).begin_execution()
        if event.kind is node.site.begins_by:
            self._entered.setdefault(_begins_line(node), []).append(node)
        if event.kind is EventKind.JUMP:
            pending += self._facts_of_way(event, node)
        if event.kind is EventKind.CONTAINER_END:
            pending += self._collected(node, all_keys=True)
            pending += self._around(node)
        if self._is_due(event, node) or items:
            self._commit(event, node)

    def _is_due(self, event: Event, node: TreeNode) -> bool:
        """Whether a moment is stored at an event.

        That of a failure is stored once it is counted, as the state gives way to the oracle.
        """
        return (
            event.kind in _COMMITTED
            or (
                node.site.is_line_over(event)
                and not (event.kind is EventKind.SUPERSEDE and _is_on_its_way(node))
            )
            or event.seq >= self._seq_stored + SEQ_RESERVE
            or _gives_way(event, node)
        )

    def _pending_of(self, node: TreeNode) -> List[Fact]:
        """Return what a container and those around it have to commit, which run in one thread."""
        return self._pending.setdefault(_begins_line(node), [])

    @_while_it_works
    def goal_begins(self, goal_id: str, server: str) -> None:
        """Store a goal that is about to be sent."""
        self._goals.add(goal_id)
        self._commit_by_hand('GOAL', (fact_of('', GOAL + goal_id, server),))

    @_while_it_works
    def last_words(self, kind: str) -> None:
        """Store what has not been stored of the trial, which has ended, as a moment of a kind."""
        facts = [fact for line in self._pending.values() for fact in line]
        facts += (
            fact for node in self._nodes.values() for fact in self._facts_of(node).all_states()
        )
        facts += self._marks()
        self._pending = {}
        self._commit_by_hand(kind, (*facts, *self._ended_goals()))

    @_while_it_works
    def keep_marks(self) -> None:
        """Store which states have begun, before one of them runs of which there is no event."""
        self._commit_by_hand('MARKS', tuple(self._marks()))

    def _marks(self) -> Iterator[Fact]:
        if self._top.tree.numbers_visits:
            for node in self._nodes.values():
                yield from self._facts_of(node).marks()

    def tell_broken(self, err: BaseException) -> None:
        """Say that the trial is not stored any more, and store that."""
        self.is_broken = True
        smach.logerr(LOST.format(self._writer.path, error_text(err)))
        self._commit_by_hand(BROKEN, ())

    def _commit_by_hand(self, kind: str, facts: Tuple[Fact, ...]) -> None:
        """Commit a moment that belongs to no event."""
        top = self._top
        self._writer.commit(
            NewMoment(time.time(), top.events.last_seq, kind, top.key, '', facts),
            lambda: must_stop(top),
        )

    def _ended_goals(self) -> Iterator[Fact]:
        """Yield that goals do not run any more."""
        if self._goals:
            for goal_id in self._goals.difference(GOALS.running()):
                self._goals.discard(goal_id)
                yield Fact('', GOAL + goal_id, None)

    def _begin_trial(self) -> None:
        self._nodes = {node.key: node for node in nodes_of(self._top.machine)}
        pending = self._pending_of(self._top)
        for node in self._nodes.values():
            pending += self._facts_of(node).all_states()
        for goal_id, server in GOALS.running().items():
            self._goals.add(goal_id)
            pending.append(fact_of('', GOAL + goal_id, server))

    def _node_of(self, event: Event) -> Optional[TreeNode]:
        """Return the container that an event is of: that of a branch goes by its label as well."""
        known = self._known_node(event.path, event.state)
        if known is None:  # a machine that was added since
            self._nodes = {node.key: node for node in nodes_of(self._top.machine)}
            known = self._known_node(event.path, event.state)
        return known

    def _known_node(self, path: str, label: str) -> Optional[TreeNode]:
        for key in ('/'.join((path, label)), path):
            node = self._nodes.get(key)
            if node is not None and node.path == path:
                return node
        return None

    def _facts_of(self, node: TreeNode) -> ContainerFacts:
        facts = self._facts.get(node.key)
        if facts is None:
            facts = self._facts[node.key] = ContainerFacts(
                node.key,
                node.records,
                lambda label: node.settings_of(label).on_retry,
                self._before.container(node.key),
            )
        return facts

    def _enters_again(self, node: TreeNode) -> bool:
        """Whether a container is to go on where it stood: it has not the stored userdata yet."""
        return self._top.tree.resumed.entry_of(node.records) is not None

    # -- what a moment has

    def _where(self, event: Event, node: TreeNode) -> Iterator[Fact]:
        """Yield where the container stands after an event."""
        kind, label, data = event.kind, event.state, event.data or {}
        if kind is EventKind.STATE_START:
            path = '/'.join((node.key, label))
            is_container = isinstance(states_of(node.machine).get(label), smach.Container)
            below = self._below(path) if is_container else []
            sent_to = [
                TreePlace(each, start).path
                for each, start in ((each, each.start_from_above()) for each in below)
                if start
            ]
            yield fact_of(node.key, AT, [label, IN, *sent_to[-1:]])
            if is_container and not goes_on_inside(node, label):
                yield from self._not_begun_below(path)
        elif (
            kind is EventKind.CONTAINER_START and node is self._top and not self._enters_again(node)
        ):
            yield fact_of(node.key, AT, [label, BEFORE])  # others do not have their inputs yet
        elif kind in _LEADS and node.has(event.target):
            yield fact_of(node.key, AT, [event.target, BEFORE, data.get(JUMPED_TO)])
        elif TAKEN_UP in data:
            failed, number, ended, text = data[TAKEN_UP]
            yield fact_of(node.key, AT, [failed, FAILED, number, name_text(ended), text])
        elif kind is EventKind.FAILURE and event.failure_kind != FailureKind.INTERRUPTED:
            told = event.failure_kind, name_text(event.outcome), event.text
            yield fact_of(node.key, AT, [label, FAILED, *told])
        elif kind is EventKind.QUERY_OPENED:
            yield fact_of(node.key, ASKED, [label, event.query_id])
        elif kind is EventKind.QUERY_ANSWERED and event.outcome == _INTERFACE:
            yield fact_of(node.key, ASKED, [label, ''])  # asked again unless it does the work
        elif _closes(event) and self._top.tree.early_end.why is None:
            yield Fact(node.key, ASKED, None)
        elif not _is_on_its_way(node):
            outcome = node.site.ended_by(event)
            if outcome is not None:
                yield fact_of(node.key, AT, [name_text(outcome), ENDED])

    def _facts_of_way(self, jump: Event, node: TreeNode) -> Iterator[Fact]:
        """Yield what a jump has changed of the failed state, and of the streaks around it.

        The machine may have left its container since the recovery was counted.
        """
        data = cast('Mapping[str, object]', jump.data)  # each jump has some
        path, _, label = str(data.get(JUMPED_FROM, '')).rpartition('/')
        failed = self._known_node(path, label) or node
        yield from self._facts_of(failed).changed([label])
        for each in failed.around():
            yield from self._facts_of(each).streaks()

    def _not_begun_below(self, path: str) -> Iterator[Fact]:
        """Yield that what is in a container or state has not begun in this visit of it."""
        yield from (Fact(node.key, AT, None) for node in self._below(path))
        for each in [each for each in self._items if each.startswith(path + '/')]:
            del self._items[each]
            yield Fact(each, ITEMS, None)

    def _below(self, path: str) -> List[TreeNode]:
        return [node for key, node in self._nodes.items() if (key + '/').startswith(path + '/')]

    def _items_around(self, event: Event, node: TreeNode) -> Iterator[Fact]:
        """Yield which items the Iterators around a container have come to, and with what userdata.

        One moment has both: what is inside goes on with the userdata of this item.
        """
        for path, wrapper in self._wrappers_around(node):
            if event.kind is EventKind.CONTAINER_START and event.path == path:
                continue  # it has not begun with any
            number = wrapper.item_number
            if number and self._items.get(path) != number:
                self._items[path] = number
                yield fact_of(path, ITEMS, number)
                yield from self._not_begun_below(path)
                if event.kind is not node.site.begins_by:  # else the commit has them
                    yield from self._keys(path, data_of(wrapper.container.userdata), None)

    def _commit(self, event: Event, node: TreeNode) -> None:
        facts = self._pending_of(node) + list(self._collected(node)) + list(self._ended_goals())
        facts += self._spent()
        facts += self._start()
        facts += self._marks()
        if self._top.settings.rates_file and _gives_way(event, node):
            # that file has just got what all states have learned, and is not to get it once more
            for each in self._nodes.values():
                facts += self._facts_of(each).states()
        self._pending_of(node).clear()
        for each in self._entered.pop(_begins_line(node), ()):
            facts += self._keys_around(each)
        self._seq_stored = event.seq
        behind, self._behind = self._behind, None
        self._writer.commit(
            NewMoment(
                event.wall_time,
                event.seq,
                event.kind.name,
                node.path,
                event.state,
                tuple(facts),
                behind,
            ),
            lambda: must_stop(node),
        )

    def _spent(self) -> Iterator[Fact]:
        """Yield what has changed of what is spent, the time of the budget in whole seconds."""
        spent = self._top.tree.spent()
        spent['budget'] = list(map(int, spent['budget']))
        for name, plain in spent.items():
            if self._spent_stored.get(name) != plain:
                self._spent_stored[name] = plain
                yield fact_of('', name, plain)

    def _start(self) -> Iterator[Fact]:
        """Yield the userdata of the start, once, where a policy may start the machine over."""
        restarts = self._top.tree.restarts
        if restarts.is_new:
            restarts.is_new = False
            for node in self._nodes.values():
                yield from start_facts(node.key, restarts.userdata.get(node, {}))

    def _collected(self, node: TreeNode, all_keys: bool = False) -> Iterator[Fact]:
        """Yield what is new of a container."""
        labels = self._ran.pop(node.key, set())
        yield from self._facts_of(node).changed(list(labels))
        if self._enters_again(node):
            return
        reached: Optional[FrozenSet[str]] = None
        if not all_keys:
            reached = frozenset().union(*(keys_of(node.machine, label) for label in labels))
        yield from self._keys(node.path, data_of(node.machine.userdata), reached)

    def _keys(
        self, path: str, data: Dict[str, object], reached: Optional[FrozenSet[str]]
    ) -> Iterator[Fact]:
        userdata = self._userdata.get(path)
        if userdata is None:
            userdata = self._userdata[path] = UserdataFacts(path, partial(self._tell, path))
        yield from userdata.changed(data, reached)

    def _around(self, node: TreeNode) -> Iterator[Fact]:
        """Yield what is new of the userdata into which the outputs of a container have gone."""
        for path, _ in self._wrappers_around(node):
            self._wrote[path] = node.key
        yield from self._keys_around(node)
        if node.parent is not None and len(node.labels_from_parent) == 1:
            self._wrote[node.parent.key] = node.key
            yield from self._keys(node.parent.key, data_of(node.parent.machine.userdata), None)

    def _keys_around(self, node: TreeNode) -> Iterator[Fact]:
        """Yield what is new of the userdata of the Concurrences and Iterators around a node."""
        for path, wrapper in self._wrappers_around(node):
            yield from self._keys(path, data_of(wrapper.container.userdata), None)

    def _tell(self, path: str, out: KeptOut) -> None:
        told = (
            path,
            '{}.{}'.format(out.key, '.'.join(out.attributes)) if out.attributes else out.key,
        )
        if told in self._told or not self._named.add(out.value):
            return
        self._told.add(told)
        what = (
            'cannot be stored: {}. It'.format(out.why)
            if not out.attributes
            else 'is stored without its attributes {}, which are no fields of its '
            'class. They'.format(', '.join(out.attributes))
        )
        smach.logwarn(
            '{}: userdata key {!r} ({}) of {} {} will be missing where the machine is '
            'resumed'.format(path, out.key, out.kind, self._wrote.get(path, 'the script'), what)
        )


def _begins_line(node: TreeNode) -> str:
    """Return the key of the outermost container around one that surely runs in its thread."""
    return direct_levels(node, at_rest=True)[-1].key


def _closes(event: Event) -> bool:
    """Whether a question is over: also by an interface that has done the work."""
    return event.kind in _CLOSES or (event.kind is EventKind.INTERFACE_END and bool(event.outcome))


def _gives_way(event: Event, node: TreeNode) -> bool:
    """Whether a state that has failed gives way to the oracle.

    A precondition is told as a target, too, and may have the same name.
    """
    return event.kind is EventKind.TRANSITION and node.is_oracle(event.target)


def must_stop(node: TreeNode) -> bool:
    """Whether nobody may wait any longer."""
    return not node.execution.scope.reasons.isdisjoint((Reason.PREEMPTED, Reason.SHUTDOWN))


def _is_on_its_way(node: TreeNode) -> bool:
    """Whether a container is left by a way that is decided again after a crash.

    Until the machine is where that leads, the state that has failed is where it stands.
    """
    departure = None if node.parent is None else node.parent.execution.departure
    return (
        departure is not None
        and departure.is_decided_again
        and departure.failed_path.startswith(node.path + '/')
    )
