"""A store whose last write is cut off at any byte, as by a power cut, stands at a whole moment."""

import os
import sqlite3

from smach_oracle.store.codecs import Codecs
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile

SMALL_PAGES = 512  # bytes, so that the last write has few
BEFORE, AFTER = {'key:a': 0}, {'key:a': 1, 'key:b': 'x'}


def moment(seq, values):
    return NewMoment(
        float(seq),
        seq,
        'STATE_START',
        'TASK',
        'A',
        tuple(Fact('TASK', name, Codecs().encode(value)) for name, value in values.items()),
    )


def held(store, trial):
    return {fact.name: Codecs().decode(*fact.value, store.part) for fact in store.facts(trial)}


def test_cut_off_at_every_byte_of_its_last_write_it_is_as_before_or_after(tmp_path):
    path = str(tmp_path / 'robot.db')
    with sqlite3.connect(path) as database:
        database.execute('PRAGMA page_size = {}'.format(SMALL_PAGES))
        database.execute('VACUUM')
    store = StoreFile(path)
    trial = store.begin_trial(NewTrial('TASK', 'abc', ('id', 'description'), 5.0))
    store.add(trial, [moment(0, BEFORE)])
    begin = os.path.getsize(path + '-wal')
    store.add(trial, [moment(1, AFTER)])
    with open(path + '-wal', 'rb') as log, open(path, 'rb') as database:
        whole, pages = log.read(), database.read()
    assert begin + SMALL_PAGES < len(whole) < begin + 20000
    found = []
    for length in range(begin, len(whole) + 1):
        cut = str(tmp_path / 'cut.db')
        for end, content in (('', pages), ('-wal', whole[:length])):
            with open(cut + end, 'wb') as stream:
                stream.write(content)
        opened = StoreFile(cut)
        values = held(opened, trial)
        assert values in (BEFORE, AFTER), length
        assert len(opened.moments(trial)) == (1 if values == BEFORE else 2), length
        found.append(values == AFTER)
        opened.close()
        for name in (cut, cut + '-wal', cut + '-shm'):
            if os.path.exists(name):
                os.remove(name)
    assert found == sorted(found)  # up to one byte it is the one before, from there on the latest
    assert found[-1] and not found[0] and found.count(True) < SMALL_PAGES + 100
