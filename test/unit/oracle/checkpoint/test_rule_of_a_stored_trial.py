"""A stored trial names the rule by which failures are told. It goes on by the rule that is set."""

import sqlite3

import pytest
from killed_machines import KilledMachine
from killed_trees import flat, make

from smach_oracle.oracle.settings.failure_rule import RULE


def told_of_rules(told):
    return [text for text in told['log'] if 'failures are told' in text]


def test_a_trial_that_goes_on_by_another_rule_says_so(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat, failing_outcomes=['aborted'])
    killed.run(kill_at=12)
    told = killed.run(failing_outcomes=None)
    assert told['outcome'] == 'succeeded' and told['events'][0][0] == 'RESUMED'
    (text,) = told_of_rules(told)
    assert 'by name, version 1 from now on' in text and 'by a list: aborted before' in text


def test_once_it_has_gone_on_the_new_rule_is_the_stored_one(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat, failing_outcomes=['aborted'])
    killed.run(kill_at=12)
    killed.run(kill_at=6, failing_outcomes=None)
    told = killed.run(failing_outcomes=None)
    assert told['events'][0][0] == 'RESUMED' and not told_of_rules(told)


@pytest.mark.parametrize('settings', [{}, {'failing_outcomes': ['aborted']}])
def test_nothing_is_said_where_the_rule_is_the_same(tmp_path, settings):
    killed = KilledMachine(make(tmp_path / 'killed'), flat, **settings)
    killed.run(kill_at=12)
    told = killed.run()
    assert told['events'][0][0] == 'RESUMED' and not told_of_rules(told)


def test_a_store_of_an_earlier_version_goes_on_and_had_the_rule_of_that(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=12)
    with sqlite3.connect(killed.store) as store:
        assert store.execute('DELETE FROM facts WHERE name = ?', (RULE,)).rowcount == 1
    store.close()
    told = killed.run()
    assert told['outcome'] == 'succeeded'
    (text,) = told_of_rules(told)
    assert 'aborted, failed, failure, error before' in text
