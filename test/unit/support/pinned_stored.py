"""What a store is told of userdata, records and marks that are drawn at random, and what it says.

    python3 test/unit/support/pinned_stored.py FOLDER [--pin]

writes that to FOLDER, and with --pin the digests to test/data/pinned/stored.txt. What users see of
a change is the difference of two folders, of before and after it.
"""

import copy
import itertools
import json
import random
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional
from unittest import mock

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from pinned import ADDRESS, drawn, write_told
from pinned_resumptions import changed
from pinned_trees import plan_of, written
from tree_model.building import World, build
from tree_model.drawing import UPSTREAM

import smach
from smach_oracle.oracle.checkpoint.container_facts import ContainerFacts, UserdataFacts, fact_of
from smach_oracle.oracle.checkpoint.stored_marks import marks_now, same_place
from smach_oracle.oracle.checkpoint.stored_tree import StoredContainer, StoredTree, read_tree
from smach_oracle.oracle.checkpoint.structure import differences, structure_of
from smach_oracle.oracle.decision.ways import PLACES, WayKind, WayResult
from smach_oracle.oracle.machine.container_records import ContainerRecords
from smach_oracle.oracle.records.history import History
from smach_oracle.oracle.records.streaks import OpenStreak
from smach_oracle.oracle.records.visits import VisitResult
from smach_oracle.oracle.settings.settings import StateSettings
from smach_oracle.store.codecs import Encoded
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile

KEYS = ('a', 'b', 'c', 'of a \udcff file')
LABELS = 'ABCD'
PATHS = ('T', 'T/A', 'T/M', 'T/M/A')
COUNTS = (0, 0, 1, 2)


class Stores:
    """A store in which each draw has a trial of its own."""

    def __init__(self, folder: str) -> None:
        self.file = StoreFile(folder + '/robot.db', 'OFF')
        self._numbers = itertools.count()

    def trial(self) -> 'Trial':
        """A new trial."""
        return Trial(
            self.file,
            self.file.begin_trial(NewTrial('T', str(next(self._numbers)), ('', '{}'), 0.0)),
        )


class Trial:
    """A trial in a store."""

    def __init__(self, store: StoreFile, number: int) -> None:
        self.store, self.number = store, number

    def add(self, facts: List[Fact], kind: str = 'JUMP', path: str = 'T', label: str = '') -> None:
        """Add a moment."""
        self.store.add(self.number, [NewMoment(0.0, 0, kind, path, label, tuple(facts))])

    def read(self, until: Optional[int] = None) -> StoredTree:
        """What it says."""
        return read_tree(self.store, self.number, until)


def tell() -> Dict[str, List[str]]:
    """Return a line for each thing that is told, by the draws that it comes from."""
    quiet = mock.patch.multiple(smach, logdebug=repr, logwarn=repr, logerr=repr)
    with tempfile.TemporaryDirectory() as folder, quiet:
        stores = Stores(folder)

        def of_userdata(rng: random.Random) -> Iterator[str]:
            return _of_userdata(rng, stores.trial())

        def of_containers(rng: random.Random) -> Iterator[str]:
            return _of_containers(rng, stores.trial())

        def of_facts(rng: random.Random) -> Iterator[str]:
            return _of_facts(rng, stores.trial())

        groups = (
            ('userdata', 4, of_userdata),
            ('containers', 4, of_containers),
            ('facts', 6, of_facts),
            ('marks', 4, _of_marks),
            ('structures', 4, _of_structures),
        )
        try:
            return drawn(groups, draws=10)
        finally:
            stores.file.close()


def _told(facts: List[Fact]) -> List[str]:
    return ['{} {}: {}'.format(each.path, each.name, _value(each.value)) for each in facts]


def _value(value: Optional[Encoded]) -> str:
    if value is None:
        return 'gone'
    return value.text or '{} of {}'.format((value.whole or b'').hex(), len(value.parts))


# -- userdata


def _of_userdata(rng: random.Random, trial: Trial) -> Iterator[str]:
    """Userdata of a container that change, and what is told of them each time."""
    data: Dict[str, Any] = {}
    kept_out: List[Any] = []
    facts = UserdataFacts('T', kept_out.append)
    for _ in range(30):
        for _ in range(rng.choice((0, 1, 2))):
            key, other = rng.choice(KEYS), rng.choice(KEYS)
            chance = rng.random()
            if chance < 0.1:
                data.pop(key, None)
            elif chance < 0.2 and other in data:
                data[key] = data[other]
            elif chance < 0.4 and type(data.get(key)) is list:
                data[key].append(rng.choice((1, 'x')))
            elif chance < 0.5 and type(data.get(key)) in (list, tuple):
                data[key] = copy.deepcopy(data[key])
            else:
                data[key] = _drawn_value(rng)
        reached = rng.choice((None, frozenset(each for each in KEYS if rng.random() < 0.7)))
        told = list(facts.changed(data, reached))
        trial.add(told)
        yield '{} {}'.format(reached and sorted(reached), _told(told))
        for each in kept_out:
            yield ADDRESS.sub('', 'kept out {}'.format(each[:3]))
        kept_out.clear()
    list(facts.changed(data, None))
    here = trial.read().container('T')
    yield repr((sorted(here.keys.items()), sorted(here.missing.items()), sorted(here.gone)))


