"""One console on a free port of the loopback, for tests that attack it."""

import json
import os

import pytest
import tornado.httpclient
import tornado.testing
import tornado.websocket
from waiting import wait_in_loop

from smach_oracle.expert.console.commands.commands import MOST_BYTES, CommandReply
from smach_oracle.expert.console.graphs.layout_worker import LayoutWorker
from smach_oracle.expert.console.page_socket import OpenPages
from smach_oracle.expert.console.people.people import People
from smach_oracle.expert.console.people.shift_journal import ShiftJournal
from smach_oracle.expert.console.sensors.question_images import ImageStore
from smach_oracle.expert.console.sensors.question_replays import QuestionReplays
from smach_oracle.expert.console.sensors.sensor_streams import SensorStreams
from smach_oracle.expert.console.server import make_app, tls_context
from smach_oracle.expert.console.trials.bag_catalogue import BagCatalogue
from smach_oracle.expert.console.trials.history_handlers import HistoryRequests
from smach_oracle.expert.console.trials.recorded_trials import RecordedTrials
from smach_oracle.expert.console.trials.trial_log import TrialLog
from smach_oracle.expert.console.web.access import AccessTokens, AllowedHosts
from smach_oracle.expert.console.web.access_control import AccessControl
from smach_oracle.expert.console.web.connections import LimitedServer
from smach_oracle.expert.console.web.proxies import TrustedProxies
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.console.web.settings import ConsoleSettings
from smach_oracle.expert.console.web.shifts import Shifts

os.environ.setdefault('ASYNC_TEST_TIMEOUT', '30')  # s; the machine may be loaded
TOKENS = {
    role: role + '-token-of-sufficient-length' for role in ('viewer', 'operator', 'teleoperator')
}


class FakeQuestionCommands:
    """Does what it is told, and remembers."""

    def __init__(self):
        self.done = []
        self.left = []

    def carry_out(self, command, person, page):
        self.done.append((command.name, person.expert, person.role))
        return CommandReply(True, 'done')

    def leave(self, page):
        self.left.append(page)


class FakeTeleoperation:
    """One hand, whose wheel a page has once it has taken it."""

    def __init__(self):
        self.drivers = set()
        self.relayed = []
        self.stopped = []

    def drives(self, page):
        return page in self.drivers

    def drive(self, command, page):
        if page not in self.drivers:
            return CommandReply(False, 'Take the wheel first.')
        self.relayed.append(command.arguments)
        return CommandReply(True)

    def carry_out(self, command, person, page):
        self.drivers.add(page)
        return CommandReply(True, '', {'wheel': page})

    def stop(self, command, person, page):
        self.stopped.append((command.name, person.role))
        self.drivers.clear()
        return CommandReply(True)

    def leave(self, page):
        self.drivers.discard(page)


class FakeMachineHand:
    """Remembers what it is told; one that stops waits until the test lets it."""

    def __init__(self):
        self.done = []

    async def stop(self, command, person):
        self.done.append((command.name, person.expert, person.role))
        return CommandReply(True, 'asked to stop')

    def carry_out(self, command, person, page):
        self.done.append((command.name, person.expert, person.role))
        return CommandReply(True, 'runs now: A in TASK')


class FakeAudit:
    """Remembers what it is told."""

    def __init__(self):
        self.records = []

    def record(self, person, command, ok, message, arguments=None, listed=None):
        self.records.append((command, ok, person.role, message, arguments))


