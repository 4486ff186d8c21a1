"""Borders of files: bags, rates, stores, and values that a store holds."""

import contextlib
import functools
import io
import json
import math
import os
import shutil
import sqlite3
import tempfile
from typing import Any, Dict, Iterator, List
from unittest import mock

from crafted_bags import crafted_bag, event
from fake_trials import play
from hypothesis import strategies as st

import smach
from smach_oracle.analysis import bag_events, bag_worker, table
from smach_oracle.analysis.bag_events import BagError, MessageStores
from smach_oracle.analysis.bag_worker import BagReadError, BagRequest, reply_of
from smach_oracle.analysis.trials import load_trials
from smach_oracle.analysis.variants import count_variants, time_series
from smach_oracle.expert.console.feeds.views import event_view
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.errors import CheckpointError
from smach_oracle.oracle.records import rates_format
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.ros.recording.bag_repair import recover_folder
from smach_oracle.store import opening, state_command
from smach_oracle.store.codecs import Codecs, NotReadable, NotStorable

from .border import REFUSED, TAKEN, Border, refused
from .json_texts import json_texts
from .values import Damage, damaged, damages, mapping_of, numbers, plain, texts, words

# thousands of small files that are synced: in memory, where the system has a folder there
_MEMORY = '/dev/shm' if os.access('/dev/shm', os.W_OK) else None


@contextlib.contextmanager
def folder() -> Iterator[str]:
    """A folder that goes."""
    made = tempfile.mkdtemp(prefix='border', dir=_MEMORY)
    try:
        yield made
    finally:
        shutil.rmtree(made, ignore_errors=True)


def written(path: str, data: bytes) -> str:
    """The path of a file with these bytes."""
    with open(path, 'wb') as stream:
        stream.write(data)
    return path


def _quiet(*_: object) -> None:
    pass


# -- bags


@functools.lru_cache(None)
def recorded() -> bytes:
    """A bag as the recorder writes it."""
    with folder() as where:
        recorder = TrialRecorder(where, warn=_quiet, say=_quiet)
        play(recorder, 1)
        assert recorder.close(60.0)
        (bag,) = os.listdir(where)
        with open(os.path.join(where, bag), 'rb') as stream:
            return stream.read()


_STORES = MessageStores()  # which remembers definitions: else each example parses them again
_NAME = '20150401T101112.345Z_t.bag'


def _take_bag(damage: Damage) -> str:
    with folder() as where:
        return _counted(written(os.path.join(where, _NAME), damage.of(recorded())))


def _counted(path: str) -> str:
    with mock.patch.object(bag_events, 'MessageStores', lambda: _STORES):
        return _read(path)


def _read(path: str) -> str:
    """Count a bag as bag_statistics does, and as the console does."""
    try:
        found = load_trials([path])
    except BagError as err:
        return refused(err, path)
    variants = count_variants(found.trials)
    table.format_text(variants, found.trials)
    table.write_json(io.StringIO(), variants, found.trials, found.skipped)
    table.write_csv(io.StringIO(newline=''), found.trials)
    time_series(found.trials)
    for trials in [[]] + [[each.trial_id] for each in found.trials]:
        request = BagRequest([path], trials, 100 if trials else 0)
        text = bag_worker._reply(request)
        try:
            reply = reply_of(text.encode())
        except BagReadError as err:
            refused(err)
            continue
        json.dumps([event_view(each) for each in reply.events], allow_nan=False)
        for each in reply.trials:
            assert math.isfinite(each.summary.start_time + each.summary.duration_s)
    return TAKEN


_event_fields = st.fixed_dictionaries(
    {},
    optional={
        'kind': st.integers(0, 40),
        'trial_id': texts,
        'seq': st.integers(0, 2**32 - 1),
        'wall_time': st.floats(),
        'path': texts,
        'state': texts,
        'outcome': texts,
        'target': texts,
        'failure_kind': st.integers(0, 255),
        'failure_class': st.integers(0, 255),
        'rate': st.floats(),
        'query_id': texts,
        'by': texts,
        'text': texts,
        'data': st.one_of(
            mapping_of(
                {
                    'recovers': st.booleans(),
                    'experiment': texts,
                    'variant': texts,
                    'seed': plain,
                    'settings': plain,
                    'last_seq': plain,
                    'to': plain,
                    'tried': plain,
                    'initial': plain,
                    'policy': plain,
                }
            ),
            plain,
        ),
    },
)


