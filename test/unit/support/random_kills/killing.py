"""Runs a tree in one process after another, each killed at a random instant, until it ends."""

import json
import os
import random
import select
import signal
import tempfile
import threading
import time
import traceback
from typing import Any, Dict, List, NamedTuple, Optional

from .building import Told, build
from .drawing import Tree, draw
from .judging import Judge
from .witness import Journal, read_journal

HUNG_AFTER_S = 120.0
EARLY = 0.1  # share of the kills that may come before the trial begins or goes on
EASIER_AFTER = 8  # kills, before the instants lie further apart
READY = b'!'


class Course(NamedTuple):
    """How one tree went; `resumed`: processes that went on where one was killed."""

    seed: str
    kills: int
    resumed: int
    states_again: int
    wrong: List[str]


class Instant(NamedTuple):
    """When a program is killed: so long after its first event, or after its process began."""

    delay_s: float
    is_early: bool


def kill_many(seed: object, kills: int, most_by_tree: int = 25) -> List[Course]:
    """Kill programs until there were so many kills; trees and instants are drawn from the seed."""
    courses: List[Course] = []
    left = kills
    while left > 0:
        tree = draw('{}-{}'.format(seed, len(courses)))
        courses.append(kill_until_it_ends(tree, min(left, most_by_tree)))
        left -= courses[-1].kills
    return courses


def kill_until_it_ends(tree: Tree, most: int) -> Course:
    """Kill the program of a tree at most that often, let it end, and judge what it has done."""
    chance = random.Random('instants ' + tree.seed)
    judge, kills, told = Judge(tree), 0, None
    with tempfile.TemporaryDirectory() as folder:
        journal = os.path.join(folder, 'journal')
        open(journal, 'w').close()
        while told is None:
            scale_s = 0.08 * (1 + kills // EASIER_AFTER)
            instant = (
                None
                if kills == most
                else Instant(chance.uniform(0.0, scale_s), chance.random() < EARLY)
            )
            told = _run(tree, folder, kills + 1, chance.random(), instant)
            kills += told is None
            lines = read_journal(journal)
            if told is None and any(line.get('kind') == 'TRIAL_END' for line in lines):
                told = {'outcome': 'ok', 'threads': [], 'rates': None}  # it had ended
    judge.read(lines)
    judge.end(told)
    begun = sum(line['what'] == 'begins' for line in lines)
    due = sum(len(tree.visits_of(path)) for path in tree.leaves)
    return Course(
        tree.seed,
        kills,
        sum(line['what'] == 'event' and line['kind'] == 'RESUMED' for line in lines),
        begun - due,
        judge.wrong,
    )


def _run(
    tree: Tree, folder: str, run: int, seed: float, instant: Optional[Instant]
) -> Optional[Dict[str, Any]]:
    """Run the program; return what it has told, None where it was killed before it did.

    `instant`: None: it is not killed.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.close(reader)
        _work(tree, folder, run, seed, writer)
    os.close(writer)
    try:
        if instant is None or not instant.is_early:
            os.read(reader, len(READY))
        wait_s = HUNG_AFTER_S if instant is None else instant.delay_s
        if not _has_told(reader, wait_s):
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        with os.fdopen(os.dup(reader), 'rb') as stream:
            told = stream.read().lstrip(READY)
    finally:
        os.close(reader)
    if told:
        return dict(json.loads(told))
    return {'error': 'hung'} if instant is None else None


def _has_told(reader: int, limit_s: float) -> bool:
    """Wait until a program has told how it ended, at most for a time."""
    return bool(select.select([reader], [], [], limit_s)[0])


def _work(tree: Tree, folder: str, run: int, seed: float, writer: int) -> None:
    """Execute the tree in this process, tell how it ended, and end the process."""
    told: Dict[str, Any] = {}
    try:
        path = os.path.join(folder, 'journal')
        machine = build(
            Told(tree, Journal(path, run), read_journal(path), random.Random(seed)),
            os.path.join(folder, 'robot.db'),
        )
        _say_at_first_event(machine, writer)
        told['outcome'] = machine.execute()
        told['rates'] = [
            ['{}/{}'.format(row.path, row.state), row.successes + row.failures]
            for row in machine.rates()
        ]
        told['threads'] = _threads_left()
    except BaseException:
        told['error'] = traceback.format_exc()
    os.write(writer, json.dumps(told).encode())
    os._exit(0)


def _say_at_first_event(machine: Any, writer: int) -> None:
    observers = machine._oracle.events.observers

    def say(_: object) -> None:
        observers.remove(say)
        os.write(writer, READY)

    observers.append(say)


def _threads_left() -> List[str]:
    until = time.monotonic() + 5.0
    left = [thread for thread in threading.enumerate() if thread is not threading.main_thread()]
    for thread in left:
        thread.join(max(0.0, until - time.monotonic()))
    return [thread.name for thread in left if thread.is_alive()]
