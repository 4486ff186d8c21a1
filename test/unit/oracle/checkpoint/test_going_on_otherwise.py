"""A stored trial goes on elsewhere than where it stood, or is over and another one begins."""

import contextlib
import os
import shutil
import time

import pytest
from held_machines import eventually
from killed_machines import Diary, KilledMachine, Noted, Points, around, in_a_process
from killed_trees import ENDS, flat, make
from left_stores import Left
from test_accepted_stores import DAMAGES, accept
from test_changed_scripts import flat_before, killed_while_it_runs, nested_after
from test_never_twice import FLAT, NEVER, ByHand, chain, killed_in, moment_of, oracle_state
from test_unanswered import Answers, nobody, questions

import smach
from smach_oracle.oracle import Expert, OperatorHand, OracleContainer
from smach_oracle.oracle.checkpoint.container_facts import fact_of
from smach_oracle.oracle.errors import CheckpointError
from smach_oracle.store.rows import NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile


def without(build, label, path=()):
    """A builder of the same script without one state. It ends where that began."""

    def changed(diary, points):
        top = machine = build(diary, points)
        for each in path:
            machine = machine.get_children()[each]
        del machine._states[label], machine._transitions[label], machine._remappings[label]
        for led in machine._transitions.values():
            led.update({outcome: 'succeeded' for outcome, to in led.items() if to == label})
        return top

    return changed


def trials_of(killed):
    with contextlib.closing(StoreFile(killed.store, read_only=True)) as store:
        return [each.outcome for each in store.trials('TOP')]


def moments_of(killed, kind):
    with contextlib.closing(StoreFile(killed.store, read_only=True)) as store:
        return [each for each in store.moments(1) if each.kind == kind]


# -- sent by hand, and the script changes then


@pytest.mark.parametrize('command', [['goto', 'C'], ['goto', 'D', '--repeat', 'C']])
def test_nothing_moves_where_a_state_that_somebody_has_named_is_gone(tmp_path, command):
    killed_while_it_runs(tmp_path, flat_before, 'B')
    after = KilledMachine(tmp_path, without(flat_before, 'C'))
    begun = after.diary.count('begins')
    oracle_state(after, *command)
    told = after.run()
    assert told.get('ended_by') == 'kept', told
    is_gone = 'was stopped at C, which is not there' in '; '.join(told['log'])
    assert is_gone == (command[1] == 'C')
    assert after.diary.count('begins') == begun


def test_nothing_moves_where_a_place_below_that_somebody_has_named_is_gone(tmp_path):
    killed_while_it_runs(tmp_path, nested_after, 'B')
    after = KilledMachine(tmp_path, without(nested_after, 'C', ['IN']))
    begun = after.diary.count('begins')
    oracle_state(after, 'goto', 'IN/C')
    told = after.run()
    assert told.get('ended_by') == 'kept', told
    assert [text for text in told['log'] if 'was stopped at TOP/IN/C, which is not there' in text]
    assert after.diary.count('begins') == begun


def test_a_person_is_asked_where_a_state_has_moved_to_where_no_oracle_is(tmp_path):
    before = KilledMachine(tmp_path, flat_before)
    assert before.run(kill_at=6) is None
    oracle_state(before, 'goto', 'B')
    begun = before.diary.count('begins')
    names = {'B': 'IN/B', 'C': 'IN/C'}
    after = KilledMachine(tmp_path, nested_after, resume_map=names, tree={'nested': False})
    told = after.run()
    assert told.get('ended_by') == 'kept', told
    assert after.diary.count('begins') == begun


def test_a_person_is_asked_where_what_was_under_way_lies_where_no_oracle_is(tmp_path):
    killed_while_it_runs(tmp_path, flat_before, 'B')
    names = {'B': 'IN/B', 'C': 'IN/C'}
    after = KilledMachine(tmp_path, nested_after, resume_map=names, tree={'nested': False})
    begun = after.diary.count('begins')
    told = after.run()
    assert told.get('ended_by') == 'kept', told
    assert after.diary.count('begins') == begun


