"""Fixtures for tests of the test kit; the machines they use are in bench_machines.py."""

import os
import sys

import pytest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import smach


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    """SMACH logs nothing, and nothing shuts it down."""
    for level in ('info', 'warn', 'debug', 'err'):
        monkeypatch.setattr(smach, 'log' + level, lambda text: None)
    monkeypatch.setattr(smach, 'is_shutdown', lambda: False)
