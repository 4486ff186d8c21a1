"""The console's web server attacked over real connections: hosts, origins, cookies, forged requests, roles, floods."""
import asyncio
import json
import os

import pytest
import tornado.httpclient
import tornado.testing
import tornado.websocket

from smach_oracle.expert.console import handlers
from smach_oracle.expert.console.access import Hosts, TokenBook
from smach_oracle.expert.console.desk import Reply
from smach_oracle.expert.console.handlers import Gate
from smach_oracle.expert.console.page_socket import Office
from smach_oracle.expert.console.sections import Sections
from smach_oracle.expert.console.sensors import Sensors
from smach_oracle.expert.console.server import make_app
from smach_oracle.expert.console.settings import ConsoleSettings
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


class FakeAudit:
    """Remembers what it is told."""

    def __init__(self):
        self.told = []

    def tell(self, person, command, ok, message, arguments=None, listed=None):
        self.told.append((command, ok, person.role, message, arguments))


class ConsoleCase(tornado.testing.AsyncHTTPTestCase):
    """One console on a free port of the loopback."""

    tokens = True

    def get_app(self):
        text = '\n'.join('{} {}'.format(role, token) for role, token in TOKENS.items())
        book = TokenBook(text, 'tokens') if self.tokens else None
        self.audit, self.desk, self.sections, self.log = FakeAudit(), FakeDesk(), Sections(), TrialLog()
        settings = ConsoleSettings('127.0.0.1', 1, book, Hosts([], False), '', '')
        self.gate = Gate(settings, book.cookie_secret if book else 'secret', self.audit)
        self.office = Office(self.sections, self.log, self.desk)
        self.sensors = Sensors()
        return make_app(self.gate, self.office, self.sensors)

    @property
    def origin(self):
        return 'http://127.0.0.1:{}'.format(self.get_http_port())

    def ask(self, path, method='GET', body=None, **headers):
        given = {name.replace('_', '-'): value for name, value in headers.items() if value is not None}
        return self.fetch(path, method=method, body=body, headers=given, follow_redirects=False,
                          allow_nonstandard_methods=True)

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

    def connect(self, cookie='', **headers):
        given = dict({'Origin': self.origin, 'Cookie': cookie}, **headers)
        request = tornado.httpclient.HTTPRequest(
            'ws://127.0.0.1:{}/socket'.format(self.get_http_port()),
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


class TestRequests(ConsoleCase):

    def test_every_answer_keeps_the_page_to_itself(self):
        for path, host in (('/', None), ('/session', None), ('/nothing', None), ('/static/js/main.js', None),
                           ('/static/nothing.js', None), ('/', 'evil.example'), ('/socket', None)):
            answer = self.ask(path, Host=host)
            for name in handlers.HEADERS:
                assert answer.headers.get(name), (path, name, answer.code)
            assert 'Server' not in answer.headers and 'Access-Control-Allow-Origin' not in answer.headers

    def test_another_host_name_is_refused_everywhere(self):
        for path in ('/', '/session', '/static/app.css', '/socket', '/nothing'):
            for host in ('evil.example', '10.1.2.3', 'localhost.evil.example'):
                assert self.ask(path, Host=host).code == 421

    def test_a_page_elsewhere_is_refused(self):
        for origin in ('http://evil.example', 'null', 'https://127.0.0.1', 'http://127.0.0.1:1'):
            assert self.ask('/session', Origin=origin).code == 403

    def test_no_file_outside_of_the_page_is_served(self):
        for path in ('/static/../server.py', '/static/%2e%2e/server.py', '/static/..%2fserver.py', '/../server.py',
                     '/static//etc/passwd', '/static/%2fetc%2fpasswd', '/server.py', '/static/js/..%5c..%5cserver.py'):
            assert self.ask(path).code in (403, 404), path

    def test_an_error_repeats_nothing_of_the_request(self):
        answer = self.ask('/<script>alert(1)</script>?x=<b>')
        assert answer.code == 404 and b'script' not in answer.body and b'<b>' not in answer.body

    def test_other_methods_do_nothing(self):
        for method in ('PUT', 'PATCH', 'OPTIONS', 'TRACE'):
            assert self.ask('/session', method, Origin=self.origin).code in (405, 400), method

    def test_a_flood_of_requests_is_cut_off(self):
        self.gate.requests._by_key['127.0.0.1'] = type(self.gate.sign_ins._make(1))(0.0, 3.0)
        assert [self.ask('/').code for _ in range(4)] == [200, 200, 200, 429]


class TestSignIn(ConsoleCase):

    def test_the_cookie_is_for_this_page_s_requests_alone(self):
        cookie = self.ask('/session').headers['Set-Cookie']
        assert 'HttpOnly' in cookie and 'SameSite=Strict' in cookie and 'Path=/' in cookie and 'Domain' not in cookie

    def test_a_token_is_exchanged_for_a_new_session(self):
        before, said = self.begin()
        assert said['signed_in'] is False and said['role'] == ''
        cookie, said = self.sign_in('operator')
        assert (said['signed_in'], said['role']) == (True, 'operator') and cookie != before
        assert TOKENS['operator'] not in cookie
        assert ('sign_in', True, 'operator', '', None) in self.audit.told

    def test_a_forged_request_is_refused(self):
        cookie, said = self.begin()
        other, other_said = self.begin()
        body = json.dumps({'token': TOKENS['operator']})
        for headers in ({}, {'X_Xsrf': ''}, {'X_Xsrf': 'wrong'}, {'X_Xsrf': other_said['xsrf']},
                        {'X_Xsrf': said['xsrf'], 'Origin': None},
                        {'X_Xsrf': said['xsrf'], 'Origin': 'http://evil.example'},
                        {'X_Xsrf': said['xsrf'], 'Cookie': None}):
            given = dict({'Cookie': cookie, 'Origin': self.origin}, **headers)
            assert self.ask('/session', 'POST', body, **given).code == 403, headers
        assert self.ask('/session', 'DELETE', Cookie=cookie, Origin=self.origin).code == 403

    def test_guessing_is_slowed_down_and_audited(self):
        cookie, said = self.begin()
        codes = [self.ask('/session', 'POST', json.dumps({'token': 'guess'}), Cookie=cookie, Origin=self.origin,
                          X_Xsrf=said['xsrf']).code for _ in range(7)]
        assert codes == [401] * 5 + [429] * 2
        assert self.ask('/session', 'POST', json.dumps({'token': TOKENS['operator']}), Cookie=cookie,
                        Origin=self.origin, X_Xsrf=said['xsrf']).code == 429, 'the right one, too'
        assert [told[:2] for told in self.audit.told] == [('sign_in', False)] * 8
        assert 'guess' not in str(self.audit.told)

    def test_what_is_no_token_is_refused(self):
        cookie, said = self.begin()
        for body in ('', '{', '[]', '{"token": 1}', '{"token": null}'):
            answer = self.ask('/session', 'POST', body, Cookie=cookie, Origin=self.origin, X_Xsrf=said['xsrf'])
            assert answer.code in (400, 429)
        assert not any(told[1] for told in self.audit.told)

    def test_a_forged_cookie_is_none(self):
        name, value = self.sign_in('viewer')[0].split('=', 1)
        parts = value.strip('"').split('|')
        for forged in (value[:-3] + 'aaa', '["x","operator",""]', '|'.join(parts[:-1] + ['0' * 64]), ''):
            assert self.begin(Cookie='{}={}'.format(name, forged))[1]['signed_in'] is False

    def test_signing_out_ends_it(self):
        cookie, said = self.sign_in('viewer')
        answer = self.ask('/session', 'DELETE', Cookie=cookie, Origin=self.origin, X_Xsrf=said['xsrf'])
        assert json.loads(answer.body)['signed_in'] is False


class TestSocket(ConsoleCase):

    @tornado.testing.gen_test
    async def test_a_socket_needs_a_session_its_own_origin_and_host(self):
        cookie, _ = await self.signed('operator')
        assert await self.refused('') == 401
        for headers in ({'Origin': 'http://evil.example'}, {'Origin': 'null'}, {'Origin': None}):
            assert await self.refused(cookie, **headers) == 403
        assert await self.refused(cookie, Host='evil.example', Origin='http://evil.example') == 421

    async def signed(self, role):
        """Sign in without leaving the loop."""
        client = self.http_client
        answer = await client.fetch(self.get_url('/session'))
        cookie = answer.headers['Set-Cookie'].split(';')[0]
        headers = {'Cookie': cookie, 'Origin': self.origin, 'X-Xsrf': json.loads(answer.body)['xsrf']}
        answer = await client.fetch(self.get_url('/session'), method='POST', headers=headers,
                                    body=json.dumps({'token': TOKENS[role]}))
        return answer.headers['Set-Cookie'].split(';')[0], json.loads(answer.body)

    @tornado.testing.gen_test
    async def test_nothing_is_told_or_done_before_a_hello_that_is_not_forged(self):
        cookie, said = await self.signed('operator')
        self.sections.put('questions', ['secret'])
        socket = await self.connect(cookie)
        self.office.push()
        reply = await self.say(socket, do='claim', question='q')
        assert not reply['ok'] and self.desk.done == []
        assert await self.say(socket, do='hello', xsrf='0' * 64, expert='ann') is None
        assert socket.close_code == 4003
        assert self.desk.done == []

    @tornado.testing.gen_test
    async def test_a_viewer_sees_and_does_nothing(self):
        self.sections.put('questions', [])
        socket = await self.open_page(*await self.signed('viewer'))
        self.office.push()
        assert json.loads(await socket.read_message())['sections'] == {'questions': []}
        for command in ('claim', 'take_over', 'release'):
            assert not (await self.say(socket, do=command, question='q'))['ok']
        assert not (await self.say(socket, do='answer', question='q', kind='goto', name='x'))['ok']
        assert self.desk.done == []
        assert [told[:3] for told in self.audit.told if told[0] == 'answer'] == [('answer', False, 'viewer')]

    @tornado.testing.gen_test
    async def test_an_operator_s_commands_are_carried_out_under_the_name_given(self):
        socket = await self.open_page(*await self.signed('operator'))
        reply = await self.say(socket, do='claim', question='q')
        assert (reply['ok'], reply['message'], self.desk.done) == (True, 'done', [('claim', 'ann', 'operator')])
        socket.close()
        while not self.desk.left:
            await asyncio.sleep(0.01)

    @tornado.testing.gen_test
    async def test_a_message_that_is_no_command_is_refused_and_audited(self):
        socket = await self.open_page(*await self.signed('operator'))
        assert not (await self.say(socket, do='publish', topic='/cmd_vel'))['ok']
        assert ('unknown', False) in [told[:2] for told in self.audit.told]

    @tornado.testing.gen_test
    async def test_a_flood_of_commands_is_dropped_and_then_cut_off(self):
        socket = await self.open_page(*await self.signed('operator'))
        for _ in range(100):
            await socket.write_message('{"id": 2, "do": "claim", "question": "q"}')
        while await socket.read_message() is not None:
            pass
        assert socket.close_code == 4008 and len(self.desk.done) < 50

    @tornado.testing.gen_test
    async def test_an_oversized_message_ends_the_connection(self):
        socket = await self.open_page(*await self.signed('operator'))
        await socket.write_message('x' * 70000)
        assert await socket.read_message() is None

    @tornado.testing.gen_test
    async def test_a_slow_page_gets_the_newest_version_and_no_queue(self):
        socket = await self.open_page(*await self.signed('viewer'))
        page, = self.office.sockets
        page._writing = True
        for number in range(100):
            self.sections.put('robots', [number])
            self.office.push()
        page._writing = False
        self.office.push()
        self.office.push()
        assert json.loads(await socket.read_message())['sections'] == {'robots': [99]}
        self.sections.put('robots', None)
        await asyncio.sleep(0.05)
        self.office.push()
        assert json.loads(await socket.read_message())['sections'] == {'robots': None}


class TestWithoutTokens(ConsoleCase):

    tokens = False

    def test_on_loopback_whoever_gets_there_is_at_home_but_not_a_page_elsewhere(self):
        _, said = self.begin()
        assert (said['signed_in'], said['role'], said['tokens']) == (True, 'teleoperator', False)
        assert self.ask('/session', Origin='http://evil.example').code == 403


del ConsoleCase  # not a case of its own