def _take_event(fields: Dict[str, Any]) -> str:
    with folder() as where:
        return _counted(written(os.path.join(where, _NAME), crafted_bag(event(**fields))))


def _take_active(damage: Damage) -> str:
    said: List[str] = []
    data = damage.of(recorded())
    with folder() as where:
        path = written(os.path.join(where, _NAME + '.active'), data)
        os.utime(path, (1, 1))
        mended = recover_folder(where, _quiet, said.append)
        for each in mended:
            _counted(each)
        if os.path.exists(path) and damage.kind != 'another':  # which may be of another program
            refused(' '.join(said), 'left as it is')
        return TAKEN if mended else REFUSED


# -- rates

_estimators = mapping_of(
    {
        'estimator': words('window', 'exponential'),
        'successes': st.integers(0, 9),
        'failures': st.integers(0, 9),
        'window': st.lists(st.sampled_from((0, 1)), max_size=5),
        'rate': st.floats(0, 1),
    }
)
_rates = mapping_of(
    {
        'format': st.just(rates_format.FORMAT),
        'version': st.just(1),
        'containers': st.dictionaries(
            words('', 'KITCHEN'),
            st.dictionaries(words('A', 'LOOK'), _estimators, max_size=2),
            max_size=2,
        ),
    },
    ['format', 'version', 'containers'],
)
_rates_texts = st.one_of(
    _rates.map(json.dumps).map(str.encode),
    json_texts.map(lambda text: text.encode('utf-8', 'surrogatepass')),
    _rates.map(lambda given: json.dumps(given).encode()).flatmap(damaged),
)


def machine(**settings: Any) -> Any:
    """A small wrapped machine."""
    inner = smach.StateMachine(outcomes=['done', 'aborted'])
    with inner:
        smach.StateMachine.add(
            'LOOK', smach.CBState(lambda ud: 'done', outcomes=['done', 'aborted'])
        )
    made = smach.StateMachine(outcomes=['done', 'aborted'])
    made.userdata.cups = 1
    with made:
        smach.StateMachine.add(
            'A',
            smach.CBState(
                _a, outcomes=['done', 'aborted'], input_keys=['cups'], output_keys=['cups']
            ),
            {'done': 'KITCHEN'},
        )
        smach.StateMachine.add('KITCHEN', inner)
    return OracleContainer.wrap(made, name='task', settings=settings)


def _a(userdata: Any) -> str:
    userdata.cups = 2
    return 'done'


def _take_rates(data: bytes) -> str:
    said: List[str] = []
    with folder() as where, mock.patch.object(smach, 'logwarn', said.append):
        path = written(os.path.join(where, 'rates.json'), data)
        made = machine(rates_file=path)
        for row in made.rates():
            assert 0 <= row.rate <= 1 and row.successes >= 0 and row.failures >= 0
        assert made.execute() == 'done'
        with open(path, encoding='utf-8') as stream:
            assert json.load(stream)['containers']['']['A']['successes'] >= 1, 'learned, and kept'
    return refused(said[0], 'rates.json') if said else TAKEN


# -- stores


@functools.lru_cache(None)
def stored() -> bytes:
    """A store with a trial that was stopped and one that has ended, as one file."""
    with folder() as where:
        path = os.path.join(where, 'robot.db')
        machine(checkpoint=path, checkpoint_synchronous='OFF').execute()
        stopped = machine(checkpoint=path, checkpoint_synchronous='OFF')
        copies: List[bytes] = []

        def copy(told: Any) -> None:
            if told.kind.name == 'STATE_START' and told.state == 'LOOK':
                database = sqlite3.connect(path)
                with contextlib.closing(database):
                    database.execute('VACUUM INTO ?', (path + '.copy',))
                with open(path + '.copy', 'rb') as stream:
                    copies.append(stream.read())

        stopped._oracle.events.observers.append(copy)
        stopped.execute()
        return copies[0]


def waiting_for_nobody() -> Any:
    """No other program changes these stores, so none is waited for."""
    return mock.patch.object(opening, 'LOOKS_AGAIN_S', ())


def _take_store(damage: Damage) -> str:
    with folder() as where:
        return _resumed(written(os.path.join(where, 'robot.db'), damage.of(stored())))


def _resumed(path: str) -> str:
    """Look at a store by oracle_state, and have a machine go on with it."""
    ends = {
        _state_command([path] + words)
        for words in (['list'], ['show'], ['edit', 'cups=3'], ['goto', 'A'])
    }
    said: List[str] = []
    with mock.patch.multiple(smach, logwarn=said.append, logerr=said.append), waiting_for_nobody():
        made = machine(checkpoint=path, checkpoint_synchronous='OFF', on_resume='recover')
        try:
            assert made.execute() in ('done', 'aborted', 'preempted')
        except CheckpointError as err:
            return refused(err, path)
    return TAKEN if ends == {0} else REFUSED


