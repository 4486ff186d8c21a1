"""Machines that are down are changed as pages command: by the code of oracle_state, and logged."""

import json
import threading

import pytest

from smach_oracle.expert.console.commands.commands import PageCommand
from smach_oracle.expert.console.robots import down_machines
from smach_oracle.expert.console.robots.down_machine_hand import DownMachineHand
from smach_oracle.expert.console.robots.down_machines import DownMachines
from smach_oracle.expert.console.web.audit import Person
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.store.codecs import Codecs
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.stopped_trial import StoppedTrial
from smach_oracle.store.store_file import NewTrial, StoreFile

ANN = Person('::1', 's1', 'operator', 'ann')
STRUCTURE = {'': {'states': {'PICK': {}, 'PLACE': {}}}}


class Down:
    """A store of the machine TASK, which was stopped while it picked, and who changes it."""

    def __init__(self, path):
        self.path, self.records = path, []
        store = StoreFile(path)
        number = store.begin_trial(NewTrial('TASK', 't', ('id', json.dumps(STRUCTURE)), 5.0))
        store.add(number, [self.moment()])
        store.close()
        self.sections = PageSections()
        self.machines = DownMachines([path], self.sections)
        self.hand = DownMachineHand(self.machines, self)
        self.machines.look()

    @staticmethod
    def moment():
        return NewMoment(
            7.0,
            1,
            'STATE_START',
            'TASK',
            'PICK',
            tuple(
                Fact('TASK', name, Codecs().encode(value))
                for name, value in (('at', ['PICK', 'in']), ('key:cups', 2))
            ),
        )

    def record(self, person, command, ok, message, arguments=None):
        self.records.append((person.expert, command, ok, message))

    @property
    def row(self):
        rows = self.sections.get('down')
        return rows[0] if rows else None

    def do(self, name, **arguments):
        given = dict({'down': self.path + '#1', 'moment': 1}, **arguments)
        return self.hand.carry_out(PageCommand(1, name, given), ANN, 1)

    def log(self):
        store = StoreFile(self.path, read_only=True)
        try:
            return [(line.who, line.what) for line in store.log()]
        finally:
            store.close()


@pytest.fixture(name='down')
def make_down(tmp_path):
    return Down(str(tmp_path / 'robot.db'))


def test_a_row_has_what_a_change_needs(down):
    assert (down.row['trial'], down.row['moment']) == (1, 1)
    assert down.row['states'] == ['PICK', 'PLACE']


def test_it_goes_on_at_another_state_and_the_log_says_who_it_was(down):
    reply = down.do('goto_stored', label='PLACE')
    assert (reply.ok, reply.message) == (True, 'TASK will go on at PLACE.')
    assert down.row['stood'] == ['TASK/PLACE was next'], 'the page has it at once'
    assert (down.row['moment'], down.row['since']) == (2, 7.0), 'it is not down since then'
    assert down.log() == [('ann (console, session s1)', 'trial 1: go to PLACE')]
    assert down.records == [('ann', 'goto_stored', True, 'TASK will go on at PLACE.')]


def test_a_key_gets_another_value(down):
    assert down.do('edit_stored', container='TASK', key='cups', json='[1, "red"]').ok
    assert down.row['userdata'] == [['TASK', 'cups', '[1,"red"]']]


def test_a_dropped_trial_is_down_no_longer(down):
    reply = down.do('drop_stored')
    assert reply.message == 'Trial 1 of TASK is dropped: it is never resumed.'
    assert down.row is None
    assert [what for _, what in down.log()] == ['trial 1: dropped']


@pytest.mark.parametrize(
    'name, arguments, why',
    [
        ('goto_stored', {'label': 'WASH'}, "there is no state 'WASH'; there are PICK, PLACE"),
        ('edit_stored', {'container': 'TASK', 'key': 'cups', 'json': 'cup'}, "'cup' is no JSON"),
        ('edit_stored', {'container': 'TASK', 'key': 'cups', 'json': '[' * 30000}, 'is no JSON'),
        ('edit_stored', {'container': 'IN', 'key': 'cups', 'json': '1'}, "no container 'IN'"),
        ('drop_stored', {'down': '/etc/passwd#1'}, 'There is no machine /etc/passwd#1 here'),
        ('drop_stored', {'moment': 9}, 'look at it again'),
    ],
)
def test_anything_else_is_refused_with_the_reason(down, name, arguments, why):
    reply = down.do(name, **arguments)
    assert not reply.ok
    assert why in reply.message
    assert down.log() == []
    assert down.records == [('ann', name, False, reply.message)]


@pytest.mark.parametrize(
    'name, more',
    [
        ('goto_stored', {'label': 'PLACE'}),
        ('drop_stored', {}),
        ('edit_stored', {'container': 'TASK', 'key': 'cups', 'json': '3'}),
    ],
)
def test_what_a_program_holds_is_not_changed(down, name, more):
    lock = MachineLock(down.path, 'TASK')
    lock.take()
    assert 'machine TASK is held by process' in down.do(name, **more).message
    lock.release()
    assert down.log() == []
    assert down.do(name, **more).ok


def test_what_has_gone_on_since_the_page_showed_it_is_not_changed(down):
    store = StoreFile(down.path)
    store.add(1, [down.moment()])
    assert 'trial 1 has gone on' in down.do('goto_stored', label='PLACE').message
    store.end_trial(1, 9.0, 'succeeded')
    store.close()
    assert 'has ended (succeeded)' in down.do('drop_stored').message
    assert down.log() == []


def test_one_that_ends_between_a_look_and_a_change_is_not_changed(down):
    store = StoreFile(down.path)
    stopped = StoppedTrial(store, store.trials()[0])
    store.end_trial(1, 9.0, 'succeeded')
    with pytest.raises(down_machines.StoreError, match='trial 1 has gone on'):
        stopped.drop('ann')
    store.close()


def test_a_store_that_hangs_holds_up_nobody_else_for_long(down, monkeypatch):
    monkeypatch.setattr(down_machines, 'BUSY_S', 0.05)
    begun, free = threading.Event(), threading.Event()

    def hang(stopped):
        begun.set()
        assert free.wait(20)
        return 'done'

    slow = threading.Thread(target=down.machines.change, args=(down.row['key'], 1, hang))
    slow.start()
    assert begun.wait(20)
    assert 'The stores are being read or changed' in down.do('drop_stored').message
    free.set()
    slow.join(20)
    assert down.do('drop_stored').ok
