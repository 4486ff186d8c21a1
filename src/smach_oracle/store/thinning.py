"""Takes moments out of a trial that goes on for long, so that its store does not grow without end.

A moment that goes hands what it has to the next one that stays. So each moment that stays says what
it has always said. Of the last ones that is all. An older one may not know any more with what
userdata some states had begun by then.
"""

import sqlite3
from typing import Dict, List, NamedTuple, Optional, Set, Tuple

from .names import EDIT, RENAMED, STRUCTURE
from .retention import used_parts
from .store_file import StoreFile, transaction

LAST = 100  # moments that all stay
EVERY = 500  # moments more before it is done again
BEGINS = 'STATE_START'  # with the userdata of then a state is entered again
# moments of a state that has failed: the userdata of its entry have what they have, too
AFTER_FAILURE = ('PRECONDITION_START', 'DECISION', 'QUERY_OPENED')
_Key = Tuple[str, str]


class _ListedMoment(NamedTuple):
    number: int
    kind: str
    path: str
    label: str
    after: Optional[int]


def thin(store: StoreFile, trial: int) -> int:
    """Take out what nothing needs of a trial, and return how many moments have gone.

    :raises StoreError: where that cannot be done. Nothing has changed then.
    """
    with transaction(store) as database:
        moments = [
            _ListedMoment(*row)
            for row in database.execute(
                'SELECT number, kind, path, label, after FROM moments WHERE trial = ? '
                'ORDER BY number',
                (trial,),
            )
        ]
        ends = {each.after for each in moments if each.after is not None}
        kept = _kept(moments[:-LAST], ends, _renamed(database, trial))
        kept.update(each.number for each in moments[-LAST:])
        going = [each.number for each in moments if each.number not in kept]
        if going:
            _hand_on(database, trial, kept)
            database.executemany(
                'DELETE FROM moments WHERE number = ?', [(number,) for number in going]
            )
            if store.added_parts:
                _drop_parts(database, store.added_parts)
        return len(going)


def _renamed(database: sqlite3.Connection, trial: int) -> Set[int]:
    """Return the moments from which on states have other names."""
    return {
        int(number)
        for (number,) in database.execute(
            'SELECT moment FROM facts JOIN moments ON moment = moments.number WHERE trial = ? AND '
            "facts.path = '' AND name IN (?, ?)",
            (trial, STRUCTURE, RENAMED),
        )
    }


def _kept(moments: List[_ListedMoment], ends: Set[int], renamed: Set[int]) -> Set[int]:
    """Return which of the older moments stay. `ends`: those from which the trial has gone on.

    They are the first one, and those from which the trial has gone on, of changes by hand and of
    new names, with the last entry of each state and the decisions since. What is before one that
    is read by its kind stays as well, or what it has would be taken for a part of that one.
    """
    kept = {each.number for each in moments[:1]}
    begun: Set[Tuple[str, str]] = set()
    is_end = True  # whether nothing older may be handed on to the moment behind
    for each in reversed(moments):
        place, stands_alone = (each.path, each.label), False
        if each.number in ends:
            begun = set()  # what is newer is a line of moments that was left
        if is_end or each.number in ends:
            kept.add(each.number)
        if each.after is not None or each.number in renamed or each.kind == EDIT:
            stands_alone = True
        elif each.kind in AFTER_FAILURE and place not in begun:
            stands_alone = True
        elif each.kind == BEGINS and place not in begun:
            begun.add(place)
            kept.add(each.number)
        if stands_alone:
            kept.add(each.number)
        if each.after is not None:
            begun = set()
        is_end = stands_alone
    return kept


def _hand_on(database: sqlite3.Connection, trial: int, kept: Set[int]) -> None:
    """Give each moment that stays the latest facts of those before it that go."""
    pending: Dict[_Key, Tuple[int, bool]] = {}  # row, whether it says that it is gone
    known: Set[_Key] = set()  # that a moment which stays has had
    gone: List[Tuple[int]] = []
    moved: List[Tuple[int, int]] = []
    latest = 0

    def hand_to(moment: int) -> None:
        for key, (row, says_gone) in pending.items():
            if says_gone and key not in known:
                gone.append((row,))
            else:
                known.add(key)
                moved.append((moment, row))
        pending.clear()

    for moment, row, path, name, says_gone in database.execute(
        'SELECT moments.number, facts.rowid, facts.path, name, text IS NULL AND whole IS NULL '
        'FROM moments LEFT JOIN facts ON moment = moments.number WHERE trial = ? '
        'ORDER BY moments.number, facts.rowid',
        (trial,),
    ).fetchall():
        if moment != latest and latest in kept:
            hand_to(latest)
        latest = moment
        if row is None:
            continue
        before = pending.pop((path, name), None)
        if before is not None:
            gone.append((before[0],))
        if moment in kept:
            known.add((path, name))
        else:
            pending[path, name] = (row, bool(says_gone))
    hand_to(latest)
    database.executemany('DELETE FROM facts WHERE rowid = ?', gone)
    database.executemany('UPDATE facts SET moment = ? WHERE rowid = ?', moved)


def _drop_parts(database: sqlite3.Connection, added: Dict[bytes, int]) -> None:
    """Take out of `added` and of the store what no fact refers to any more.

    Nothing older than a part that is new in the store refers to it, so no older fact is read.
    """
    for digest in set(added).difference(used_parts(database, min(added.values()))):
        database.execute('DELETE FROM parts WHERE digest = ?', (digest,))
        del added[digest]
