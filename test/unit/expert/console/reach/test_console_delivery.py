"""Messages sent to real HTTP and SMTP servers, and to those that fail, hang and refuse."""

import base64
import email
import email.policy
import errno
import logging
import math
import socket
import ssl
import time

import pytest
import receiving
import rospy
from expert_fixtures import make_question
from receiving import PASSWORD

from smach_oracle.expert.console.reach import delivery
from smach_oracle.expert.console.reach.calls_text import called_question
from smach_oracle.expert.console.reach.delivery import NotDelivered, deliver
from smach_oracle.expert.console.reach.on_call import MailServer, OnCallList, Receiver
from smach_oracle.expert.console.reach.secret_file import Secret
from smach_oracle.expert.console.sensors.images import BrowserFile
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.msg import OpenQuery
from smach_oracle.ros.expert.question_messages import to_goal

PICTURE = BrowserFile('image/jpeg', b'\xff\xd8 a picture', {})
ORIGIN = 'https://robots.example.org'
HOSTILE = 'x\r\nBcc: all@example.org <!channel> @channel [y](https://evil.example) *z* \u202e<b>'


def question(picture=PICTURE, deadline_s=math.inf, query_id='q1', **changes):
    goal = to_goal(make_question(query_id, **changes), '/robot', rospy.Time(1))
    listed = ListedQuestion('/robot/query', goal, OpenQuery.PENDING, '', 10.0, deadline_s)
    return called_question(listed, ORIGIN, picture)


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp('certificates')
    receiving.make_certificate(str(made))
    receiving.make_certificate(str(made), 'other')
    return made


def post(url, form='json', ca_file='', authorization=None, questions=()):
    receiver = Receiver('bob', form, Secret(url), authorization)
    deliver(receiver, questions or [question()], OnCallList({}, (), ca_file=ca_file))


def mail(port, security='none', ca_file='', password=None, host='localhost', questions=()):
    user = '' if password is None else 'robots'
    server = MailServer(host, port, security, 'robots@example.org', user, Secret(password or ''))
    receiver = Receiver('ann', 'mail', Secret('ann@example.org'))
    deliver(receiver, questions or [question()], OnCallList({}, (), server, ca_file=ca_file))


def refusal(send, *arguments, **more):
    """What it says, and whether it will never succeed."""
    with pytest.raises(NotDelivered) as error:
        send(*arguments, **more)
    assert PASSWORD not in str(error.value)
    assert error.value.__context__ is None, 'no traceback shows what the server said'
    return str(error.value), error.value.final


def test_json_has_sentence_link_and_picture(serve):
    server = serve(receiving.WebhookServer())
    post(server.url, authorization=Secret('Bearer x'))
    ((path, body),) = server.taken
    (told,) = body['questions']
    assert path == '/' + PASSWORD and server.headers[0]['Authorization'] == 'Bearer x'
    assert told['sentence'] == (
        '/robot: PICK (in PICK_AND_PLACE) ended with aborted, which would end PICK_AND_PLACE: no '
        'grasp found.'
    )
    assert told['link'] == ORIGIN + '/#questions//robot/query+q1'
    assert base64.b64decode(told['picture']['base64']) == PICTURE.body
    assert (told['robot'], told['state']) == ('/robot', 'PICK')
    assert body['text'] == '/robot asks about PICK'


def test_slack_and_mattermost_get_a_text_that_mentions_nobody(serve):
    server = serve(receiving.WebhookServer())
    for form in ('slack', 'mattermost'):
        post(server.url, form, questions=[question(text=HOSTILE), question(query_id='q2')])
    slack, mattermost = (body for _, body in server.taken)
    assert set(slack) == set(mattermost) == {'text'}
    assert '<' + ORIGIN + '/#questions//robot/query+q1|Open the question>' in slack['text']
    assert '&lt;!channel&gt;' in slack['text'] and '<!' not in slack['text']
    assert slack['text'].count('\n') == 1, 'a line each'
    assert '](' + ORIGIN + '/#questions//robot/query+q2)' in mattermost['text']
    assert '@channel' not in mattermost['text'] and 'https://evil' not in mattermost['text']
    assert '\\*z\\*' in mattermost['text'] and '\u202e' not in mattermost['text']


