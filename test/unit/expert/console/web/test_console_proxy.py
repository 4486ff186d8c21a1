"""The console behind reverse proxies: real ones with TLS, raw sockets, and forged headers."""

import json
import shutil
import socket
import ssl
import subprocess
import tempfile
from pathlib import Path

import console_case
import pytest
import tornado.httpclient
import tornado.httputil
import tornado.testing
import tornado.websocket
from console_case import TOKENS
from waiting import wait_in_loop

from smach_oracle.expert.console.web.framing import is_framed_well
from smach_oracle.expert.console.web.proxies import PublicAddress, TrustedProxies
from smach_oracle.expert.console.web.settings import read_settings
from smach_oracle.oracle.errors import SettingsError

CADDY = shutil.which('caddy')
NGINX = shutil.which('nginx') or shutil.which('nginx', path='/usr/sbin')
PUBLIC = PublicAddress.parse('~public_address', 'https://robots.example.org')
# the example of doc/open_console.md, with folders and ports of the test
CONFIGURATION = """
daemon off; pid {folder}/pid; error_log {folder}/error.log; worker_processes 1;
events {{}}
http {{
  access_log off;
  client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy;
  fastcgi_temp_path {folder}/f; uwsgi_temp_path {folder}/u; scgi_temp_path {folder}/s;
  map $http_upgrade $connection_upgrade {{ default upgrade; '' close; }}
  server {{
    listen 127.0.0.1:{port} ssl;
    ssl_certificate {folder}/own.pem; ssl_certificate_key {folder}/own.key;
    location / {{
      proxy_pass http://127.0.0.1:{console};
      proxy_http_version 1.1;
      proxy_set_header Host $http_host;
      proxy_set_header X-Forwarded-For $proxy_add_x_forwarded_for;
      proxy_set_header X-Forwarded-Proto $scheme;
      proxy_set_header Upgrade $http_upgrade;
      proxy_set_header Connection $connection_upgrade;
    }}
  }}
}}
"""
CADDYFILE = """
{{
  admin off
  auto_https disable_redirects
  default_sni robots.example.org
  storage file_system {folder}/caddy
}}
https://robots.example.org:{port} {{
  bind 127.0.0.1
  tls {folder}/own.pem {folder}/own.key
  reverse_proxy 127.0.0.1:{console}
}}
"""
HIDDEN = 'GET /hidden HTTP/1.1\r\nHost: {host}\r\n\r\n'
# a request with a body behind it that hides a second one from who counts otherwise
DOUBTFUL = [
    ('Content-Length: +{n}',),
    ('Content-Length: -{n}',),
    ('Content-Length: {n_}',),
    ('Content-Length: 0x{x}',),
    ('Content-Length: {n}, {n}',),
    ('Content-Length: {n}', 'Content-Length: {n}'),
    ('Content-Length: {n}', 'Content-Length: 0'),
    ('Content-Length : {n}',),
    ('Content-Length\x0b: {n}',),
    ('Content-Length: {n} 0',),
    ('Content-Length:',),
    ('Content-Length: {n}', 'Transfer-Encoding: chunked'),
    ('Transfer-Encoding: chunked',),
    ('Transfer-Encoding: xchunked',),
    ('Transfer-Encoding: chunked, identity',),
    ('Transfer-Encoding:\r\n chunked',),
    ('Transfer-Encoding: \x0bchunked',),
    ('Transfer_Encoding: chunked', 'Transfer-Encoding: identity'),
    ('X: a\rContent-Length: {n}',),
    ('X: a\x00b', 'Content-Length: {n}'),
]
# Tornado drops this white space before anybody can look at it
DROPPED = [('Content-Length: \x0c{n}',), ('Content-Length: {n}\x1f',)]
CHUNKED = '0\r\n\r\n'


def talk(line, text):
    """What comes back until the other end closes, or says nothing more for a while."""
    line.settimeout(1.0)
    line.sendall(text.encode('latin-1'))
    said = b''
    try:
        while True:
            part = line.recv(65536)
            if not part:
                break
            said += part
    except (OSError, ssl.SSLError):
        pass
    return said.decode('latin-1')


