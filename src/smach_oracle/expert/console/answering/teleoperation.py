"""Drives the manipulation interfaces that run for questions, as the pages command."""

import math
import threading
import time
from typing import Dict, Optional, Set

import rospy

from smach_oracle.msg import TeleopCommand, TeleopState
from smach_oracle.ros.master_watch import timed_master

from ...followed_server import ListedQuestion
from ...front_end import FrontEnd
from ...interface_outputs import InterfaceOutputs
from ...repeating import repeat
from ..commands.checks import shown
from ..commands.commands import CommandReply, PageCommand
from ..feeds.views import number
from ..shapes.commands import WheelDataView
from ..shapes.sensors import ManipulationView
from ..web.audit import Audit, Person
from ..web.sections import PageSections
from .driving_control import DrivingSession
from .interface_actions import action_of, interface_actions
from .interface_output_view import interface_output_view
from .teleop_client import TeleopClient

DISCOVERY_PERIOD_S = 0.5
SECTIONS_PERIOD_S = 0.1
NOT_RUNNING = 'No manipulation interface runs for this question.'
TAKE_FIRST = 'Take the wheel first.'


class Teleoperation:
    """All of them.

    `drive` and `stop` are called from the server's loop and wait for nothing, the rest from other
    threads.
    """

    def __init__(self, sections: PageSections, front_end: FrontEnd, audit: Audit) -> None:
        self._sections = sections
        self._front_end = front_end
        self._audit = audit
        self._outputs = InterfaceOutputs()
        self._lock = threading.Lock()
        self._clients: Dict[str, TeleopClient] = {}  # by question
        self._interfaces: Set[str] = set()

    def is_interface(self, action: str) -> bool:
        """Whether there is a SharedAutonomy action of that name."""
        return action in self._interfaces

    def start(self) -> None:
        """Begin. The threads end with the node."""
        for step, period_s in (
            (self.discover, DISCOVERY_PERIOD_S),
            (self.write_sections, SECTIONS_PERIOD_S),
        ):
            repeat(step, period_s)

    def drives(self, page: int) -> bool:
        """Whether a page is in control of an interface."""
        return any(
            client.control.session is not None and client.control.session.page == page
            for client in list(self._clients.values())
        )

    def drive(self, command: PageCommand, page: int) -> CommandReply:
        """Relay one command of the page in control. A command that comes late stops the arm."""
        arguments = command.arguments
        client = self._clients.get(arguments['question'])
        if client is None:
            return CommandReply(False, NOT_RUNNING)
        with self._lock:
            session = client.control.session
            if session is None or session.page != page:
                return CommandReply(False, TAKE_FIRST)
            if arguments['arm'] and arguments['arm'] not in client.arms:
                client.release(_operator(session))
                return CommandReply(
                    False,
                    'unknown arm {}; allowed: {}'.format(
                        shown(arguments['arm']), ', '.join(client.arms)
                    ),
                )
            was_held = client.control.held
            if client.control.accept(arguments['sent'] / 1e3, arguments['held'], time.monotonic()):
                if not client.busy(_operator(session)):
                    client.send(_operator(session), arguments, True)
            elif was_held or arguments['held']:
                client.release(_operator(session))
        return CommandReply(True)

    def stop(self, command: PageCommand, person: Person, page: int) -> CommandReply:
        """Leave control, or end that of whoever has it. It waits for nothing."""
        key = command.arguments['question']
        if command.name == 'leave_wheel':
            self._leave(key, page, 'left')
            return CommandReply(True)
        client = self._clients.get(key)
        if client is not None:
            client.stop_whoever_drives()
        who = person.expert or 'somebody at {}'.format(person.client)  # to stop needs no name
        self._leave(key, None, '{} has stopped the hand'.format(who))
        reply = CommandReply(client is not None, '' if client is not None else NOT_RUNNING)
        self._audit.record(
            person, command.name, reply.ok, reply.message, {}, self._front_end.find(key)
        )
        return reply

    def carry_out(self, command: PageCommand, person: Person, page: int) -> CommandReply:
        """Take control, and record it in the audit."""
        key = command.arguments['question']
        client, listed = self._clients.get(key), self._front_end.find(key)
        if client is None or listed is None:
            reply = CommandReply(False, NOT_RUNNING)
        else:
            with self._lock:
                now_s = time.monotonic()
                why = client.control.take(DrivingSession(key, page, person, listed, now_s), now_s)
            reply = CommandReply(not why, why, None if why else WheelDataView(wheel=page))
        self._audit.record(person, command.name, reply.ok, reply.message, {}, listed)
        return reply

    def leave(self, page: int) -> None:
        """A page is gone: what it drives stops."""
        for key in list(self._clients):
            self._leave(key, page, 'the page is gone')

    def _leave(self, key: str, page: Optional[int], why: str) -> None:
        client = self._clients.get(key)
        if client is None:
            return
        with self._lock:
            session = client.control.session
            if session is None or page not in (None, session.page):
                return
            client.release(_operator(session))
            summary = client.control.leave(time.monotonic())
        self._audit.record(session.person, 'leave_wheel', True, why, summary, session.listed)

    def discover(self) -> None:
        """Ask the master once for interfaces, and for those among them that move an arm."""
        types = dict(timed_master().getTopicTypes())
        self._interfaces = interface_actions(types.items())
        running = {
            listed.key: action_of(listed)
            for listed in self._front_end.questions()
            if listed.goal.interface
        }
        moving = {
            key: action
            for key, action in running.items()
            if types.get(action + '/state') == TeleopState._type
            and types.get(action + '/command') == TeleopCommand._type
        }
        for key in set(self._clients) - set(moving):
            self._leave(key, None, 'the interface has ended')
            self._clients.pop(key).stop()
        self._outputs.follow([listed.goal.robot for listed in self._front_end.questions()])
        for key in set(moving) - set(self._clients):
            self._begin(key, moving[key])

    def _begin(self, key: str, action: str) -> None:
        try:
            self._clients[key] = TeleopClient(action)
        except (AttributeError, TypeError, ValueError) as err:
            # one robot's wrong settings must not stop the others' interfaces
            rospy.logerr_throttle(
                10,
                '{} does not have the settings of a manipulation interface: {!r}'.format(
                    action, err
                ),
            )

    def write_sections(self) -> None:
        """Bring the sections up to date. End the sessions of pages that have fallen silent."""
        for key, client in dict(self._clients).items():
            if client.control.session is not None and client.control.silent(time.monotonic()):
                self._leave(key, None, 'the page has fallen silent')
        self._sections.put(
            'manipulation', {key: _view(client) for key, client in dict(self._clients).items()}
        )
        self._sections.put(
            'interface_output',
            {
                listed.key: interface_output_view(self._outputs.newest(listed.goal.query_id))
                for listed in self._front_end.questions()
                if self._known(listed)
            },
        )

    def _known(self, listed: ListedQuestion) -> bool:
        output = self._outputs.newest(listed.goal.query_id)
        return bool(listed.goal.interface) and output is not None


def _operator(session: DrivingSession) -> str:
    """A name for each page: two pages of one person are two operators."""
    return '{} ({} {})'.format(session.person.expert, rospy.get_name(), session.page)


def _view(client: TeleopClient) -> ManipulationView:
    state, session = client.state, client.control.session
    view: ManipulationView = {
        'frames': sorted(client.frames(client.arm)),
        'arms': client.arms,
        'boxes': client.boxes,
        'wheel': session.page if session else None,
        'driver': session.person.expert if session else '',
    }
    if state is not None:
        at, way = state.tool_pose.position, state.achieved.linear
        view['state'] = {
            'arm': state.arm,
            'moving': state.moving,
            'limit': state.limit[:300],
            'refused': state.refused[:300],
            'share': number(state.speed, 3),
            'speed': number(math.sqrt(way.x**2 + way.y**2 + way.z**2), 3),
            'clearance': number(state.clearance, 3),
            'gripper': number(state.gripper, 3),
            'stalled': state.gripper_stalled,
            'at': (number(at.x, 3), number(at.y, 3), number(at.z, 3)),
        }
    return view
