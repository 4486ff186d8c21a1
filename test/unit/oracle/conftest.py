"""Fixtures for tests of the executive; the states and fakes they use are in machines.py."""

import os
import sys
import tempfile
import threading
from pathlib import Path

import pytest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)

from fake_clock import FakeClock

import smach
from smach_oracle.oracle.machine import tree

FAILS = 'error::pytest.PytestUnhandledThreadExceptionWarning'


def pytest_collection_modifyitems(items):
    """An error that ends a thread fails the test, unless that says otherwise.

    Upstream's Concurrence runs its states in threads that such errors end.
    """
    if os.environ.get('SMACH_UPSTREAM'):
        return
    for item in items:
        if HERE in str(item.fspath) and item.get_closest_marker('filterwarnings') is None:
            item.add_marker(pytest.mark.filterwarnings(FAILS))


@pytest.fixture(autouse=True)
def log(monkeypatch):
    """Everything that is logged, as (level, text); the shutdown check is put back afterwards."""
    lines = []
    for level in ('info', 'warn', 'debug', 'err'):

        def logger(text, level=level):
            lines.append((level, str(text)))

        monkeypatch.setattr(smach, 'log' + level, logger)
    monkeypatch.setattr(smach, 'is_shutdown', lambda: False)
    return lines


@pytest.fixture
def clock(monkeypatch):
    """The clock of every machine that the test wraps: only the test has its time pass."""
    clock = FakeClock()
    monkeypatch.setattr(tree, 'Clock', lambda: clock)
    return clock


@pytest.fixture
def quiet_threads(monkeypatch):
    """Upstream's Concurrence lets its threads raise. The shutdown check is put back, too."""
    monkeypatch.setattr(threading, 'excepthook', lambda *said: None)
    yield
    smach.set_shutdown_check(lambda: False)


@pytest.fixture
def tmp_path():
    """In memory where the system has room there.

    Learned rates are synced at every failure: on a slow disk these tests did little but wait for
    it. No test here cuts the power.
    """
    in_memory = '/dev/shm'
    folder = in_memory if os.access(in_memory, os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix='smach_oracle-', dir=folder) as path:
        yield Path(path)
