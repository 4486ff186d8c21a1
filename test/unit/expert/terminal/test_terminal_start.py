"""The terminal's command line."""

import getpass
import socket

import pytest

from smach_oracle.expert.terminal.start import parse


@pytest.mark.parametrize(
    'raised', [KeyError('getpwuid(): uid not found: 4711'), OSError('No username set')]
)
def test_a_user_without_a_name_is_an_operator(monkeypatch, raised):
    def nobody():
        raise raised

    monkeypatch.setattr(getpass, 'getuser', nobody)
    monkeypatch.setattr(socket, 'gethostname', lambda: 'desk')
    assert parse([]).name == 'operator@desk'
    assert parse(['--name', 'ann']).name == 'ann'


def test_a_user_who_has_one_is_called_by_it(monkeypatch):
    monkeypatch.setattr(getpass, 'getuser', lambda: 'ann')
    monkeypatch.setattr(socket, 'gethostname', lambda: 'desk')
    assert parse([]).name == 'ann@desk'
