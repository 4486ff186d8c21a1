"""Moments are taken out of a trial that goes on for long, and each that stays says what it said."""

import json
import random

from killed_machines import in_a_process

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.checkpoint.stored_tree import read_tree
from smach_oracle.store.codecs import Codecs, Encoded
from smach_oracle.store.names import EDIT
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile, transaction
from smach_oracle.store.thinning import LAST, thin

KINDS = ['STATE_START'] * 6 + ['TRANSITION'] * 3 + ['DECISION', 'QUERY_OPENED', EDIT, 'JUMP']


def drawn(chance, moments):
    """That many moments as a machine could have left them, some from an earlier one."""
    for index in range(moments):
        path, label = chance.choice(['TOP', 'TOP/IN']), chance.choice('ABC')
        facts = {'key:' + chance.choice('xyz'): [index, 'x' * 40]}
        if chance.random() < 0.7:
            facts['at'] = [label, chance.choice(['before', 'in'])]
        if chance.random() < 0.1:
            facts['execution'] = index
        if chance.random() < 0.3:
            facts['goal:{}'.format(index)] = 'server'
        told = [
            Fact(
                path if not name.startswith('goal') else '',
                name,
                Encoded(json.dumps(value), None, {}),
            )
            for name, value in facts.items()
        ]
        if chance.random() < 0.3:
            told.append(Fact('', 'goal:{}'.format(index - 1), None))
        after = chance.randint(1, index) if index and chance.random() < 0.004 else None
        yield NewMoment(float(index), index, chance.choice(KINDS), path, label, tuple(told), after)


def all_told(store, trial, moment):
    tree = read_tree(store, trial, moment)
    return {
        path: {name: value for name, value in vars(container).items() if name != 'begun'}
        for path, container in tree.containers.items()
    }, tree.goals


def test_whatever_stays_says_what_it_said(tmp_path):
    for seed in range(3):
        chance = random.Random(seed)
        store = StoreFile(str(tmp_path / '{}.db'.format(seed)), 'OFF')
        trial = store.begin_trial(NewTrial('TOP', 'id', ('s', '{}'), 0.0))
        other = store.begin_trial(NewTrial('OTHER', 'other', ('s', '{}'), 0.0))
        for moment in drawn(chance, 400):
            # `after` is the number of a moment of this trial, and the other's lie between
            after = moment.after and 2 * moment.after - 1
            store.add(trial, [moment._replace(after=after)])
            store.add(other, [moment._replace(after=None)])
        numbers = [each.number for each in store.moments(trial)]
        before = {number: all_told(store, trial, number) for number in numbers}
        of_other = all_told(store, other, None)
        gone = thin(store, trial)
        left = [each.number for each in store.moments(trial)]
        assert gone == len(numbers) - len(left) and gone > 100, (seed, gone)
        assert left[-LAST:] == numbers[-LAST:]
        for number in left[::3]:
            (now, goals), (was, goals_then) = all_told(store, trial, number), before[number]
            if number not in left[-LAST:]:  # may have lost with what userdata a state had begun
                for path, container in now.items():
                    snapshots, had = container.pop('snapshots'), was[path].pop('snapshots')
                    assert not set(snapshots).difference(had)
            assert (now, goals) == (was, goals_then), (seed, number)
        assert all_told(store, other, None) == of_other
        assert len(store.moments(other)) == 400
        assert thin(store, trial) <= 100
        store.close()


def trial_with(store, name, values):
    """A trial with one moment for each value."""
    trial = store.begin_trial(NewTrial('TOP', name, ('s', '{}'), 0.0))
    for seq, value in enumerate(values):
        store.add(
            trial,
            [
                NewMoment(
                    0.0,
                    seq,
                    'TRANSITION',
                    'TOP',
                    'A',
                    (Fact('TOP', 'key:x', Codecs().encode(value)),),
                )
            ],
        )
    return trial


