"""SMACH machines of drawn trees; their states tell a journal what they do."""

import collections
import random
import threading
import time
from typing import Any, Dict, List, Optional

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert

from .drawing import TOP, Node, Tree
from .witness import Journal

LONGEST_S = 0.003  # of one state, and of an answer
OUTCOMES = ['ok', 'aborted', 'preempted']


class Told:
    """What the states of one process share."""

    def __init__(
        self, tree: Tree, journal: Journal, before: List[Dict[str, Any]], chance: random.Random
    ) -> None:
        """`before`: the journal of the processes that were killed."""
        self.tree, self.journal, self.chance = tree, journal, chance
        self.ended = collections.Counter(
            (line['path'], tuple(line['items'])) for line in before if line['what'] == 'ends'
        )
        self.keys = tree.leaves + [
            item_key(path) for path, node in tree.nodes.items() if node.kind == 'repeated'
        ]


def item_key(path: str) -> str:
    """The userdata key with the item of an Iterator."""
    return 'item:' + path


class Witnessed(smach.State):
    """Tells when it begins, what it sees, and when it has written its own key and ends."""

    def __init__(self, told: Told, path: str) -> None:
        smach.State.__init__(self, OUTCOMES, told.keys, [path])
        self._told, self._path = told, path
        self._above = told.tree.iterators_above(path)

    def execute(self, userdata: Any) -> str:
        told, path = self._told, self._path
        items = tuple(userdata[item_key(above)] for above in self._above)
        seen = {key: userdata[key][-1] for key in told.tree.leaves if userdata[key]}
        told.journal.write('begins', path=path, items=items, seen=seen)
        time.sleep(told.chance.uniform(0.0, LONGEST_S))  # the work that is killed
        number = told.ended[path, items] = told.ended[path, items] + 1
        stamp = '{} {}'.format(items, number)
        if told.chance.random() < 0.5:
            userdata[path] = userdata[path] + [stamp]
        else:
            userdata[path].append(stamp)
        outcome = 'aborted' if number <= told.tree.nodes[path].failures else 'ok'
        told.journal.write('ends', path=path, items=items, stamp=stamp, outcome=outcome)
        return outcome


class Willing(Expert):
    """Sends the machine to the failed state again, after a while."""

    def __init__(self, told: Told) -> None:
        self._told = told

    def ask(self, question: Any, cancelled: threading.Event, progress: Any) -> Optional[Answer]:
        time.sleep(self._told.chance.uniform(0.0, LONGEST_S))  # a person takes time, too
        self._told.journal.write(
            'answers',
            query=question.question_id,
            path='{}/{}'.format(question.container_path, question.failed_state),
        )
        return Answer(AnswerKind.GOTO, state=question.failed_state)


def build(told: Told, store: str) -> smach.StateMachine:
    """The machine of a tree under an oracle that keeps a store."""
    machine = _built(told, TOP, told.tree.top)
    for key in told.keys:
        machine.userdata[key] = []
    wrapped = OracleContainer.wrap(
        machine,
        name=TOP,
        expert=Willing(told),
        settings={
            'checkpoint': store,
            'checkpoint_synchronous': 'OFF',
            'checkpoint_wait_s': 60,
            'on_resume': 'recover',
            'memory': 1000,
            'max_recoveries': 100,
        },
    )
    journal = told.journal
    wrapped._oracle.events.observers.append(
        lambda event: journal.write(
            'event',
            kind=event.kind.name,
            seq=event.seq,
            trial=event.trial_id,
            path=event.path,
            state=event.state,
            target=event.target,
            query=event.query_id,
            failure=event.failure_kind,
            last_seq=(event.data or {}).get('last_seq'),
        )
    )
    return wrapped


def _built(told: Told, path: str, node: Node) -> Any:
    if node.kind == 'leaf':
        return Witnessed(told, path)
    return {'machine': _machine, 'sequence': _sequence, 'beside': _beside, 'repeated': _repeated}[
        node.kind
    ](told, path, node)


def _children(told: Told, path: str, node: Node) -> Any:
    return [
        (child.label, _built(told, '{}/{}'.format(path, child.label), child))
        for child in node.children
    ]


def _keys(told: Told, path: str) -> Any:
    """The input and output keys of a container: it reads all, and writes what is below it."""
    return told.keys, [leaf for leaf in told.tree.leaves if leaf.startswith(path + '/')]


def _machine(told: Told, path: str, node: Node) -> Any:
    machine = smach.StateMachine(OUTCOMES, *_keys(told, path))
    children = _children(told, path, node)
    with machine:
        for (label, child), following in zip(children, children[1:] + [('ok', None)]):
            smach.StateMachine.add(label, child, {'ok': following[0]})
    return machine


def _sequence(told: Told, path: str, node: Node) -> Any:
    sequence = smach.Sequence(OUTCOMES, 'ok', *_keys(told, path))
    with sequence:
        for label, child in _children(told, path, node):
            smach.Sequence.add(label, child)
    return sequence


def _beside(told: Told, path: str, node: Node) -> Any:
    children = _children(told, path, node)
    both = smach.Concurrence(
        OUTCOMES,
        'aborted',
        *_keys(told, path),
        outcome_map={'ok': {label: 'ok' for label, _ in children}},
    )
    with both:
        for label, child in children:
            smach.Concurrence.add(label, child)
    return both


def _repeated(told: Told, path: str, node: Node) -> Any:
    iterator = smach.Iterator(
        OUTCOMES,
        *_keys(told, path),
        it=range(node.items),
        it_label=item_key(path),
        exhausted_outcome='ok',
    )
    ((label, child),) = _children(told, path, node)
    with iterator:
        smach.Iterator.set_contained_state(label, child, loop_outcomes=['ok'])
    return iterator
