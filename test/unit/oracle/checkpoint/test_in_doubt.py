"""States may have run that are not stored, or under another name: a person is asked first."""

import contextlib

import pytest
from killed_machines import KilledMachine, Noted
from killed_trees import ENDS
from left_stores import Left
from test_never_twice import NEVER, ByHand, Sends, chain, killed_in, oracle_state

import smach
from smach_oracle.oracle import Expert
from smach_oracle.oracle.checkpoint.checkpointer import Checkpointer
from smach_oracle.store.store_file import StoreFile

LABELS = ('LOOK', 'POUR', 'CARRY')


def fault(*given):
    raise RuntimeError('a fault of the store')


class Breaks(Noted):
    """Its first execution has the store fail from then on."""

    def execute(self, userdata):
        if not self._diary.count('begins')[self._name]:
            Checkpointer._commit = fault  # of this process only
        return super().execute(userdata)


def breaking(diary, points):
    machine = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
    machine.userdata.done = []
    with machine:
        for label, following in zip(LABELS, [*LABELS[1:], 'succeeded']):
            kind = Breaks if label == 'LOOK' else Noted
            smach.StateMachine.add(
                label, kind(label, diary, points), dict(ENDS, succeeded=following)
            )
    return machine


def broken(folder, **settings):
    """Stored until LOOK, and killed in CARRY."""
    return killed_in(folder, breaking, 'CARRY', **settings)


def first_moment_of_look(killed):
    with contextlib.closing(StoreFile(killed.store, read_only=True)) as store:
        return next(
            each.number
            for each in store.moments(1)
            if (each.kind, each.label) == ('STATE_START', 'LOOK')
        )


WAYS = {
    'recover': lambda killed: {},
    'state': lambda killed: {'on_resume': 'state:LOOK'},
    'moment': lambda killed: {'resume_from': first_moment_of_look(killed)},
    'goto': lambda killed: oracle_state(killed, 'goto', 'LOOK') and {},
    'edit': lambda killed: oracle_state(killed, 'edit', 'x=1') and {},
}


@pytest.mark.parametrize('guarded_before', [NEVER, {'states': {}}], ids=['guarded', 'since'])
@pytest.mark.parametrize('way', sorted(WAYS))
def test_after_a_fault_of_the_store_nothing_moves_until_somebody_answers(
    tmp_path, way, guarded_before
):
    killed = broken(tmp_path / 'killed', **guarded_before)
    more = WAYS[way](killed)
    begun = killed.diary.count('begins')
    for settings in (more, {}, {}):
        told = killed.run(**{**NEVER, **settings})
        assert (told['outcome'], told['ended_by']) == (None, 'kept')
    assert killed.diary.count('begins') == begun
    assert 'kept, as nobody answered: TOP/LOOK' in oracle_state(killed)


def test_a_person_is_told_what_may_have_run_meanwhile(tmp_path):
    class Told(Expert):
        def ask(self, question, cancelled, progress):
            here = [each for each in question.choices if each.state == 'POUR']
            (tmp_path / 'repeats').write_text(' '.join(here[0].repeats))

    killed = broken(tmp_path / 'killed', **NEVER)
    assert killed.run(expert=Told())['ended_by'] == 'kept'
    assert (tmp_path / 'repeats').read_text() == 'POUR'


@pytest.mark.parametrize('way', sorted(WAYS))
def test_what_may_have_run_meanwhile_is_not_repeated_by_itself(tmp_path, way):
    """The person has LOOK repeated, the program is killed there, and nobody answers any more."""
    killed = broken(tmp_path / 'killed', **NEVER)
    assert killed.run(kill_at=8, expert=Sends('LOOK'), **WAYS[way](killed)) is None
    for _ in range(2):
        told = killed.run(on_resume='state:LOOK')
        assert told.get('ended_by') == 'kept', told
    assert killed.diary.count('begins')['LOOK'] > 1
    assert killed.diary.count('begins')['POUR'] == 1
    assert killed.run(expert=ByHand())['outcome'] == 'succeeded'
    assert killed.diary.count('begins')['POUR'] == 1


def test_a_fault_before_the_first_state_is_asked_about_as_well(tmp_path, monkeypatch):
    monkeypatch.setattr(Checkpointer, '_begin_trial', fault)
    left = Left(chain(*LABELS), **NEVER)
    monkeypatch.undo()
    killed = left.killed_at(left.first_in('CARRY'), tmp_path / 'killed')
    told = killed.run()
    assert told['ended_by'] == 'kept'
    assert not [text for text in told['log'] if 'failures are told' in text], 'no rule was stored'
    assert killed.diary.count('begins')['POUR'] == 1


def test_a_state_of_a_changed_script_is_asked_about_before_the_machine_goes_there(tmp_path):
    killed_in(tmp_path / 'killed', chain(*LABELS), 'CARRY', **NEVER)
    after = KilledMachine(
        tmp_path / 'killed', chain('LOOK', 'TEA', 'CARRY'), states={'TEA': {'on_retry': 'never'}}
    )
    for _ in range(2):
        assert after.run(on_resume='state:LOOK')['ended_by'] == 'kept'
    assert after.diary.count('begins')['LOOK'] == after.diary.count('begins')['POUR'] == 1


@pytest.mark.parametrize('on_no_answer', ['stop', {'goto': 'LOOK'}, {'goto': 'POUR'}])
@pytest.mark.parametrize('first', [{'on_resume': 'state:LOOK'}, {}], ids=['to LOOK', 'goto'])
def test_a_state_that_is_held_back_ends_no_resumed_trial(tmp_path, first, on_no_answer):
    killed = killed_in(tmp_path / 'killed', chain(*LABELS), 'CARRY', **NEVER)
    if not first:
        oracle_state(killed, 'goto', 'LOOK')
    for settings in (first, {}, {}):
        told = killed.run(on_no_answer=on_no_answer, **settings)
        assert (told['outcome'], told['ended_by']) == (None, 'kept'), told['log']
    assert killed.diary.count('begins') == {'LOOK': 2, 'POUR': 1, 'CARRY': 1}


def test_it_is_said_that_states_may_have_run_since_the_fault_of_the_store(tmp_path):
    said = 'TOP: {} was not written any more after a fault of the store'
    killed = broken(tmp_path / 'killed')
    told = killed.run()
    assert [text for text in told['log'] if text.startswith(said.format(killed.store))]