def _drawn_value(rng: random.Random) -> Any:
    return rng.choice(
        (
            lambda: rng.choice((1, 1.0, True, None, 'text', 'long ' * 60, bytes(2), bytes(300))),
            lambda: [rng.choice((1, 'x')), [2]],
            lambda: (1, 'x'),
            lambda: [rng.choice((bytes, bytearray))(rng.choice((2, 300)))],
            lambda: {'x': ['long'] * 80},
            lambda: {'x': ['long'] * 80, 'y': rng.choice((bytes, bytearray))(300)},
            threading.Lock,
            lambda: [object()],
        )
    )()


# -- records


def _of_containers(rng: random.Random, trial: Trial) -> Iterator[str]:
    """The records of a container, what is told of them, and of those with which it goes on."""
    records, before = ContainerRecords(History(rng.choice((3, 9)))), StoredContainer()
    facts = _facts_of(records, before)
    streaks = records.streaks
    for _ in range(30):
        label, chance = rng.choice(LABELS), rng.random()
        record = records.by_label.get(label)
        if record is None:
            record = records.make(label, StateSettings(memory=3), False)
        told: List[Fact] = []
        if chance < 0.1:
            records.history.begin_execution()
            streaks.end_execution()
            told += facts.begin_execution()
        elif chance < 0.2:
            records.history.supersede(label, 'ok', False)
        elif chance < 0.4:
            records.note_failure(record)
            record.learn(True)
            records.visit_ended(record, 'aborted', VisitResult.FAILURE)
            streak = streaks.setdefault(label, OpenStreak(0, 1.0, tuple(LABELS)))
            streak.note(rng.choice(('again', 'from A')), rng.random() < 0.5)
            record.recoveries += 1
            if rng.random() < 0.5:
                way = WayResult('again', WayKind.AGAIN.value, rng.choice(PLACES), 'f', None, 0.0)
                record.go_way(way, lambda: 1.5)
        else:
            for _ in range(rng.choice((1, 1, 1, 4))):
                records.visit_ended(record, 'ok', VisitResult.SUCCESS)
            streaks.pop(label, None)
        mark = records.marks[rng.choice(LABELS)]
        mark.reached, mark.done = rng.randrange(3), rng.random() < 0.5
        chance = rng.random()
        if chance < 0.6:
            told += facts.changed(sorted(rng.sample(LABELS, rng.randrange(4))))
            told += facts.marks()
        elif chance < 0.7:
            told += facts.streaks()
        elif chance < 0.8:
            told += facts.all_states()
        trial.add(told)
        yield str(_told(told))
        if rng.random() < 0.05:
            trial.add(list(facts.all_states()))
            before = trial.read().container('T')
            yield written(vars(before))
            records.history.take_over(
                before.visits, before.visits_of_execution, records.history.told(), lambda _: True
            )
            facts = _facts_of(records, before)
    trial.add([*facts.all_states(), *facts.marks()])
    yield written(vars(trial.read().container('T')))


def _facts_of(records: ContainerRecords, before: StoredContainer) -> ContainerFacts:
    return ContainerFacts('T', records, lambda label: 'never ' + label, before)


# -- what is read


def _of_facts(rng: random.Random, trial: Trial) -> Iterator[str]:
    """Facts of each kind, and what they come to at moments of their trial."""
    for _ in range(rng.choice((0, 1, 12, 24))):
        kind = rng.choice(
            ('STATE_START', 'STATE_START', 'DECISION', 'QUERY_OPENED', 'EDIT', 'JUMP')
        )
        path, label = rng.choice(PATHS[:2]), rng.choice(LABELS[:2])
        facts = [_drawn_fact(rng, path) for _ in range(rng.choice((0, 1, 3)))]
        trial.add(facts, kind, path, label)
    moments = [each.number for each in trial.store.moments(trial.number)]
    for until in (None, *rng.sample(moments, min(len(moments), 2))):
        tree = trial.read(until)
        yield '{} {}'.format(written(tree.whole), written(tree.goals))
        above, below = (tree.container(path).keys for path in PATHS[:2])
        yield str([above.get(key) is not None and above[key] is below.get(key) for key in 'ab'])
        for path, here in sorted(tree.containers.items()):
            place = (sorted(here.labels()), here.phase, here.moved_to, here.jumped_to, here.label)
            yield '{} {} {}'.format(path, written(vars(here)), written(place))
            here.complete_snapshots({'a': 'now', 'b': 'now'})
            yield '{} {}'.format(written(here.snapshots), [here.visits_of(each) for each in LABELS])
    trial.add([Fact('T', rng.choice(('at', 'history', 'streaks')), Encoded('{', None, {}))])
    try:
        trial.read()
    except Exception as err:
        yield str(err)


