"""The lines by which an operator holds robots: `pause`, `resume`, `goto PATH STATE` and the like.

Calls go to all robots at once: one that hangs delays no other. `pause` and `preempt` need no
master. They reach the robots that it has known before.
"""

from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import rosgraph
import rospy

from smach_oracle.msg import ControlStatus, MachineControl
from smach_oracle.ros.main_thread import outside_main_thread
from smach_oracle.ros.master_watch import timed_master
from smach_oracle.ros.service_calls import CALL_LIMIT_S, ServerGoneError, ServiceCall
from smach_oracle.srv import (
    CommandMachine,
    CommandMachineRequest,
    SendMachine,
    SendMachineRequest,
    SetAutonomy,
    SetAutonomyRequest,
    SetBreakpoint,
    SetBreakpointRequest,
)

from ..stop_calls import StopCalls

TOPIC = '/oracle/control'
_STATUS_LIMIT_S = 1.0
_FORGET_LOOKS = 40  # a robot that is gone. One that a new master does not know yet comes back
_MASTER_LIMIT_S = 2.0  # a stop waits so long for one that hangs
_ALL = 'all'
Told = List[Tuple[str, str]]  # text and style
Robots = Callable[[], Sequence[str]]


class _Word(NamedTuple):
    """One command word."""

    meaning: str
    most: int  # how many words may follow it, beside the robot's name
    fewest: int
    service: str
    kind: type
    of_all: bool  # whether it means all robots where none is named
    request: Callable[..., Any]  # of who commands, and the words that follow
    stops: bool = False  # whether it is for the robots known last while no master answers


def _machine(by: str, path: str = '') -> CommandMachineRequest:
    return CommandMachineRequest(path=path, by=by)


def _send(by: str, path: str, state: str, repeat: str = '') -> SendMachineRequest:
    if repeat not in ('', 'repeat'):
        raise _UsageError('the third word can be repeat, which confirms that states are repeated')
    return SendMachineRequest(path=path, state=state, confirm_repeats=bool(repeat), by=by)


def _breakpoint(by: str, pattern: str) -> SetBreakpointRequest:
    return SetBreakpointRequest(pattern=pattern, by=by)


def _no_breakpoint(by: str, pattern: str) -> SetBreakpointRequest:
    return SetBreakpointRequest(pattern=pattern, remove=True, by=by)


def _autonomy(by: str, pattern: str, level: str = '') -> SetAutonomyRequest:
    return SetAutonomyRequest(pattern=pattern, level=level, by=by)


_WORDS: Dict[str, _Word] = {
    'pause': _Word(
        'hold at the next state', 1, 0, 'pause', CommandMachine, True, _machine, stops=True
    ),
    'resume': _Word('lift the pause', 1, 0, 'resume', CommandMachine, False, _machine),
    'step': _Word('enter one state [PATH]', 1, 0, 'step', CommandMachine, False, _machine),
    'confirm': _Word(
        'let a state be entered [PATH]', 1, 0, 'confirm', CommandMachine, False, _machine
    ),
    'preempt': _Word(
        'stop the machine', 1, 0, 'preempt', CommandMachine, True, _machine, stops=True
    ),
    'goto': _Word('PATH STATE [repeat]: go there', 3, 2, 'go_to', SendMachine, False, _send),
    'break': _Word(
        'PATTERN: pause before these states', 1, 1, 'breakpoint', SetBreakpoint, False, _breakpoint
    ),
    'unbreak': _Word(
        'PATTERN: not any more', 1, 1, 'breakpoint', SetBreakpoint, False, _no_breakpoint
    ),
    'autonomy': _Word(
        'PATTERN run, announce or confirm', 2, 1, 'autonomy', SetAutonomy, False, _autonomy
    ),
}
OPERATOR_WORDS = [(word, each.meaning) for word, each in _WORDS.items()] + [
    ('status', 'what runs, what waits')
]


class _UsageError(Exception):
    """The typed line is not a whole command. This error never leaves this module."""


def robots_of_master() -> Sequence[str]:
    """Return the nodes that can be held, by the master's list of topics.

    :raises ServerGoneError: where the master does not answer.
    """
    try:
        published = outside_main_thread(
            lambda: timed_master(_MASTER_LIMIT_S).getPublishedTopics('')
        )
    except (OSError, rosgraph.MasterException) as err:
        raise ServerGoneError('the master does not answer: {}'.format(err)) from err
    return sorted(
        topic[: -len(TOPIC)]
        for topic, kind in published
        if kind == ControlStatus._type and topic.endswith(TOPIC)
    )


