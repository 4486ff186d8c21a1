"""Attacks on the console that take more than one request, or one that no browser would send."""

import hmac
import json
import socket
import threading
import time

import console_case
import pytest
import tornado.testing
import tornado.web
from console_case import TOKENS

from smach_oracle.expert.console import page_socket
from smach_oracle.expert.console.commands.commands import COMMANDS, CommandReply
from smach_oracle.expert.console.server import STATIC
from smach_oracle.expert.console.web import sessions
from smach_oracle.expert.console.web.access import (
    ROLES,
    AccessTokens,
    ClientRateLimits,
    RateLimit,
    SocketRateLimits,
)

ARGUMENTS = {
    'text': 'the gripper is worn',
    'note': '1.5-7',
    'question': 'q',
    'kind': 'goto',
    'name': 'x',
    'held': True,
    'frame': 'tool',
    'linear': [0, 0, 0],
    'angular': [0, 0, 0],
    'gripper': '',
    'sent': 1.0,
    'xsrf': 'x',
    'trial': 't',
    'outcome': 'succeeded',
    'stamp': '1.000000000',
    'region': [[0, 0], [9, 0], [9, 9]],
    'strokes': [],
    'robot': '/r',
    'robots': [],
    'path': '',
    'pattern': 'A',
    'remove': False,
    'down': 'd',
    'moment': 1,
    'label': 'A',
    'container': 'M',
    'key': 'k',
    'json': '1',
}
FRAMES = {'use_frame': 'fresh', 'drive': 'tool'}


def test_no_time_tells_how_much_of_a_token_is_right(monkeypatch):
    tokens = AccessTokens(
        '\n'.join('{} {}'.format(role, token) for role, token in TOKENS.items()), 'file'
    )
    compared = []
    real = hmac.compare_digest
    monkeypatch.setattr(
        hmac, 'compare_digest', lambda one, other: compared.append((one, other)) or real(one, other)
    )
    right = TOKENS['operator']
    for guess in (
        '',
        'x',
        right[:-1],
        right + 'x',
        right,
        TOKENS['viewer'],
        TOKENS['teleoperator'],
    ):
        compared.clear()
        tokens.identify(guess)
        assert len(compared) == len(TOKENS), 'all of them, whichever it is'
        assert {len(each) for pair in compared for each in pair} == {32}, 'digests, and no tokens'


