"""Fixtures for tests of the executive; the states and fakes they use are in machines.py."""
import os
import sys

import pytest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import smach  # noqa: E402


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
