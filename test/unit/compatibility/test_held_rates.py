"""Rates files of version 0.1 are read, and the rates are those that they were."""

import json
import shutil

import product
import pytest
import readings
from held import RATES, TRIALS, expected, lacking, name_of

HELD = expected('rates')
NAMES = ['{file} {settings}'.format(**case) for case in HELD]
KINDS = [('window', {}), ('exponential', {'estimator': 'exponential'})]


def states_in(path):
    return json.loads(path.read_text())['containers']['']


def count(states, what):
    return {label: state[what] for label, state in states.items()}


def test_every_file_is_read():
    files = [*RATES.glob('*.json'), *TRIALS.rglob('rates.json')]
    assert {case['file'] for case in HELD} == set(map(name_of, files))
    assert len(HELD) == len(readings.RATES_CASES)


@pytest.mark.parametrize('number', range(len(HELD)), ids=NAMES)
def test_a_file_gives_the_rates_that_it_gave(number):
    read = readings.rates(*readings.RATES_CASES[number])
    # plain states of Concurrences have had rates only since: the file does not speak of them
    held = [(state['path'], state['state']) for state in HELD[number]['states']]
    since = [state for state in read['states'] if (state['path'], state['state']) not in held]
    assert not any(state['failures'] or state['successes'] for state in since)
    read['states'] = [state for state in read['states'] if state not in since]
    assert not list(lacking(HELD[number], read))


@pytest.mark.parametrize('case', HELD, ids=NAMES)
def test_the_file_has_failures_in_it(case):
    assert any(state['failures'] for state in case['states'])


@pytest.mark.parametrize('name, settings', KINDS)
def test_a_machine_goes_on_with_the_file_in_its_settings(name, settings, tmp_path):
    path = tmp_path / 'rates.json'
    shutil.copy(str(RATES / (name + '.json')), str(path))
    before = states_in(path)
    machine = product.OracleContainer.wrap(
        product.machine('fetch'), settings=dict(settings, rates_file=str(path))
    )
    assert machine.execute() == 'succeeded'
    after = states_in(path)
    assert count(after, 'failures') == count(before, 'failures')
    assert count(after, 'successes') == {
        label: successes + 1 for label, successes in count(before, 'successes').items()
    }


@pytest.mark.parametrize(
    'name, script, settings',
    [
        ('window', 'fetch', {}),
        ('exponential', 'fetch', {'estimator': 'exponential'}),
        ('window_nested', 'kitchen', {}),
    ],
)
def test_a_file_is_written_as_it_was(name, script, settings, tmp_path):
    held, path = RATES / (name + '.json'), tmp_path / 'rates.json'
    shutil.copy(str(held), str(path))
    machine = product.OracleContainer.wrap(product.machine(script), settings=settings)
    machine.load_rates(str(path))
    path.unlink()
    machine.save_rates(str(path))
    assert not list(lacking(json.loads(held.read_text()), json.loads(path.read_text())))
