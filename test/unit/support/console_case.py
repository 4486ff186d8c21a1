"""One console on a free port of the loopback, for tests that attack it."""
import json
import os

import pytest
import tornado.httpclient
import tornado.testing
import tornado.websocket

from smach_oracle.expert.console.access import Hosts, TokenBook
from smach_oracle.expert.console.bags import BagShelf
from smach_oracle.expert.console.commands import MOST_BYTES
from smach_oracle.expert.console.desk import Reply
from smach_oracle.expert.console.handlers import Gate
from smach_oracle.expert.console.history_handlers import HistoryRoom
from smach_oracle.expert.console.layout import Layouter
from smach_oracle.expert.console.page_socket import Office
from smach_oracle.expert.console.recorded import RecordedTrials
from smach_oracle.expert.console.sections import Sections
from smach_oracle.expert.console.sensors import Sensors
from smach_oracle.expert.console.server import make_app, tls_context
from smach_oracle.expert.console.settings import ConsoleSettings
from smach_oracle.expert.console.stills import StillFiles
from smach_oracle.expert.console.trial_log import TrialLog

os.environ.setdefault('ASYNC_TEST_TIMEOUT', '30')  # s; the machine may be loaded
TOKENS = {role: role + '-token-of-sufficient-length' for role in ('viewer', 'operator', 'teleoperator')}


class FakeDesk:
    """Does what it is told, and remembers."""

    def __init__(self):
        self.done = []
        self.left = []

    def carry_out(self, command, person, browser):
        self.done.append((command.name, person.expert, person.role))
        return Reply(True, 'done')

    def leave(self, browser):
        self.left.append(browser)


class FakeHands:
    """One hand, whose wheel a page has once it has taken it."""

    def __init__(self):
        self.wheels = set()
        self.relayed = []

    def drives(self, browser):
        return browser in self.wheels

    def drive(self, command, browser):
        if browser not in self.wheels:
            return Reply(False, 'Take the wheel first.')
        self.relayed.append(command.arguments)
        return Reply(True)

    def carry_out(self, command, person, browser):
        self.wheels.add(browser)
        return Reply(True, '', {'wheel': browser})

    def leave(self, browser):
        self.wheels.discard(browser)


class FakeAudit:
    """Remembers what it is told."""

    def __init__(self):
        self.told = []

    def tell(self, person, command, ok, message, arguments=None, listed=None):
        self.told.append((command, ok, person.role, message, arguments))


class ConsoleCase(tornado.testing.AsyncHTTPTestCase):
    """One console on a free port of the loopback."""

    tokens = True
    certificate, private_key = '', ''

    def get_app(self):
        text = '\n'.join('{} {}'.format(role, token) for role, token in TOKENS.items())
        book = TokenBook(text, 'tokens') if self.tokens else None
        self.audit, self.desk, self.sections, self.log = FakeAudit(), FakeDesk(), Sections(), TrialLog()
        settings = ConsoleSettings('127.0.0.1', 1, book, Hosts([], False), self.certificate, self.private_key)
        self.hands = FakeHands()
        self.gate = Gate(settings, book.cookie_secret if book else 'secret', self.audit)
        self.office = Office(self.sections, self.log, self.desk, self.hands)
        self.sensors = Sensors()
        self.files = StillFiles()
        self.shelf = BagShelf(self.folders(), self.sections)
        recorded = RecordedTrials(self.shelf, Layouter(), self.files)
        return make_app(self.gate, self.office, self.sensors, HistoryRoom(recorded, self.files))

    def folders(self):
        """Of bags."""
        return []

    def get_protocol(self):
        return 'https' if self.certificate else 'http'

    def get_httpserver_options(self):
        return {'ssl_options': tls_context(self.gate.settings), 'max_body_size': MOST_BYTES, 'max_header_size': 16384}

    @property
    def origin(self):
        return '{}://127.0.0.1:{}'.format(self.get_protocol(), self.get_http_port())

    def ask(self, path, method='GET', body=None, **headers):
        given = {name.replace('_', '-'): value for name, value in headers.items() if value is not None}
        return self.fetch(path, method=method, body=body, headers=given, follow_redirects=False,
                          allow_nonstandard_methods=True, ca_certs=self.certificate or None)

    def begin(self, **headers):
        """A fresh session: its cookie and what the server says of it."""
        answer = self.ask('/session', **headers)
        cookie = answer.headers['Set-Cookie'].split(';')[0] if 'Set-Cookie' in answer.headers else headers['Cookie']
        return cookie, json.loads(answer.body)

    def sign_in(self, role):
        cookie, said = self.begin()
        answer = self.ask('/session', 'POST', json.dumps({'token': TOKENS[role]}), Cookie=cookie, Origin=self.origin,
                          X_Xsrf=said['xsrf'])
        assert answer.code == 200
        return answer.headers['Set-Cookie'].split(';')[0], json.loads(answer.body)

    async def signed(self, role):
        """Sign in without leaving the loop."""
        client = self.http_client
        answer = await client.fetch(self.get_url('/session'), ca_certs=self.certificate or None)
        cookie = answer.headers['Set-Cookie'].split(';')[0]
        headers = {'Cookie': cookie, 'Origin': self.origin, 'X-Xsrf': json.loads(answer.body)['xsrf']}
        answer = await client.fetch(self.get_url('/session'), method='POST', headers=headers,
                                    ca_certs=self.certificate or None, body=json.dumps({'token': TOKENS[role]}))
        return answer.headers['Set-Cookie'].split(';')[0], json.loads(answer.body)

    def connect(self, cookie='', **headers):
        given = dict({'Origin': self.origin, 'Cookie': cookie}, **headers)
        request = tornado.httpclient.HTTPRequest(
            self.origin.replace('http', 'ws', 1) + '/socket', ca_certs=self.certificate or None,
            headers={name: value for name, value in given.items() if value is not None})
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

    async def open_page(self, cookie, said, expert='ann'):
        socket = await self.connect(cookie)
        reply = await self.say(socket, do='hello', xsrf=said['xsrf'], expert=expert)
        assert reply['ok'], reply
        return socket
