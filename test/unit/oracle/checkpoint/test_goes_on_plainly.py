"""Stored trials of which little has to be found out, and those that look so."""

import os
import signal

import pytest
from killed_machines import Diary, in_a_process

import smach
from smach_oracle.oracle import OperatorHand, OracleContainer
from smach_oracle.store.store_file import StoreFile


@pytest.fixture
def shutdown():
    asked = []
    smach.set_shutdown_check(lambda: bool(asked))
    yield asked
    smach.set_shutdown_check(lambda: False)


def noted(diary, label, then=lambda: 'ok'):
    def work(_):
        diary.write('begins', label)
        return then()

    return smach.CBState(work, outcomes=['ok', 'aborted'])


def chain(**states):
    machine = smach.StateMachine(['ok', 'aborted'])
    labels = list(states)
    with machine:
        for label, following in zip(labels, [*labels[1:], 'ok']):
            smach.StateMachine.add(label, states[label], {'ok': following})
    return machine


def test_without_an_oracle_a_trial_goes_on_between_two_states(tmp_path, shutdown):
    def stopped():
        shutdown.append(True)
        return 'ok'

    diary = Diary(str(tmp_path / 'diary'))
    for outcome in (None, 'ok'):
        machine = chain(A=noted(diary, 'A', stopped), B=noted(diary, 'B'))
        settings = {'checkpoint': str(tmp_path / 'robot.db'), 'on_resume': 'recover'}
        OracleContainer.wrap(machine, name='TOP', recover=False, settings=settings)
        assert machine.execute() == outcome
        shutdown.clear()
    assert diary.count('begins') == {'A': 1, 'B': 1}


def test_a_trial_begins_without_a_look_at_all_before_it(tmp_path, monkeypatch):
    def count_them(_, machine=None):
        raise AssertionError('there may be thousands')

    monkeypatch.setattr(StoreFile, 'trials', count_them)
    machine = chain(A=noted(Diary(str(tmp_path / 'diary')), 'A'))
    OracleContainer.wrap(machine, name='TOP', settings={'checkpoint': str(tmp_path / 'robot.db')})
    assert [machine.execute() for _ in range(3)] == ['ok'] * 3


def test_a_container_to_which_a_state_has_moved_is_done_once_it_has_run(tmp_path):
    diary = Diary(str(tmp_path / 'diary'))

    def run(label, work, **more):
        fails = iter(['aborted'])
        machine = chain(
            LOOK=noted(diary, 'LOOK'),
            **{label: chain(S=noted(diary, 'S', work))},
            LAST=noted(diary, 'LAST', lambda: next(fails, 'ok')),
        )
        settings = {
            'checkpoint': str(tmp_path / 'robot.db'),
            'policy': 'step_back',
            'states': {label: {'on_retry': 'never'}},
            **more,
        }
        OracleContainer.wrap(machine, name='TOP', settings=settings)
        return machine.execute()

    def killed():
        return run('BEFORE', lambda: os.kill(os.getpid(), signal.SIGKILL))

    def goes_on():
        moved = {'BEFORE/S': 'AFTER/S'}
        return run('AFTER', lambda: 'ok', on_resume='recover', resume_map=moved)

    assert in_a_process(killed) is None
    assert in_a_process(goes_on) == 'aborted'
    assert diary.count('begins') == {'LOOK': 1, 'S': 2, 'LAST': 1}, 'AFTER is not repeated'


def test_a_pause_that_was_ended_between_two_trials_does_not_come_back(tmp_path):
    def stops():
        hand.pause('ann')
        raise KeyboardInterrupt

    works = iter([stops, lambda: 'ok'])
    diary = Diary(str(tmp_path / 'diary'))
    machine = chain(A=noted(diary, 'A', lambda: next(works)()))
    settings = {'checkpoint': str(tmp_path / 'robot.db'), 'on_resume': 'restart'}
    OracleContainer.wrap(machine, name='TOP', settings=settings)
    hand = OperatorHand(machine)
    with pytest.raises(KeyboardInterrupt):
        machine.execute()
    hand.resume('ann')
    assert machine.execute() == 'ok'