def test_bytes_that_another_trial_refers_to_stay(tmp_path):
    path = str(tmp_path / 'robot.db')
    images = [bytes([number]) * 5000 for number in range(150)]
    texts = [[text.decode('latin-1') * 20, text] for text in images]
    before = StoreFile(path, 'OFF')
    old = trial_with(before, 'old', images[:9] + texts[:9])
    before.close()
    store, beside = StoreFile(path, 'OFF'), StoreFile(path, 'OFF')
    trial = trial_with(store, 'new', texts + images)
    other = trial_with(beside, 'beside', images[5:20] + texts[5:20])
    thin(store, trial)
    for number, wanted in (
        (old, images[:9] + texts[:9]),
        (other, images[5:20] + texts[5:20]),
        (trial, images[-LAST:]),
    ):
        values = [Codecs().decode(*fact.value, store.part) for fact in store.facts(number)]
        assert values[-len(wanted) :] == wanted
    with transaction(store) as database:
        (left,) = database.execute('SELECT count(*) FROM parts').fetchone()
    needed = {*range(20), *range(149 - LAST, 150)}  # and the texts of twenty
    assert left == len(needed) + 20
    beside.close()
    store.close()


def test_what_a_thinning_takes_does_not_grow_with_the_trials_before(tmp_path):
    took = []
    for moments in (0, 5000):
        path = str(tmp_path / '{}.db'.format(moments))
        with_old = StoreFile(path, 'OFF')
        trial = with_old.begin_trial(NewTrial('TOP', 'old', ('s', '{}'), 0.0))
        with_old.add(
            trial,
            [
                NewMoment(
                    0.0,
                    seq,
                    'TRANSITION',
                    'TOP',
                    'A',
                    (Fact('TOP', 'key:x', Codecs().encode([seq, b'x' * 2000])),),
                )
                for seq in range(moments)
            ],
        )
        with_old.close()
        store, steps = StoreFile(path, 'OFF'), [0]
        trial = trial_with(
            store,
            'new',
            [[seq, 'x' * 300, bytes([seq % 256, seq // 256]) * 2000] for seq in range(300)],
        )
        with transaction(store) as database:
            database.set_progress_handler(
                lambda counted=steps: counted.__setitem__(0, counted[0] + 1), 100
            )
        assert thin(store, trial) > 100
        took.append(steps[0])
        store.close()
    assert 0 < took[1] < 1.3 * took[0], took


def loops(path, rounds):
    """Run a machine of three states that goes round, one of them with a large value each time."""

    def work():
        for level in ('info', 'warn', 'debug'):
            setattr(smach, 'log' + level, lambda *args: None)
        left = [rounds]

        def look(userdata):
            left[0] -= 1
            userdata.image = bytes([left[0] % 256, left[0] // 256]) * 5000
            return 'succeeded' if left[0] else 'enough'

        machine = smach.StateMachine(['succeeded', 'enough'])
        with machine:
            smach.StateMachine.add(
                'LOOK',
                smach.CBState(look, outcomes=['succeeded', 'enough'], output_keys=['image']),
                {'succeeded': 'POUR'},
            )
            smach.StateMachine.add(
                'POUR',
                smach.CBState(lambda userdata: 'succeeded', outcomes=['succeeded']),
                {'succeeded': 'LOOK'},
            )
        OracleContainer.wrap(
            machine,
            name='TOP',
            settings={
                'checkpoint': path,
                'checkpoint_synchronous': 'OFF',
                'checkpoint_wait_s': 60,
                'states': {'POUR': {'on_retry': 'never'}},
            },
        ).execute()

    assert in_a_process(work) is None


def test_a_trial_without_end_has_a_store_that_does_not_grow(tmp_path):
    sizes, facts = [], []
    for rounds in (700, 2100):
        path = tmp_path / '{}.db'.format(rounds)
        loops(str(path), rounds)
        store = StoreFile(str(path), read_only=True)
        moments = store.moments(1)
        assert LAST < len(moments) < 1000
        assert moments[0].kind == 'TRIAL_START' and moments[-1].kind == 'TRIAL_END'
        sizes.append(path.stat().st_size)
        facts.append(len(list(store.facts(1))))
        told = read_tree(store, 1).container('TOP')
        assert told.states['POUR']['counts'][0] == rounds - 1
        assert told.marks['POUR'][2] is True
        assert len(told.visits) >= 50 and told.visits_of_execution == 2 * rounds - 1
    assert sizes[1] < 1.5 * sizes[0], sizes
    assert facts[1] < 1.5 * facts[0], facts
