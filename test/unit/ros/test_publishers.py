"""Two threads publish what a machine has learned; no master."""

import threading

import pytest
import rospy
from waiting import stays, wait_for

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.ros.publishers import RatesPublisher


class FakeTopic:
    def __init__(self, *_, **__):
        self.told = []

    def publish(self, message):
        self.told.append(message.transitions[0].count if message.transitions else 0)

    def unregister(self):
        """Nobody listens."""


class Machine:
    """Whoever looks first is kept waiting between his look and what he publishes."""

    trial_id = 'trial-1'

    def __init__(self):
        self.visits = 1
        self.looked = threading.Event()
        self.go_on = threading.Event()

    def rates(self):
        return []

    def transition_counts(self):
        rows = [('TOP', 'PICK', 'succeeded', 'PLACE', self.visits)]
        if not self.looked.is_set():
            self.looked.set()
            # forever would be a deadlock, since the other one waits for this one
            self.go_on.wait(0.5)
        return rows


@pytest.fixture
def publisher(monkeypatch):
    monkeypatch.setattr(rospy, 'Publisher', FakeTopic)
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    publisher = RatesPublisher(period_s=0.001)
    yield publisher
    publisher.close()


def test_what_was_learned_last_is_what_stays_latched(publisher):
    machine = Machine()
    publisher.request(machine)  # the thread of the rates looks, and is slow
    assert machine.looked.wait(20.0)
    machine.visits = 2
    publisher.publish(machine)  # the machine's own thread, at the end of its trial
    machine.go_on.set()
    told = publisher._publisher.told
    assert wait_for(lambda: len(told) == 2, 20.0) and told == [1, 2]


def test_a_wrapped_machine_is_published_when_its_trial_ends(publisher):
    machine = smach.StateMachine(['succeeded'])
    with machine:
        smach.StateMachine.add(
            'PICK', smach.CBState(lambda *_: 'succeeded', outcomes=['succeeded'])
        )
    publisher.watch(OracleContainer.wrap(machine))
    assert machine.execute() == 'succeeded'
    assert publisher._publisher.told[-1] == 1


def test_a_machine_is_forgotten_when_nobody_looks_at_it_any_more(publisher):
    machine = Machine()
    publisher.request(machine)
    assert machine.looked.wait(20.0)  # the thread of the rates is at it
    publisher.request(machine)
    publisher.forget(machine)  # waits for that look, and for another one perhaps
    told = len(publisher._publisher.told)
    assert told and publisher._pending == {}
    assert stays(lambda: len(publisher._publisher.told) == told, 0.1)
