"""The console over TLS with a certificate of its own making, and what is no certificate."""

import json
import os
import shutil
import subprocess
import tempfile

import console_case
import pytest
import tornado.iostream
import tornado.testing

from smach_oracle.expert.console.server import tls_context
from smach_oracle.expert.console.web.settings import read_settings
from smach_oracle.oracle.errors import SettingsError

FOLDER = tempfile.mkdtemp(prefix='console-tls-')


def path(name):
    return os.path.join(FOLDER, name)


def openssl(*arguments):
    subprocess.run(
        ['openssl', *arguments], check=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def make(name):
    openssl(
        'req',
        '-x509',
        '-newkey',
        'rsa:2048',
        '-nodes',
        '-days',
        '2',
        '-subj',
        '/CN=robot',
        '-addext',
        'subjectAltName=DNS:localhost,IP:127.0.0.1',
        '-keyout',
        path(name + '.key'),
        '-out',
        path(name + '.pem'),
    )


def setup_module():
    make('own')
    make('other')
    openssl(
        'rsa',
        '-aes128',
        '-passout',
        'pass:secret',
        '-in',
        path('own.key'),
        '-out',
        path('locked.key'),
    )
    with open(path('empty'), 'w', encoding='utf-8'):
        pass


def teardown_module():
    shutil.rmtree(FOLDER)


class TestEncrypted(console_case.ConsoleCase):
    certificate, private_key = path('own.pem'), path('own.key')

    def test_the_page_comes_encrypted_and_its_cookie_never_leaves_without(self):
        answer = self.ask('/')
        assert answer.code == 200 and b'Operator console' in answer.body
        assert 'Secure' in self.ask('/session').headers['Set-Cookie']
        assert self.sign_in('operator')[1]['role'] == 'operator'

    def test_who_does_not_know_the_certificate_does_not_trust_it(self):
        with pytest.raises(Exception, match='certificate verify failed'):
            self.fetch('/', raise_error=True, ca_certs=path('other.pem'), validate_cert=True)

    @tornado.testing.gen_test
    async def test_without_encryption_nothing_is_told(self):
        with pytest.raises((ConnectionResetError, tornado.iostream.StreamClosedError)):
            await self.http_client.fetch(self.get_url('/').replace('https', 'http'))

    @tornado.testing.gen_test
    async def test_the_socket_is_encrypted_too_and_a_page_that_is_not_may_not_open_it(self):
        cookie, info = await self.signed('operator')
        assert await self.refused(cookie, Origin=self.origin.replace('https', 'http')) == 403
        self.sections.put('questions', [])
        socket = await self.open_page(cookie, info)
        self.pages.push()
        assert json.loads(await socket.read_message())['sections'] == {'questions': []}


def refusal(certificate, key):
    given = {'certificate': path(certificate), 'private_key': path(key)}
    with pytest.raises(SettingsError) as error:
        tls_context(read_settings(lambda name, default: given.get(name, default)))
    return str(error.value)


@pytest.mark.parametrize(
    'certificate, key, says',
    [
        ('nothing.pem', 'own.key', "~certificate: '{}'"),
        ('own.pem', 'nothing.key', "~private_key: '{}'"),
        ('own.pem', '', "~private_key: '{}'"),
        ('own.pem', 'other.key', 'KEY_VALUES_MISMATCH'),
        ('own.key', 'own.pem', 'a certificate and the key'),
        ('empty', 'own.key', 'a certificate and the key'),
        ('own.pem', 'empty', 'a certificate and the key'),
        ('own.pem', 'locked.key', 'a key with a passphrase'),
    ],
)
def test_what_cannot_be_used_is_named(certificate, key, says):
    wrong = path(certificate if 'certificate' in says else key)
    assert says.format(wrong) in refusal(certificate, key)
