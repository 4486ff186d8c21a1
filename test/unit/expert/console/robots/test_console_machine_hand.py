"""Machines are held as pages command: stops wait for nothing, and what goes on must be heard."""

import asyncio
import threading

import pytest
import rosgraph
import rospy

from smach_oracle.expert import stop_calls
from smach_oracle.expert.console.commands.commands import PageCommand
from smach_oracle.expert.console.robots import machine_hand
from smach_oracle.expert.console.robots.machine_hand import MachineHand
from smach_oracle.expert.console.web.audit import Person
from smach_oracle.expert.stop_calls import StopCalls
from smach_oracle.ros import service_calls
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.srv import CommandMachineRequest, CommandMachineResponse

ANN, NOBODY = Person('::1', 's', 'operator', 'ann'), Person('::1', 's', 'viewer', '')


class Calls:
    """Of a robot that answers once it may."""

    def __init__(self):
        self.asked, self.free = [], threading.Event()
        self.error = None

    def call(self, robot, service, request):
        self.asked.append((service, request.path, request.by))
        assert self.free.wait(20)
        if self.error:
            raise self.error
        return CommandMachineResponse(True, 'it is asked to stop')


class Held:
    """A hand on /alpha, whose machine is TASK."""

    def __init__(self):
        self.calls, self.records, self.called = Calls(), [], []
        self.silent = ''
        self.hand = MachineHand(
            lambda: {'/alpha': ['TASK', 'TASK/IN']},
            self,
            lambda robot, seen: self.silent,
            self.calls,
            self.call,
        )

    def record(self, person, command, ok, message, arguments=None):
        self.records.append((person.expert, command, ok))

    def call(self, name, kind, request):
        self.called.append((name, request))
        return CommandMachineResponse(True, 'runs now: A in TASK')

    def stop(self, *paths, robot='/alpha', person=NOBODY):
        """Replies to stops that are sent one right after the other."""

        async def all_of_them():
            return await asyncio.gather(
                *(
                    self.hand.stop(
                        PageCommand(1, 'stop_machine', {'robot': robot, 'path': path}), person
                    )
                    for path in paths
                )
            )

        return asyncio.run(all_of_them())

    def start(self, name='resume_machine', **arguments):
        return self.hand.carry_out(
            PageCommand(
                1, name, dict({'robot': '/alpha', 'path': 'TASK', 'seen': 1.0}, **arguments)
            ),
            ANN,
            1,
        )


@pytest.fixture(name='held')
def make_held():
    return Held()


def test_a_stop_needs_no_name_and_no_robot_that_is_heard(held):
    held.silent = 'silent'
    held.calls.free.set()
    (reply,) = held.stop('TASK')
    assert (reply.ok, reply.message) == (True, 'it is asked to stop')
    assert held.calls.asked == [('/alpha/oracle/preempt', 'TASK', 'somebody at ::1')]
    assert held.records == [('', 'stop_machine', True)]


def test_a_robot_that_hangs_is_told_and_asked_no_more_than_some_times_at_once(held, monkeypatch):
    monkeypatch.setattr(machine_hand, 'CALL_LIMIT_S', 0.05)
    replies = held.stop(*['TASK'] * 9, '')
    assert not any(reply.ok for reply in replies) and 'not known' in replies[0].message
    assert len(held.calls.asked) == machine_hand.MOST_AT_ONCE + 1, 'another path is another stop'
    held.calls.free.set()


def test_what_cannot_be_reached_and_what_is_not_there_is_told(held):
    held.calls.free.set()
    held.calls.error = ServerGoneError('gone')
    assert held.stop('TASK')[0].message == 'gone'
    assert held.stop('OTHER')[0].message == 'There is no machine OTHER of /alpha here.'
    assert 'no robot /beta' in held.stop('', robot='/beta')[0].message
    assert len(held.calls.asked) == 1


def test_what_lets_a_machine_go_on_must_be_heard(held):
    assert held.start().message == 'runs now: A in TASK'
    name, request = held.called.pop()
    assert (name, request.path, request.by) == ('/alpha/oracle/resume', 'TASK', 'ann')
    held.silent = 'it is silent'
    for command in ('resume_machine', 'step_machine', 'confirm_state'):
        assert held.start(command).message == 'it is silent'
    assert held.called == []
    assert held.start('set_breakpoint', pattern='A', remove=True).ok
    assert (held.called[0][0], held.called[0][1].remove) == ('/alpha/oracle/breakpoint', True)
    assert held.start(path='OTHER').ok is False