class OperatorCommands:
    """Carries out the lines of one expert."""

    def __init__(
        self, expert: str, robots: Robots = robots_of_master, stop_calls: Optional[StopCalls] = None
    ) -> None:
        """`expert`: the name under which to command."""
        self._expert = expert
        self._robots = robots
        self._stop_calls = stop_calls or StopCalls()
        self._unlisted: Dict[str, int] = {}  # by robot the looks at which no master had it

    def look_up(self) -> None:
        """Learn which robots there are, and where. Call it again and again, in another thread.

        :raises ServerGoneError: where the master does not answer.
        """
        listed = self._robots()
        self._unlisted = {
            robot: 0 if robot in listed else looks + 1
            for robot, looks in {**dict.fromkeys(listed, 0), **self._unlisted}.items()
            if looks < _FORGET_LOOKS
        }
        self._stop_calls.look_up(listed)

    def carry_out(self, line: str) -> Optional[Told]:
        """Carry a line out, and return the text to show, or None where it commands nothing."""
        name, *words = line.split() or ['']
        if name != 'status' and name not in _WORDS:
            return None
        try:
            robots, words = self._meant(name, words)
            if name == 'status':
                return [told for robot in robots for told in _status_of(robot)]
            return list(self._call(robots, _WORDS[name], words))
        except (_UsageError, ServerGoneError) as err:
            return [('{}: {}'.format(name, err), 'red')]

    def _meant(self, name: str, words: List[str]) -> Tuple[Sequence[str], List[str]]:
        """The robots that are meant, and the words without their name."""
        robots = self._now(name)
        if not robots:
            raise _UsageError('no robot is there')
        if words and (words[0] in robots or words[0] == _ALL):
            return (robots if words[0] == _ALL else [words[0]]), words[1:]
        if len(robots) > 1 and name != 'status' and not _WORDS[name].of_all:
            raise _UsageError('name one of {}, or all, first'.format(', '.join(robots)))
        return robots, words

    def _now(self, name: str) -> Sequence[str]:
        """The robots that there are. A stop is also for those that a master has listed before."""
        known = set(self._unlisted) if name in _WORDS and _WORDS[name].stops else set()
        try:
            return sorted(known.union(self._robots()))
        except ServerGoneError:
            if not known:
                raise
            return sorted(known)

    def _call(
        self, robots: Sequence[str], word: _Word, words: List[str]
    ) -> Iterator[Tuple[str, str]]:
        if not word.fewest <= len(words) <= word.most:
            raise _UsageError(word.meaning)
        request = word.request(self._expert, *words)
        calls = [
            (
                robot,
                ServiceCall(
                    '{}/oracle/{}'.format(robot, word.service),
                    word.kind,
                    request,
                    self._stop_calls.address_of(robot) if word.stops else '',
                ),
            )
            for robot in robots
        ]
        for robot, call in calls:
            try:
                response = call.result(CALL_LIMIT_S)
                yield '  {}: {}'.format(robot, response.message), 'green' if response.ok else 'red'
            except ServerGoneError as err:
                yield '  {}'.format(err), 'red'


def _status_of(robot: str) -> Told:
    try:
        message = rospy.wait_for_message(robot + TOPIC, ControlStatus, _STATUS_LIMIT_S)
    except rospy.ROSException:
        return [('  {} does not tell'.format(robot), 'red')]
    return [told for machine in message.machines for told in machine_lines(robot, machine)]


def machine_lines(robot: str, machine: MachineControl) -> Told:
    """Return how a machine stands, in lines."""
    how = (
        'paused by ' + (machine.paused_by or 'somebody')
        if machine.paused
        else ('runs' if machine.running else 'does not run')
    )
    lines = [('  {} {}: {}'.format(robot, machine.path, how), 'bold')]
    for each in machine.active:
        waits = (
            ' waits ({}{})'.format(
                each.held_by,
                ', to be confirmed'
                if each.waits_for_confirmation and each.held_by != 'confirm'
                else '',
            )
            if each.held_by
            else ' runs'
        )
        lines.append(
            (
                '    {}/{}{}'.format(each.path, each.state, waits),
                'yellow' if each.held_by else 'dim',
            )
        )
    lines += [('    breakpoint {}'.format(each), 'dim') for each in machine.breakpoints]
    lines += [
        ('    autonomy {} {}'.format(pattern, level), 'dim')
        for pattern, level in zip(machine.autonomy_patterns, machine.autonomy_levels)
    ]
    return lines + [
        ('    {} is to go to {}'.format(path, state), 'dim')
        for path, state in zip(machine.jump_containers, machine.jump_states)
    ]
