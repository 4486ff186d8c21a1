"""Names that programs written for version 0.1 import, with their members and parameters."""

import inspect

import listings
import product
import pytest
from held import expected

HELD = expected('names')
CLASSES = [place for place, held in sorted(HELD.items()) if 'members' in held]
ENUMERATIONS = [place for place, held in sorted(HELD.items()) if 'values' in held]
FUNCTIONS = sorted(set(HELD) - set(CLASSES) - set(ENUMERATIONS))
METHODS = [
    (place, method)
    for place in CLASSES
    for method in sorted(HELD[place]['parameters'])
    if not hasattr(Exception, method)  # of which each version of Python says something else
]
POSITIONAL = inspect.Parameter.POSITIONAL_OR_KEYWORD.name
KEYWORD = inspect.Parameter.KEYWORD_ONLY.name
VARIADIC = (inspect.Parameter.VAR_POSITIONAL.name, inspect.Parameter.VAR_KEYWORD.name)


def are_taken(held, now):
    """Whether every call that was right for the old parameters is right for the new ones."""
    positions = [name for name, kind, _ in held if kind == POSITIONAL]
    demanded = {name for name, kind, optional in now if not optional and kind not in VARIADIC}
    return (
        [name for name, kind, _ in now if kind == POSITIONAL][: len(positions)] == positions
        and {name for name, _, _ in held} <= {name for name, _, _ in now}
        and demanded <= {name for name, _, optional in held if not optional}
    )


@pytest.mark.parametrize('place', CLASSES)
def test_a_class_has_the_members_that_it_had(place):
    assert not set(HELD[place]['members']) - set(listings.public(place)['members'])


@pytest.mark.parametrize('place', ENUMERATIONS)
def test_an_enumeration_has_the_values_that_it_had(place):
    now = listings.public(place)['values']
    assert {name: now.get(name) for name in HELD[place]['values']} == HELD[place]['values']


@pytest.mark.parametrize('place, method', METHODS)
def test_a_method_takes_the_parameters_that_it_took(place, method):
    now = listings.public(place)['parameters'][method]
    assert are_taken(HELD[place]['parameters'][method], now)


@pytest.mark.parametrize('place', FUNCTIONS)
def test_a_function_takes_the_parameters_that_it_took(place):
    assert are_taken(HELD[place]['parameters'], listings.public(place)['parameters'])


A, B, C = ['a', POSITIONAL, False], ['b', POSITIONAL, True], ['c', KEYWORD, True]


@pytest.mark.parametrize(
    'now', [[A, B, C], [A, B, C, ['d', KEYWORD, True]], [A, B, ['d', POSITIONAL, True], C]]
)
def test_further_parameters_do_no_harm(now):
    assert are_taken([A, B, C], now)


@pytest.mark.parametrize(
    'now',
    [
        [A, B],
        [['z', POSITIONAL, False], B, C],
        [B, A, C],
        [A, ['b', POSITIONAL, False], C],
        [A, B, C, ['d', KEYWORD, False]],
    ],
)
def test_a_parameter_that_is_gone_renamed_moved_or_demanded_is_noticed(now):
    assert not are_taken([A, B, C], now)


def test_the_events_of_observers_have_the_fields_of_the_message():
    fields = [name for _, name in expected('interface_files')['msg/OracleEvent.msg'][0]['fields']]
    machine, events = product.OracleContainer.wrap(product.machine('fetch'), name='FETCH'), []
    machine.events.observers.append(events.append)
    assert machine.execute() == 'succeeded'
    assert [event.seq for event in events] == list(range(len(events))) and len(events) > 10
    for event in events:
        assert not [name for name in fields if name != 'header' and not hasattr(event, name)]
    assert {(event.path, event.trial_id) for event in events} == {('FETCH', machine.trial_id)}
