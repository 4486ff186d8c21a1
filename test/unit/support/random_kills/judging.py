"""Holds the journal of a tree that was killed against what must hold."""

import collections
from typing import Any, Dict, List, NamedTuple, Tuple

from smach_oracle.oracle.checkpoint.checkpointer import _COMMITTED
from smach_oracle.oracle.records.events import FailureKind

from .drawing import LINES, TOP, Tree

Line = Dict[str, Any]
Items = Tuple[int, ...]
PROMISED = {kind.name for kind in _COMMITTED}


class Decision(NamedTuple):
    """A state to which the machine was sent, and the items of all Iterators then."""

    target: str
    items: Dict[str, int]


class _Visits:
    """The visits of one state with certain items."""

    def __init__(self) -> None:
        self.phase = 'new'  # begun, ended, over: the end is stored
        self.run = 0  # in which it began last
        self.thread = 0
        self.counted = 0
        self.decisions: List[Decision] = []  # since it began last


class Judge:
    """Reads the journal line by line; `wrong` is what did not hold."""

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self.wrong: List[str] = []
        self._visits: Dict[Tuple[str, Items], _Visits] = collections.defaultdict(_Visits)
        self._latest: Dict[str, Items] = {}  # items of each state's last beginning
        self._stamps: Dict[str, str] = {}  # by state: what it wrote last
        self._items: Dict[str, int] = {}  # by Iterator
        self._run = 0
        self._last_seq = self._promised = -1
        self._trial = ''
        self._answered: Dict[str, int] = {}
        self.is_over = False  # whether the trial has ended

    def read(self, lines: List[Line]) -> None:
        """Take all lines."""
        for line in lines:
            if self.is_over:
                return
            if line['run'] != self._run:
                self._run = line['run']
                if line['what'] != 'event':
                    self._say(line, 'a process begins with something that is no event')
            getattr(self, '_' + line['what'])(line)

    def end(self, told: Dict[str, Any]) -> None:
        """Take what the last process, which was not killed, has returned."""
        if told.get('outcome') != 'ok' or told['threads']:
            self.wrong.append('ended as {}'.format(told))
            return
        self.wrong += ['{} {} never ended'.format(*visit) for visit in self._missing()]
        if self.is_over or told['rates'] is None:
            return
        rates = {path: count for path, count in told['rates']}
        for path in self._tree.leaves:
            counted = sum(self._visits[path, items].counted for items in self._tree.visits_of(path))
            if rates.get(path) != counted:
                self.wrong.append(
                    '{}: {} visits are in its rates, and {} ended'.format(
                        path, rates.get(path), counted
                    )
                )

    def _missing(self) -> List[Tuple[str, Items]]:
        return [
            (path, items)
            for path in self._tree.leaves
            for items in self._tree.visits_of(path)
            if not self._visits[path, items].counted
        ]

    def _say(self, line: Line, text: str) -> None:
        self.wrong.append('{}: {}'.format(text, line))

    # -- states

    def _begins(self, line: Line) -> None:
        path, items = line['path'], tuple(line['items'])
        visits = self._visits[path, items]
        if visits.phase != 'new' and not any(
            self._covers(each, path, items) for each in visits.decisions
        ):
            self._say(
                line,
                'runs again and nobody has decided that ({} in run {})'.format(
                    visits.phase, visits.run
                ),
            )
        if visits.phase == 'begun' and visits.run == line['run']:
            self._say(line, 'begins twice in one process without an end')
        visits.phase, visits.run, visits.decisions = 'begun', line['run'], []
        self._latest[path] = items
        self._items.update(zip(self._tree.iterators_above(path), items))
        self._sees(line, path)

    def _covers(self, decision: Decision, path: str, items: Items) -> bool:
        tree = self._tree
        above = tree.iterators_above(decision.target)
        held = dict(zip(tree.iterators_above(path), items))
        return tree.is_behind(path, decision.target) and all(
            held.get(each) == decision.items.get(each, 0) for each in above
        )

    def _sees(self, line: Line, path: str) -> None:
        for other in self._tree.leaves:
            if self._tree.precede(other, path) and line['seen'].get(other) != self._stamps.get(
                other, 'nothing, as it has not ended'
            ):
                self._say(
                    line,
                    'sees {!r} of {}, which left {!r}'.format(
                        line['seen'].get(other), other, self._stamps.get(other)
                    ),
                )

    def _ends(self, line: Line) -> None:
        path = line['path']
        visits = self._visits[path, tuple(line['items'])]
        visits.phase, visits.thread = 'ended', line['thread']
        visits.counted += 1
        self._stamps[path] = line['stamp']

    def _answers(self, line: Line) -> None:
        self._decided(line['path'])

    # -- events

    def _event(self, line: Line) -> None:
        kind, path = line['kind'], '{}/{}'.format(line['path'], line['state'])
        if kind == 'TRIAL_START' or kind == 'RESUMED':
            self._begin(line)
            if self.is_over:
                return
        if line['trial'] != self._trial:
            self._say(line, 'another trial')
        if line['seq'] <= self._last_seq:
            self._say(line, 'a number is used twice, or is smaller than one before')
        self._last_seq = line['seq']
        if kind == 'STATE_START':
            self._goes_on(line, path)
        if kind == 'CONTAINER_END' and line['path'] in self._tree.nodes:
            for child in self._tree.nodes[line['path']].children:
                self._goes_on(line, path + child.label)
        if kind == 'FAILURE' and line['failure'] == FailureKind.INTERRUPTED:
            self._in_doubt(line, path)
        if kind in ('DECISION', 'JUMP') and line['target']:
            self._decided(self._place(line['path'], line['target']))
        if kind == 'QUERY_ANSWERED':
            if line['query'] in self._answered:
                self._say(line, 'a question is answered twice')
            self._answered[line['query']] = line['seq']
        if self._is_promised(line):
            self._promised = line['seq']
            self._stored(line['thread'])

    def _is_promised(self, line: Line) -> bool:
        """Whether what has happened in the thread is stored once others are told of an event."""
        kind, nodes = line['kind'], self._tree.nodes
        if kind == 'TRANSITION':
            return line['target'] == 'ORACLE' or nodes[line['path']].kind not in LINES
        holder = nodes.get(line['path'].rpartition('/')[0])
        ends_branch = (
            kind == 'CONTAINER_END'
            and nodes[line['path']].kind in LINES
            and holder is not None
            and holder.kind not in LINES
        )
        return kind in PROMISED or ends_branch

    def _begin(self, line: Line) -> None:
        if line['kind'] == 'TRIAL_START':
            self.is_over = bool(self._latest) and not self._missing()
            if self._latest and not self.is_over:
                self._say(line, 'a new trial begins, and the old one had not ended')
            self._trial, self._last_seq, self._promised = line['trial'], -1, -1
        elif line['last_seq'] < self._promised:
            self._say(line, 'event {} was promised'.format(self._promised))

    def _goes_on(self, line: Line, path: str) -> None:
        """A visit begins, or its container ends: the one before is in doubt no more."""
        visits = self._visits.get((path, self._latest.get(path, ())))
        if visits is not None and visits.phase == 'ended' and visits.run != line['run']:
            visits.phase = 'over'

    def _in_doubt(self, line: Line, path: str) -> None:
        if path not in self._tree.nodes or self._tree.nodes[path].kind != 'leaf':
            self._say(line, 'in doubt, and no state')
            return
        visits = self._visits.get((path, self._latest.get(path, ())))
        if visits is None or visits.run == line['run']:
            return
        if visits.phase == 'over':
            items = self._latest[path]
            if not self._next_item_may_have_begun(path, items) and not visits.decisions:
                self._say(line, 'in doubt, and its end was stored')
        elif visits.phase == 'ended':
            visits.counted -= 1
            visits.phase = 'begun'

    def _next_item_may_have_begun(self, path: str, items: Items) -> bool:
        """Whether the state is to run with further items, or was to and was killed before it."""
        return items != self._tree.visits_of(path)[-1]

    def _stored(self, thread: int) -> None:
        """All that ended in a thread is stored with what it commits."""
        for visits in self._visits.values():
            if visits.phase == 'ended' and visits.run == self._run and visits.thread == thread:
                visits.phase = 'over'

    def _decided(self, target: str) -> None:
        for visits in self._visits.values():
            visits.decisions.append(Decision(target, dict(self._items)))

    def _place(self, container: str, target: str) -> str:
        for path in (
            '{}/{}'.format(container, target),
            target,
            '{}/{}'.format(TOP, target.lstrip('/')),
        ):
            if path in self._tree.nodes:
                return path
        return container