def test_where_a_state_is_gone_a_person_is_asked_at_the_initial_state(tmp_path):
    def begins_in_b(diary, points):
        machine = flat_before(diary, points)
        machine.set_initial_state(['B'])
        return machine

    killed_while_it_runs(tmp_path, begins_in_b, 'C')
    after = KilledMachine(tmp_path, without(begins_in_b, 'C'))
    assert after.run(expert=Answers(tmp_path / 'asked', nobody))['ended_by'] == 'kept'
    assert questions(tmp_path / 'asked')[0][1:3] == ['TOP', 'B']


class BegunLater(smach.StateMachine):
    """Adds its initial state as it is executed."""

    def __init__(self, diary, points):
        super().__init__(['succeeded', 'aborted'], ['done'], ['done'])
        self._first = Noted('W', diary, points)
        with self:
            smach.StateMachine.add('X', Noted('X', diary, points), {'succeeded': 'Y'})
            smach.StateMachine.add('Y', Noted('Y', diary, points), ENDS)
        self._initial_state_label = 'W'

    def execute(self, *userdata):
        if 'W' not in self.get_children():
            with self:
                smach.StateMachine.add('W', self._first, {'succeeded': 'X'})
        return super().execute(*userdata)


def test_where_the_initial_state_is_not_there_yet_a_person_is_asked_at_another_one(tmp_path):
    def begun_later(diary, points):
        return around('LATER', BegunLater(diary, points), ENDS)

    killed_while_it_runs(tmp_path, begun_later, 'W')
    after = KilledMachine(tmp_path, begun_later)
    assert after.run(expert=Answers(tmp_path / 'asked', nobody))['ended_by'] == 'kept'
    assert questions(tmp_path / 'asked')[0][1:3] == ['TOP/LATER', 'X']


def test_a_person_is_asked_where_no_oracle_leads_to_the_state_any_more(tmp_path):
    """The script is the same, and its settings leave the machine below to itself."""
    killed_while_it_runs(tmp_path, nested_after, 'B')
    after = KilledMachine(tmp_path, nested_after, tree={'nested': False}, on_resume='recover')
    begun = after.diary.count('begins')
    oracle_state(after, 'goto', 'IN/C')
    told = after.run()
    assert told.get('ended_by') == 'kept', told
    assert after.diary.count('begins') == begun


class Filled(smach.StateMachine):
    """Adds its states as it is executed."""

    def __init__(self, diary, points):
        super().__init__(['succeeded', 'aborted'], ['done'], ['done'])
        self._made = diary, points

    def execute(self, *userdata):
        if 'X' not in self.get_children():
            with self:
                smach.StateMachine.add('X', Noted('X', *self._made), {'succeeded': 'Y'})
                smach.StateMachine.add('Y', Noted('Y', *self._made), ENDS)
        return super().execute(*userdata)


def filled_later(diary, points):
    """Two states, between them a machine that is empty until it is executed."""
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('A', Noted('A', diary, points), {'succeeded': 'LATER'})
        smach.StateMachine.add('LATER', Filled(diary, points), {'succeeded': 'B'})
        smach.StateMachine.add('B', Noted('B', diary, points), ENDS)
    return machine


@pytest.mark.parametrize('on_resume', ['recover', 'ask'])
@pytest.mark.parametrize('kill_at', [8, 10, 12])
def test_a_machine_that_is_empty_until_it_is_executed_begins_again(tmp_path, kill_at, on_resume):
    killed = KilledMachine(tmp_path, filled_later, on_resume=on_resume)
    assert killed.run(kill_at=kill_at) is None
    told = killed.run()
    assert told.get('outcome') == 'succeeded', told
    assert told['done'] == ['A', 'X', 'Y', 'B']


def test_before_a_state_that_has_moved_a_person_is_asked(tmp_path):
    """It was sent to B, which lies in a machine of its own now."""
    before = KilledMachine(tmp_path, flat_before)
    names = {'B': 'IN/B', 'C': 'IN/C'}
    assert before.run(kill_at=6) is None
    oracle_state(before, 'goto', 'B')
    begun = before.diary.count('begins')
    after = KilledMachine(tmp_path, nested_after, resume_map=names, on_resume='ask')
    told = after.run()
    assert told.get('ended_by') == 'kept', told
    assert after.diary.count('begins') == begun
    assert after.run(on_resume='recover')['outcome'] == 'succeeded'


