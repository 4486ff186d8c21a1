"""Which smach the unit tests run on, that of $SMACH_UPSTREAM or that of src/; and the folders of
shared helpers.
"""

import os
import re
import subprocess
import sys

import pytest

HERE = os.path.dirname(os.path.abspath(__file__))
SRC = os.path.abspath(os.path.join(HERE, os.pardir, os.pardir, 'src'))

sys.path.append(SRC)  # after a sourced workspace, whose smach_oracle has the generated messages
sys.path.append(os.path.join(HERE, os.pardir, 'rostest'))  # waiting, expert_fixtures
# worlds, cameras and trials that tests of several rooms use
sys.path.append(os.path.join(HERE, 'support'))
if os.environ.get('SMACH_UPSTREAM'):
    sys.path.insert(0, os.path.abspath(os.environ['SMACH_UPSTREAM']))


LACKING = re.compile(r"No module named '([\w.]+)'|Python package ([\w.]+) is not installed")


def what_may_lack(text):
    """The module that a failure lacks, where another Python cannot have it; else ''."""
    found = LACKING.search(text)
    may_lack = os.environ.get('SMACH_ORACLE_MAY_LACK', '').split()
    name = (found.group(1) or found.group(2)).split('.')[0] if found else ''
    return name if name in may_lack else ''


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector):
    """Leave out a file that imports what another Python cannot have (scripts/test --python)."""
    report = (yield).get_result()
    leave_out(report, str(collector.fspath), str(report.longrepr))


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """Leave out a test for the same reason, also where a command that it runs says so."""
    report = (yield).get_result()
    if call.excinfo is not None:
        leave_out(report, str(item.fspath), told_by(call.excinfo.value, report))


def told_by(error, report):
    """What an error says, those before it, and a command that has ended with it."""
    told = report.capstderr if isinstance(error, subprocess.CalledProcessError) else ''
    while error is not None:
        told, error = told + '\n' + str(error), error.__cause__ or error.__context__
    return told


def leave_out(report, path, told):
    """Make a failure a test that was left out, where what was told names such a reason."""
    lacking = what_may_lack(told) if report.failed else ''
    if lacking:
        report.outcome = 'skipped'
        report.longrepr = (path, 0, 'lacks ' + lacking)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session, exitstatus):
    """A folder of which all was left out has not failed."""
    if os.environ.get('SMACH_ORACLE_MAY_LACK') and (
        exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED
    ):
        session.exitstatus = pytest.ExitCode.OK
