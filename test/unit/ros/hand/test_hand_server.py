"""Which machines of a node a command means."""

import gc
import threading

import pytest
import rospy

import smach
from smach_oracle.oracle import OperatorHand, OracleContainer
from smach_oracle.ros.hand import all_at_once, hand_server
from smach_oracle.ros.hand.hand_server import HandServer
from smach_oracle.srv import (
    CommandMachineRequest,
    SendMachineRequest,
    SetAutonomyRequest,
    SetBreakpointRequest,
)


class Silent:
    """In place of what publishes and listens."""

    def __init__(self, *args):
        self.changes = 0

    def changed(self):
        self.changes += 1

    def moved(self):
        pass

    def start(self):
        self.offered_before = set(self.offered)

    def listen_for(self, machine):
        pass


@pytest.fixture
def services(monkeypatch):
    offered = {}
    monkeypatch.setattr(
        rospy, 'Service', lambda name, kind, handle: offered.__setitem__(name, handle)
    )
    monkeypatch.setattr(hand_server, 'ControlPublisher', Silent)
    monkeypatch.setattr(Silent, 'offered', offered, raising=False)
    monkeypatch.setattr(hand_server, 'ViewerCommands', Silent)
    return offered


def machine(name):
    made = smach.StateMachine(outcomes=['done'])
    with made:
        smach.StateMachine.add('A', smach.CBState(lambda ud: 'done', outcomes=['done']))
    return OracleContainer.wrap(made, name=name)


def is_paused(each):
    return OperatorHand(each).status().paused


def test_the_status_is_advertised_after_the_services(services):
    server = HandServer()
    assert server._status.offered_before == set(services) != set()


def test_a_path_means_one_machine_and_no_path_all(services):
    server, one, two = HandServer(), machine('task'), machine('task_2')
    server.watch(one)
    server.watch(two)
    pause = services['~oracle/pause']
    assert pause(CommandMachineRequest(path='task', by='eva')).ok
    assert (is_paused(one), is_paused(two)) == (True, False)
    response = pause(CommandMachineRequest())
    assert response.ok and 'task does not run' in response.message
    assert 'task_2 does not run' in response.message and is_paused(two)
    refused = pause(CommandMachineRequest(path='other'))
    assert (refused.ok, refused.message) == (
        False,
        "there is no machine 'other' here; there are: task, task_2",
    )


class Hanging(smach.StateMachine):
    """Its request_preempt does not return before the test lets it."""

    free = threading.Event()

    def request_preempt(self):
        assert self.free.wait(60)
        super().request_preempt()


def test_a_machine_that_hangs_delays_no_other_one(services, monkeypatch):
    monkeypatch.setattr(all_at_once, 'ANSWER_LIMIT_S', 0.2)
    monkeypatch.setattr(Hanging, 'is_running', lambda _: True)
    hanging = Hanging(outcomes=['done', 'preempted'])
    with hanging:
        smach.StateMachine.add('A', smach.CBState(lambda ud: 'done', outcomes=['done']))
    server, task = HandServer(), machine('task')
    server.watch(OracleContainer.wrap(hanging, name='a_first'))
    server.watch(task)
    preempt = services['~oracle/preempt']
    replies = []
    asked = threading.Thread(
        target=lambda: replies.append(preempt(CommandMachineRequest())), daemon=True
    )
    asked.start()
    asked.join(20)
    assert replies and replies[0].ok, 'the first one has held the other up'
    assert replies[0].message == 'task does not run; a_first has not answered yet'
    alone = preempt(CommandMachineRequest(path='a_first'))
    assert (alone.ok, alone.message) == (False, 'a_first has not answered yet')
    Hanging.free.set()


def test_going_somewhere_needs_one_machine(services):
    server, one, two = HandServer(), machine('task'), machine('task_2')
    server.watch(one)
    server.watch(two)
    go_to = services['~oracle/go_to']
    assert not go_to(SendMachineRequest(state='A')).ok
    assert go_to(SendMachineRequest(path='/task_2', state='A')).message == (
        'task_2 does not run; it will begin in A'
    )


def test_what_is_refused_and_what_is_forgotten(services):
    server, one = HandServer(), machine('task')
    server.watch(one)
    stop = services['~oracle/breakpoint']
    assert stop(SetBreakpointRequest(pattern='A')).message == 'task pauses before task/A'
    assert stop(SetBreakpointRequest(pattern='A', remove=True)).ok
    assert not stop(SetBreakpointRequest(pattern='A', remove=True)).ok
    server.forget(one)
    assert services['~oracle/resume'](CommandMachineRequest(path='task')).message == (
        "there is no machine 'task' here; there are: none; the first has yet to run"
    )
    assert not one.events.observers


def test_who_calls_is_who_commands(services):
    server, one = HandServer(), machine('task')
    server.watch(one)
    request = CommandMachineRequest()
    request._connection_header = {'callerid': '/rosservice_1'}
    services['~oracle/pause'](request)
    assert OperatorHand(one).status().paused_by == '/rosservice_1'