@pytest.mark.parametrize('repeats', [[], ['--repeat', 'POUR']])
def test_sent_to_a_state_that_has_moved_it_repeats_what_somebody_allows(tmp_path, repeats):
    def moved(diary, points):
        machine = FLAT(diary, points)
        kitchen = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
        with kitchen:
            smach.StateMachine.add('SEE', machine._states['LOOK'], ENDS)
        kitchen.userdata.done = []
        machine._states['LOOK'] = kitchen
        return machine

    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY', **NEVER)
    oracle_state(killed, 'goto', 'LOOK', *repeats)
    after = KilledMachine(
        tmp_path / 'killed', moved, resume_map={'LOOK': 'LOOK/SEE'}, on_resume='recover', **NEVER
    )
    told = after.run()
    assert told.get('ended_by') == ('outcome' if repeats else 'kept'), told
    assert after.diary.count('begins') == {
        'LOOK': 2,
        'POUR': 1 + len(repeats) // 2,
        'CARRY': 1 + len(repeats) // 2,
    }


def beside_an_own(diary, points):
    """A Concurrence of a plain state and a machine that the script has given an oracle itself."""
    inner = OracleContainer(['succeeded', 'aborted'], ['done'], ['done'])
    with inner:
        for label, following in (('P', 'Q'), ('Q', 'succeeded')):
            state = Noted(label, diary, points)
            smach.StateMachine.add(label, state, dict(ENDS, succeeded=following))
    both = smach.Concurrence(['succeeded', 'aborted'], 'succeeded', ['done'], ['done'])
    with both:
        smach.Concurrence.add('LEFT', Noted('LEFT', diary, points))
        smach.Concurrence.add('INNER', inner)
    return around('BOTH', both, ENDS)


@pytest.mark.parametrize('nested', [False, ['BOTH/INNER']])
def test_a_concurrence_whose_branches_have_no_oracle_begins_again_as_a_whole(tmp_path, nested):
    left = Left(beside_an_own, tree={'nested': nested})
    killed = left.killed_at(left.first_in('Q'), tmp_path / 'killed')
    assert killed.run().get('outcome') == 'succeeded'
    assert killed.diary.count('begins')['P'] == killed.diary.count('begins')['Q'] == 2


# -- questions


def test_a_question_about_another_state_is_not_taken_up(tmp_path):
    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY')
    with contextlib.closing(StoreFile(killed.store)) as store:
        asked = fact_of('TOP', 'asked', ['POUR', 'of before'])
        store.add(1, [NewMoment(0.0, 0, 'MARKS', 'TOP', '', (asked,))])
    assert killed.run()['outcome'] == 'succeeded', 'it goes on with CARRY, and asks nobody'


def test_from_an_earlier_moment_a_new_question_is_put(tmp_path):
    """It may have been answered since."""
    killed = KilledMachine(tmp_path, flat, max_recoveries=0)
    killed.run(expert=Answers(tmp_path / 'asked', lambda *_: os.kill(os.getpid(), 9)))
    moment = moment_of(killed, 'QUERY_OPENED', 'B')
    asked = tmp_path / 'again'
    for settings in ({}, {'resume_from': moment}):
        killed.run(expert=Answers(asked, nobody), on_no_answer='stop', kill_at=7, **settings)
    first, *again = [each[0] for each in questions(tmp_path / 'asked') + questions(asked)]
    assert first == again[0] != again[1]


# -- which trial goes on


def test_an_earlier_moment_of_a_trial_that_had_come_to_its_end_is_gone_on_from(tmp_path):
    killed = KilledMachine(tmp_path, flat)
    points = KilledMachine(make(tmp_path / 'whole'), flat).run()['points']
    assert killed.run(kill_at=points) is None
    told = killed.run(resume_from=moment_of(killed, 'STATE_START', 'C'))
    assert (told['outcome'], told['events'][0][0]) == ('succeeded', 'RESUMED')


