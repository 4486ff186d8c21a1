"""The command oracle_state, on the store of a machine that was killed."""

import contextlib
import os
import signal
import threading

import pytest
from killed_machines import KilledMachine, Noted, around

import smach
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.state_command import main
from smach_oracle.store.store_file import StoreFile

NOBODY = 65534
ENDS = {'succeeded': 'succeeded', 'aborted': 'aborted'}


def build(diary, points):
    inner = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
    with inner:
        smach.StateMachine.add('X', Noted('X', diary, points), {'succeeded': 'Y'})
        smach.StateMachine.add('Y', Noted('Y', diary, points), ENDS)
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    machine.userdata.file = open('/dev/null')
    with machine:
        smach.StateMachine.add('A', Noted('A', diary, points), {'succeeded': 'XY'})
        smach.StateMachine.add('XY', inner, ENDS)
    return machine


class Together(smach.State):
    """Ends the process once another one runs as well."""

    def __init__(self, both):
        smach.State.__init__(self, ['succeeded'])
        self._both = both

    def execute(self, userdata):
        self._both.wait()
        os.kill(os.getpid(), signal.SIGKILL)
        return 'succeeded'


def side_by_side(diary, points):
    together = threading.Barrier(2)
    left = smach.StateMachine(['succeeded'])
    with left:
        smach.StateMachine.add('L', Together(together))
    both = smach.Concurrence(['succeeded'], 'succeeded')
    with both:
        smach.Concurrence.add('LEFT', left)
        smach.Concurrence.add('RIGHT', Together(together))
    return around('BOTH', both, {'succeeded': 'succeeded'})


LONG = ['PUT_EVERYTHING_THAT_WAS_FOUND_WHERE_IT_BELONGS_%d' % number for number in range(6)]


def deep(diary, points):
    """Machines in machines, whose paths have 300 letters."""
    inner = Noted('FIRST', diary, points)
    for label in reversed(LONG):
        machine = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
        with machine:
            smach.StateMachine.add(label, inner, {'succeeded': 'LAST'})
            smach.StateMachine.add('LAST', Noted('LAST', diary, points), ENDS)
        inner = machine
    machine.userdata.done = []
    return machine


@pytest.fixture
def killed(tmp_path):
    """Killed while X runs."""
    machine = KilledMachine(tmp_path, build)
    assert machine.run(kill_at=11) is None
    assert machine.diary.count('begins')['X'] == 1
    return machine


@contextlib.contextmanager
def read_only(folder):
    """Within it nothing in a folder can be written, not even by root."""
    names = [folder] + [os.path.join(folder, name) for name in os.listdir(folder)]
    modes = {name: os.stat(name).st_mode for name in names}
    user = os.geteuid()
    os.chmod(folder, 0o555)
    for name in names[1:]:
        os.chmod(name, 0o444)
    above = os.path.dirname(folder)
    os.chmod(above, os.stat(above).st_mode | 0o055)
    if user == 0:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(user)
        for name, mode in modes.items():
            if os.path.exists(name):
                os.chmod(name, mode)


def told(capsys, *arguments):
    assert main([str(each) for each in arguments]) == 0
    return capsys.readouterr().out


def refused(capsys, *arguments):
    assert main([str(each) for each in arguments]) == 2
    return capsys.readouterr().err


def test_a_list_says_how_each_trial_stands(killed, capsys):
    assert 'stopped: TOP/XY/X was under way' in told(capsys, killed.store)
    assert killed.run()['outcome'] == 'succeeded'
    assert 'ended: succeeded' in told(capsys, killed.store, 'list')


def test_it_shows_where_the_machine_stood_and_its_userdata(killed, capsys):
    said = told(capsys, killed.store, 'show')
    assert 'TOP/XY was under way' in said and 'TOP/XY/X was under way' in said
    assert 'TOP done = ["A"]' in said
    assert 'TOP file = (_io.TextIOWrapper, not stored: no codec is registered' in said


def test_an_earlier_moment_is_shown(killed, capsys):
    lines = told(capsys, killed.store, 'moments').splitlines()
    first = next(line for line in lines if line.endswith('TOP/A'))
    assert 'TOP done = []' in told(capsys, killed.store, 'show', '--at', first.split()[0])