class ConsoleCase(tornado.testing.AsyncHTTPTestCase):
    """One console on a free port of the loopback."""

    tokens = True
    certificate, private_key = '', ''
    public, proxies = None, TrustedProxies()

    def get_app(self):
        text = '\n'.join('{} {}'.format(role, token) for role, token in TOKENS.items())
        tokens = AccessTokens(text, 'tokens') if self.tokens else None
        self.audit, self.question_commands, self.sections, self.log = (
            FakeAudit(),
            FakeQuestionCommands(),
            PageSections(),
            TrialLog(),
        )
        hosts = AllowedHosts([self.public.host] if self.public else [], False)
        settings = ConsoleSettings(
            '127.0.0.1', 1, tokens, hosts, self.certificate, self.private_key
        )._replace(public=self.public, proxies=self.proxies)
        self.teleoperation = FakeTeleoperation()
        self.access = AccessControl(
            settings, tokens.cookie_secret if tokens else 'secret', self.audit
        )
        self.machine_hand, self.down_machine_hand = FakeMachineHand(), FakeQuestionCommands()
        self.pages = OpenPages(
            self.sections,
            self.log,
            self.question_commands,
            self.teleoperation,
            self.machine_hand,
            self.down_machine_hand,
            People(ShiftJournal(), Shifts(), self.audit),
        )
        self.sensors = SensorStreams()
        self.files = ImageStore()
        self.catalogue = BagCatalogue(self.folders(), self.sections)
        self.replays = QuestionReplays()
        recorded = RecordedTrials(self.catalogue, LayoutWorker(), self.files)
        return make_app(
            self.access,
            self.pages,
            self.sensors,
            HistoryRequests(recorded, self.files),
            replays=self.replays,
        )

    def folders(self):
        """Of bags."""
        return []

    def get_protocol(self):
        return 'https' if self.certificate else 'http'

    def get_httpserver_options(self):
        return {
            'ssl_options': tls_context(self.access.settings),
            'max_body_size': MOST_BYTES,
            'max_header_size': 16384,
        }

    def get_http_server(self):
        limited = LimitedServer(self._app, **self.get_httpserver_options())
        limited.connections = self.access.connections
        limited.proxies = self.proxies
        return limited

    @property
    def origin(self):
        return '{}://127.0.0.1:{}'.format(self.get_protocol(), self.get_http_port())

    def ask(self, path, method='GET', body=None, **headers):
        given = {
            name.replace('_', '-'): value for name, value in headers.items() if value is not None
        }
        return self.fetch(
            path,
            method=method,
            body=body,
            headers=given,
            follow_redirects=False,
            allow_nonstandard_methods=True,
            ca_certs=self.certificate or None,
        )

    def begin(self, **headers):
        """A fresh session: its cookie and what the server says of it."""
        answer = self.ask('/session', **headers)
        cookie = (
            answer.headers['Set-Cookie'].split(';')[0]
            if 'Set-Cookie' in answer.headers
            else headers['Cookie']
        )
        return cookie, json.loads(answer.body)

    def sign_in(self, role):
        cookie, info = self.begin()
        answer = self.ask(
            '/session',
            'POST',
            json.dumps({'token': TOKENS[role]}),
            Cookie=cookie,
            Origin=self.origin,
            X_Xsrf=info['xsrf'],
        )
        assert answer.code == 200
        return answer.headers['Set-Cookie'].split(';')[0], json.loads(answer.body)

    async def signed(self, role):
        """Sign in without leaving the loop."""
        client = self.http_client
        answer = await client.fetch(self.get_url('/session'), ca_certs=self.certificate or None)
        cookie = answer.headers['Set-Cookie'].split(';')[0]
        headers = {
            'Cookie': cookie,
            'Origin': self.origin,
            'X-Xsrf': json.loads(answer.body)['xsrf'],
        }
        answer = await client.fetch(
            self.get_url('/session'),
            method='POST',
            headers=headers,
            ca_certs=self.certificate or None,
            body=json.dumps({'token': TOKENS[role]}),
        )
        return answer.headers['Set-Cookie'].split(';')[0], json.loads(answer.body)

    def connect(self, cookie='', **headers):
        given = dict({'Origin': self.origin, 'Cookie': cookie}, **headers)
        request = tornado.httpclient.HTTPRequest(
            self.origin.replace('http', 'ws', 1) + '/socket',
            ca_certs=self.certificate or None,
            headers={name: value for name, value in given.items() if value is not None},
        )
        return tornado.websocket.websocket_connect(request)

    async def refused(self, cookie='', **headers):
        with pytest.raises(tornado.httpclient.HTTPClientError) as error:
            await self.connect(cookie, **headers)
        return error.value.code

    async def say(self, socket, number=1, **command):
        await socket.write_message(json.dumps(dict(command, id=number)))
        while True:
            text = await socket.read_message()
            if text is None:
                return None
            message = json.loads(text)
            if message.get('re') == number:
                return message

    async def until(self, condition):
        """Let the console work until the condition holds."""
        assert await wait_in_loop(condition)

    async def open_page(self, cookie, info, expert='ann'):
        socket = await self.connect(cookie)
        reply = await self.say(socket, do='hello', xsrf=info['xsrf'], expert=expert)
        assert reply['ok'], reply
        return socket