def test_a_moment_of_the_trial_before_is_refused(tmp_path):
    killed = KilledMachine(tmp_path, flat)
    killed.run()
    moment = moment_of(killed, 'STATE_START', 'B')
    killed.run(kill_at=8)
    assert 'checkpoint.from: {}'.format(moment) in killed.run(resume_from=moment)['error']


def test_a_trial_that_was_stopped_before_its_first_moment_does_not_go_on(tmp_path):
    killed = KilledMachine(tmp_path, flat, on_resume='ask')
    with contextlib.closing(StoreFile(killed.store)) as store:
        store.begin_trial(NewTrial('TOP', 'of before', ('', '{}'), 0.0))
    told = killed.run()
    assert (told['outcome'], told['events'][0][0]) == ('succeeded', 'TRIAL_START')


def test_where_the_clock_was_put_back_the_program_was_stopped_just_now(tmp_path):
    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY')
    with contextlib.closing(StoreFile(killed.store)) as store:
        store.add(1, [NewMoment(time.time() + 9000.0, 0, 'MARKS', 'TOP', '', ())])
    assert [text for text in killed.run()['log'] if 'its program was stopped 0 s ago' in text]


def test_after_a_loss_the_trial_that_is_left_goes_on(tmp_path):
    """Its store was put back from a copy, which does not have the next trial."""
    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY', **NEVER)
    StoreFile(killed.store).close()  # its log goes into the database
    shutil.copy(killed.store, killed.store + '.copy')
    for _ in range(2):
        assert killed.run(expert=ByHand())['outcome'] == 'succeeded'
    shutil.copy(killed.store + '.copy', killed.store)
    accept(killed)
    assert killed.run()['ended_by'] == 'kept'
    assert trials_of(killed) == ['']


def test_who_wants_a_new_trial_after_a_loss_gets_one(tmp_path):
    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY', **NEVER)
    DAMAGES['log gone'](killed)
    accept(killed)
    assert killed.run(on_resume='restart')['outcome'] == 'succeeded'
    assert trials_of(killed) == ['succeeded']


# -- without an oracle


def observed(folder, kill_at, **settings):
    """Execute a machine that is only observed, killed at a point."""

    def work():
        diary, points = Diary(str(folder / 'diary')), Points(kill_at)
        machine = OracleContainer.wrap(
            FLAT(diary, points),
            name='TOP',
            recover=False,
            settings=dict(NEVER, checkpoint=str(folder / 'robot.db'), **settings),
        )
        machine.events.observers.append(points)
        try:
            return machine.execute()
        except CheckpointError as err:
            return str(err)

    return in_a_process(work)


def test_without_an_oracle_no_state_is_held_back(tmp_path):
    assert observed(tmp_path, 14) is None
    assert Diary(str(tmp_path / 'diary')).count('begins')['CARRY'] == 1
    for on_resume in ('ask', 'recover'):  # as often as it is tried
        assert 'only an oracle can find out how' in observed(tmp_path, 0, on_resume=on_resume)
    assert observed(tmp_path, 0, on_resume='state:POUR') == 'succeeded'
    assert Diary(str(tmp_path / 'diary')).count('begins') == {'LOOK': 1, 'POUR': 2, 'CARRY': 2}


@pytest.mark.parametrize('recover, labels', [(True, {'A'}), (False, {'A', 'ORACLE'})])
def test_only_the_meta_state_is_no_part_of_the_structure(tmp_path, recover, labels):
    machine = smach.StateMachine(['succeeded'])
    with machine:
        for label in sorted(labels):
            smach.StateMachine.add(
                label, smach.CBState(lambda _: 'succeeded', outcomes=['succeeded'])
            )
    path = str(tmp_path / 'robot.db')
    OracleContainer.wrap(machine, recover=recover, settings={'checkpoint': path}).execute()
    with contextlib.closing(StoreFile(path, read_only=True)) as store:
        described = store.description(store.trials()[0].structure)
    assert all(
        ('"{}":'.format(label) in described) == (label in labels) for label in ('A', 'ORACLE')
    )


# -- numbers of events


class Claims(Expert):
    """Is claimed and released again and again, and ends the program then."""

    def ask(self, question, cancelled, progress):
        for _ in range(700):
            progress('claimed', 'ann', '')
            progress('released', 'ann', '')
        os.kill(os.getpid(), 9)