@pytest.mark.parametrize(
    'more, why',
    [((), 'there is no moment 99'), (('--trial', '1'), 'there is no moment 99 of trial 1')],
)
def test_a_moment_that_is_not_there_is_named(killed, capsys, more, why):
    assert why in refused(capsys, killed.store, 'show', '--at', '99', *more)


def test_a_moment_of_a_trial_before_is_shown(killed, capsys):
    killed.run()
    killed.run()
    assert 'trial 2 of TOP' in told(capsys, killed.store, 'show')
    assert 'trial 1 of TOP' in told(capsys, killed.store, 'show', '--at', '2')
    assert 'no moment 2 of trial 2' in refused(
        capsys, killed.store, 'show', '--at', '2', '--trial', '2'
    )


def test_what_is_in_a_state_is_shown_while_that_is_under_way(killed, capsys):
    told(capsys, killed.store, 'goto', 'XY/Y')
    assert 'stopped: TOP/XY was next, on the way to TOP/XY/Y\n' in told(capsys, killed.store)
    assert 'TOP/XY/X was under way' not in told(capsys, killed.store, 'show')
    killed.run()
    assert 'Where it stood\n  TOP had ended with succeeded\n\n' in told(
        capsys, killed.store, 'show'
    )


def test_of_each_branch_the_state_under_way_is_listed(tmp_path, capsys):
    machine = KilledMachine(tmp_path, side_by_side)
    assert machine.run() is None
    assert 'stopped: TOP/BOTH/LEFT/L was under way, TOP/BOTH/RIGHT was under way\n' in told(
        capsys, machine.store
    )


class EndsAtTwo(smach.State):
    """Ends the process at the second item."""

    def __init__(self):
        smach.State.__init__(self, ['succeeded'], ['item'])

    def execute(self, userdata):
        if userdata.item == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        return 'succeeded'


def iterated(diary, points):
    loop = smach.Iterator(
        ['succeeded'], [], [], it=[1, 2, 3], it_label='item', exhausted_outcome='succeeded'
    )
    with loop:
        smach.Iterator.set_contained_state('ONE', EndsAtTwo(), loop_outcomes=['succeeded'])
    return around('LOOP', loop, {'succeeded': 'succeeded'})


def test_the_item_of_an_iterator_is_shown(tmp_path, capsys):
    machine = KilledMachine(tmp_path, iterated)
    assert machine.run() is None
    assert '  TOP/LOOP was at item 2\n' in told(capsys, machine.store, 'show')


def test_it_goes_on_at_a_state_with_a_long_path(tmp_path, capsys):
    machine = KilledMachine(tmp_path, deep)
    assert machine.run(kill_at=5) is None
    told(capsys, machine.store, 'goto', '/'.join(LONG[:-1] + ['LAST']))
    assert ', on the way to TOP/' in told(capsys, machine.store)
    assert machine.run()['outcome'] == 'succeeded'
    assert machine.diary.count('begins') == {'LAST': 6}


def test_an_edited_key_is_what_the_machine_goes_on_with(killed, capsys):
    told(capsys, killed.store, 'edit', 'done=["by hand"]', '--container', 'TOP/XY')
    assert killed.run()['done'] == ['by hand', 'X', 'Y']
    assert 'done = ["by hand"]' in told(capsys, killed.store, 'log')


def test_it_goes_on_at_another_state(killed, capsys):
    told(capsys, killed.store, 'goto', 'A')
    assert killed.run()['outcome'] == 'succeeded'
    assert killed.diary.count('begins')['A'] == 2


def test_it_goes_on_at_a_state_below(killed, capsys):
    told(capsys, killed.store, 'goto', 'XY/Y')
    assert killed.run()['outcome'] == 'succeeded'
    assert killed.diary.count('begins') == {'A': 1, 'X': 1, 'Y': 1}


def test_a_dropped_trial_is_not_resumed(killed, capsys):
    told(capsys, killed.store, 'drop')
    assert 'ended: dropped' in told(capsys, killed.store)
    assert killed.run()['events'][0][0] == 'TRIAL_START'


@pytest.mark.parametrize('change', [['drop'], ['goto', 'A'], ['edit', 'done=[]']])
def test_what_a_process_holds_is_not_changed(killed, capsys, change):
    lock = MachineLock(killed.store, 'TOP')
    lock.take()
    assert 'machine TOP is held by process' in refused(capsys, killed.store, *change)
    lock.release()
    assert told(capsys, killed.store, 'log') == ''


