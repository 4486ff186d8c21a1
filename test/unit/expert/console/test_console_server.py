"""The console's web server attacked over real connections: hosts, origins, cookies, forged
requests, roles, floods.
"""

import json
import time

import console_case
import tornado.testing
from console_case import TOKENS

from smach_oracle.expert.console import page_socket, server
from smach_oracle.expert.console.web import handlers, sessions
from smach_oracle.expert.console.web.access import ClientRateLimits


class TestRequests(console_case.ConsoleCase):
    def test_every_answer_keeps_the_page_to_itself(self):
        for path, host in (
            ('/', None),
            ('/session', None),
            ('/nothing', None),
            ('/static/js/main.js', None),
            ('/static/nothing.js', None),
            ('/', 'evil.example'),
            ('/socket', None),
        ):
            answer = self.ask(path, Host=host)
            for name in handlers.HEADERS:
                assert answer.headers.get(name), (path, name, answer.code)
            assert 'Server' not in answer.headers
            assert 'Access-Control-Allow-Origin' not in answer.headers

    def test_another_host_name_is_refused_everywhere(self):
        for path in ('/', '/session', '/static/css/page.css', '/socket', '/nothing'):
            for host in ('evil.example', '10.1.2.3', 'localhost.evil.example'):
                assert self.ask(path, Host=host).code == 421

    def test_a_page_elsewhere_is_refused(self):
        for origin in ('http://evil.example', 'null', 'https://127.0.0.1', 'http://127.0.0.1:1'):
            assert self.ask('/session', Origin=origin).code == 403

    def test_no_file_outside_of_the_page_is_served(self):
        for path in (
            '/static/../server.py',
            '/static/%2e%2e/server.py',
            '/static/..%2fserver.py',
            '/../server.py',
            '/static//etc/passwd',
            '/static/%2fetc%2fpasswd',
            '/server.py',
            '/static/js/..%5c..%5cserver.py',
        ):
            assert self.ask(path).code in (403, 404), path

    def test_an_error_repeats_nothing_of_the_request(self):
        answer = self.ask('/<script>alert(1)</script>?x=<b>')
        assert answer.code == 404 and b'script' not in answer.body and b'<b>' not in answer.body

    def test_other_methods_do_nothing(self):
        for method in ('PUT', 'PATCH', 'OPTIONS', 'TRACE'):
            assert self.ask('/session', method, Origin=self.origin).code in (405, 400), method

    def test_a_flood_of_requests_is_cut_off(self):
        self.access.requests = ClientRateLimits(rate=0.0, burst=3.0, for_all=5.0)
        assert [self.ask('/session').code for _ in range(4)] == [200, 200, 200, 429]

    def test_as_many_pages_as_one_browser_may_have_can_be_loaded_at_once(self):
        files = 1 + sum(path.is_file() for path in server.STATIC.rglob('*'))
        assert self.access.files.take('10.0.0.1'), 'the first of them'
        wanted = page_socket.MOST_OF_A_SESSION * files - 1
        assert sum(self.access.files.take('10.0.0.1') for _ in range(wanted)) == wanted
        self.access.requests = ClientRateLimits(rate=0.0, burst=0.0, for_all=5.0)
        assert [self.ask(path).code for path in ('/', '/static/css/page.css', '/session')] == [
            200,
            200,
            429,
        ]


