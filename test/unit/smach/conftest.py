"""Fixtures for tests of the engine. With $SMACH_UPSTREAM they run on upstream, without those of our
improvements.
"""

import os
import sys

import pytest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import smach


def pytest_configure(config):
    config.addinivalue_line('markers', 'improvement: behaviour that upstream smach does not have')


def pytest_collection_modifyitems(items):
    if not os.environ.get('SMACH_UPSTREAM'):
        return
    for item in items:
        if item.get_closest_marker('improvement'):
            item.add_marker(pytest.mark.skip(reason='an improvement over upstream smach'))


@pytest.fixture(autouse=True)
def log(monkeypatch):
    """Everything that is logged, as (level, text); shutdown check and open containers are put back
    afterwards.
    """
    lines = []
    for level in ('info', 'warn', 'debug', 'err'):

        def logger(text, level=level):
            lines.append((level, str(text)))

        monkeypatch.setattr(smach, 'log' + level, logger)
    monkeypatch.setattr(smach, 'is_shutdown', lambda: False)
    yield lines
    while smach.Container._construction_stack:
        smach.Container._construction_stack.pop()


@pytest.fixture
def said(log):
    """The texts logged at a level."""
    return lambda level: [text for logged_at, text in log if logged_at == level]
