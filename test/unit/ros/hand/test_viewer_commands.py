"""What viewers want of machines that run, with machines that stand still in a state."""

import threading

import pytest
import rospy
from waiting import wait_for

import smach
from smach_common.introspection import viewer_jump
from smach_common.introspection.container_watch import ContainerWatch
from smach_common.introspection.introspection_server import set_initial_states
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.ros.hand.viewer_commands import ViewerCommands


class Running:
    """A machine A -> B -> C in a thread, which stays in A until it is told."""

    def __init__(self, settings=None, wrap=True):
        self.entered, self.opened = threading.Event(), threading.Event()
        self.visited, self.events = [], []
        machine = smach.StateMachine(outcomes=['done', 'aborted'])
        with machine:
            for label, following in (('A', 'B'), ('B', 'C'), ('C', 'done')):
                smach.StateMachine.add(
                    label,
                    smach.CBState(self.visit, cb_args=[label], outcomes=['ok'], input_keys=['x']),
                    {'ok': following},
                )
        machine.userdata.x = 0
        self.machine = OracleContainer.wrap(machine, settings=settings) if wrap else machine
        if wrap:
            self.machine.events.observers.append(self.events.append)
        self._thread = threading.Thread(target=self.machine.execute, daemon=True)
        self._thread.start()
        assert self.entered.wait(20)

    def visit(self, ud, label):
        self.visited.append((label, ud.x))
        self.entered.set()
        assert self.opened.wait(20)
        return 'ok'

    def end(self):
        self.opened.set()
        self._thread.join(20)
        assert not self._thread.is_alive()
        return self.visited


@pytest.fixture
def viewers(monkeypatch):
    monkeypatch.setattr(viewer_jump, '_senders', [])
    return ViewerCommands()


def watch_of(running):
    return ContainerWatch(running.machine, lambda *args: None, lambda: False)


def test_a_machine_that_runs_is_sent_with_what_comes_with_the_command(viewers):
    running = Running()
    watch = watch_of(running)
    assert set_initial_states(watch, ['C'], {'x': 7}, '/viewer')
    assert watch.jump_to is None and running.machine.get_initial_states() == ['C']
    assert running.end() == [('A', 0), ('C', 7)]
    (sent,) = [event for event in running.events if event.kind is EventKind.SENT]
    assert (sent.target, sent.by) == ('C', '/viewer')


def test_where_it_cannot_go_nothing_is_set_and_a_warning_tells(viewers):
    running = Running({'states': {'A': {'on_retry': 'confirm'}}})
    assert set_initial_states(watch_of(running), ['A'], {'x': 7}, '/viewer') is False
    assert running.end() == [('A', 0), ('B', 0), ('C', 0)]
    assert [event.text for event in running.events if event.kind is EventKind.WARNING] == [
        'is not sent to A as /viewer wants: going to A may repeat A: confirm that it may'
    ]


def test_a_command_that_a_client_repeats_is_one_wish(viewers):
    running = Running()
    assert viewers.send(running.machine, 'A', (), '') and running.machine.is_running()
    for _ in range(3):
        assert viewers.send(running.machine, 'A', (), '')
    running.opened.set()
    assert wait_for(lambda: not running.machine.is_running())
    assert viewers.send(running.machine, 'A', (), '') is None  # it runs no more
    assert running.end() == [('A', 0), ('A', 0), ('B', 0), ('C', 0)]


def test_what_is_refused_stays_refused_when_a_client_repeats_it(viewers):
    running = Running({'states': {'A': {'on_retry': 'confirm'}}})
    for _ in range(3):
        assert set_initial_states(watch_of(running), ['A'], {'x': 7}, '/viewer') is False
    assert running.machine.userdata.x == 0
    assert running.end() == [('A', 0), ('B', 0), ('C', 0)]
    assert [event.kind for event in running.events].count(EventKind.WARNING) == 1


def test_a_container_that_is_to_begin_in_a_guarded_state_asks_before_it_comes_again(viewers):
    """The author enters KITCHEN twice: the second time POUR is not drawn, but a viewer's wish."""
    poured, rounds = [], []
    kitchen = smach.StateMachine(outcomes=['done', 'aborted'])
    with kitchen:
        smach.StateMachine.add(
            'LOOK',
            smach.CBState(
                lambda ud: 'ok' if len(rounds) == 0 else 'enough', outcomes=['ok', 'enough']
            ),
            {'ok': 'POUR', 'enough': 'done'},
        )
        smach.StateMachine.add(
            'POUR',
            smach.CBState(lambda ud: poured.append(1) or 'ok', outcomes=['ok']),
            {'ok': 'done'},
        )

    def wish(ud):
        rounds.append(1)
        if len(rounds) == 1:
            watch = ContainerWatch(kitchen, lambda *args: None, lambda: False)
            assert set_initial_states(watch, ['POUR'], {}, '/viewer')
        return 'again' if len(rounds) == 1 else 'ok'

    machine = smach.StateMachine(outcomes=['done', 'aborted'])
    with machine:
        smach.StateMachine.add('KITCHEN', kitchen, {'done': 'WISH'})
        smach.StateMachine.add(
            'WISH',
            smach.CBState(wish, outcomes=['again', 'ok']),
            {'again': 'KITCHEN', 'ok': 'done'},
        )
    OracleContainer.wrap(machine, settings={'states': {'POUR': {'on_retry': 'confirm'}}})
    assert machine.execute() == 'aborted'  # nobody is there to be asked
    assert poured == [1]


def test_a_bare_machine_goes_there_as_ever(viewers):
    running = Running(wrap=False)
    watch = watch_of(running)
    assert set_initial_states(watch, ['C'], {}) and watch.jump_to == 'C'
    assert running.end() == [('A', 0), ('C', 0)]


def test_upstream_s_servers_are_listened_to(viewers, monkeypatch):
    topics = []
    monkeypatch.setattr(rospy, 'Subscriber', lambda name, *args: topics.append(name))

    class Proxy:
        _path = '/SHOWN'

        def __init__(self):
            self._init_cmd = type('Topic', (), {'resolved_name': '/viewed/smach/container_init'})

        def transitioned(self, *args):
            pass

    Proxy.__module__ = 'smach_ros.introspection'
    running = Running()
    running.machine.register_transition_cb(Proxy().transitioned)
    viewers.listen_for(running.machine)
    viewers.listen_for(running.machine)
    assert topics == ['/viewed/smach/container_init']
    command = type(
        'Command',
        (),
        {
            'path': '/SHOWN',
            'initial_states': ['C'],
            'local_data': 'gAN9cQAu',
            '_connection_header': {},
        },
    )
    viewers._on_command(command, topics[0])
    command.path = '/OTHER'
    viewers._on_command(command, topics[0])
    assert running.end() == [('A', 0), ('C', 0)]