class TestOdd(console_case.ConsoleCase):
    def raw(self, *lines, body=b'', limit_s=40.0):
        """The status of a request written by hand, 0 where the connection is closed."""
        answer = self.io_loop.run_sync(
            lambda: self.io_loop.run_in_executor(None, self._talk, lines, body), timeout=limit_s
        )
        return int(answer.split()[1]) if answer else 0

    def _talk(self, lines, body):
        with socket.create_connection(('127.0.0.1', self.get_http_port()), 30.0) as line:
            try:  # the server may hang up while it is still being told
                line.sendall('\r\n'.join(lines + ('', '')).encode() + body)
                return line.recv(4096)
            except ConnectionError:
                return b''

    def test_two_hosts_none_and_one_hidden_in_the_address(self):
        own = 'Host: 127.0.0.1:{}'.format(self.get_http_port())
        assert self.raw('GET /session HTTP/1.1', own) == 200
        assert self.raw('GET /session HTTP/1.1', own, 'Host: evil.example') in (400, 421, 0)
        assert self.raw('GET /session HTTP/1.1', 'Host: evil.example', own) in (400, 421, 0)
        assert self.raw('GET /session HTTP/1.0') in (400, 421, 0)
        assert self.raw('GET http://evil.example/session HTTP/1.1', 'Host: evil.example') in (
            400,
            404,
            421,
            0,
        )

    def test_what_is_too_large_is_not_even_read(self):
        own = 'Host: 127.0.0.1:{}'.format(self.get_http_port())
        assert self.raw('POST /session HTTP/1.1', own, 'Content-Length: 1000000000') in (
            400,
            413,
            0,
        )
        assert self.raw('GET /session HTTP/1.1', own, 'X-Long: ' + 'x' * 70000) in (400, 431, 0)
        assert self.raw(
            'POST /session HTTP/1.1',
            own,
            'Transfer-Encoding: chunked',
            body=b'fffff\r\n' + b'x' * 0xFFFFF,
        ) in (400, 413, 0)
        assert self.raw('GET /session HTTP/1.1', own) == 200, 'it is still there'

    def test_nobody_gets_another_share_by_calling_himself_somebody_else(self):
        self.access.requests = ClientRateLimits(rate=0.0, burst=2.0, for_all=5.0)
        codes = [
            self.ask(
                '/session',
                X_Forwarded_For='10.0.0.{}'.format(number),
                X_Real_Ip='10.1.0.{}'.format(number),
                Forwarded='for=10.2.0.{}'.format(number),
            ).code
            for number in range(4)
        ]
        assert codes == [200, 200, 429, 429]

    def test_strangers_take_nothing_from_who_has_come_with_a_token(self):
        cookie, _ = self.sign_in('viewer')
        self.access.requests = ClientRateLimits(rate=0.0, burst=2.0, for_all=1.0)
        assert [self.ask('/session').code for _ in range(4)] == [200, 200, 429, 429]
        assert [self.ask('/session', Cookie=cookie).code for _ in range(4)] == [200, 200, 429, 429]
        self.access.requests = ClientRateLimits(rate=0.0, burst=2.0, for_all=0.0)
        assert self.ask('/session').code == 429
        assert self.ask('/session', Cookie=cookie).code == 200, 'however many they are'

    def tried(self, token, session):
        cookie, info = session
        return self.ask(
            '/session',
            'POST',
            json.dumps({'token': token}),
            Cookie=cookie,
            Origin=self.origin,
            X_Xsrf=info['xsrf'],
        ).code

    def test_wrong_tokens_shut_nobody_out(self):
        mine, theirs = self.begin(), self.begin()
        self.access.wrong_tokens = ClientRateLimits(rate=0.0, burst=10.0, for_all=1.0)
        assert [self.tried('guess', theirs) for _ in range(200)].count(429) == 195
        assert len(self.audit.records) <= 11, 'the audit is not flooded'
        assert self.ask('/').code == 200 and self.ask('/session').code == 200, 'nor is the page'
        assert self.tried(TOKENS['operator'], mine) == 200, 'of the same address'

    def test_a_stranger_who_asks_for_little_has_it_however_much_others_ask_for(self):
        self.access.requests = ClientRateLimits(rate=0.0, burst=150.0, for_all=5.0)
        self.access.files = ClientRateLimits(rate=0.0, burst=1500.0, for_all=5.0)
        for limits, all_had in ((self.access.requests, 750), (self.access.files, 7500)):
            had = sum(
                limits.take('10.0.0.{}'.format(number)) for _ in range(1000) for number in range(20)
            )
            assert had == all_had * 1.4, 'with a tenth of a share of each'
        files = sum(path.is_file() for path in STATIC.rglob('*'))
        assert all(self.access.files.take('192.168.0.9') for _ in range(files)), 'a page is loaded'
        assert [self.ask(path).code for path in ('/', '/session')] == [200, 200]
        assert self.sign_in('operator')[1]['role'] == 'operator'

    def cookie_of(self, secret, clock=time.time, text=None):
        text = text or sessions.to_text(
            sessions.BrowserSession('known-to-the-attacker', time.time(), 'teleoperator')
        )
        value = tornado.web.create_signed_value(secret, self.access.cookie, text, clock=clock)
        return '{}={}'.format(self.access.cookie, value.decode())

    def test_a_cookie_of_other_tokens_or_of_yesterday_is_none(self):
        assert self.begin(Cookie=self.cookie_of(self.access.secret))[1]['signed_in'] is True, (
            'as it would be made'
        )
        assert self.begin(Cookie=self.cookie_of('another secret'))[1]['signed_in'] is False
        assert (
            self.begin(Cookie=self.cookie_of(self.access.secret, lambda: time.time() - 13 * 3600))[
                1
            ]['signed_in']
            is False
        )

    def test_a_session_counts_from_its_own_beginning_and_one_that_says_none_is_none(self):
        for text in (
            sessions.to_text(sessions.BrowserSession('x', time.time() - 13 * 3600, 'teleoperator')),
            '["x", "teleoperator", ""]',
        ):
            answer = self.ask('/session', Cookie=self.cookie_of(self.access.secret, text=text))
            assert (
                json.loads(answer.body)['signed_in'] is False and 'Set-Cookie' in answer.headers
            ), text

    def test_a_session_that_an_attacker_has_begun_is_not_the_one_that_is_signed_in(self):
        planted, info = self.begin()
        answer = self.ask(
            '/session',
            'POST',
            json.dumps({'token': TOKENS['operator']}),
            Cookie=planted,
            Origin=self.origin,
            X_Xsrf=info['xsrf'],
        )
        assert answer.code == 200
        assert self.begin(Cookie=planted)[1]['signed_in'] is False