@pytest.mark.parametrize('path', ['task', ''])
def test_the_next_machine_of_a_path_obeys_what_was_asked_there(services, path):
    server, one, two = HandServer(), machine('task'), machine('task')
    server.watch(one)
    services['~oracle/pause'](CommandMachineRequest(path=path, by='eva'))
    services['~oracle/breakpoint'](SetBreakpointRequest(path=path, pattern='A'))
    services['~oracle/autonomy'](SetAutonomyRequest(path=path, pattern='A', level='confirm'))
    server.watch(two)
    status = OperatorHand(two).status()
    assert (status.paused, status.paused_by, status.breakpoints) == (True, 'eva', ('A',))
    assert status.autonomy == {'A': 'confirm'}
    services['~oracle/resume'](CommandMachineRequest(path=path))
    services['~oracle/breakpoint'](SetBreakpointRequest(path=path, pattern='A', remove=True))
    services['~oracle/autonomy'](SetAutonomyRequest(path=path, pattern='A'))
    server.begins(one)  # once more
    status = OperatorHand(one).status()
    assert (status.paused, status.breakpoints, status.autonomy) == (False, (), {})


@pytest.mark.parametrize('path', ['task', ''])
def test_a_machine_of_another_path_obeys_what_was_asked_of_all(services, path):
    server, one, two, three = HandServer(), machine('task'), machine('task_2'), machine('task_3')
    server.watch(one)
    services['~oracle/step'](CommandMachineRequest(path=path))  # nothing waits: it pauses
    services['~oracle/pause'](CommandMachineRequest(path=path))
    services['~oracle/breakpoint'](SetBreakpointRequest(path=path, pattern='A'))
    server.watch(two)
    status = OperatorHand(two).status()
    assert (status.paused, status.breakpoints) == ((False, ()) if path else (True, ('A',)))
    services['~oracle/preempt'](CommandMachineRequest(path=path))
    server.watch(three)
    assert not is_paused(three)


def test_between_two_machines_the_node_is_held(services):
    server = HandServer()
    server.watch(machine('task'))
    gc.collect()  # nobody else has it
    pause = services['~oracle/pause'](CommandMachineRequest(by='eva'))
    assert (pause.ok, pause.message) == (True, 'no machine is there; the next one obeys')
    again, other = machine('task'), machine('task_2')
    for each in (again, other):
        server.watch(each)
        assert OperatorHand(each).status().paused_by == 'eva'


def test_a_command_reaches_the_machine_that_has_begun_last_and_all_that_run(services, monkeypatch):
    server, one, two = HandServer(), machine('task'), machine('task')
    pause, resume = services['~oracle/pause'], services['~oracle/resume']
    one_hand, two_hand = OperatorHand(one), OperatorHand(two)
    server.watch(one)
    server.watch(two)
    server.begins(one)  # once more
    assert [hand.status().running for _, hand in server._hands()] == [False]
    monkeypatch.setattr(type(one), 'is_running', lambda self: self is one)
    assert pause(CommandMachineRequest()).message.startswith('task is paused')
    assert resume(CommandMachineRequest()).message.startswith('task goes on')
    server.begins(two)
    assert len(server._hands()) == 2
    pause(CommandMachineRequest(path='task'))
    assert one_hand.status().paused and two_hand.status().paused


def test_a_machine_that_waits_for_its_turn_obeys_without_a_word(services):
    server, one, two = HandServer(), machine('task'), machine('task')
    server.watch(one)
    server.watch(two)
    assert services['~oracle/pause'](CommandMachineRequest()).message.count('task') == 1
    assert is_paused(one) and is_paused(two)
    services['~oracle/preempt'](CommandMachineRequest())
    assert not is_paused(one) and not is_paused(two)


def test_what_a_program_asks_before_its_machine_runs_stays(services):
    server, one, two = HandServer(), machine('task'), machine('task')
    server.watch(one)
    OperatorHand(two).set_breakpoint('A')
    OperatorHand(two).pause(by='the program')
    server.watch(two)
    server.begins(one)
    server.begins(two)
    status = OperatorHand(two).status()
    assert (status.paused_by, status.breakpoints) == ('the program', ('A',))
    assert not is_paused(one)


def test_a_machine_that_was_named_anew_goes_by_that_name_alone(services):
    server, one = HandServer(), machine('morning')
    server.watch(one)
    OracleContainer.wrap(one, name='evening')
    server.begins(one)
    pause = services['~oracle/pause']
    assert pause(CommandMachineRequest(path='evening')).ok
    assert not pause(CommandMachineRequest(path='morning')).ok


def test_paths_are_forgotten_after_many(services, monkeypatch):
    monkeypatch.setattr(hand_server, 'MOST_PATHS', 2)
    server, machines = HandServer(), [machine(name) for name in 'abc']
    for each in machines:
        server.watch(each)
    assert [path for path, _ in server._hands()] == ['b', 'c']
