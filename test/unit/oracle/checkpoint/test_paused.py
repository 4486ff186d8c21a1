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

PAUSE, RESUME = ('pause',), ('resume',)


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
                for command, *what in commands:
                    getattr(OperatorHand(machine.machine), command)(*what, by='ann')
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
        ([PAUSE], True),
        ([PAUSE, RESUME], False),
        ([PAUSE, RESUME, PAUSE], True),
        ([], False),
    ],
)
def test_it_is_paused_where_it_goes_on_and_says_so(tmp_path, log, commands, is_paused):
    killed = KilledMachine(make(tmp_path / 'killed'), build)
    killed_after(killed, *commands)

    def work():
        with held(killed).begin() as machine:
            if is_paused:
                machine.waits_before('TOP/A')
                assert machine.hand.status().paused_by == 'ann'
                assert not killed.diary.count('begins')
                machine.hand.resume()
            return machine.end(), [text for _, text in log if 'is paused' in text]

    said = ['TOP: is paused, as before its program was stopped'] if is_paused else []
    assert in_a_process(work) == ['succeeded', said]
    assert killed.diary.count('begins') == {'A': 1, 'B': 1, 'C': 1}  # what is killed writes none


def test_where_a_held_machine_was_sent_it_waits_after_a_crash(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), build)

    def is_sent():
        machine = held(killed)
        machine.hand.pause(by='ann')
        machine.begin().waits_before('TOP/A')
        machine.hand.go_to('TOP', 'C', by='ann')
        machine.waits_before('TOP/C')
        os.kill(os.getpid(), signal.SIGKILL)

    def goes_on():
        with held(killed).begin() as machine:
            machine.waits_before('TOP/C')
            machine.hand.resume()
            return machine.end()

    assert in_a_process(is_sent) is None
    assert in_a_process(goes_on) == 'succeeded'
    assert killed.diary.count('begins') == {'C': 1}


def test_a_command_of_which_nothing_is_kept_makes_no_moment(tmp_path):
    moments = []
    for times in (1, 5):
        killed = KilledMachine(make(tmp_path / str(times)), build)
        killed_after(killed, *[('set_breakpoint', 'C'), ('remove_breakpoint', 'C')] * times)
        moments.append(len(StoreFile(killed.store, read_only=True).moments(1)))
    assert moments[0] == moments[1]


def test_killed_again_and_gone_back_it_is_still_paused(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), build)
    killed_after(killed, PAUSE)
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


@pytest.mark.parametrize('commands, is_paused', [([PAUSE], True), ([PAUSE, RESUME], False)])
def test_a_trial_that_is_restarted_waits_before_its_first_state(tmp_path, log, commands, is_paused):
    killed = KilledMachine(make(tmp_path / 'killed'), build)
    killed_after(killed, *commands)

    def begun(kill):
        def work():
            machine = Held(
                build(Diary(killed.diary._path), Points(0)),
                name='TOP',
                settings=settings_of(killed, on_resume='restart'),
            )
            with machine.begin():
                if is_paused:
                    machine.waits_before('TOP/A')
                    assert machine.hand.status().paused_by == 'ann'
                    if kill:
                        os.kill(os.getpid(), signal.SIGKILL)
                    machine.hand.resume()
                return machine.end(), [text for _, text in log if 'is paused' in text]

        return in_a_process(work)

    said = ['TOP: is paused, as before its program was stopped'] if is_paused else []
    if is_paused:
        assert begun(kill=True) is None  # and it is so once more
    assert begun(kill=False) == ['succeeded', said]
