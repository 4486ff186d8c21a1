"""Idle connections of strangers take neither all files nor anybody's place."""

import asyncio
import contextlib
import json
import socket

import console_case
import tornado.iostream
import tornado.testing

from smach_oracle.expert.console.web import connections
from smach_oracle.expert.console.web.access import network_of
from smach_oracle.expert.console.web.connections import OpenConnections


def test_with_ipv6_a_whole_network_counts_as_one_address():
    assert network_of('2001:db8:1:2:3:4:5:6') == network_of('2001:db8:1:2::9')
    assert network_of('2001:db8:1:2::9') != network_of('2001:db8:1:3::9')
    assert network_of('::ffff:10.0.0.1') == network_of('10.0.0.1') != network_of('10.0.0.2')
    assert network_of('fe80::1%eth0') == network_of('fe80::2')
    assert network_of('') == ''


class Held(contextlib.ExitStack):
    """Real sockets, each with its stream at the server's side."""

    def stream(self):
        ours, theirs = socket.socketpair()
        self.callback(theirs.close)
        stream = tornado.iostream.IOStream(ours)
        self.callback(stream.close)
        return stream


class TestFiles(tornado.testing.AsyncTestCase):
    def test_where_files_run_out_a_stranger_goes_for_each_that_comes(self):
        with Held() as held:
            first, second = held.stream(), held.stream()
            room = OpenConnections(most_files=2 * second.socket.fileno())
            assert room.admit(first, '10.0.0.1'), 'as long as there are files'
            assert room.admit(second, '10.0.0.2') and first.closed()
            assert room.admit(held.stream(), '10.0.0.2') and not second.closed(), 'one is free'
            assert room.admit(held.stream(), '10.0.0.3') and second.closed(), 'the oldest one'


class CrowdCase(console_case.ConsoleCase):
    async def crowd(self, count, address='127.0.0.1'):
        """OpenConnections that ask for nothing."""
        made = []
        for _ in range(count):
            made.append(socket.socket())
            self.addCleanup(made[-1].close)
            made[-1].bind((address, 0))
            made[-1].setblocking(False)
            await asyncio.get_running_loop().sock_connect(
                made[-1], ('127.0.0.1', self.get_http_port())
            )
        return made

    async def asked(self, line, cookie=''):
        """Status of a request on a connection."""
        loop = asyncio.get_running_loop()
        await loop.sock_sendall(
            line,
            'GET /session HTTP/1.1\r\nHost: localhost\r\nCookie: {}\r\n\r\n'.format(
                cookie
            ).encode(),
        )
        return int((await loop.sock_recv(line, 65536)).split()[1])

    async def claims(self, page):
        """Whether it goes on."""
        return (await self.say(page, 2, do='claim', question='q'))['ok']


def open_of(made):
    """How many of some connections the server has not closed."""
    return sum(is_open(line) for line in made)


def is_open(line):
    try:
        return line.recv(1, socket.MSG_PEEK) != b''
    except BlockingIOError:
        return True
    except ConnectionError:
        return False


class TestCrowd(CrowdCase):
    @tornado.testing.gen_test
    async def test_an_address_has_a_few_and_who_has_a_token_keeps_his_own(self):
        page = await self.open_page(*await self.signed('operator'))
        made = await self.crowd(200)
        await self.until(lambda: open_of(made) <= connections.MOST_OF_A_NETWORK)
        assert await self.claims(page), 'the page that was open'
        late = await self.open_page(*await self.signed('operator'))
        assert await self.claims(late), 'one that has come since'

    @tornado.testing.gen_test
    async def test_all_addresses_have_a_number_together_and_a_person_gets_in_among_them(self):
        made = []
        for number in range(100, 140):
            made += await self.crowd(7, '127.0.0.{}'.format(number))
        await self.until(lambda: open_of(made) <= connections.MOST_STRANGERS)
        asking = await self.crowd(6)
        assert [await self.asked(each) for each in asking * 2] == [200] * 12, 'as a browser loads'
        assert await self.claims(await self.open_page(*await self.signed('operator')))

    @tornado.testing.gen_test
    async def test_addresses_with_many_make_room_for_those_with_few(self):
        quiet = await self.crowd(connections.SPARED)
        made = []
        for number in range(100, 110):
            made += await self.crowd(30, '127.0.0.{}'.format(number))
        await self.until(lambda: open_of(made) <= connections.MOST_STRANGERS - len(quiet))
        assert open_of(quiet) == len(quiet)

    @tornado.testing.gen_test
    async def test_one_that_asks_stays_longer_than_those_that_do_not(self):
        (asking,) = await self.crowd(1)
        idle = await self.crowd(connections.MOST_OF_A_NETWORK - 1)
        assert await self.asked(asking) == 200
        await self.crowd(5)
        await self.until(lambda: open_of(idle) == len(idle) - 5)
        assert await self.asked(asking) == 200

    @tornado.testing.gen_test
    async def test_a_browser_has_a_number_too_and_takes_none_from_others(self):
        cookie, _ = await self.signed('viewer')
        codes = [
            await self.asked((await self.crowd(1))[0], cookie)
            for _ in range(connections.MOST_OF_A_SESSION + 2)
        ]
        assert codes == [200] * connections.MOST_OF_A_SESSION + [503] * 2
        assert await self.claims(await self.open_page(*await self.signed('operator')))


class TestWithoutTokens(CrowdCase):
    tokens = False

    @tornado.testing.gen_test
    async def test_idle_connections_close_no_page(self):
        answer = await self.http_client.fetch(self.get_url('/session'))
        page = await self.open_page(
            answer.headers['Set-Cookie'].split(';')[0], json.loads(answer.body)
        )
        made = await self.crowd(100)
        await self.until(lambda: open_of(made) <= connections.MOST_OF_A_NETWORK)
        assert await self.claims(page)
