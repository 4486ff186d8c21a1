"""The socket of one page: sections go out as they change, commands come in."""

import asyncio
import itertools
import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Coroutine, Optional, Set, Union

import tornado.iostream
import tornado.web
import tornado.websocket

from .answering.onlookers import Onlookers
from .answering.question_commands import QuestionCommands
from .answering.teleoperation import Teleoperation
from .commands.commands import CommandError, CommandReply, PageCommand, needed_role, parse, stops
from .commands.driving import DRIVING_COMMANDS, STOPPING_COMMANDS
from .commands.holding import HOLDING_COMMANDS, MACHINE_STOPS
from .commands.people import PEOPLE_COMMANDS
from .commands.stored import STORED_COMMANDS
from .people.people import People
from .robots.down_machine_hand import DownMachineHand
from .robots.machine_hand import MachineHand
from .shapes.commands import HelloDataView
from .trials.trial_log import TrialLog
from .web import sessions
from .web.access import RateLimit, SocketRateLimits, may
from .web.audit import Person
from .web.handlers import access_of, set_security_headers
from .web.row_lists import LOOKED_AT, SentLists
from .web.sections import PageSections

MOST_SOCKETS = 64
MOST_OF_A_SESSION = 16  # tabs of one browser
HELLO_LIMIT_S = 10.0
# between checks of the age of its session: clocks are set, machines sleep
LONGEST_UNSEEN_S = 60.0
MOST_AT_WORK = 8
MOST_EVENTS_AT_ONCE = 500
LONGEST_DRIVE = 2000
LONGEST_STOP = 16384  # of many robots
NAME_FIRST = 'say your name first: the robot and the records have it'
TOO_FAST = 4008
FORGED = 4003
SIGNED_OUT = 4001
TOO_OLD = 4002  # the page asks for the token by itself, and keeps what the person was typing


class OpenPages:
    """The objects that the sockets of all pages share."""

    def __init__(
        self,
        sections: PageSections,
        log: TrialLog,
        question_commands: QuestionCommands,
        teleoperation: Teleoperation,
        machine_hand: MachineHand,
        down_machine_hand: DownMachineHand,
        people: People,
    ) -> None:
        self.sections = sections
        self.log = log
        self.question_commands = question_commands
        self.teleoperation = teleoperation
        self.machine_hand = machine_hand
        self.down_machine_hand = down_machine_hand
        self.people = people
        self.onlookers = Onlookers(sections)
        self.open: Set['PageSocket'] = set()
        self.sockets: Set['PageSocket'] = set()  # those that have said hello
        self.numbers = itertools.count(1)
        self._trials_lock = threading.Lock()  # so that no older list is put last
        self._trials_version = -1  # of the list of live trials
        self.workers = ThreadPoolExecutor(8, 'command')

    def worker(self, command: PageCommand) -> Callable[..., CommandReply]:
        """Return the function that carries out a command, in a thread."""
        if command.name in HOLDING_COMMANDS:
            return self.machine_hand.carry_out
        if command.name in STORED_COMMANDS:
            return self.down_machine_hand.carry_out
        if command.name in PEOPLE_COMMANDS:
            return self.people.carry_out
        return (
            self.teleoperation.carry_out
            if command.name in DRIVING_COMMANDS
            else self.question_commands.carry_out
        )

    def close(self, session: sessions.BrowserSession) -> None:
        """Close the pages of a session that has ended.

        Their claims are released, and an arm that they drive stops.
        """
        for socket in list(self.open):
            if socket.session is not None and socket.session.id == session.id:
                socket.end(SIGNED_OUT, 'signed out')

    def write_trials(self) -> None:
        """Bring the list of live trials up to date, if anybody looks and something has changed."""
        with self._trials_lock:
            version = self.log.version
            if version != self._trials_version and any(
                'trials' in socket.lists.looks for socket in list(self.sockets)
            ):
                self._trials_version = version
                self.sections.put('trials', self.log.overview())

    def push(self) -> None:
        """Send every page what is new."""
        for socket in list(self.sockets):
            socket.push()


