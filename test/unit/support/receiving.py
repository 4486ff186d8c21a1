"""Real servers on the loopback that receive what the console sends, and some that misbehave."""

import http.server
import json
import socket
import ssl
import subprocess
import threading

from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult

PASSWORD = 'hunter2-is-what-nobody-may-see'


def make_certificate(folder, name='own'):
    """A key and a certificate of localhost. It returns the certificate's path."""
    path = '{}/{}'.format(folder, name)
    subprocess.run(
        ['openssl', 'req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-days', '2']
        + ['-subj', '/CN=localhost', '-addext', 'subjectAltName=DNS:localhost']
        + ['-keyout', path + '.key', '-out', path + '.pem'],
        check=True,
        stderr=subprocess.PIPE,
    )
    return path + '.pem'


def server_context(certificate):
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certificate, certificate.replace('.pem', '.key'))
    return context


class WebhookServer:
    """Takes posts. `statuses` are its answers, in turn; the last one stays."""

    def __init__(self, statuses=(200,), certificate='', answer=b'ok', headers=()):
        self.taken = []  # pairs of path and JSON
        self.headers = []
        self.statuses = list(statuses)
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers['Content-Length']))
                outer.taken.append((self.path, json.loads(body.decode())))
                outer.headers.append(dict(self.headers))
                more = outer.statuses[1:]
                status = outer.statuses.pop(0) if more else outer.statuses[0]
                self.send_response(status)
                for name, value in headers:
                    self.send_header(name, value)
                self.send_header('Content-Length', str(len(answer)))
                self.end_headers()
                self.wfile.write(answer)

            def log_message(self, *arguments):
                """It is silent."""

        self._server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Handler)
        if certificate:
            self._server.socket = server_context(certificate).wrap_socket(
                self._server.socket, server_side=True
            )
        self.port = self._server.server_address[1]
        self.url = '{}://localhost:{}/{}'.format(
            'https' if certificate else 'http', self.port, PASSWORD
        )
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def stop(self):
        self._server.shutdown()
        self._server.server_close()


class MailServer(Controller):
    """A real SMTP server. `refuses`: what it says to a recipient, in place of taking mails."""

    def __init__(self, refuses='', **more):
        self.taken = []
        self.logged_in = []
        self._refuses = refuses
        super().__init__(self, hostname='127.0.0.1', port=0, **more)

    @property
    def bound_port(self):
        return self.server.sockets[0].getsockname()[1]

    def _trigger_server(self):
        """Its base connects to the port that it was given, which is 0."""
        socket.create_connection(('127.0.0.1', self.bound_port), 5.0).close()

    async def handle_RCPT(self, server, session, envelope, address, options):
        if self._refuses:
            return self._refuses
        envelope.rcpt_tos.append(address)
        return '250 OK'

    async def handle_DATA(self, server, session, envelope):
        self.taken.append(envelope)
        return '250 OK'

    def authenticate(self, server, session, envelope, mechanism, data):
        password = data.password.decode()
        self.logged_in.append(data.login.decode())
        return AuthResult(success=password == PASSWORD, handled=False)


class RudeServer:
    """Accepts connections and treats them as `manner` does, in a thread each."""

    def __init__(self, manner):
        self._listener = socket.create_server(('127.0.0.1', 0))
        self.port = self._listener.getsockname()[1]
        self.lines = []
        self.over = threading.Event()
        threading.Thread(target=self._accept, args=[manner], daemon=True).start()

    def _accept(self, manner):
        while not self.over.is_set():
            try:
                line, _ = self._listener.accept()
            except OSError:
                return
            self.lines.append(line)
            threading.Thread(target=self._treat, args=[manner, line], daemon=True).start()

    def _treat(self, manner, line):
        try:
            manner(self, line)
        except OSError:
            return

    def stop(self):
        self.over.set()
        self._listener.close()
        for line in self.lines:
            line.close()


def hangs(server, line):
    """It says nothing, forever."""
    server.over.wait()


def dribbles(server, line):
    """A sign now and then, and never an end."""
    while not server.over.wait(0.1):
        line.sendall(b'2')


def hangs_up(server, line):
    line.close()


def floods(server, line):
    """An answer without an end, at full speed."""
    line.sendall(b'HTTP/1.1 200 OK\r\nContent-Length: 10000000000\r\n\r\n')
    while not server.over.is_set():
        line.sendall(b'x' * 65536)
