"""The commands of version 0.1 are there, and take the options that they took."""

import listings
import pytest
from held import expected, run_all

OPTIONS = expected('options')


@pytest.fixture(name='results', scope='module')
def call_with_every_option():
    """The output of each command for a line with all its options and one that does not exist."""
    there = [command for command in sorted(OPTIONS) if command in listings.commands()]
    lines = [listings.with_every_option(command, OPTIONS[command]) for command in there]
    return dict(zip(there, run_all(lines)))


def test_every_command_is_there():
    assert not set(OPTIONS) - set(listings.commands())


@pytest.mark.parametrize('command', sorted(OPTIONS))
def test_a_command_takes_the_options_that_it_took(command, results):
    result = results[command]
    assert result.code == 2
    # every other option on the line is known, and its values are accepted
    assert result.errors.endswith('unrecognized arguments: {}\n'.format(listings.UNKNOWN))
