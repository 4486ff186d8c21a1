"""How the console's sessions end by themselves, and by another one: what a browser was signed in as
is over then.
"""

import json
import time

import console_case
import pytest
import tornado.testing
from console_case import TOKENS

from smach_oracle.expert.console import page_socket
from smach_oracle.expert.console.web import sessions


class TestAnother(console_case.ConsoleCase):
    @tornado.testing.gen_test
    async def test_signing_in_once_more_ends_what_that_browser_was_signed_in_as(self):
        cookie, info = await self.signed('teleoperator')
        page = await self.open_page(cookie, info)
        answer = await self.http_client.fetch(
            self.get_url('/session'),
            method='POST',
            body=json.dumps({'token': TOKENS['viewer']}),
            headers={'Cookie': cookie, 'Origin': self.origin, 'X-Xsrf': info['xsrf']},
        )
        assert json.loads(answer.body)['role'] == 'viewer'
        assert await page.read_message() is None and page.close_code == page_socket.SIGNED_OUT
        assert await self.refused(cookie) == 401, 'a copy of its cookie is good for nothing'
        assert [record[:3] for record in self.audit.records if record[0].startswith('sign')] == [
            ('sign_in', True, 'teleoperator'),
            ('sign_out', True, 'teleoperator'),
            ('sign_in', True, 'viewer'),
        ]
        await self.open_page(answer.headers['Set-Cookie'].split(';')[0], json.loads(answer.body))

    def test_a_wrong_token_ends_nothing(self):
        cookie, info = self.sign_in('operator')
        assert (
            self.ask(
                '/session',
                'POST',
                json.dumps({'token': 'no such token'}),
                Cookie=cookie,
                Origin=self.origin,
                X_Xsrf=info['xsrf'],
            ).code
            == 401
        )
        assert self.begin(Cookie=cookie)[1]['role'] == 'operator'


class TestAge(console_case.ConsoleCase):
    @tornado.testing.gen_test
    async def test_a_page_is_closed_as_soon_as_its_session_is_too_old(self):
        page = await self.open_page(*await self.signed('operator'))
        (socket,) = self.pages.open
        began_s = time.monotonic()
        socket.session = socket.session._replace(
            began_s=time.time() - 3600.0 * sessions.HOURS + 0.5
        )
        socket._look_at_age()
        assert await page.read_message() is None
        assert page.close_code == page_socket.TOO_OLD and time.monotonic() - began_s > 0.45
        await self.until(lambda: not self.pages.open)
        assert self.question_commands.left, 'what it held is let go'

    @tornado.testing.gen_test
    async def test_its_age_is_looked_at_again_and_again_as_clocks_are_set(self):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(page_socket, 'LONGEST_UNSEEN_S', 0.05)
            cookie, info = await self.signed('operator')
            page = await self.open_page(cookie, info)
            patch.setattr(sessions, 'HOURS', 0)
            assert await page.read_message() is None
            assert page.close_code == page_socket.TOO_OLD
            assert await self.refused(cookie) == 401
        await self.open_page(*await self.signed('operator'))

    @tornado.testing.gen_test
    async def test_a_page_that_says_hello_too_late_gets_nothing(self):
        cookie, info = await self.signed('operator')
        page = await self.connect(cookie)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sessions, 'HOURS', 0)
            reply = await self.say(page, do='hello', xsrf=info['xsrf'], expert='ann')
        assert reply is None or not reply['ok']
        assert not self.pages.sockets


class TestWithoutTokens(console_case.ConsoleCase):
    tokens = False

    @tornado.testing.gen_test
    async def test_a_page_stays_open_however_old_it_is(self):
        answer = await self.http_client.fetch(self.get_url('/session'))
        cookie = answer.headers['Set-Cookie'].split(';')[0]
        page = await self.open_page(cookie, json.loads(answer.body))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sessions, 'HOURS', 0)
            (socket,) = self.pages.open
            check_age, again = socket._look_at_age, []
            patch.setattr(socket, '_look_at_age', lambda: again.append(True))
            check_age()
            assert (await self.say(page, 9, do='watch', trial=''))['ok'], (
                'a hand that it drives goes on'
            )
            assert not again
            assert await self.refused(cookie) == 401, 'a request gets a new session'


def test_a_session_survives_its_cookie_and_nothing_else_becomes_one():
    session = sessions.new_session()
    assert sessions.from_text(sessions.to_text(session).encode()) == session
    assert sessions.from_text(b'["a",1.0,"operator",""]') == sessions.BrowserSession(
        'a', 1.0, 'operator'
    )
    for text in (
        None,
        b'',
        b'{',
        b'[]',
        b'[1,2,3,4]',
        b'["a",1.0,"root",""]',
        b'{"id": 1}',
        b'["a",1.0,"operator"]',
        b'["a","operator",""]',
        b'["a","1.0","operator",""]',
        b'["a",true,"operator",""]',
        b'["a",null,"operator",""]',
        b'["a",NaN,"operator",""]',
        b'["a",Infinity,"operator",""]',
        b'["a",1e999,"operator",""]',
        b'[["a"],1.0,"operator",""]',
        b'["a",1.0,["operator"],""]',
    ):
        assert sessions.from_text(text) is None, text
    assert sessions.xsrf_token(session, 'a') != sessions.xsrf_token(session, 'b')
    assert session.id not in session.short
