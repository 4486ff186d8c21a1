"""The on-call list: who is called, how, after what time, and when not. Read from a YAML file."""

import os
import re
import ssl
from typing import Any, List, Mapping, NamedTuple, Optional, Sequence, Tuple
from urllib.parse import urlsplit

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.oracle.settings.written import as_text, as_value
from smach_oracle.ros.reading.yaml_files import read_yaml

from .quiet_hours import QuietHours
from .secret_file import Secret, SecretFile

MOST_PEOPLE = 20
FORMS = ('json', 'slack', 'mattermost')
SECURITIES = ('tls', 'starttls', 'none')
PORTS = {'tls': 465, 'starttls': 587, 'none': 25}
_ADDRESS = re.compile(r"[A-Za-z0-9.!#$%&'*+/=?^_`{|}~-]+@[A-Za-z0-9.-]+")
_port = checks.whole(1, '1 to 65535', 65535)
_after_s = checks.number(0.0, 7 * 86400.0, 's from 0 to a week')


class MailServer(NamedTuple):
    """The SMTP server that takes the mails of the console."""

    host: str
    port: int
    security: str  # tls from the first byte, starttls, or none
    sender: str  # address
    user: str = ''  # '' where it asks nobody
    password: Secret = Secret('')


class Receiver(NamedTuple):
    """One way to reach a person."""

    person: str
    kind: str  # mail, or the form of a webhook: json, slack, mattermost
    address: Secret  # of e-mail, or a URL
    authorization: Optional[Secret] = None  # header of a webhook

    @property
    def words(self) -> str:
        """Return who is reached, and how. It shows no address, since one may be a secret."""
        return '{} by {}'.format(self.person, 'e-mail' if self.kind == 'mail' else self.kind)


class OnCallPerson(NamedTuple):
    """A person who may be called."""

    receivers: Tuple[Receiver, ...]
    quiet: QuietHours


class CallStep(NamedTuple):
    """The people who are called once a question has waited for so long."""

    after_s: float
    people: Tuple[str, ...]


class OnCallList(NamedTuple):
    """The file, read and checked."""

    people: Mapping[str, OnCallPerson]
    steps: Tuple[CallStep, ...]  # by their time
    mail: Optional[MailServer] = None
    pictures: bool = True  # whether the camera's picture leaves the machine
    ca_file: str = ''  # of the authorities that sign the receivers' certificates. '': the system's


_PARTS = ('secrets', 'mail', 'people', 'order', 'pictures', 'ca_file')
_OF_MAIL = ('server', 'port', 'security', 'sender', 'user', 'password')
_OF_PERSON = ('mail', 'webhook', 'form', 'authorization', 'quiet')
_OF_STEP = ('call', 'after_s')


def read_on_call(path: str) -> OnCallList:
    """Read an on-call list. Files that it names lie in its folder, unless their paths are whole.

    :raises SettingsError: naming file, line, key, value and what is allowed. It never shows a
        secret.
    """
    values, lines = read_yaml(path, '~on_call')
    try:
        return _OnCallFile(os.path.dirname(os.path.abspath(path))).read(values)
    except SettingsError as err:
        line = next((lines[key] for key in _above(err.key) if key in lines), None)
        origin = path if line is None else '{} line {}'.format(path, line)
        raise err.set_at(origin) from None


def _above(key: str) -> Sequence[str]:
    """A dotted key, and those that it is in, from the inside out."""
    parts = re.findall(r'[^.\[]+|\[\d+\]', key)
    return [''.join(_joined(parts[:count])) for count in range(len(parts), 0, -1)]


def _joined(parts: List[str]) -> List[str]:
    return [('' if not index or part[0] == '[' else '.') + part for index, part in enumerate(parts)]


