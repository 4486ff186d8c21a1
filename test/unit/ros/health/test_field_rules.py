"""What messages and statuses of the diagnostics say of the robot's health."""

from types import SimpleNamespace

import pytest

from smach_oracle.oracle.settings.health import checked_health
from smach_oracle.ros.health.field_rules import (
    Status,
    why_unwell_by_message,
    why_unwell_by_status,
)

NAN = float('nan')


def condition(**given):
    return checked_health('healthy', given)[0]


@pytest.mark.parametrize(
    'given, value, why',
    [
        ({}, True, ''),
        ({}, False, 'off'),
        ({'equals': False}, True, 'on'),
        ({}, 1, ''),
        ({}, 0, '0'),
        ({'equals': 2}, 2.0, ''),
        ({'equals': 2}, 3, '3'),
        ({'equals': 'run'}, 'run', ''),
        ({'equals': 'run'}, 'stop', 'stop'),
        ({'equals': 'run'}, '', 'empty'),
        ({'at_least': 0.2}, 0.2, ''),
        ({'at_least': 0.2}, 0.1, '0.1, at least 0.2'),
        ({'at_most': 80}, 81.5, '81.5, at most 80'),
        ({'at_least': 1, 'at_most': 2}, 1.5, ''),
        ({'at_least': 0}, NAN, 'nan is no number'),
        ({'at_least': 0}, 'x', "'x' is no number"),
        ({'at_least': 0}, True, 'True is no number'),
    ],
)
def test_a_value_is_well_or_says_why_not(given, value, why):
    assert why_unwell_by_message(condition(topic='/t', **given), SimpleNamespace(data=value)) == why


@pytest.mark.parametrize(
    'field, why',
    [
        ('state.cells.1.voltage', ''),
        ('state.cells.0.voltage', '3, at least 4'),
        ('state.cells.2.voltage', '/t has no field state.cells.2.voltage'),
        ('state.cell', '/t has no field state.cell'),
        ('state.name.voltage', '/t has no field state.name.voltage'),
        ('state.7', '/t has no field state.7'),
    ],
)
def test_a_field_may_lie_deep(field, why):
    cells = [SimpleNamespace(voltage=3), SimpleNamespace(voltage=4)]
    message = SimpleNamespace(state=SimpleNamespace(cells=cells, name='a'))
    assert why_unwell_by_message(condition(topic='/t', field=field, at_least=4), message) == why


@pytest.mark.parametrize(
    'worst, level, why',
    [
        ('warn', 0, ''),
        ('warn', 1, ''),
        ('warn', 2, 'error (hot)'),
        ('warn', 3, 'stale (hot)'),
        ('ok', 0, ''),
        ('ok', 1, 'warn (hot)'),
        ('ok', 3, 'stale (hot)'),
        ('warn', 7, '7 (hot)'),
        ('warn', -1, '-1 (hot)'),
    ],
)
def test_a_status_is_well_up_to_a_level(worst, level, why):
    power = condition(diagnostics='P', worst=worst)
    assert why_unwell_by_status(power, Status(level, 'hot')) == why
    assert why_unwell_by_status(power, Status(level, '')) == why.replace(' (hot)', '')
