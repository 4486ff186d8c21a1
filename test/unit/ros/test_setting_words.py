"""What the report of a check says of settings."""

import pytest

from smach_oracle.oracle.settings.settings import Settings
from smach_oracle.ros.oracle_run.setting_words import in_words


def unwell():
    """A function of the author's own."""


@pytest.mark.parametrize(
    'given, words',
    [
        ({'recoveries': 0, 'minutes': 2.5}, 'of a trial: 0 recoveries and 2.5 minutes'),
        ({'recoveries': 1, 'questions': 2}, 'of a trial: 1 recovery and 2 questions'),
        ({'minutes': 1}, 'of a trial: 1 minute'),
        ({}, 'of a trial: no limit'),
    ],
)
def test_a_budget_is_told_by_its_limits(given, words):
    assert in_words(Settings.from_dict({'budget': given}).budget) == words


@pytest.mark.parametrize(
    'given, words',
    [
        ({'topic': '/motors_on', 'name': 'motors'}, '[motors (data of /motors_on is true)]'),
        (
            {'topic': '/charge', 'at_least': 20, 'max_age_s': 3},
            '[charge (data of /charge is at least 20, not older than 3 s)]',
        ),
        (
            {'topic': 'charge', 'at_least': 20, 'at_most': 95.5, 'field': 'battery.level'},
            '[charge (battery.level of charge is at least 20 and at most 95.5)]',
        ),
        ({'diagnostics': '/Power', 'worst': 'ok'}, '[Power (diagnostics of /Power at worst ok)]'),
        ({'function': unwell}, '[unwell (a function)]'),
    ],
)
def test_a_condition_is_told_by_what_must_hold(given, words):
    assert in_words(Settings.from_dict({'healthy': [given]}).healthy) == words


def test_all_else_is_told_as_it_is_written():
    assert in_words((True, 0.50, 'x', 3)) == '[true, 0.5, x, 3]'
