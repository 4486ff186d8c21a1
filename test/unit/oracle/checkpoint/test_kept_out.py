"""What is kept out of a store."""

import threading

from killed_machines import Diary, KilledMachine, Noted, around, each_of

import smach
from smach_oracle.oracle import OracleContainer

ENDS = {'succeeded': 'succeeded', 'aborted': 'aborted'}


class Opens(smach.State):
    """Writes what no codec knows, an open file by default."""

    def __init__(self, make=lambda: open('/dev/null')):
        smach.State.__init__(self, ['succeeded'], [], ['file'])
        self._make = make

    def execute(self, userdata):
        userdata.file = self._make()
        return 'succeeded'


def test_a_value_that_cannot_be_stored_is_named_with_the_state_that_wrote_it(tmp_path, log):
    inner = smach.StateMachine(['succeeded'], [], ['file'])
    with inner:
        smach.StateMachine.add('OPEN', Opens(), {'succeeded': 'succeeded'})
    machine = smach.StateMachine(['succeeded'])
    machine.userdata.mine = open('/dev/null')
    machine.userdata['of a \udcff file'] = 'a text'
    with machine:
        smach.StateMachine.add('A', Opens(), {'succeeded': 'AGAIN'}, remapping={'file': 'other'})
        again = Opens(threading.Lock)
        smach.StateMachine.add('AGAIN', again, {'succeeded': 'IN'}, remapping={'file': 'other'})
        smach.StateMachine.add('IN', inner, {'succeeded': 'succeeded'})
    OracleContainer.wrap(
        machine, name='TOP', settings={'checkpoint': str(tmp_path / 'robot.db')}
    ).execute()
    named = [
        text.split(' cannot be stored')[0]
        for level, text in log
        if level == 'warn' and 'cannot be stored' in text
    ]
    kind = '(_io.TextIOWrapper)'
    assert named == [
        "TOP: userdata key 'mine' {} of the script".format(kind),
        "TOP: userdata key 'of a \\\\udcff file' (builtins.str) of the script",
        "TOP: userdata key 'other' {} of TOP/A".format(kind),
        "TOP/IN: userdata key 'file' {} of TOP/IN/OPEN".format(kind),
    ]


class Looks(smach.State):
    """Notes which keys it finds."""

    def __init__(self, diary):
        smach.State.__init__(self, ['succeeded'], ['file', 'mine', 'cup'])
        self._diary = diary

    def execute(self, userdata):
        self._diary.write(
            'finds',
            ','.join(
                key for key in ('file', 'mine', 'cup') if userdata._ud._data.get(key) is not None
            ),
        )
        return 'succeeded'


def test_what_was_not_stored_is_missing_or_as_the_script_gives_it(tmp_path):
    def build(diary, points):
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        machine.userdata.mine = open('/dev/null')
        machine.userdata.cup = 'red'
        with machine:
            smach.StateMachine.add('OPEN', Opens(), {'succeeded': 'A'})
            smach.StateMachine.add('A', Noted('A', diary, points), {'succeeded': 'LOOK'})
            smach.StateMachine.add('LOOK', Looks(diary), {'succeeded': 'succeeded'})
        return machine

    for is_killed, found in ((False, 'file,mine,cup'), (True, 'mine,cup')):
        folder = tmp_path / str(is_killed)
        folder.mkdir()
        killed = KilledMachine(folder, build)
        if is_killed:
            assert killed.run(kill_at=6) is None
            assert killed.diary.count('begins')['A'] == 1
        told = killed.run(states={'LOOK': {}})
        assert told['outcome'] == 'succeeded'
        missing = [text for text in told['log'] if "userdata key 'file' is missing, as " in text]
        assert len(missing) == is_killed
        assert list(killed.diary.count('finds')) == [found]


class WithoutLength:
    """A user's own items."""

    def __getitem__(self, index):
        return [1, 2][index]


def test_an_iterator_that_cannot_go_on_is_named_at_the_start(tmp_path, log):
    def iterated(items):
        diary = Diary(str(tmp_path / 'diary'))
        return each_of(items, 'I', Noted('I', diary, lambda: None, keys=('done', 'item')))

    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('LIST', iterated([1, 2]), {'succeeded': 'MADE'})
        smach.StateMachine.add('MADE', iterated(lambda: iter([1, 2])), {'succeeded': 'ONCE'})
        smach.StateMachine.add('ONCE', iterated(iter([1, 2])), {'succeeded': 'SET'})
        smach.StateMachine.add('SET', iterated({1, 2}), {'succeeded': 'MAP'})
        smach.StateMachine.add('MAP', iterated({1: 'a', 2: 'b'}), {'succeeded': 'NO_LENGTH'})
        smach.StateMachine.add('NO_LENGTH', iterated(WithoutLength()), ENDS)
    OracleContainer.wrap(
        machine, name='TOP', settings={'checkpoint': str(tmp_path / 'robot.db')}
    ).execute()
    named = [text for level, text in log if level == 'warn' and 'begins again' in text]
    assert [text.split(': begins again with its first item')[0] for text in named] == [
        'TOP/ONCE',
        'TOP/SET',
        'TOP/MAP',
        'TOP/NO_LENGTH',
    ]


def test_an_iterator_that_cannot_go_on_begins_with_its_first_item_again(tmp_path):
    def build(diary, points):
        first, second = (Noted(name, diary, points, keys=('done', 'item')) for name in 'AB')
        inner = smach.StateMachine(['succeeded', 'aborted'], ['done', 'item'], ['done'])
        with inner:
            smach.StateMachine.add('A', first, {'succeeded': 'B'})
            smach.StateMachine.add('B', second, ENDS)
        return around('ALL', each_of(iter([1, 2, 3]), 'EACH', inner), ENDS)

    machine = KilledMachine(tmp_path, build)
    whole = machine.run()
    for number in range(whole['points'] // 2, whole['points'] - 6, 3):  # the first one is done
        folder = tmp_path / str(number)
        folder.mkdir()
        machine = KilledMachine(folder, build)
        assert machine.run(number) is None
        told = machine.run()
        assert (told['outcome'], told['done']) == ('succeeded', whole['done'])
        assert machine.diary.count('ends')['A1'] == 2


def test_a_value_that_goes_up_through_containers_is_named_once(tmp_path, log):
    inner = smach.StateMachine(['succeeded'], [], ['file'])
    with inner:
        smach.StateMachine.add('OPEN', Opens(), {'succeeded': 'succeeded'})
    machine = smach.StateMachine(['succeeded'], [], ['given'])
    with machine:
        smach.StateMachine.add('IN', inner, remapping={'file': 'given'})
    OracleContainer.wrap(
        machine, name='TOP', settings={'checkpoint': str(tmp_path / 'robot.db')}
    ).execute()
    (named,) = [text for level, text in log if 'cannot be stored' in text]
    assert named.startswith("TOP/IN: userdata key 'file' (_io.TextIOWrapper) of TOP/IN/OPEN")


def test_a_key_that_is_said_to_be_missing_is_not_named_again(tmp_path):
    def build(diary, points):
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        machine.userdata.mine = open('/dev/null')
        with machine:
            smach.StateMachine.add('A', Noted('A', diary, points), {'succeeded': 'B'})
            smach.StateMachine.add('B', Noted('B', diary, points), ENDS)
        return machine

    killed = KilledMachine(tmp_path, build)
    killed.run(kill_at=4)
    told = killed.run()
    assert told['outcome'] == 'succeeded'
    (of_mine,) = [text for text in told['log'] if "key 'mine'" in text]
    assert 'has the value that the script gives it' in of_mine