def test_many_events_between_two_moments_are_numbered_once(tmp_path):
    killed = KilledMachine(tmp_path, flat, max_recoveries=0)
    assert killed.run(expert=Claims()) is None
    with contextlib.closing(StoreFile(killed.store, read_only=True)) as store:
        kinds = [each.kind for each in store.moments(1)]
    assert len([kind for kind in kinds if kind in ('QUERY_CLAIMED', 'QUERY_RELEASED')]) == 1
    assert killed.run()['events'][0][1] > 1400


def test_after_many_commands_of_an_operator_no_number_comes_again(tmp_path):
    def commanded(diary, points):
        class Commanded(Noted):
            def execute(self, userdata):
                if killed.diary.count('begins')['A']:
                    return super().execute(userdata)
                diary.write('begins', 'A')
                for _ in range(1200):
                    OperatorHand(machine).set_breakpoint('C')
                eventually(lambda: moments_of(killed, 'OPERATOR_COMMAND'))
                os.kill(os.getpid(), 9)

        machine = flat(diary, points)
        machine.get_children()['A'].__class__ = Commanded
        return machine

    killed = KilledMachine(tmp_path, commanded)
    assert killed.run() is None
    assert len(moments_of(killed, 'OPERATOR_COMMAND')) == 1
    assert killed.run()['events'][0][1] > 1200


# -- userdata


def test_a_key_that_had_gone_does_not_come_back(tmp_path):
    def dropping(diary, points):
        class Drops(Noted):
            def execute(self, userdata):
                machine.userdata = smach.UserData()
                machine.userdata.done = []
                return 'succeeded'

        class Looks(Noted):
            def execute(self, userdata):
                diary.write('finds', ' '.join(machine.userdata.keys()))
                return super().execute(userdata)

        machine = flat(diary, points)
        machine.userdata.extra = 'of the script'
        for label, kind in (('A', Drops), ('B', Looks)):
            machine.get_children()[label].__class__ = kind
        return machine

    left = Left(dropping, userdata='keep')
    killed = left.killed_at(left.first_in('B'), tmp_path / 'killed')
    assert killed.run()['outcome'] == 'succeeded'
    assert set(killed.diary.count('finds')) == {'done'}


# -- a machine that stands under two labels


def test_under_the_other_label_what_is_in_a_machine_may_have_been_done(tmp_path):
    def shared(diary, points):
        inner = chain('POUR', 'CARRY')(diary, points)
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        with machine:
            smach.StateMachine.add('ONE', inner, {'succeeded': 'TWO'})
            smach.StateMachine.add('TWO', inner, ENDS)
        return machine

    left = Left(shared, **NEVER)
    killed = left.killed_at(left.first_in('CARRY', times=2), tmp_path / 'killed')
    begun = killed.diary.count('begins')
    told = killed.run()
    assert [text for text in told['log'] if text.startswith('TOP/TWO: the program was stopped')]
    assert killed.diary.count('begins') == begun


# -- without a store


def test_wrapped_again_without_a_store_a_machine_waits_for_none(tmp_path, log):
    failed = []

    def fails_once(userdata):
        failed.append(1)
        return 'aborted' if len(failed) % 2 else 'succeeded'

    machine = smach.StateMachine(['succeeded', 'aborted'])
    with machine:
        carry = smach.CBState(fails_once, outcomes=['succeeded', 'aborted'])
        pour = smach.CBState(lambda _: 'succeeded', outcomes=['succeeded'])
        smach.StateMachine.add('CARRY', carry)
        smach.StateMachine.add('POUR', pour, {'succeeded': 'CARRY'})
    states = {'POUR': {'on_retry': 'never'}, 'CARRY': {'preconditions': ['POUR']}}
    path = str(tmp_path / 'robot.db')
    for store in ({'checkpoint': path, 'checkpoint_wait_s': 0.1}, {}):
        OracleContainer.wrap(machine, settings=dict(store, states=states))
        assert machine.execute() == 'succeeded'
    assert not [text for _, text in log if path in text and 'what is not stored' in text]
