"""Servers that take messages, and how long they are waited for."""

import contextlib

import pytest
import receiving

from smach_oracle.expert.console.reach import delivery


@pytest.fixture
def serve():
    """A function that has a server stopped at the end."""
    with contextlib.ExitStack() as stack:

        def begin(server):
            stack.callback(server.stop)
            if isinstance(server, receiving.MailServer):
                server.start()
            return server

        yield begin


@pytest.fixture
def impatient(monkeypatch):
    """Short limits: real ones are tried by nobody who waits."""
    monkeypatch.setattr(delivery, 'LIMIT_S', 1.5)
    monkeypatch.setattr(delivery, 'STEP_LIMIT_S', 0.5)