def written(host, lines, path='/session'):
    """A request with these lines, and one that is hidden in its body."""
    hidden = HIDDEN.format(host=host)
    n = len(CHUNKED + hidden)
    lines = [line.format(n=n, n_='{}_{}'.format(n // 100, n % 100), x=n) for line in lines]
    return (
        '\r\n'.join(['GET {} HTTP/1.1'.format(path), 'Host: ' + host, *lines, '', '']) + CHUNKED
    ) + hidden


class Counted(console_case.ConsoleCase):
    """A console of which the test knows what it has taken for a request."""

    def setUp(self):
        self.paths = []  # of all requests that the console has taken for one
        super().setUp()
        finder = self._app.find_handler

        def find(request, **more):
            self.paths.append(request.path)
            return finder(request, **more)

        self._app.find_handler = find

    def beside(self, work, *arguments):
        """Run in a thread, while the console works."""
        return self.io_loop.run_sync(
            lambda: self.io_loop.run_in_executor(None, work, *arguments), timeout=60
        )


class Behind(Counted):
    """A console that trusts a proxy on the loopback."""

    public, proxies = PUBLIC, TrustedProxies(['127.0.0.1'])

    def passed_on(self, path='/session', **headers):
        return self.ask(
            path, **dict({'Host': 'robots.example.org', 'X_Forwarded_Proto': 'https'}, **headers)
        )


class TestFraming(Counted):
    def raw(self, text):
        def work():
            with socket.create_connection(('127.0.0.1', self.get_http_port()), 30.0) as line:
                return talk(line, text)

        return self.beside(work)

    def test_a_request_whose_end_is_in_doubt_is_refused_and_nothing_behind_it_is_read(self):
        host = '127.0.0.1:{}'.format(self.get_http_port())
        for lines in DOUBTFUL:
            said = self.raw(written(host, lines))
            assert said.startswith('HTTP/1.1 400') and said.count('HTTP/1.1 ') == 1, (lines, said)
        assert self.paths == []

    def test_a_body_of_a_plain_length_is_read_and_so_is_the_request_behind_it(self):
        host = '127.0.0.1:{}'.format(self.get_http_port())
        hidden = HIDDEN.format(host=host)
        said = self.raw(written(host, ['Content-Length: {n}']) + hidden)
        assert self.paths == ['/session', '/hidden'], 'the one in the body was no request'
        assert said.count('HTTP/1.1 ') == 2


class TestTrust(Behind):
    def test_a_request_through_the_proxy_needs_the_public_address(self):
        assert self.passed_on().code == 200
        assert self.passed_on(Origin='https://robots.example.org').code == 200
        for wrong in (
            {'Host': 'localhost'},
            {'Host': 'evil.example'},
            {'Host': 'robots.example.org:444'},
            {'X_Forwarded_Proto': 'http'},
            {'X_Forwarded_Proto': None},
            {'X_Forwarded_Proto': 'https, http'},
        ):
            assert self.passed_on(**wrong).code == 421, wrong
        for origin in ('http://robots.example.org', 'https://evil.example', self.origin, 'null'):
            assert self.passed_on(Origin=origin).code == 403, origin

    def test_the_cookie_of_a_browser_that_uses_tls_is_secure(self):
        assert 'Secure' in self.passed_on().headers['Set-Cookie']

    def test_limits_are_those_of_the_browser_and_not_of_the_proxy(self):
        seen = []
        self.access.requests = type(
            'Limits', (), {'take': lambda _, key, known=False: seen.append(key) or True}
        )()
        self.passed_on(X_Forwarded_For='10.0.0.1')
        self.passed_on(X_Forwarded_For='6.6.6.6, 10.0.0.2')  # the first one is what it said itself
        self.passed_on(X_Forwarded_For='10.0.0.3, 127.0.0.1')
        self.passed_on(X_Forwarded_For='', X_Real_Ip='6.6.6.6', Forwarded='for=6.6.6.6')
        self.passed_on(X_Forwarded_For='10.0.0.4, junk')
        assert seen == ['10.0.0.1', '10.0.0.2', '10.0.0.3', '127.0.0.1', '127.0.0.1']

    def test_many_idle_connections_of_the_proxy_shut_nobody_out(self):
        lines = [
            socket.create_connection(('127.0.0.1', self.get_http_port()), 30.0) for _ in range(100)
        ]
        try:
            assert self.passed_on().code == 200
            assert self.io_loop.run_sync(
                lambda: wait_in_loop(lambda: len(self.access.connections._known) >= 100)
            )
        finally:
            for line in lines:
                line.close()


class TestUntrusted(Behind):
    proxies = TrustedProxies(['192.0.2.1'])

    def test_nobody_else_is_believed(self):
        seen = []
        self.access.requests = type(
            'Limits', (), {'take': lambda _, key, known=False: seen.append(key) or True}
        )()
        answer = self.passed_on(X_Forwarded_For='10.0.0.1')
        assert answer.code == 200, 'the public address is a name of this console, too'
        assert seen == ['127.0.0.1'] and 'Secure' not in answer.headers['Set-Cookie']
        assert self.passed_on(Origin='https://robots.example.org').code == 403, 'it came by http'


class ThroughProxy(Behind):
    """A real proxy with TLS in front of the console."""

    configuration = ''

    def command(self, path):
        """What starts it with a file."""
        raise NotImplementedError

    def setUp(self):
        super().setUp()
        self.folder = tempfile.mkdtemp(prefix='console-proxy-')
        self.addCleanup(shutil.rmtree, self.folder)
        subprocess.run(
            ['openssl', 'req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-days', '2']
            + ['-subj', '/CN=robots.example.org']
            + ['-addext', 'subjectAltName=DNS:robots.example.org']
            + ['-keyout', self.folder + '/own.key', '-out', self.folder + '/own.pem'],
            check=True,
            stderr=subprocess.PIPE,
        )
        _, self.port = tornado.testing.bind_unused_port()
        _.close()
        file = self.folder + '/configuration'
        Path(file).write_text(
            self.configuration.format(
                folder=self.folder, port=self.port, console=self.get_http_port()
            )
        )
        proxy = subprocess.Popen(self.command(file), stderr=subprocess.DEVNULL)
        self.addCleanup(proxy.wait, 20)
        self.addCleanup(proxy.terminate)
        assert self.io_loop.run_sync(lambda: wait_in_loop(self.listens)), proxy.poll()

    def listens(self):
        try:
            socket.create_connection(('127.0.0.1', self.port), 1.0).close()
            return True
        except ConnectionRefusedError:
            return False

    def open(self):
        context = ssl.create_default_context(cafile=self.folder + '/own.pem')
        line = socket.create_connection(('127.0.0.1', self.port), 30.0)
        return context.wrap_socket(line, server_hostname='robots.example.org')

    def through(self, text):
        def work():
            with self.open() as line:
                return talk(line, text)

        return self.beside(work)

    def asked(self, method='GET', body='', **headers):
        lines = ['{}: {}'.format(name.replace('_', '-'), value) for name, value in headers.items()]
        text = '\r\n'.join(
            [
                '{} /session HTTP/1.1'.format(method),
                'Host: robots.example.org',
                'Connection: close',
                'Content-Length: {}'.format(len(body)),
                *lines,
                '',
                body,
            ]
        )
        head, _, said = self.through(text).partition('\r\n\r\n')
        cookies = [line for line in head.splitlines() if line.startswith('Set-Cookie: ')]
        cookie = cookies[0].split(': ')[1].split(';')[0] if cookies else ''
        return head, cookie, json.loads(said) if head.startswith('HTTP/1.1 200') else said

    def signs_in_and_answers(self):
        head, cookie, info = self.asked()
        assert 'Secure' in head and info['signed_in'] is False
        own = {'Cookie': cookie, 'Origin': PUBLIC.origin, 'X_Xsrf': info['xsrf']}
        token = json.dumps({'token': TOKENS['operator']})
        assert '403' in self.asked('POST', token, **dict(own, Origin=self.origin))[0]
        _, cookie, info = self.asked('POST', token, **own)
        assert info['role'] == 'operator'
        request = tornado.httpclient.HTTPRequest(
            'wss://127.0.0.1:{}/socket'.format(self.port),
            headers={'Host': 'robots.example.org', 'Origin': PUBLIC.origin, 'Cookie': cookie},
            validate_cert=False,
        )

        async def claim():
            page = await tornado.websocket.websocket_connect(request)
            hello = await self.say(page, do='hello', xsrf=info['xsrf'], expert='ann')
            return hello, await self.say(page, 2, do='claim', question='q')

        hello, reply = self.io_loop.run_sync(claim, 30)
        assert hello['ok'] and reply['ok']
        assert self.question_commands.done == [('claim', 'ann', 'operator')]

    def smuggles_nothing(self):
        for lines in DOUBTFUL + DROPPED:
            self.paths.clear()
            said = self.through(written('robots.example.org', lines))
            # a proxy may read a request behind a body, as anybody's. Then it answers it
            answers = said.count('HTTP/1.1 ')
            assert len(self.paths) <= answers, (lines, self.paths, said)

    def mixes_up_nobody(self):
        for lines in DOUBTFUL + DROPPED:
            self.through(written('robots.example.org', lines))
            self.paths.clear()
            head, _, info = self.asked()
            assert head.startswith('HTTP/1.1 200') and info['signed_in'] is False, lines
            assert self.paths == ['/session'], lines


@pytest.mark.skipif(NGINX is None, reason='there is no nginx, whose package starts a server')
class TestNginx(ThroughProxy):
    configuration = CONFIGURATION

    def command(self, path):
        return [NGINX, '-p', self.folder, '-c', path]

    def test_a_person_signs_in_and_answers_through_it(self):
        self.signs_in_and_answers()

    def test_no_request_is_smuggled_through_it(self):
        self.smuggles_nothing()

    def test_two_people_on_one_connection_to_the_console_get_their_own_answers(self):
        self.mixes_up_nobody()


@pytest.mark.skipif(CADDY is None, reason='there is no Caddy')
class TestCaddy(ThroughProxy):
    """It keeps its connections to the console, and sends requests of many people on them."""

    configuration = CADDYFILE

    def command(self, path):
        return [CADDY, 'run', '--adapter', 'caddyfile', '--config', path]

    def test_a_person_signs_in_and_answers_through_it(self):
        self.signs_in_and_answers()

    def test_no_request_is_smuggled_through_it(self):
        self.smuggles_nothing()

    def test_two_people_on_one_connection_to_the_console_get_their_own_answers(self):
        self.mixes_up_nobody()


@pytest.mark.parametrize(
    'text, origin',
    [
        ('https://robots.example.org', 'https://robots.example.org'),
        ('https://Robots.Example.org:443/', 'https://robots.example.org'),
        ('http://robots.example.org:8090', 'http://robots.example.org:8090'),
        ('https://[2001:DB8::1]:8443', 'https://[2001:db8::1]:8443'),
    ],
)
def test_a_public_address_is_an_origin(text, origin):
    public = PublicAddress.parse('~public_address', text)
    assert public.origin == origin and public.is_host(origin.split('://')[1].upper())
    assert public.is_host('{}:{}'.format(public.host, public.port))
    assert not public.is_host('localhost') and not public.is_host('')


@pytest.mark.parametrize(
    'given, says',
    [
        ({'public_address': 'robots.example.org'}, "~public_address: 'robots.example.org'"),
        ({'public_address': 'ftp://robots'}, 'http:// or https://'),
        ({'public_address': 'https://robots/console'}, 'and no path'),
        ({'public_address': 'https://ann:secret@robots'}, '~public_address'),
        ({'public_address': 'https://robots:x'}, '~public_address'),
        ({'trusted_proxy': 'nginx'}, "~trusted_proxy: 'nginx'"),
        ({'trusted_proxy': '127.0.0.1'}, "~public_address: 'none'"),
        (
            {'trusted_proxy': '127.0.0.1', 'public_address': 'https://robots'},
            "~token_file: 'none'",
        ),
        ({'on_call': '/nothing.yaml'}, "~public_address: 'none'"),
    ],
)
def test_settings_that_do_not_fit_are_named(given, says):
    with pytest.raises(SettingsError) as error:
        read_settings(lambda name, default: given.get(name, default))
    assert says in str(error.value)


def test_only_one_plain_length_is_framed_well():
    headers = tornado.httputil.HTTPHeaders({'Content-Length': '5'})
    assert is_framed_well(headers)
    headers['Transfer-Encoding'] = 'chunked'
    assert not is_framed_well(headers)