def _drawn_fact(rng: random.Random, here: str) -> Fact:
    path = rng.choice((here, here, *PATHS, ''))
    if not path:
        name = rng.choice(('goal:1', 'goal:2', 'paused', 'questions'))
        return fact_of('', name, rng.choice((None, 'arm', 3)))
    label, number = rng.choice(LABELS), rng.choice(COUNTS)
    at = rng.choice(
        (
            [label, 'before'],
            [label, 'before', rng.choice((None, 'T/M/A'))],
            [label, 'before', None, ['A', 'M/A']],
            [label, 'in'],
            [label, 'in', 'T/M/A'],
            [label, 'failed', 1, 'aborted', ''],
            ['succeeded', 'ended'],
            [label, 'moved', 'T/M/A', ['A', rng.choice(('in', 'before', 'failed'))]],
        )
    )
    name, plain = rng.choice(
        (
            ('at', at),
            ('at', at),
            ('execution', rng.choice((1, 2))),
            ('history', ['A', 'B', None]),
            ('streaks', {'A': [0, 1.0, [], ['again'], 1, '']}),
            ('asked', [label, 'id']),
            ('items', number),
            ('visit:{}'.format(number), [label, 'ok', 1, rng.choice((1, 2)), number]),
            ('visit:{}:{}'.format(rng.choice((1, 2)), number), [label, 'ok', 2]),
            ('state:' + label, {'learned': {}, 'counts': [number, 0, 0, 0], 'longest_s': None}),
            ('state:' + label, {'counts': [1, 0, 0, 0], 'mark': [1, 1, True, False]}),
            ('ways:' + label, {'ways': {}, 'ways_total': number}),
            ('mark:' + label, [number, 1, True, False, 'never']),
            ('out:' + rng.choice('ab'), ['file', 'no codec']),
            ('key:' + rng.choice('abc'), number),
            ('key:' + rng.choice('ab'), [number]),
            ('key:' + rng.choice('ab'), [number]),
            ('key:' + rng.choice('ab'), [number]),
            ('key:' + rng.choice('abc'), rng.choice(({'$by': ['none', 1]}, [1], 'text'))),
        )
    )
    is_gone = rng.random() < 0.15 and name.startswith(('at', 'asked', 'items', 'key', 'out'))
    return Fact(path, name, None) if is_gone else fact_of(path, name, plain)


# -- marks


def _of_marks(rng: random.Random) -> Iterator[str]:
    """The marks with which a trial goes on, from its last moment or another, with other names."""
    latest = StoredTree({path: _drawn_container(rng) for path in PATHS}, {})
    tree = StoredTree(
        {
            path: rng.choice((container, _drawn_container(rng)))
            for path, container in latest.containers.items()
            if rng.random() < 0.9
        },
        {},
    )
    names = {label: rng.choice((label, 'A')) for label in LABELS}
    for place_of in (same_place, lambda path, label: (path, names[label])):
        for place, mark in sorted(marks_now(copy.deepcopy(latest), latest, place_of).items()):
            yield 'other {} {}'.format(place, vars(mark))
        for place, mark in sorted(marks_now(latest, tree, place_of).items()):
            yield '{} {}'.format(place, vars(mark))


def _drawn_container(rng: random.Random) -> StoredContainer:
    def some() -> List[str]:
        return [label for label in LABELS if rng.random() < 0.4]

    return StoredContainer(
        at=rng.choice(([], ['A', 'in'], ['B', 'before'], ['ok', 'ended'], ['A', 'moved', 'T/M/A'])),
        states={label: {'counts': [rng.choice(COUNTS), 0, 0, 0]} for label in some()},
        marks={label: [rng.choice(COUNTS) for _ in range(4)] for label in some()},
        begun={*some()},
    )


# -- structures


def _of_structures(rng: random.Random) -> Iterator[str]:
    """The structure of a tree, and what differs in another one."""
    plan = plan_of(rng.randrange(1000), UPSTREAM)
    other = plan
    for _ in range(rng.choice((0, 1, 1, 3))):
        other = changed(other, rng)
    one, two, third = (
        structure_of(build(World(each)), rng.choice(('', 'L1')))
        for each in (plan, other, plan_of(rng.randrange(1000), UPSTREAM))
    )
    odd = smach.StateMachine(['ok', 2])
    with odd:
        odd.add('ONE', smach.State(['ok', 2]), {'ok': 'NONE', 2: 2})
        odd.add('NONE', smach.Iterator(['ok'], [], [], [], 'item', exhausted_outcome='ok'))
    yield structure_of(odd, '').description
    yield one.id
    yield one.description
    for before, now in ((one, two), (two, one), (one, third), (one, one)):
        yield json.dumps(differences(before.description, now.description))
    yield json.dumps(differences(one.description[:-1], one.description))


if __name__ == '__main__':
    write_told('stored', tell(), Path(sys.argv[1]), '--pin' in sys.argv)
