"""The on-call list: what is read, what is refused, and that no refusal shows a secret."""

import os
from datetime import datetime

import pytest

from smach_oracle.expert.console.reach.on_call import read_on_call
from smach_oracle.expert.console.reach.quiet_hours import QuietHours
from smach_oracle.oracle.errors import SettingsError

GOOD = """
secrets: secrets
mail: {server: smtp.example.org, sender: robots@example.org, user: robots, password: mail}
people:
  ann: {mail: ann@example.org, quiet: [22:00-07:00, sun]}
  bob: {webhook: chat, form: slack}
  eve: {mail: eve@example.org, webhook: json, authorization: header}
order:
  - {after_s: 300, call: bob}
  - {call: [ann, eve]}
"""
HIDDEN = 'hunter2-is-what-nobody-may-see'
SECRETS = """# NAME VALUE
mail {0} # and more
chat https://hooks.example.org/{0}
json http://127.0.0.1:9/{0}
header Bearer {0}
path /{0}
""".format(HIDDEN)


@pytest.fixture
def written(tmp_path):
    """A function that writes a list, and secrets next to it. It returns the path of the list."""

    def write(text=GOOD, secrets=SECRETS, mode=0o600):
        file = tmp_path / 'secrets'
        file.write_text(secrets)
        file.chmod(mode)
        (tmp_path / 'on_call.yaml').write_text(text)
        return str(tmp_path / 'on_call.yaml')

    return write


def test_a_list_is_read(written):
    on_call = read_on_call(written())
    assert [(step.after_s, step.people) for step in on_call.steps] == [
        (0.0, ('ann', 'eve')),
        (300.0, ('bob',)),
    ]
    assert [each.words for person in on_call.people.values() for each in person.receivers] == [
        'ann by e-mail',
        'bob by slack',
        'eve by e-mail',
        'eve by json',
    ]
    mail = on_call.mail
    assert (mail.host, mail.port, mail.security) == ('smtp.example.org', 587, 'starttls')
    assert mail.password.value == HIDDEN + ' # and more'
    assert on_call.people['eve'].receivers[1].authorization.value == 'Bearer ' + HIDDEN
    assert on_call.pictures and on_call.ca_file == ''
    assert HIDDEN not in repr(on_call), 'nor can it be logged by accident'


def changed(old, new):
    assert old in GOOD
    return GOOD.replace(old, new)


@pytest.mark.parametrize(
    'text, says',
    [
        ('', 'people: 0'),
        ('people: [', 'not valid YAML'),
        ('call: ann', 'on_call.call'),
        (changed('bob: {', 'bob: {phone: 1, '), 'line 6: people.bob.phone'),
        (changed('{mail: ann@example.org, quiet: [22:00-07:00, sun]}', '{}'), 'line 5: people.ann'),
        (changed('ann@example.org', 'ann'), "line 5: people.ann.mail: 'ann'"),
        (changed('ann@example.org', '"ann@example.org\\nBcc: all"'), 'people.ann.mail'),
        (changed('22:00-07:00', '22-7'), "line 5: people.ann.quiet: '22-7'"),
        (changed('slack', 'irc'), "line 6: people.bob.form: 'irc'"),
        (changed('webhook: chat', 'webhook: nothing'), 'line 6: people.bob.webhook'),
        (changed('webhook: chat', 'webhook: https://x/' + HIDDEN), 'a name of a secret in'),
        (changed('webhook: chat', 'webhook: path'), 'a URL that begins with https://'),
        (changed('password: mail', 'password: ' + HIDDEN), 'line 3: mail.password'),
        (changed(', password: mail', ''), 'together with mail.password'),
        (changed('server: smtp.example.org', 'security: none, server: x'), 'mail.security'),
        (changed('server: smtp.example.org, ', ''), 'mail.server'),
        (changed('sender: robots@example.org', 'sender: robots'), "mail.sender: 'robots'"),
        (changed('sender', 'port: 0, sender'), 'mail.port: 0'),
        (changed('call: bob', 'call: [bob, rob]'), "order[0].call: 'rob'"),
        (changed('call: bob', 'call: []'), 'order[0].call'),
        (changed('300', '-1'), 'order[0].after_s: -1'),
        (GOOD.split('order')[0], 'order: None'),
        (GOOD + 'ca_file: nothing.pem\n', 'line 11: ca_file'),
        (GOOD + 'pictures: few\n', "line 11: pictures: 'few'"),
        (changed('secrets: secrets\n', ''), 'secrets: None'),
        (changed('mail: {', 'other: {'), 'other'),
        (changed('secrets: secrets', 'secrets: nothing'), 'No such file'),
    ],
)
def test_what_is_wrong_is_named_and_no_secret_is_shown(written, text, says):
    with pytest.raises(SettingsError) as error:
        read_on_call(written(text))
    told = str(error.value)
    assert says in told and 'on_call' in told
    assert HIDDEN not in told and HIDDEN not in repr(vars(error.value))


@pytest.mark.parametrize(
    'secrets, mode, says',
    [
        (SECRETS, 0o640, 'chmod 600'),
        (SECRETS, 0o604, 'chmod 600'),
        (SECRETS + HIDDEN, 0o600, "secrets line 7: 'one word'"),
        (SECRETS + 'mail ' + HIDDEN, 0o600, 'secrets line 7'),
    ],
)
def test_secrets_that_others_may_read_or_that_have_no_name_are_refused(
    written, secrets, mode, says
):
    with pytest.raises(SettingsError) as error:
        read_on_call(written(secrets=secrets, mode=mode))
    assert says in str(error.value) and HIDDEN not in str(error.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SettingsError, match='no such file'):
        read_on_call(os.path.join(str(tmp_path), 'nothing.yaml'))


@pytest.mark.parametrize(
    'text, moments',
    [
        # 2 January 2026 was a Friday
        ('22:00-07:00', {'02 21:59': False, '02 22:00': True, '03 06:59': True, '03 07:00': False}),
        ('12:00-13:00', {'02 11:59': False, '02 12:59': True, '02 13:00': False}),
        ('sat', {'02 23:59': False, '03 00:00': True, '03 23:59': True, '04 00:00': False}),
        ('fri 22:00-07:00', {'02 06:00': False, '02 22:00': True, '03 06:59': True}),
        ('Fri 22:00-24:00', {'02 23:59': True, '03 00:00': False, '01 23:00': False}),
    ],
)
def test_quiet_hours_cover_a_moment(text, moments):
    quiet = QuietHours('quiet', [text])
    for moment, covered in moments.items():
        assert quiet.covers(datetime.strptime('2026-01-' + moment, '%Y-%m-%d %H:%M')) == covered


@pytest.mark.parametrize('text', ['', '22:00', '24:00-07:00', '07:00-07:00', 'day', '1:00-2:00'])
def test_what_is_no_span_is_refused(text):
    with pytest.raises(SettingsError):
        QuietHours('quiet', [text])