class PageSocket(tornado.websocket.WebSocketHandler):
    """One open page."""

    def initialize(self, pages: OpenPages) -> None:
        """Called by Tornado."""
        self._access = access_of(self)
        self._pages = pages
        self._person: Optional[Person] = None
        self.session: Optional[sessions.BrowserSession] = None
        self._name = ''
        self._number = next(pages.numbers)
        self._limits = SocketRateLimits(
            RateLimit(10.0, 40.0), RateLimit(70.0, 70.0), RateLimit(0.5, 20.0)
        )
        self._sent_version = 0
        self._watched = ''
        self._watched_from = 0
        self.lists = SentLists()
        self._writing = False
        self._at_work = 0  # commands that wait for a robot, or for their turn
        self._turn = asyncio.Lock()
        self._tasks: Set['asyncio.Task[None]'] = set()

    def set_default_headers(self) -> None:
        """Set the headers of every answer."""
        set_security_headers(self)

    def write_error(self, status_code: int, **_: object) -> None:
        """Answer with the status alone."""
        self.finish('{} {}\n'.format(status_code, self._reason))

    def prepare(self) -> None:
        """Check host, rate, origin and session before the handshake."""
        status = self._access.refusal(self)
        if not status and not self._access.from_own_page(self, must_say=True):
            status = 403
        self.session = self._access.session(self)
        if not status and self._access.identity(self.session) is None:
            status = 401
        if not status and not self._has_room():
            status = 503
        if status:
            raise tornado.web.HTTPError(status)

    def _has_room(self) -> bool:
        session = self.session
        own = [
            each
            for each in self._pages.open
            if session and each.session and each.session.id == session.id
        ]
        return len(self._pages.open) < MOST_SOCKETS and len(own) < MOST_OF_A_SESSION

    def check_origin(self, origin: str) -> bool:
        """Checked in `prepare` already."""
        return self._access.from_own_page(self, must_say=True)

    def open(self, *_: str, **__: str) -> None:
        """Begin. Nothing is sent before the page has said hello."""
        self.set_nodelay(True)
        self._pages.open.add(self)
        asyncio.get_running_loop().call_later(HELLO_LIMIT_S, self._demand_hello)
        self._look_at_age()

    def _demand_hello(self) -> None:
        if self._person is None:
            self.close(FORGED, 'no hello')

    def _look_at_age(self) -> None:
        if self._gone or self.session is None or self._access.settings.tokens is None:
            return
        if self._access.identity(self.session) is None:
            self.end(TOO_OLD, 'sign in again')
            return
        pause_s = min(self.session.left_s, LONGEST_UNSEEN_S)
        asyncio.get_running_loop().call_later(pause_s, self._look_at_age)

    def on_close(self) -> None:
        """Claims run out unless the page comes back."""
        self._pages.open.discard(self)
        self._pages.sockets.discard(self)
        self._pages.onlookers.leave(self._number)
        self._pages.question_commands.leave(self._number)
        self._pages.teleoperation.leave(self._number)

    async def on_message(self, message: Union[str, bytes]) -> None:
        """Carry out one command. Ignore those of a page that is being closed."""
        if self._gone:
            return
        if not self._bucket(message).take():
            if not self._limits.unruly.take():
                if _only_stops(message):
                    self._stop_at_last(parse(message))  # no limit holds it up
                self.end(TOO_FAST, 'too many commands')
                return
            if not _only_stops(message):
                return
        try:
            command = parse(message)
        except CommandError as err:
            self._note(None, CommandReply(False, str(err)))
            self._reply(err.number, CommandReply(False, str(err)))
            return
        reply = self._at_once(command)
        if reply is not None:
            self._answer(command, reply)
            return
        # the next message is read meanwhile: a stop waits for no robot that hangs
        if command.name in MACHINE_STOPS:
            self._begin(self._stop_machine(command))
            return
        self._at_work += 1
        self._begin(self._in_turn(command))

    def _stop_at_last(self, command: PageCommand) -> None:
        """Obey the last command of a page that is closed: it stops something."""
        if self._at_once(command) is None:
            self._begin(self._stop_machine(command))

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _answer(self, command: PageCommand, reply: CommandReply) -> None:
        if command.name != 'drive' or not reply.ok:
            self._reply(command.number, reply)

    def end(self, code: int, why: str) -> None:
        """Close it. What the page drives stops now, not when its browser has closed it, too."""
        self._pages.teleoperation.leave(self._number)
        self.close(code, why)

    @property
    def _gone(self) -> bool:
        return self.ws_connection is None or self.ws_connection.is_closing()

    def _bucket(self, message: Union[str, bytes]) -> RateLimit:
        driving = (
            isinstance(message, str) and len(message) <= LONGEST_DRIVE and '"drive"' in message
        )
        return (
            self._limits.driving
            if driving and self._pages.teleoperation.drives(self._number)
            else self._limits.commands
        )

    def _at_once(self, command: PageCommand) -> Optional[CommandReply]:
        """Reply to what needs no robot's word, and to what is refused. Return None for the rest."""
        if command.name == 'hello':
            return self._hello(command)
        if self._person is None:
            return CommandReply(False, 'say hello first')
        if not may(self._person.role, needed_role(command.name)):
            return self._note(
                command,
                CommandReply(
                    False,
                    '{}s may not {} (sign in as {})'.format(
                        self._person.role, command.name.replace('_', ' '), needed_role(command.name)
                    ),
                ),
            )
        if not self._person.expert and not _by_anybody(command):
            return self._note(command, CommandReply(False, NAME_FIRST))
        if command.name == 'view':
            self._pages.onlookers.look(self._number, command.arguments['question'], self._person)
            return self._note(command, CommandReply(True))
        if command.name == 'watch':
            self._watched, self._watched_from = command.arguments['trial'], 0
            return self._note(command, CommandReply(True))
        if command.name == 'look':
            self.lists.looks = LOOKED_AT.get(command.arguments['at'], ())
            self._pages.write_trials()
            return self._note(command, CommandReply(True))
        if command.name == 'pressed':
            self._pages.question_commands.note_press(command, self._person)
            return CommandReply(True)
        if command.name == 'drive':
            return self._pages.teleoperation.drive(command, self._number)
        if command.name in STOPPING_COMMANDS:  # whatever else is at work
            return self._pages.teleoperation.stop(command, self._person, self._number)
        if self._at_work >= MOST_AT_WORK and not stops(command):
            return self._note(command, CommandReply(False, 'too many commands at a time'))
        return None

    async def _in_turn(self, command: PageCommand) -> None:
        """Obey in the order in which the page has sent: a release and a claim do not overtake."""
        try:
            async with self._turn:
                if self._person is not None and not self._gone:
                    self._answer(command, await self._work(self._person, command))
        finally:
            self._at_work -= 1

    async def _stop_machine(self, command: PageCommand) -> None:
        """Obey before its turn: it waits for no other command."""
        if self._person is not None:
            self._answer(command, await self._pages.machine_hand.stop(command, self._person))

    async def _work(self, person: Person, command: PageCommand) -> CommandReply:
        try:
            loop = asyncio.get_running_loop()
            return await loop.run_in_executor(
                self._pages.workers, self._pages.worker(command), command, person, self._number
            )
        finally:
            if self._gone:  # while the robot was asked
                self._pages.question_commands.leave(self._number)
                self._pages.teleoperation.leave(self._number)

    def _hello(self, command: PageCommand) -> CommandReply:
        session, identity = self.session, self._access.identity(self.session)
        if (
            session is None
            or identity is None
            or not sessions.same(
                command.arguments['xsrf'], sessions.xsrf_token(session, self._access.secret)
            )
        ):
            self._note(None, CommandReply(False, 'forged'))
            self.close(FORGED, 'forged')
            return CommandReply(False, 'forged')
        name = identity.name or command.arguments['expert']
        self._person = Person(self.request.remote_ip or '', session.short, identity.role, name)
        self._pages.sockets.add(self)
        self._pages.onlookers.rename(self._number, self._person)
        self._note(command, CommandReply(True))
        return CommandReply(True, name, HelloDataView(browser=session.short))

    def _note(self, command: Optional[PageCommand], reply: CommandReply) -> CommandReply:
        """Record in the audit a command that went no further than this socket."""
        session = self.session.short if self.session else ''
        person = self._person or Person(self.request.remote_ip or '', session, '', '')
        arguments = (
            {name: value for name, value in command.arguments.items() if name != 'xsrf'}
            if command
            else {}
        )
        self._access.audit.record(
            person, command.name if command else 'unknown', reply.ok, reply.message, arguments
        )
        return reply

    def _reply(self, number: int, reply: CommandReply) -> None:
        answer = {'re': number, 'ok': reply.ok, 'message': reply.message}
        self._send(
            json.dumps(
                answer if reply.data is None else dict(answer, data=reply.data), allow_nan=False
            )
        )

    def push(self) -> None:
        """Send what has changed, unless the last batch is still on its way.

        A slow link thus never builds up lag.
        """
        if self._writing or self._person is None:
            return
        version, changed = self._pages.sections.since(self._sent_version)
        new = (
            self._pages.log.events(self._watched, self._watched_from, MOST_EVENTS_AT_ONCE)
            if self._watched
            else []
        )
        lists = self.lists.changes(self._pages.sections.lists)
        if not changed and not new and not lists:
            return
        parts = ['"now":{:.3f}'.format(time.time())]
        if changed:
            if not self._sent_version:
                # of an earlier connection the page may know sections that are gone
                parts.append('"all":true')
            parts.append(
                '"sections":{%s}'
                % ','.join('{}:{}'.format(json.dumps(name), text) for name, text in changed)
            )
        if lists:
            parts.append('"lists":' + lists)
        if new:
            parts.append(
                '"events":{{"trial":{},"from":{},"events":[{}]}}'.format(
                    json.dumps(self._watched), self._watched_from, ','.join(new)
                )
            )
        self._sent_version = version
        self._watched_from += len(new)
        self._writing = True
        self._send('{%s}' % ','.join(parts), self._written)

    def _written(self) -> None:
        self._writing = False

    def _send(self, text: str, done: Optional[Callable[[], None]] = None) -> None:
        async def send() -> None:
            try:
                await self.write_message(text)
            except (tornado.websocket.WebSocketClosedError, tornado.iostream.StreamClosedError):
                pass
            if done is not None:
                done()

        asyncio.get_running_loop().create_task(send())


def _by_anybody(command: PageCommand) -> bool:
    """Whether a command may come from somebody who has not said a name."""
    return needed_role(command.name) == 'viewer' or stops(command)


def _only_stops(message: Union[str, bytes]) -> bool:
    """Whether a message is a command that can only stop something."""
    if len(message) > LONGEST_STOP:
        return False
    try:
        command = parse(message)
    except CommandError:
        return False
    return stops(command)
