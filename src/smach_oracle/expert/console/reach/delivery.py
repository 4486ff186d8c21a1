"""Sends one message to one receiver, within a limited time. An error shows nothing that is secret.

The texts of receivers' answers are not shown either: one may repeat a password or a URL.
"""

import errno
import smtplib
import socket
import ssl
import threading
from typing import Dict, Sequence

import tornado.httpclient
import tornado.simple_httpclient

from .calls_text import CalledQuestion, mail_of, webhook_body
from .on_call import MailServer, OnCallList, Receiver

LIMIT_S = 20.0  # for the whole of a delivery
STEP_LIMIT_S = 10.0  # to connect, and for each word of a mail server
MOST_ANSWER = 65536  # bytes of an answer
_AGAIN = (408, 425, 429)  # HTTP: later it may be taken
# which one is raised depends on when the receiver closes
_CLOSED = (
    tornado.simple_httpclient.HTTPStreamClosedError,
    BrokenPipeError,
    ConnectionAbortedError,
    ConnectionResetError,
    ssl.SSLEOFError,
    ssl.SSLZeroReturnError,
)


class NotDelivered(Exception):
    """A receiver has not taken a message. The text says why. `final`: it never will."""

    def __init__(self, why: str, final: bool = False) -> None:
        super().__init__(why)
        self.final = final


def deliver(receiver: Receiver, questions: Sequence[CalledQuestion], on_call: OnCallList) -> None:
    """Send a message about these questions. It takes no longer than LIMIT_S or so.

    :raises NotDelivered: whatever goes wrong.
    """
    refusal = None
    try:
        if receiver.kind == 'mail':
            _send_mail(receiver, questions, on_call)
        else:
            _post(receiver, questions, on_call.ca_file)
    except Exception as err:  # of foreign servers: its own text may show a secret
        refusal = _refusal(err)
    if refusal is not None:  # raised here, so that no traceback has the other error
        raise refusal


def _refusal(err: Exception) -> NotDelivered:
    if isinstance(err, NotDelivered):
        return err
    if isinstance(err, smtplib.SMTPException):
        return _refusal_of_mail(err)
    if isinstance(err, tornado.simple_httpclient.HTTPTimeoutError):
        return NotDelivered('it does not answer in time')
    if isinstance(err, _CLOSED):
        return NotDelivered('it closed the connection')
    if isinstance(err, tornado.httpclient.HTTPClientError):
        final = 300 <= err.code < 500 and err.code not in _AGAIN
        return NotDelivered('it answered with status {}'.format(err.code), final)
    if isinstance(err, ssl.SSLCertVerificationError):
        return NotDelivered('its certificate is not trusted')
    if isinstance(err, (socket.timeout, TimeoutError)):
        return NotDelivered('it does not answer in time')
    if isinstance(err, socket.gaierror):
        return NotDelivered('its name is not found')
    if isinstance(err, ConnectionRefusedError):
        return NotDelivered('it refuses the connection')
    if isinstance(err, OSError) and err.errno and not isinstance(err, ssl.SSLError):
        name = errno.errorcode.get(err.errno, err.errno)
        return NotDelivered('the connection failed ({})'.format(name))
    return NotDelivered('it cannot be talked to ({})'.format(type(err).__name__))


def _refusal_of_mail(err: smtplib.SMTPException) -> NotDelivered:
    if isinstance(err, smtplib.SMTPServerDisconnected):
        return NotDelivered('it closed the connection, or was too slow')
    if isinstance(err, smtplib.SMTPAuthenticationError):
        return NotDelivered('it refused the password ({})'.format(err.smtp_code), True)
    if isinstance(err, smtplib.SMTPNotSupportedError):
        return NotDelivered('it has no STARTTLS, or no log-in', True)
    codes = []
    if isinstance(err, smtplib.SMTPRecipientsRefused):
        codes = [code for code, _ in err.recipients.values()]
    elif isinstance(err, smtplib.SMTPResponseException):
        codes = [err.smtp_code]
    if not codes:
        return NotDelivered('it cannot be talked to ({})'.format(type(err).__name__))
    return NotDelivered('it answered with code {}'.format(codes[0]), codes[0] >= 500)


def _post(receiver: Receiver, questions: Sequence[CalledQuestion], ca_file: str) -> None:
    headers: Dict[str, str] = {'Content-Type': 'application/json'}
    if receiver.authorization is not None:
        headers['Authorization'] = receiver.authorization.value
    client = tornado.httpclient.HTTPClient(
        tornado.simple_httpclient.SimpleAsyncHTTPClient,
        max_buffer_size=2 * MOST_ANSWER,
        max_body_size=MOST_ANSWER,
    )
    try:
        client.fetch(
            tornado.httpclient.HTTPRequest(
                receiver.address.value,
                method='POST',
                headers=headers,
                body=webhook_body(receiver.kind, questions),
                connect_timeout=STEP_LIMIT_S,
                request_timeout=LIMIT_S,
                follow_redirects=False,  # the receiver is the one of the file, and no other
                decompress_response=False,
                ca_certs=ca_file or None,
                user_agent='smach_oracle',
            )
        )
    finally:
        client.close()


def _send_mail(
    receiver: Receiver, questions: Sequence[CalledQuestion], on_call: OnCallList
) -> None:
    server = on_call.mail
    if server is None:
        raise NotDelivered('no mail server is named', True)
    mail = mail_of(questions, server.sender, receiver.address.value)
    client = _client(server, on_call.ca_file)
    # a server that sends a little now and then would hold the thread forever
    guard = threading.Timer(LIMIT_S, _hang_up, [client])
    guard.daemon = True
    guard.start()
    try:
        client.connect(server.host, server.port)
        if server.security == 'starttls':
            client.starttls(context=ssl.create_default_context(cafile=on_call.ca_file or None))
        if server.user:
            client.login(server.user, server.password.value)
        client.send_message(mail)
        _take_leave(client)
    finally:
        guard.cancel()
        client.close()


def _client(server: MailServer, ca_file: str) -> smtplib.SMTP:
    if server.security == 'tls':
        context = ssl.create_default_context(cafile=ca_file or None)
        client: smtplib.SMTP = smtplib.SMTP_SSL(timeout=STEP_LIMIT_S, context=context)
    else:
        client = smtplib.SMTP(timeout=STEP_LIMIT_S)
    # smtplib checks a certificate against the name that it was made with
    setattr(client, '_host', server.host)
    return client


def _take_leave(client: smtplib.SMTP) -> None:
    """The mail is taken. Whatever happens now, it is not sent once more."""
    try:
        client.quit()
    except (smtplib.SMTPException, OSError):
        return


def _hang_up(client: smtplib.SMTP) -> None:
    sock = client.sock
    if sock is not None:
        try:
            sock.shutdown(socket.SHUT_RDWR)
        except OSError:  # it has gone by itself
            return