class TestPages(console_case.ConsoleCase):
    @tornado.testing.gen_test
    async def test_no_role_gives_a_command_of_a_higher_one(self):
        for role in ROLES:
            page = await self.open_page(*await self.signed(role))
            for name, spec in COMMANDS.items():
                if ROLES.index(spec.role) <= ROLES.index(role):
                    continue
                info = {field: ARGUMENTS.get(field) for field in spec.checks if field in ARGUMENTS}
                if 'frame' in info:
                    info['frame'] = FRAMES[name]
                reply = await self.say(page, 5, do=name, **info)
                words = '{}s may not {} (sign in as {})'.format(
                    role, name.replace('_', ' '), spec.role
                )
                assert (reply['ok'], reply['message']) == (False, words)
        assert self.question_commands.done == [] and self.teleoperation.relayed == []
        assert not self.teleoperation.drivers

    @tornado.testing.gen_test
    async def test_a_viewer_stops_what_another_one_drives(self):
        page = await self.open_page(*await self.signed('teleoperator'))
        await self.say(page, 2, do='take_wheel', question='q')
        viewer = await self.open_page(*await self.signed('viewer'))
        assert (await self.say(viewer, 3, do='stop_hand', question='q'))['ok']
        assert self.teleoperation.stopped == [('stop_hand', 'viewer')]
        assert not self.teleoperation.drivers

    @tornado.testing.gen_test
    async def test_a_stop_waits_for_no_limit_and_no_other_command(self):
        page = await self.open_page(*await self.signed('operator'))
        hanging = threading.Event()
        self.addCleanup(hanging.set)
        self.question_commands.carry_out = lambda *_: hanging.wait(60) and CommandReply(True)
        for number in range(10, 60):  # more than may be at work, and than the rate allows
            await page.write_message(json.dumps({'id': number, 'do': 'claim', 'question': 'q'}))
        assert (await self.say(page, 99, do='stop_hand', question='q'))['ok']
        assert (await self.say(page, 100, do='leave_wheel', question='q'))['ok']
        for command in ('stop_machine', 'pause_machine'):
            assert (await self.say(page, 101, do=command, robot='/r', path=''))['ok']

    @tornado.testing.gen_test
    async def test_a_stop_that_comes_too_fast_is_obeyed_before_the_page_is_closed(self):
        page = await self.open_page(*await self.signed('operator'))
        socket = next(iter(self.pages.open))
        socket._limits = SocketRateLimits(*[RateLimit(0.0, 0.0)] * 3)
        robots = ['/a_robot_with_a_long_name_{:03}'.format(number) for number in range(200)]
        await page.write_message(json.dumps({'id': 9, 'do': 'stop_robots', 'robots': robots}))
        await self.until(lambda: self.machine_hand.done)
        assert self.machine_hand.done == [('stop_robots', 'ann', 'operator')]
        while await page.read_message() is not None:
            pass
        assert page.close_code == page_socket.TOO_FAST

    @tornado.testing.gen_test
    async def test_what_a_page_drives_stops_as_soon_as_the_page_is_closed_for_too_much(self):
        page = await self.open_page(*await self.signed('teleoperator'))
        await self.say(page, 2, do='take_wheel', question='q')
        assert self.teleoperation.drivers
        socket = next(iter(self.pages.open))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(socket, 'close', lambda *_: None)  # its browser does not answer
            socket.end(page_socket.TOO_FAST, 'too many commands')
        assert not self.teleoperation.drivers

    @tornado.testing.gen_test
    async def test_nobody_shuts_the_others_out_by_opening_pages(self):
        first = await self.signed('viewer')
        pages = [await self.connect(first[0]) for _ in range(page_socket.MOST_OF_A_SESSION)]
        assert await self.refused(first[0]) == 503, 'also such as never say hello'
        await self.open_page(*await self.signed('operator'))
        pages[0].close()
        await self.until(lambda: len(self.pages.open) <= page_socket.MOST_OF_A_SESSION)
        await self.open_page(*first)

    @tornado.testing.gen_test
    async def test_many_browsers_together_are_held_to_a_number(self):
        cookies = [(await self.signed('operator'))[0] for _ in range(5)]
        limit = page_socket.MOST_SOCKETS
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(page_socket, 'HELLO_LIMIT_S', 600.0)  # on a busy machine all stay, too
            pages = [await self.connect(cookies[number % 4]) for number in range(limit)]
            assert await self.refused(cookies[4]) == 503
            pages[0].close()
            await self.until(lambda: len(self.pages.open) < limit)
            await self.connect(cookies[4])

    @tornado.testing.gen_test
    async def test_a_page_that_never_says_hello_is_closed(self):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(page_socket, 'HELLO_LIMIT_S', 0.1)
            page = await self.connect((await self.signed('viewer'))[0])
            assert await page.read_message() is None
        assert page.close_code == page_socket.FORGED

    @tornado.testing.gen_test
    async def test_bytes_and_deep_nesting_are_refused(self):
        page = await self.open_page(*await self.signed('operator'))
        await page.write_message(b'\x00\xff' * 100, binary=True)
        await page.write_message('[' * 30000)
        assert not (
            await self.say(
                page,
                6,
                do='answer',
                question='q',
                kind='goto',
                name='x',
                outputs=[{'key': 'a', 'value': json.loads('[' * 40 + ']' * 40)}],
            )
        )['ok']
        assert self.question_commands.done == []