def _state_command(arguments: List[str]) -> int:
    out, err = io.StringIO(), io.StringIO()
    with mock.patch('sys.stdout', out), mock.patch('sys.stderr', err), waiting_for_nobody():
        code = state_command.main(arguments)
    if code:
        refused(err.getvalue(), 'oracle_state: ')
    return code


_facts = st.lists(
    st.tuples(
        words('task', 'task/KITCHEN', ''),
        words(
            'at',
            'history',
            'execution',
            'asked',
            'items',
            'state:A',
            'state:LOOK',
            'visit:0:0',
            'key:cups',
            'out:cups',
            'goal:g',
            'counted',
            'budget',
            'tree',
            'seq',
        ),
        st.one_of(json_texts, st.none()),
        st.one_of(st.none(), st.binary(max_size=20)),
    ),
    min_size=1,
    max_size=4,
)


def _take_facts(facts: List[Any]) -> str:
    with folder() as where:
        path = written(os.path.join(where, 'robot.db'), stored())
        with contextlib.closing(sqlite3.connect(path)) as database:
            (last,) = database.execute('SELECT max(number) FROM moments').fetchone()
            for of, name, text, whole in facts:
                if text is not None and not _is_utf8(text):
                    text = None
                database.execute('DELETE FROM facts WHERE path = ? AND name = ?', (of, name))
                database.execute(
                    'INSERT INTO facts VALUES (?, ?, ?, ?, ?)', (last, of, name, text, whole)
                )
            database.commit()
        return _resumed(path)


def _is_utf8(text: str) -> bool:
    try:
        return bool(text.encode('utf-8')) or True
    except UnicodeEncodeError:
        return False


_tagged = st.recursive(
    st.one_of(plain, json_texts),
    lambda inner: st.one_of(
        st.lists(inner, max_size=2),
        st.tuples(
            st.sampled_from(
                (
                    '$tuple',
                    '$float',
                    '$map',
                    '$bytes',
                    '$bytearray',
                    '$set',
                    '$frozenset',
                    '$complex',
                    '$ordered',
                    '$part',
                    '$enum',
                    '$data',
                    '$named',
                    '$by',
                    '$else',
                )
            ),
            st.one_of(
                inner,
                st.lists(st.lists(inner, min_size=2, max_size=2), max_size=2),
                st.lists(
                    st.one_of(words('os:system', 'builtins:object', 'enum:Enum'), inner),
                    min_size=2,
                    max_size=2,
                ),
            ),
        ).map(lambda both: {both[0]: both[1]}),
    ),
    max_leaves=6,
)


def _take_value(value: Any) -> str:
    try:
        Codecs().decode(json.dumps(value), None, lambda digest: b'part')
    except NotReadable as err:
        return refused(err)
    return TAKEN


_anything = st.one_of(
    plain,
    st.binary(max_size=300),
    st.sets(numbers, max_size=3),
    st.tuples(plain, plain),
    st.complex_numbers(),
    st.dictionaries(st.one_of(numbers, st.tuples(texts, texts)), plain, max_size=3),
    st.builds(object),
    st.text(min_size=200, max_size=400),
)


def _take_userdata(value: Any) -> str:
    codecs = Codecs()
    try:
        text, whole, parts = codecs.encode(value)
    except NotStorable as err:
        return refused(err)
    again = codecs.decode(text, whole, parts.__getitem__)
    assert _same(again, value), (again, value)
    return TAKEN


def _same(one: Any, other: Any) -> bool:
    """Whether both are equal, NaN to NaN."""
    if type(one) is not type(other):
        return False
    if isinstance(one, set):
        return sorted(map(repr, one)) == sorted(map(repr, other))
    return one == other or repr(one) == repr(other)


BORDERS = [
    Border('bag, damaged', damages, _take_bag),
    Border('bag, its events', _event_fields, _take_event, (TAKEN,)),
    Border('bag that was being written', damages, _take_active),
    Border('rates file', _rates_texts, _take_rates),
    Border('store, damaged', damages, _take_store),
    Border('store, its facts', _facts, _take_facts),
    Border('store, its values', _tagged, _take_value),
    Border('userdata that is stored', _anything, _take_userdata),
]
