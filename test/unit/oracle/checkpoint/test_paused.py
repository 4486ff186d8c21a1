"""A machine that an operator had paused is paused where it is resumed."""

import os
import signal

import pytest
from held_machines import Held
from killed_machines import Diary, KilledMachine, Noted, Points, in_a_process
from killed_trees import ENDS, make

import smach
from smach_oracle.oracle import OperatorHand
from smach_oracle.store.store_file import StoreFile


def build(diary, points):
    """A, B and C; an operator pauses the machine while A runs."""
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        for label, following in (('A', 'B'), ('B', 'C'), ('C', 'succeeded')):
            smach.StateMachine.add(
                label, Noted(label, diary, points), dict(ENDS, succeeded=following)
            )
    return machine


def settings_of(killed, **more):
    return {
        'checkpoint': killed.store,
        'checkpoint_synchronous': 'OFF',
        'on_resume': 'recover',
        'checkpoint_wait_s': 60,
        **more,
    }


def held(killed):
    return Held(
        build(Diary(killed.diary._path), Points(0)), name='TOP', settings=settings_of(killed)
    )


def killed_after(killed, *commands):
    """Kill the machine in A, after these commands of an operator."""

    def work():
        diary = Diary(killed.diary._path)

        class Commanded(Noted):
            def execute(self, userdata):
                for command in commands:
                    getattr(OperatorHand(machine.machine), command)(by='ann')
                os.kill(os.getpid(), signal.SIGKILL)

        Commanded.__name__ = 'Noted'  # the script has not changed
        script = build(diary, Points(0))
        script._states['A'] = Commanded('A', diary, Points(0))
        machine = Held(script, name='TOP', settings=settings_of(killed))
        machine.machine.execute()

    assert in_a_process(work) is None


@pytest.mark.parametrize(
    'commands, is_paused',
    [
        (['pause'], True),
        (['pause', 'resume'], False),
        (['pause', 'resume', 'pause'], True),
        ([], False),
    ],
)
def test_it_is_paused_where_it_goes_on_and_says_so(tmp_path, commands, is_paused):
    killed = KilledMachine(make(tmp_path / 'killed'), build)
    killed_after(killed, *commands)

    def work():
        with held(killed).begin() as machine:
            if is_paused:
                machine.waits_before('TOP/A')
                assert machine.hand.status().paused_by == 'ann'
                assert not killed.diary.count('begins')
                machine.hand.resume()
            return machine.end()

    assert in_a_process(work) == 'succeeded'
    assert killed.diary.count('begins') == {'A': 1, 'B': 1, 'C': 1}  # what is killed writes none


def test_killed_again_and_gone_back_it_is_still_paused(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), build)
    killed_after(killed, 'pause')
    first = StoreFile(killed.store, read_only=True).moments(1)[0].number

    def waits(**more):
        def work():
            machine = Held(
                build(Diary(killed.diary._path), Points(0)),
                name='TOP',
                settings=settings_of(killed, **more),
            ).begin()
            machine.waits_before('TOP/A')
            os.kill(os.getpid(), signal.SIGKILL)

        return in_a_process(work)

    assert waits() is None
    assert waits(resume_from=first) is None
    assert not killed.diary.count('begins')