@pytest.mark.parametrize(
    'change, why',
    [
        (['goto', 'NOWHERE'], "there is no state 'NOWHERE'; there are A, XY, XY/X, XY/Y"),
        (['edit', 'done=cup'], "'cup' is no JSON"),
        (['edit', 'done'], 'KEY=JSON is wanted'),
        (
            ['edit', 'done=1', '--container', 'TOP/ZZ'],
            "no container 'TOP/ZZ'; there are TOP, TOP/XY",
        ),
        (['drop', '--trial', '9'], 'there is no trial 9'),
    ],
)
def test_a_wrong_change_is_refused_with_what_is_allowed(killed, capsys, change, why):
    assert why in refused(capsys, killed.store, *change)
    assert told(capsys, killed.store, 'log') == ''


def test_a_trial_that_has_ended_is_not_changed(killed, capsys):
    killed.run()
    assert 'has ended (succeeded)' in refused(capsys, killed.store, 'goto', 'A')


EVERY = [[], ['show'], ['moments'], ['log'], ['edit', 'done=[]'], ['goto', 'A'], ['drop']]


@pytest.mark.parametrize('command', EVERY)
def test_what_cannot_be_opened_is_told_in_one_line(tmp_path, capsys, command):
    notes = tmp_path / 'notes.txt'
    notes.write_text('These are my notes, and no store of a machine. ' * 20)
    for path, why in (
        (tmp_path / 'none' / 'robot.db', 'there is no such store'),
        (tmp_path, 'unable to open'),
        (notes, 'is damaged, or no store'),
    ):
        said = refused(capsys, path, *command)
        assert said.count('\n') == 1 and why in said and str(path) in said


@pytest.mark.parametrize('command', EVERY)
def test_a_damaged_store_is_told_in_one_line(killed, capsys, command):
    StoreFile(killed.store).close()  # its log goes into the database
    with open(killed.store, 'r+b') as stream:
        stream.seek(0, 2)
        size = stream.tell()
        stream.seek(100)
        stream.write(b'\xa5' * (size - 100))
    said = refused(capsys, killed.store, *command)
    assert said.count('\n') == 1 and 'is damaged' in said


@pytest.mark.parametrize('command', EVERY)
def test_a_store_that_cannot_be_written_is_looked_at_and_not_changed(killed, capsys, command):
    """As from a medium that is read only, and with no file of the log next to it."""
    StoreFile(killed.store).close()
    folder = os.path.dirname(killed.store)
    before = sorted(os.listdir(folder))
    with read_only(folder):
        try:
            code = main([killed.store, *command])
        except SystemExit as err:
            code = err.code
    said = capsys.readouterr()
    if command and command[0] in ('edit', 'goto', 'drop'):
        assert code == 2 and said.err.count('\n') == 1 and killed.store in said.err
    else:
        assert code == 0, said.err
    assert sorted(os.listdir(folder)) == before
    assert told(capsys, killed.store, 'log') == ''


def test_looking_for_a_store_makes_none(tmp_path, capsys):
    where = tmp_path / 'none.db'
    assert 'there is no such store' in refused(capsys, where, 'drop')
    assert not where.exists()


def test_a_key_that_is_new_is_said_to_be(killed, capsys):
    assert told(capsys, killed.store, 'edit', 'done=["A"]') == 'done is changed\n'
    assert told(capsys, killed.store, 'edit', 'file=1') == 'file is changed\n'
    assert told(capsys, killed.store, 'edit', 'don=["A"]') == ('don is new: TOP had done, file\n')
    assert told(capsys, killed.store, 'edit', 'don=["B"]') == 'don is changed\n'


def test_an_edit_of_a_container_that_will_begin_says_what_its_input_keys_get(killed, capsys):
    edit = ('edit', 'done=["by hand"]', '--container', 'TOP/XY')
    assert told(capsys, killed.store, *edit) == 'done is changed\n'
    told(capsys, killed.store, 'goto', 'XY/Y')
    assert told(capsys, killed.store, *edit) == (
        'done is changed\n'
        'TOP/XY is not under way: as it begins, its input keys get the values of TOP\n'
    )
    assert killed.run()['done'] == ['A', 'Y']
