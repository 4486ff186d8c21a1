"""What an operator types to hold robots, with services that keep what they are asked."""

import io

import pytest
from prompt_toolkit.output import DummyOutput
from rich.console import Console
from test_terminal import FakeFrontEnd, FakeStatusListener, FakeSteps, goal
from typist import ENTER, typist

from smach_oracle.expert.terminal import operator_commands
from smach_oracle.expert.terminal.operator_commands import OperatorCommands, machine_lines
from smach_oracle.expert.terminal.prompts import Prompts
from smach_oracle.expert.terminal.terminal import Terminal
from smach_oracle.msg import ActiveState, MachineControl
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.srv import CommandMachineResponse


@pytest.fixture
def called(monkeypatch):
    """The calls that were made, as (service, request)."""
    calls = []

    class FakeCall:
        addresses = {}

        def __init__(self, name, kind, request, address):
            calls.append((name, request))
            self.addresses[name] = address
            self._name = name

        def result(self, limit_s):
            if '/hangs/' in self._name:
                raise ServerGoneError('{} does not answer'.format(self._name))
            return CommandMachineResponse('/refuses/' not in self._name, 'runs now: B in task')

    monkeypatch.setattr(operator_commands, 'ServiceCall', FakeCall)
    return calls


def told(line, *robots):
    return OperatorCommands('ann', lambda: robots).carry_out(line)


def test_a_pause_goes_to_all_robots_and_says_what_each_answers(called):
    assert told('pause', '/hangs', '/robot') == [
        ('  /hangs/oracle/pause does not answer', 'red'),
        ('  /robot: runs now: B in task', 'green'),
    ]
    assert [name for name, _ in called] == ['/hangs/oracle/pause', '/robot/oracle/pause']
    assert called[1][1].by == 'ann'


class FakeStopCalls:
    def __init__(self):
        self.looked_up = []

    def look_up(self, robots):
        self.looked_up += robots

    def address_of(self, robot):
        return 'at ' + robot if robot in self.looked_up else ''


def test_a_stop_needs_no_master_and_what_lets_go_does(called):
    def robots():
        if not there:
            raise ServerGoneError('the master does not answer')
        return there

    there = ['/a', '/b']
    operator = OperatorCommands('ann', robots, FakeStopCalls())
    operator.look_up()
    operator.carry_out('pause')
    there = []
    for _ in range(3):
        with pytest.raises(ServerGoneError):
            operator.look_up()
    assert [style for _, style in operator.carry_out('pause')] == ['green', 'green']
    assert operator.carry_out('preempt /b') == [('  /b: runs now: B in task', 'green')]
    addresses = operator_commands.ServiceCall.addresses
    assert addresses['/a/oracle/pause'] == 'at /a' and addresses['/b/oracle/preempt'] == 'at /b'
    before = len(called)
    for line in ('resume /a', 'step /a', 'goto /a task PICK', 'status'):
        ((text, style),) = operator.carry_out(line)
        assert style == 'red' and 'the master does not answer' in text
    assert len(called) == before
    there = ['/a', '/b']
    operator.carry_out('resume /a')
    assert addresses['/a/oracle/resume'] == '', 'asked at the master'


def test_a_stop_is_also_for_robots_that_a_new_master_does_not_know_yet(called):
    there = ['/a', '/gone']
    operator = OperatorCommands('ann', lambda: there, FakeStopCalls())
    operator.look_up()
    there = ['/b']
    operator.look_up()
    assert len(operator.carry_out('pause')) == 3
    assert operator.carry_out('resume') == [('  /b: runs now: B in task', 'green')]
    there = ['/a', '/b']
    for _ in range(operator_commands._FORGET_LOOKS):
        operator.look_up()
    assert len(operator.carry_out('pause')) == 2, 'what is gone for long is forgotten'


def test_what_lets_go_names_its_robot_where_there_are_several(called):
    ((text, style),) = told('resume', '/a', '/b')
    assert (text, style) == ('resume: name one of /a, /b, or all, first', 'red') and not called
    told('resume /b', '/a', '/b')
    told('step all task/PICK', '/a', '/b')
    assert [(name, request.path) for name, request in called] == [
        ('/b/oracle/resume', ''),
        ('/a/oracle/step', 'task/PICK'),
        ('/b/oracle/step', 'task/PICK'),
    ]


def test_every_command_asks_for_what_it_says(called):
    for line in (
        'goto task PICK',
        'goto task PICK repeat',
        'break PICK_*',
        'unbreak PICK_*',
        'autonomy PICK confirm',
        'confirm',
        'preempt',
    ):
        assert told(line, '/robot')[0][1] == 'green'
    (_, go), (_, again), (_, stop), (_, no_stop), (_, level) = called[:5]
    assert (go.path, go.state, go.confirm_repeats) == ('task', 'PICK', False)
    assert again.confirm_repeats
    assert (stop.pattern, stop.remove, no_stop.remove) == ('PICK_*', False, True)
    assert (level.pattern, level.level) == ('PICK', 'confirm')
    assert [name.rsplit('/', 1)[1] for name, _ in called] == [
        'go_to',
        'go_to',
        'breakpoint',
        'breakpoint',
        'autonomy',
        'confirm',
        'preempt',
    ]


@pytest.mark.parametrize(
    'line, wrong',
    [
        ('goto task', 'PATH STATE'),
        ('goto task PICK twice', 'confirms that states are repeated'),
        ('break', 'PATTERN'),
        ('pause a b', 'hold at the next state'),
    ],
)
def test_what_is_no_whole_command_is_told(called, line, wrong):
    ((text, style),) = told(line, '/robot')
    assert wrong in text and style == 'red' and not called


def test_other_lines_are_no_commands(called):
    assert told('1', '/robot') is None and told('', '/robot') is None and not called
    assert told('pause') == [('pause: no robot is there', 'red')]
    assert told('step', '/refuses') == [('  /refuses: runs now: B in task', 'red')]


def test_a_machine_that_waits_for_a_confirmation_shows_so():
    lines = machine_lines(
        '/robot',
        MachineControl(
            path='task',
            running=True,
            paused=True,
            paused_by='eva',
            active=[
                ActiveState('task', 'A', 'paused', True),
                ActiveState('task/B', 'C', '', False),
            ],
            breakpoints=['X'],
            autonomy_patterns=['A'],
            autonomy_levels=['confirm'],
            jump_containers=['task/B'],
            jump_states=['D'],
        ),
    )
    assert [text for text, _ in lines] == [
        '  /robot task: paused by eva',
        '    task/A waits (paused, to be confirmed)',
        '    task/B/C runs',
        '    breakpoint X',
        '    autonomy A confirm',
        '    task/B is to go to D',
    ]


@pytest.mark.parametrize('goals', [(), (goal('q1'),), (goal('q1'), goal('q2'))])
def test_the_terminal_takes_commands_whatever_it_shows(called, goals):
    front_end = FakeFrontEnd(*goals)
    console = Console(file=io.StringIO(), width=100)
    with typist(console.file.getvalue, 'pause' + ENTER + 'q' + ENTER, ()) as keys:
        Terminal(
            front_end,
            console,
            Prompts(keys, DummyOutput()),
            FakeSteps,
            preconditions=FakeStatusListener,
            operator=OperatorCommands('ann', lambda: ['/robot']),
        ).run()
    assert '/robot: runs now: B in task' in console.file.getvalue()
    assert not front_end.decisions and len(called) == 1
