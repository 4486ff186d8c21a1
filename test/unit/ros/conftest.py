"""Fixtures for tests of the ROS side."""

import pytest
from warm_python import ORACLE_RUN, WarmPython

from smach_oracle.ros import parameters


@pytest.fixture(autouse=True)
def nothing_read_before(monkeypatch):
    """Have read no parameter yet. A process remembers them."""
    monkeypatch.setattr(parameters, '_read', {})


@pytest.fixture(scope='session')
def warm_python():
    """Runs programs under `oracle_run`, whose modules are imported once."""
    python = WarmPython(*ORACLE_RUN)
    yield python
    python.close()
