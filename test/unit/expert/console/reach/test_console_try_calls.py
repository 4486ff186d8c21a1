"""The test message of an on-call list: servers take it, refuse it, hang, or are not there."""

import time
from datetime import datetime

import receiving
from receiving import PASSWORD

from smach_oracle.experiment.launching import free_port
from smach_oracle.expert.console.reach.on_call import (
    MailServer,
    OnCallList,
    OnCallPerson,
    Receiver,
)
from smach_oracle.expert.console.reach.quiet_hours import QuietHours
from smach_oracle.expert.console.reach.secret_file import Secret
from smach_oracle.expert.console.reach.try_calls import SENTENCE, try_calls

ORIGIN = 'https://robots.example.org'


def on_call_of(mail_port, **urls):
    """A list with one person for each webhook, and ann, who has a mail address and sleeps."""
    people = {
        name: OnCallPerson((Receiver(name, 'json', Secret(url)),), QuietHours('quiet', []))
        for name, url in urls.items()
    }
    always = QuietHours('quiet', ['mon', 'tue', 'wed', 'thu', 'fri', 'sat', 'sun'])
    assert always.covers(datetime.now())
    people['ann'] = OnCallPerson((Receiver('ann', 'mail', Secret('ann@example.org')),), always)
    server = MailServer('localhost', mail_port, 'none', 'robots@example.org', '', Secret(''))
    return OnCallList(people, (), server)


def test_each_is_told_apart_and_one_that_hangs_delays_nobody(serve, impatient):
    good, mail = serve(receiving.WebhookServer()), serve(receiving.MailServer())
    refuses = serve(receiving.WebhookServer([404], answer=PASSWORD.encode()))
    rude = serve(receiving.RudeServer(receiving.hangs))
    begun_s = time.monotonic()
    tried = try_calls(
        on_call_of(
            mail.bound_port,
            good=good.url,
            refuses=refuses.url,
            hangs='http://127.0.0.1:{}/{}'.format(rude.port, PASSWORD),
            gone='http://127.0.0.1:{}/{}'.format(free_port(), PASSWORD),
        ),
        ORIGIN,
    )
    assert time.monotonic() - begun_s < 8.0
    lines = {each.receiver.person: each.words for each in tried}
    assert lines['good'] == 'good by json: sent' and lines['ann'] == 'ann by e-mail: sent'
    assert lines['refuses'].endswith('404') and not lines['refuses'].endswith('sent')
    assert all(lines[name] and 'sent' not in lines[name] for name in ('hangs', 'gone'))
    assert PASSWORD not in ''.join(lines.values())
    ((_, body),) = good.taken
    assert body['questions'][0]['sentence'] == SENTENCE
    assert body['questions'][0]['link'] == ORIGIN + '/'


def test_a_mail_server_that_refuses_is_told_by_its_code(serve):
    mail = serve(receiving.MailServer('550 no such user ' + PASSWORD))
    (tried,) = try_calls(on_call_of(mail.bound_port), ORIGIN)
    assert tried.words == 'ann by e-mail: it answered with code 550'