class TestSignIn(console_case.ConsoleCase):
    def test_the_cookie_is_for_this_page_s_requests_alone(self):
        cookie = self.ask('/session').headers['Set-Cookie']
        assert all(part in cookie for part in ('HttpOnly', 'SameSite=Strict', 'Path=/'))
        assert 'Domain' not in cookie

    def test_a_token_is_exchanged_for_a_new_session(self):
        before, info = self.begin()
        assert info['signed_in'] is False and info['role'] == ''
        cookie, info = self.sign_in('operator')
        assert (info['signed_in'], info['role']) == (True, 'operator') and cookie != before
        assert TOKENS['operator'] not in cookie
        assert ('sign_in', True, 'operator', '', None) in self.audit.records

    def test_a_forged_request_is_refused(self):
        cookie, info = self.begin()
        other, other_said = self.begin()
        body = json.dumps({'token': TOKENS['operator']})
        for headers in (
            {},
            {'X_Xsrf': ''},
            {'X_Xsrf': 'wrong'},
            {'X_Xsrf': other_said['xsrf']},
            {'X_Xsrf': info['xsrf'], 'Origin': None},
            {'X_Xsrf': info['xsrf'], 'Origin': 'http://evil.example'},
            {'X_Xsrf': info['xsrf'], 'Cookie': None},
        ):
            given = dict({'Cookie': cookie, 'Origin': self.origin}, **headers)
            assert self.ask('/session', 'POST', body, **given).code == 403, headers
        assert self.ask('/session', 'DELETE', Cookie=cookie, Origin=self.origin).code == 403

    def test_guessing_is_slowed_down_and_audited(self):
        cookie, info = self.begin()
        codes = [
            self.ask(
                '/session',
                'POST',
                json.dumps({'token': 'guess'}),
                Cookie=cookie,
                Origin=self.origin,
                X_Xsrf=info['xsrf'],
            ).code
            for _ in range(7)
        ]
        assert codes == [401] * 5 + [429] * 2
        assert (
            self.ask(
                '/session',
                'POST',
                json.dumps({'token': TOKENS['operator']}),
                Cookie=cookie,
                Origin=self.origin,
                X_Xsrf=info['xsrf'],
            ).code
            == 200
        ), 'the right one is let in'
        assert [record[:2] for record in self.audit.records] == [('sign_in', False)] * 7 + [
            ('sign_in', True)
        ]
        assert 'guess' not in str(self.audit.records)

    def test_what_is_no_token_is_refused(self):
        cookie, info = self.begin()
        for body in ('', '{', '[]', '{"token": 1}', '{"token": null}'):
            answer = self.ask(
                '/session', 'POST', body, Cookie=cookie, Origin=self.origin, X_Xsrf=info['xsrf']
            )
            assert answer.code in (400, 429)
        assert not any(record[1] for record in self.audit.records)

    def test_a_forged_cookie_is_none(self):
        name, value = self.sign_in('viewer')[0].split('=', 1)
        parts = value.strip('"').split('|')
        for forged in (
            value[:-3] + 'aaa',
            '["x","operator",""]',
            '|'.join(parts[:-1] + ['0' * 64]),
            '',
        ):
            assert self.begin(Cookie='{}={}'.format(name, forged))[1]['signed_in'] is False

    def test_signing_out_ends_it(self):
        cookie, info = self.sign_in('viewer')
        answer = self.ask(
            '/session', 'DELETE', Cookie=cookie, Origin=self.origin, X_Xsrf=info['xsrf']
        )
        assert json.loads(answer.body)['signed_in'] is False
        assert ('sign_out', True, 'viewer', '', None) in self.audit.records
        assert self.begin(Cookie=cookie)[1]['signed_in'] is False, (
            'a copy of its cookie is good for nothing'
        )

    def test_who_has_not_signed_in_cannot_flood_what_is_known_of_ended_sessions(self):
        ended, info = self.sign_in('viewer')
        self.ask('/session', 'DELETE', Cookie=ended, Origin=self.origin, X_Xsrf=info['xsrf'])
        shown, known = len(self.audit.records), len(self.access._ended)
        for _ in range(3):
            cookie, info = self.begin()
            assert (
                self.ask(
                    '/session', 'DELETE', Cookie=cookie, Origin=self.origin, X_Xsrf=info['xsrf']
                ).code
                == 200
            )
        assert (len(self.audit.records), len(self.access._ended)) == (shown, known)

    def test_sessions_whose_cookie_is_too_old_anyway_are_forgotten(self):
        self.access._ended['long ago'] = time.monotonic() - 3600.0 * sessions.HOURS - 1.0
        self.access.end(sessions.BrowserSession('now', time.time(), 'viewer'))
        assert list(self.access._ended) == ['now']

    @tornado.testing.gen_test
    async def test_a_page_whose_session_ends_while_it_connects_gets_nothing(self):
        cookie, info = await self.signed('operator')
        page = await self.connect(cookie)
        # as between its handshake and its list of open pages
        self.access.end(next(iter(self.pages.open)).session)
        reply = await self.say(page, do='hello', xsrf=info['xsrf'], expert='ann')
        assert reply is None or not reply['ok']
        assert not self.pages.sockets

    @tornado.testing.gen_test
    async def test_a_page_that_takes_its_time_to_go_commands_nothing_any_more(self):
        page = await self.open_page(*await self.signed('operator'))
        assert (await self.say(page, 9, do='claim', question='/robot q'))['ok']
        self.pages.close(next(iter(self.pages.open)).session)
        for number in range(3):  # before it has heard that it should go
            page.write_message(json.dumps({'id': number, 'do': 'claim', 'question': '/robot q'}))
        await self.until(lambda: not self.pages.open)
        assert len(self.question_commands.done) == 1

    @tornado.testing.gen_test
    async def test_signing_out_closes_the_pages_of_that_browser_alone(self):
        cookie, info = await self.signed('operator')
        pages = [await self.open_page(cookie, info) for _ in range(2)]
        other = await self.open_page(*await self.signed('operator'))
        await self.http_client.fetch(
            self.get_url('/session'),
            method='DELETE',
            headers={'Cookie': cookie, 'Origin': self.origin, 'X-Xsrf': info['xsrf']},
        )
        for page in pages:
            while await page.read_message() is not None:
                pass
            assert page.close_code == page_socket.SIGNED_OUT
        assert await self.refused(cookie) == 401
        assert (await self.say(other, 9, do='watch', trial=''))['ok']