class _OnCallFile:
    """Reads the parts of one file."""

    def __init__(self, folder: str) -> None:
        self._folder = folder
        self._secrets: Optional[SecretFile] = None

    def read(self, values: Mapping[str, Any]) -> OnCallList:
        given = checks.section('on_call', values, _PARTS)
        if 'secrets' in given:
            self._secrets = SecretFile('secrets', self._path('secrets', given['secrets']))
        mail = self._mail(given['mail']) if 'mail' in given else None
        named = checks.mapping('people', given.get('people'))
        if not 0 < len(named) <= MOST_PEOPLE:
            raise SettingsError('people', len(named), '1 to {} people'.format(MOST_PEOPLE))
        people = {name: self._person(name, named[name], mail) for name in named}
        ca_file = self._path('ca_file', given['ca_file']) if given.get('ca_file') else ''
        if ca_file:
            _check_authorities(ca_file)
        return OnCallList(
            people,
            self._steps(given.get('order'), people),
            mail,
            checks.flag('pictures', given.get('pictures', True)),
            ca_file,
        )

    def _path(self, key: str, value: object) -> str:
        return os.path.join(self._folder, path_of(checks.label(key, value)))

    def _secret(self, key: str, value: object) -> Secret:
        name = as_text(value)
        if self._secrets is None:
            raise SettingsError('secrets', None, 'a file of secrets, one of which is for ' + key)
        return self._secrets.find(key, name if isinstance(name, str) else '')

    def _mail(self, value: object) -> MailServer:
        given = checks.section('mail', value, _OF_MAIL)
        security = checks.choice(SECURITIES)('mail.security', given.get('security', 'starttls'))
        user = checks.text('mail.user', given.get('user', ''))
        if bool(user) != ('password' in given):
            raise SettingsError('mail.user', user, 'together with mail.password')
        if user and security == 'none':
            raise SettingsError(
                'mail.security', security, 'tls or starttls, where a password is sent'
            )
        return MailServer(
            checks.label('mail.server', given.get('server')),
            _port('mail.port', given.get('port', PORTS[security])),
            security,
            _mail_address('mail.sender', given.get('sender')),
            user,
            self._secret('mail.password', given['password']) if user else Secret(''),
        )

    def _person(self, name: str, value: object, mail: Optional[MailServer]) -> OnCallPerson:
        key = 'people.' + name
        given = checks.section(key, value, _OF_PERSON)
        receivers = []
        if 'mail' in given:
            if mail is None:
                raise SettingsError('mail', None, 'a server for the mails to ' + name)
            address = _mail_address(key + '.mail', given['mail'])
            receivers.append(Receiver(name, 'mail', Secret(address)))
        if 'webhook' in given:
            form = checks.choice(FORMS)(key + '.form', given.get('form', 'json'))
            url = self._secret(key + '.webhook', given['webhook'])
            _check_url(key + '.webhook', url.value)
            header = (
                self._secret(key + '.authorization', given['authorization'])
                if 'authorization' in given
                else None
            )
            receivers.append(Receiver(name, form, url, header))
        if not receivers:
            raise SettingsError(key, dict(given), 'a mail address, a webhook, or both')
        quiet = as_value(given.get('quiet')) or ()
        spans = (quiet,) if isinstance(quiet, str) else checks.words(key + '.quiet', quiet)
        return OnCallPerson(tuple(receivers), QuietHours(key + '.quiet', spans))

    def _steps(self, value: object, people: Mapping[str, OnCallPerson]) -> Tuple[CallStep, ...]:
        if not isinstance(value, list) or not value:
            raise SettingsError(
                'order', value, 'a list of at least one step, with call and after_s'
            )
        steps = [self._step('order[{}]'.format(n), step, people) for n, step in enumerate(value)]
        return tuple(sorted(steps, key=lambda step: step.after_s))

    def _step(self, key: str, value: object, people: Mapping[str, OnCallPerson]) -> CallStep:
        given = checks.section(key, value, _OF_STEP)
        call = given.get('call', [])
        names = (call,) if isinstance(call, str) else checks.words(key + '.call', call)
        for name in names or ('',):
            if name not in people:
                raise SettingsError(key + '.call', name, 'one or more of ' + ', '.join(people))
        return CallStep(_after_s(key + '.after_s', given.get('after_s', 0.0)), tuple(names))


def _mail_address(key: str, value: object) -> str:
    text = as_text(value)
    if not isinstance(text, str) or not _ADDRESS.fullmatch(text):
        raise SettingsError(key, value, 'an e-mail address, such as ann@example.org')
    return text


def _check_url(key: str, url: str) -> None:
    try:
        parts = urlsplit(url)
        good = parts.scheme in ('http', 'https') and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:
        good = False
    if not good or re.search(r'[\x00-\x20\x7f]', url):
        raise SettingsError(key, 'the secret of that name', 'a URL that begins with https://')


def _check_authorities(path: str) -> None:
    try:
        ssl.create_default_context(cafile=path)
    except (OSError, ssl.SSLError) as err:
        raise SettingsError('ca_file', path, 'a PEM file ({})'.format(err)) from None
