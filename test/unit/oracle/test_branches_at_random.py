"""Random trees of Iterators and Concurrences without failures run as without an oracle."""

import random

import pytest
from machines import FakeExpert

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind

TREES = 60
DEPTH = 4


class Leaf(smach.State):
    """Notes what it reads, adds to it, and ends with the next outcome of its own."""

    def __init__(self, name, seed, course):
        smach.State.__init__(
            self, outcomes=['ok', 'other', 'preempted'], io_keys=['sum'], input_keys=['item']
        )
        self._name, self._random, self._course = name, random.Random(seed), course

    def execute(self, ud):
        item = ud.item if 'item' in ud else None
        self._course.append((self._name, item, ud.sum if item is not None else None))
        if item is not None:
            ud.sum = ud.sum + 1
        return self._random.choice(['ok', 'ok', 'other'])


class Maker:
    """Makes the same tree, with another list for its course, whenever it is given one seed."""

    def __init__(self, seed):
        self._random = random.Random(seed)
        self.courses = {}  # by thread: that of each branch of a Concurrence is its own
        self._number = 0

    def make(self, depth, course):
        """A state with the outcomes ok, other and preempted."""
        self._number += 1
        kinds = [self._leaf]
        if depth:
            kinds += [self._machine, self._iterator, self._concurrence]
        return self._random.choice(kinds)(depth, course)

    def _leaf(self, depth, course):
        return Leaf('L{}'.format(self._number), self._random.random(), course)

    def _machine(self, depth, course):
        machine = smach.StateMachine(
            ['ok', 'other', 'preempted'], input_keys=['sum', 'item'], output_keys=['sum']
        )
        count = self._random.randint(1, 3)
        with machine:
            for index in range(count):
                following = 'S{}'.format(index + 1) if index + 1 < count else 'ok'
                smach.StateMachine.add(
                    'S{}'.format(index), self.make(depth - 1, course), {'ok': following}
                )
        return machine

    def _iterator(self, depth, course):
        iterator = smach.Iterator(
            ['ok', 'other', 'preempted'],
            input_keys=['sum'],
            output_keys=['sum'],
            exhausted_outcome='ok',
            it_label='item',
            it=list(range(self._random.randint(0, 4))),
        )
        loops = self._random.choice([['ok'], ['ok', 'other']])
        with iterator:
            smach.Iterator.set_contained_state(
                'EACH', self.make(depth - 1, course), loop_outcomes=loops
            )
        return iterator

    def _concurrence(self, depth, course):
        concurrence = smach.Concurrence(
            ['ok', 'other', 'preempted'],
            default_outcome='other',
            input_keys=['sum', 'item'],
            output_keys=[],
            outcome_map={'ok': {'B0': 'ok'}},
        )
        with concurrence:
            for index in range(self._random.randint(1, 3)):
                own = self.courses.setdefault((self._number, index), [])
                # each has keys of its own: which of several writes last is not told
                smach.Concurrence.add(
                    'B{}'.format(index),
                    self.make(depth - 1, own),
                    remapping={'sum': 'sum{}'.format(index)},
                )
                concurrence.userdata['sum{}'.format(index)] = 0
        return concurrence


def run(seed, wrap):
    maker = Maker(seed)
    course = maker.courses[()] = []
    top = smach.StateMachine(['ok', 'other', 'preempted'])
    top.userdata.sum, top.userdata.item = 0, 'top'
    with top:
        smach.StateMachine.add('TREE', maker.make(DEPTH, course))
    events = []
    if wrap:
        OracleContainer.wrap(top, expert=FakeExpert())
        top.events.observers.append(events.append)
    outcomes = [top.execute(), top.execute()]
    assert not [event for event in events if event.kind is EventKind.FAILURE]
    return outcomes, maker.courses, top.userdata.sum


@pytest.mark.parametrize('seed', range(TREES))
def test_without_a_failure_a_tree_runs_as_bare(seed):
    bare = run(seed, wrap=False)
    assert bare[1], 'something has run'
    assert run(seed, wrap=True) == bare


class Fails(smach.State):
    """Ends an item well after as many failures as were drawn for it; notes each try."""

    def __init__(self, failures, tried):
        smach.State.__init__(
            self, ['ok', 'aborted', 'stuck', 'preempted'], input_keys=['item'], io_keys=['done']
        )
        self._left, self._tried = dict(failures), tried

    def execute(self, ud):
        self._tried.append(ud.item)
        if self._left[ud.item]:
            return self._left[ud.item].pop()
        ud.done = ud.done + [ud.item]
        return 'ok'


@pytest.mark.parametrize('seed', range(40))
def test_each_item_is_finished_once_in_its_turn_whatever_fails(seed):
    draw = random.Random(seed)
    count, tried = draw.randint(1, 6), []
    # an abort is its own oracle's affair, stuck that of the oracle of the machine around
    failures = {
        item: [draw.choice(['aborted', 'stuck']) for _ in range(draw.choice([0, 0, 1, 2]))]
        for item in range(count)
    }
    planned = {item: len(each) + 1 for item, each in failures.items()}
    items = draw.choice([list, tuple, iter, lambda given: lambda: list(given)])(range(count))
    iterator = smach.Iterator(
        ['done', 'aborted', 'preempted'],
        ['done'],
        ['done'],
        it=items,
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state(
            'EACH',
            Fails(failures, tried),
            loop_outcomes=['ok'],
            final_outcome_map={'stuck': 'aborted'},
        )
    machine = smach.StateMachine(['done', 'aborted', 'preempted'])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('ALL', iterator)
    OracleContainer.wrap(
        machine,
        settings={
            'max_recoveries': 100,
            'memory': 1000,
            'userdata': draw.choice(['restore', 'keep']),
        },
    )
    assert machine.execute() == 'done'
    assert machine.userdata.done == list(range(count))
    assert tried == [item for item in range(count) for _ in range(planned[item])]