class TestSocket(console_case.ConsoleCase):
    @tornado.testing.gen_test
    async def test_a_socket_needs_a_session_its_own_origin_and_host(self):
        cookie, _ = await self.signed('operator')
        assert await self.refused('') == 401
        for headers in ({'Origin': 'http://evil.example'}, {'Origin': 'null'}, {'Origin': None}):
            assert await self.refused(cookie, **headers) == 403
        assert await self.refused(cookie, Host='evil.example', Origin='http://evil.example') == 421

    @tornado.testing.gen_test
    async def test_nothing_is_told_or_done_before_a_hello_that_is_not_forged(self):
        cookie, info = await self.signed('operator')
        self.sections.put('questions', ['secret'])
        socket = await self.connect(cookie)
        self.pages.push()
        reply = await self.say(socket, do='claim', question='q')
        assert not reply['ok'] and self.question_commands.done == []
        assert await self.say(socket, do='hello', xsrf='0' * 64, expert='ann') is None
        assert socket.close_code == 4003
        assert self.question_commands.done == []

    @tornado.testing.gen_test
    async def test_a_viewer_sees_and_does_nothing(self):
        self.sections.put('questions', [])
        socket = await self.open_page(*await self.signed('viewer'))
        self.pages.push()
        assert json.loads(await socket.read_message())['sections'] == {'questions': []}
        for command in ('claim', 'take_over', 'release'):
            assert not (await self.say(socket, do=command, question='q'))['ok']
        assert not (await self.say(socket, do='answer', question='q', kind='goto', name='x'))['ok']
        assert self.question_commands.done == []
        assert [record[:3] for record in self.audit.records if record[0] == 'answer'] == [
            ('answer', False, 'viewer')
        ]

    @tornado.testing.gen_test
    async def test_an_operator_s_commands_are_carried_out_under_the_name_given(self):
        socket = await self.open_page(*await self.signed('operator'))
        reply = await self.say(socket, do='claim', question='q')
        assert (reply['ok'], reply['message'], self.question_commands.done) == (
            True,
            'done',
            [('claim', 'ann', 'operator')],
        )
        socket.close()
        await self.until(lambda: self.question_commands.left)

    @tornado.testing.gen_test
    async def test_a_message_that_is_no_command_is_refused_and_audited(self):
        socket = await self.open_page(*await self.signed('operator'))
        assert not (await self.say(socket, do='publish', topic='/cmd_vel'))['ok']
        assert ('unknown', False) in [record[:2] for record in self.audit.records]

    @tornado.testing.gen_test
    async def test_a_flood_of_commands_is_dropped_and_then_cut_off(self):
        socket = await self.open_page(*await self.signed('operator'))
        for _ in range(100):
            await socket.write_message('{"id": 2, "do": "claim", "question": "q"}')
        while await socket.read_message() is not None:
            pass
        assert socket.close_code == 4008 and len(self.question_commands.done) < 50

    @tornado.testing.gen_test
    async def test_an_oversized_message_ends_the_connection(self):
        socket = await self.open_page(*await self.signed('operator'))
        await socket.write_message('x' * 70000)
        assert await socket.read_message() is None

    @tornado.testing.gen_test
    async def test_a_slow_page_gets_the_newest_version_and_no_queue(self):
        socket = await self.open_page(*await self.signed('viewer'))
        (page,) = self.pages.sockets
        page._writing = True
        for number in range(100):
            self.sections.put('robots', [number])
            self.pages.push()
        page._writing = False
        self.pages.push()
        self.pages.push()
        first = json.loads(await socket.read_message())
        assert first['sections'] == {'robots': [99]} and first['all'], (
            'what else a page knows from before is gone'
        )
        self.sections.put('robots', None)
        await self.until(lambda: not page._writing)
        self.pages.push()
        second = json.loads(await socket.read_message())
        assert second['sections'] == {'robots': None} and 'all' not in second