def test_a_deadline_and_what_comes_then_are_told():
    until = time.strftime('%H:%M', time.localtime(time.time() + 90.0))
    told = question(deadline_s=time.monotonic() + 90.0).sentence
    assert ' It waits until ' + until in told
    assert told.endswith('then: PICK_AND_PLACE ends with aborted.')


@pytest.mark.parametrize('left_s', [math.inf, 1e300, 1e9])
def test_a_deadline_that_is_far_off_is_not_told(left_s):
    assert 'It waits until' not in question(deadline_s=time.monotonic() + left_s).sentence


def test_a_webhook_with_tls_is_checked(serve, folder):
    server = serve(receiving.WebhookServer(certificate=str(folder / 'own.pem')))
    post(server.url, ca_file=str(folder / 'own.pem'))
    assert len(server.taken) == 1
    said, _ = refusal(post, server.url, ca_file=str(folder / 'other.pem'))
    assert said == 'its certificate is not trusted'
    said, _ = refusal(post, server.url)
    assert said == 'its certificate is not trusted'
    assert len(server.taken) == 1


@pytest.mark.parametrize(
    'status, final', [(400, True), (404, True), (408, False), (429, False), (500, False)]
)
def test_a_webhook_that_refuses_is_told_by_its_status_alone(serve, status, final):
    server = serve(receiving.WebhookServer([status], answer=PASSWORD.encode()))
    assert refusal(post, server.url) == ('it answered with status {}'.format(status), final)


def test_a_redirect_is_not_followed(serve):
    other = serve(receiving.WebhookServer())
    server = serve(receiving.WebhookServer([302, 307], headers=[('Location', other.url)]))
    assert refusal(post, server.url) == ('it answered with status 302', True)
    assert refusal(post, server.url) == ('it answered with status 307', True)
    assert other.taken == [], 'it is not in the file'


@pytest.mark.parametrize(
    'manner, says',
    [
        (receiving.hangs, 'it does not answer in time'),
        (receiving.dribbles, 'it does not answer in time'),
        (receiving.hangs_up, 'it closed the connection'),
        (receiving.floods, 'it closed the connection'),
    ],
)
def test_a_webhook_that_is_rude_takes_a_limited_time(serve, impatient, manner, says):
    server = serve(receiving.RudeServer(manner))
    begun_s = time.monotonic()
    said, final = refusal(post, 'http://127.0.0.1:{}/{}'.format(server.port, PASSWORD))
    assert (said, final) == (says, False)
    assert time.monotonic() - begun_s < 8.0


@pytest.mark.parametrize(
    'error',
    [
        OSError(errno.EPIPE, 'while it is sent'),
        OSError(errno.ECONNRESET, 'while it is read'),
        OSError(errno.ECONNABORTED, 'as it is made'),
        ssl.SSLEOFError(ssl.SSL_ERROR_EOF, 'in the handshake'),
        ssl.SSLZeroReturnError(ssl.SSL_ERROR_ZERO_RETURN, 'behind it'),
    ],
)
def test_a_connection_that_ends_is_told_alike_at_each_moment(monkeypatch, error):
    def posts(*_):
        raise error

    monkeypatch.setattr(delivery, '_post', posts)
    assert refusal(post, 'http://127.0.0.1:1/') == ('it closed the connection', False)


def free_port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


def test_nobody_listens_or_there_is_no_such_name():
    port = free_port()
    refused = ('it refuses the connection', False)
    assert refusal(post, 'http://127.0.0.1:{}/{}'.format(port, PASSWORD)) == refused
    assert refusal(mail, port, host='127.0.0.1') == refused
    unknown = ('its name is not found', False)
    assert refusal(post, 'http://nothing.invalid/' + PASSWORD) == unknown
    assert refusal(mail, 25, host='nothing.invalid') == unknown