class Fleet(Held):
    """A hand on three robots, of which /b hangs until it is set free."""

    def __init__(self):
        super().__init__()
        self.hand = MachineHand(
            lambda: {robot: ['TASK'] for robot in ('/a', '/b', '/c')},
            self,
            lambda robot, seen: self.silent,
            self,
        )

    def call(self, robot, service, request):
        if robot == '/b':
            assert self.calls.free.wait(20)
        self.called.append((service, request.path))
        return CommandMachineResponse(robot != '/c', 'it does not run')

    def stop_many(self, name, *robots):
        command = PageCommand(1, name, {'robots': list(robots)})
        return asyncio.run(self.hand.stop(command, NOBODY))


def test_all_robots_are_stopped_at_once_and_none_waits_for_another(monkeypatch):
    monkeypatch.setattr(machine_hand, 'CALL_LIMIT_S', 0.3)
    fleet = Fleet()
    reply = fleet.stop_many('stop_robots')
    assert sorted(fleet.called) == [('/a/oracle/preempt', ''), ('/c/oracle/preempt', '')]
    assert not reply.ok and reply.message.startswith('Asked to stop: 1 of 3. /b: /b has not')
    assert reply.message.endswith('/c: it does not run')
    assert fleet.records == [('', 'stop_robots', False)]
    fleet.calls.free.set()


def test_several_robots_are_paused_and_no_other():
    fleet = Fleet()
    fleet.calls.free.set()
    fleet.silent = 'silent'
    reply = fleet.stop_many('pause_robots', '/b', '/a', '/b')
    assert (reply.ok, reply.message) == (True, 'Asked to pause: 2 of 2.')
    assert sorted(fleet.called) == [('/a/oracle/pause', ''), ('/b/oracle/pause', '')]
    assert 'no robot /z' in fleet.stop_many('stop_robots', '/z').message


class Proxy:
    """A service at the first of two places, then at the second."""

    reached = []
    master_is_there = True

    def __init__(self, name, kind):
        self.name = name

    def __call__(self, request):
        if not self.master_is_there:
            raise rospy.ServiceException('unable to contact master')
        self.reached.append('by the master')
        return CommandMachineResponse(True, '')


class Direct(Proxy):
    def __init__(self, name, kind, address):
        super().__init__(name, kind)
        self.address = address

    def __call__(self, request):
        if self.address != 'rosrpc://here:1':
            raise rospy.ServiceException('connection refused')
        self.reached.append(self.address)
        return CommandMachineResponse(True, '')


class Master:
    address = 'rosrpc://here:1'

    def lookupService(self, service):
        if service != '/alpha/oracle/preempt':
            raise rosgraph.MasterError('no such service')
        return self.address


def test_a_stop_needs_no_master_once_it_is_known_where_the_robot_is(monkeypatch):
    monkeypatch.setattr(rospy, 'ServiceProxy', Proxy)
    monkeypatch.setattr(service_calls, '_AtAddress', Direct)
    monkeypatch.setattr(stop_calls, 'timed_master', Master)
    monkeypatch.setattr(Proxy, 'reached', [])
    calls = StopCalls()
    calls.look_up(['/alpha', '/beta'])
    monkeypatch.setattr(Proxy, 'master_is_there', False)
    request = CommandMachineRequest()
    calls.call('/alpha', '/alpha/oracle/pause', request)
    with pytest.raises(ServerGoneError, match='unable to contact master'):
        calls.call('/beta', '/beta/oracle/pause', request)
    monkeypatch.setattr(Proxy, 'master_is_there', True)
    monkeypatch.setattr(Master, 'address', 'rosrpc://elsewhere:1')
    calls.look_up(['/alpha'])
    calls.call('/alpha', '/alpha/oracle/pause', request)
    assert Proxy.reached == ['rosrpc://here:1', 'by the master'], 'started anew meanwhile'
