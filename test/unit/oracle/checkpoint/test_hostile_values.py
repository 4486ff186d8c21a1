"""Whatever a value does as it is looked at, it is left out and named, and the rest is stored."""

import threading
import time

import pytest
from hostile_values import (
    HalfSet,
    More,
    OfList,
    Pair,
    Rude,
    SlottedMore,
    boxed,
    holding_itself,
    raising,
    shared,
    values,
    with_more,
)
from hypothesis import HealthCheck, given, settings

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.store.codecs import Codecs, NotReadable, NotStorable
from smach_oracle.store.stopped_trial import StoppedTrial, chosen_trial
from smach_oracle.store.store_file import StoreFile

QUICK = {
    'deadline': None,
    'derandomize': True,
    'database': None,
    'suppress_health_check': list(HealthCheck),
}


def machine_of(tmp_path, steps, **more):
    """A machine with a state for each of these functions, and a store."""
    machine = smach.StateMachine(['ok', 'aborted'])
    with machine:
        for number, step in enumerate(steps):
            smach.StateMachine.add(
                'S{}'.format(number),
                smach.CBState(
                    step, outcomes=['ok'], input_keys=['odd', 'good'], output_keys=['odd', 'good']
                ),
                {'ok': 'S{}'.format(number + 1) if number + 1 < len(steps) else 'ok'},
            )
    OracleContainer.wrap(
        machine,
        name='TOP',
        settings=dict(
            {
                'checkpoint': str(tmp_path / 'robot.db'),
                'checkpoint_synchronous': 'OFF',
                'checkpoint_wait_s': 60,
                'on_resume': 'recover',
            },
            **more,
        ),
    )
    return machine


def writes(value, good=None):
    def step(userdata):
        userdata.odd = value
        userdata.good = good
        return 'ok'

    return step


def stopped(userdata):
    raise KeyboardInterrupt


def stored_keys(tmp_path):
    """The userdata of the trial that was stopped, as `oracle_state show` has it."""
    store = StoreFile(str(tmp_path / 'robot.db'), read_only=True)
    try:
        return {
            key: text for _, key, text in StoppedTrial(store, chosen_trial(store, None)).userdata()
        }
    finally:
        store.close()


def named(log):
    return [text for level, text in log if 'missing where the machine is resumed' in text]


@settings(max_examples=300, **QUICK)
@given(boxed(values))
def test_no_value_raises_anything_but_that_it_cannot_be_stored(box):
    (value,) = box
    codecs = Codecs()
    try:
        text, whole, parts = codecs.encode(value, lambda name: None)
    except NotStorable as err:
        assert str(err)
        return
    try:
        codecs.decode(text, whole, parts.__getitem__)
    except NotReadable:
        pytest.fail('{} was stored, and cannot be read'.format(text))


@settings(max_examples=60, **QUICK)
@given(boxed(values))
def test_a_machine_stores_all_that_stands_beside_a_value(tmp_path_factory, box):
    (value,) = box
    tmp_path = tmp_path_factory.mktemp('store')
    log = []
    for level in ('info', 'warn', 'debug', 'err'):
        setattr(smach, 'log' + level, lambda text, level=level: log.append((level, text)))
    machine = machine_of(
        tmp_path, [writes(value, 'kept'), lambda userdata: 'ok', stopped], deep_copy_keys=['odd']
    )
    with pytest.raises(KeyboardInterrupt):
        machine.execute()
    keys = stored_keys(tmp_path)
    assert keys['good'] == '"kept"'
    assert not [text for level, text in log if level == 'err']
    names = [text for text in named(log) if "'odd'" in text]
    assert len(names) <= 1, 'it is said once'
    if 'not stored: ' in keys['odd']:
        assert names and 'TOP/S0' in names[0], 'and with the state that wrote it'


@pytest.mark.parametrize(
    'value, words',
    [
        (HalfSet('cup'), ('hostile_values.HalfSet', 'grasp is not set')),
        (HalfSet, ('builtins.type', 'no codec')),
        (OfList(), ('hostile_values.OfList', 'other data')),
        (Pair(1, HalfSet('cup')), ('hostile_values.Pair', 'grasp')),
        (type('Odd', (OfList,), {'__reduce__': raising(Rude)})(), ('Odd', 'by its name')),
        (holding_itself(), ('builtins.list', 'holds itself')),
        (open, ('builtins.', 'no codec')),
    ],
    ids=range(7),
)
def test_a_value_that_cannot_be_stored_is_named_once(tmp_path, log, value, words):
    machine = machine_of(tmp_path, [writes(value)] * 4)
    assert machine.execute() == 'ok'
    (said,) = named(log)
    assert said.startswith("TOP: userdata key 'odd' (")
    assert 'of TOP/S0 cannot be stored' in said
    assert all(word in said for word in words)
    assert not [text for level, text in log if level == 'err']


@pytest.mark.parametrize(
    'value, names', [(with_more(), 'extra'), (SlottedMore('cup'), 'note')], ids=range(2)
)
def test_attributes_that_are_no_fields_are_named(tmp_path, log, value, names):
    setattr(value, names, 1)
    machine = machine_of(tmp_path, [writes(value), lambda userdata: 'ok', stopped])
    with pytest.raises(KeyboardInterrupt):
        machine.execute()
    (said,) = named(log)
    assert (
        "'odd' (hostile_values.{}) of TOP/S0 is stored without its attributes {},".format(
            type(value).__name__, names
        )
        in said
    )
    assert '"name":"cup"' in stored_keys(tmp_path)['odd']


def test_a_property_that_was_cached_is_no_loss(tmp_path, log):
    value = More()
    assert value.length == 3
    machine_of(tmp_path, [writes(value)]).execute()
    assert not named(log)


def test_a_value_that_goes_up_is_named_once_also_as_a_list(tmp_path, log):
    inner = smach.StateMachine(['ok'], [], ['odd'])
    with inner:
        smach.StateMachine.add(
            'IN',
            smach.CBState(writes([HalfSet('cup')]), outcomes=['ok'], output_keys=['odd', 'good']),
        )
    machine = smach.StateMachine(['ok'])
    with machine:
        smach.StateMachine.add('BELOW', inner)
    OracleContainer.wrap(machine, name='TOP', settings={'checkpoint': str(tmp_path / 'robot.db')})
    machine.execute()
    assert len(named(log)) == 1


def test_data_that_have_no_end_do_not_hold_the_machine_for_ever():
    begun_s = time.monotonic()
    with pytest.raises(NotStorable, match='more than'):
        Codecs().encode(shared())
    assert time.monotonic() - begun_s < 60


def test_data_that_hold_themselves_do_not_hold_the_machine_up(tmp_path, log):
    machine = machine_of(tmp_path, [writes(holding_itself()), lambda userdata: 'ok'])
    runs = threading.Thread(target=machine.execute, daemon=True)
    runs.start()
    runs.join(30)
    assert not runs.is_alive()
    assert len(named(log)) == 1


def test_ctrl_c_comes_through_a_value():
    value = type('Slow', (), {'__getattr__': raising(KeyboardInterrupt)})
    codecs = Codecs()
    codecs.register(value, lambda each: each.anything, id)
    with pytest.raises(KeyboardInterrupt):
        codecs.encode(value())