def test_a_mail_has_sentence_link_and_picture(serve):
    server = serve(receiving.MailServer())
    mail(server.bound_port, questions=[question(text=HOSTILE), question(None, query_id='q2')])
    (taken,) = server.taken
    assert taken.rcpt_tos == ['ann@example.org'], 'and nobody else'
    message = email.message_from_bytes(taken.content, policy=email.policy.default)
    assert message['Subject'] == '/robot asks about PICK, and 1 more'
    assert message['Bcc'] is None and message['Message-ID'].endswith('@example.org>')
    text = message.get_body().get_content()
    assert ORIGIN + '/#questions//robot/query+q1' in text and 'query+q2' in text
    (picture,) = message.iter_attachments()
    assert (picture.get_content(), picture.get_content_type()) == (PICTURE.body, 'image/jpeg')


def test_a_mail_goes_by_starttls_and_a_password(serve, folder):
    server = receiving.MailServer(
        tls_context=receiving.server_context(str(folder / 'own.pem')), auth_required=True
    )
    server.SMTP_kwargs['authenticator'] = server.authenticate
    serve(server)
    own = str(folder / 'own.pem')
    mail(server.bound_port, 'starttls', own, PASSWORD)
    assert server.logged_in == ['robots'] and len(server.taken) == 1
    said = refusal(mail, server.bound_port, 'starttls', own, 'wrong')
    assert said == ('it refused the password (535)', True)
    said = refusal(mail, server.bound_port, 'starttls', str(folder / 'other.pem'), PASSWORD)
    assert said == ('its certificate is not trusted', False)
    assert len(server.taken) == 1 and set(server.logged_in) == {'robots'}


def test_a_mail_goes_by_tls_from_the_first_byte(serve, folder):
    server = serve(
        receiving.MailServer(ssl_context=receiving.server_context(str(folder / 'own.pem')))
    )
    mail(server.bound_port, 'tls', str(folder / 'own.pem'))
    assert len(server.taken) == 1
    assert refusal(mail, server.bound_port, 'tls') == ('its certificate is not trusted', False)


def test_a_mail_never_goes_unencrypted_where_tls_is_wanted(serve):
    server = serve(receiving.MailServer())
    said = refusal(mail, server.bound_port, 'starttls', '', PASSWORD)
    assert said == ('it has no STARTTLS, or no log-in', True)
    assert server.taken == [] and server.logged_in == []


@pytest.mark.parametrize(
    'refuses, said',
    [
        ('550 no such user ' + PASSWORD, ('it answered with code 550', True)),
        ('451 later ' + PASSWORD, ('it answered with code 451', False)),
    ],
)
def test_a_mail_server_that_refuses_is_told_by_its_code_alone(serve, refuses, said):
    server = serve(receiving.MailServer(refuses))
    assert refusal(mail, server.bound_port) == said


@pytest.mark.parametrize(
    'manner, says',
    [
        (receiving.hangs, 'it closed the connection, or was too slow'),
        (receiving.dribbles, 'it closed the connection, or was too slow'),
        (receiving.hangs_up, 'it closed the connection, or was too slow'),
    ],
)
def test_a_mail_server_that_is_rude_takes_a_limited_time(serve, impatient, manner, says):
    server = serve(receiving.RudeServer(manner))
    begun_s = time.monotonic()
    assert refusal(mail, server.port) == (says, False)
    assert time.monotonic() - begun_s < 8.0


def test_no_log_of_a_library_shows_a_secret(serve, impatient, caplog, folder):
    caplog.set_level(logging.DEBUG)
    server = serve(receiving.WebhookServer([500], answer=PASSWORD.encode()))
    rude = serve(receiving.RudeServer(receiving.floods))
    tls = serve(receiving.WebhookServer(certificate=str(folder / 'own.pem')))
    for url in (server.url, 'http://127.0.0.1:{}/{}'.format(rude.port, PASSWORD), tls.url):
        refusal(post, url, authorization=Secret(PASSWORD))
    assert PASSWORD not in caplog.text