class TestWithoutTokens(console_case.ConsoleCase):
    tokens = False

    def test_on_loopback_whoever_gets_there_is_at_home_but_not_a_page_elsewhere(self):
        _, info = self.begin()
        assert (info['signed_in'], info['role'], info['tokens']) == (True, 'teleoperator', False)
        assert self.ask('/session', Origin='http://evil.example').code == 403


class TestPeople(console_case.ConsoleCase):
    """Without tokens, where anybody may choose a name."""

    tokens = False

    async def nameless(self, expert=''):
        answer = await self.http_client.fetch(self.get_url('/session'))
        socket = await self.connect(answer.headers['Set-Cookie'].split(';')[0])
        self.xsrf = json.loads(answer.body)['xsrf']
        return socket, await self.say(socket, do='hello', xsrf=self.xsrf, expert=expert)

    @tornado.testing.gen_test
    async def test_who_has_said_no_name_looks_and_stops_and_does_nothing_else(self):
        socket, hello = await self.nameless()
        assert (hello['ok'], hello['message']) == (True, '')
        for command in (
            {'do': 'claim'},
            {'do': 'take_over'},
            {'do': 'take_wheel'},
            {'do': 'answer', 'kind': 'goto', 'name': 'x'},
        ):
            refused = await self.say(socket, 5, question='q', **command)
            assert (refused['ok'], refused['message']) == (False, page_socket.NAME_FIRST)
        assert self.question_commands.done == []
        for command in ('view', 'stop_hand', 'leave_wheel'):
            assert (await self.say(socket, 6, do=command, question='q'))['ok']
        for command, ok in (
            ('stop_machine', True),
            ('pause_machine', True),
            ('resume_machine', False),
        ):
            assert (await self.say(socket, 7, do=command, robot='/r', path=''))['ok'] is ok
        assert [name for name, *_ in self.machine_hand.done] == ['stop_machine', 'pause_machine']

    @tornado.testing.gen_test
    async def test_a_page_tells_all_others_which_question_it_shows(self):
        socket, hello = await self.nameless('ann')
        other, _ = await self.nameless()
        for page in (socket, other):
            await self.say(page, 7, do='view', question='q')
        assert [each['name'] for each in self.sections.get('onlookers')['q']] == ['ann', '']
        assert self.sections.get('onlookers')['q'][0]['session'] == hello['data']['browser']
        await self.say(other, 8, do='hello', xsrf=self.xsrf, expert='bob')
        assert [each['name'] for each in self.sections.get('onlookers')['q']] == ['ann', 'bob']
        await self.say(other, 9, do='view', question='')
        assert [each['name'] for each in self.sections.get('onlookers')['q']] == ['ann']
        socket.close()
        await self.until(lambda: self.sections.get('onlookers') == {})
