"""Fixtures for tests of the ROS side."""

import pytest
from warm_python import ORACLE_RUN, WarmPython


@pytest.fixture(scope='session')
def warm_python():
    """Runs programs under `oracle_run`, whose modules are imported once."""
    python = WarmPython(*ORACLE_RUN)
    yield python
    python.close()
