"""A rates file names the rule by which failures were told, and another one is told of once."""

import json

from machines import Scripted, watched

from smach_oracle.oracle.settings.failure_rule import RULE

BY_NAME, LISTED = {'by_name': 1}, {'failing_outcomes': ['aborted']}


def run(path, **settings):
    machine = watched(Scripted('aborted'), settings=dict({'rates_file': str(path)}, **settings))
    machine.machine.execute()
    return machine


def rules(path):
    return json.loads(path.read_text())['failure_rules']


def said(log, level='warn'):
    return [text for found, text in log if found == level and 'failures were told' in text]


def test_the_file_names_the_rule(tmp_path, log):
    path = tmp_path / 'rates.json'
    run(path)
    assert rules(path) == {'': BY_NAME}
    run(path)
    assert not said(log) and not said(log, 'info')


def test_rates_that_were_learned_by_another_rule_stay_and_that_is_told_once(tmp_path, log):
    path = tmp_path / 'rates.json'
    run(path, failing_outcomes=['aborted'])
    assert rules(path) == {'': LISTED}
    assert run(path).rate('A').failures == 2
    (text,) = said(log)
    assert 'by a list: aborted' in text and 'by name, version 1' in text
    run(path)
    assert len(said(log)) == 1, 'now the file has the new rule'
    run(path, failing_outcomes=['aborted'])
    assert len(said(log)) == 2, 'and a list is another rule again'


def test_where_nothing_was_learned_no_rule_is_told_of(tmp_path, log):
    path = tmp_path / 'rates.json'
    run(path, failing_outcomes=['aborted'])
    content = json.loads(path.read_text())
    path.write_text(json.dumps(dict(content, containers={'': {}})))
    run(path)
    assert not said(log)


def test_a_file_of_an_earlier_version_names_none_which_is_told_once_where_it_may_differ(
    tmp_path, log
):
    path = tmp_path / 'rates.json'

    def forget_the_rule():
        content = json.loads(path.read_text())
        del content['failure_rules']
        path.write_text(json.dumps(content))

    run(path)
    forget_the_rule()
    run(path, failing_outcomes=['aborted'])  # it may be the list that was set before
    assert not said(log) and not said(log, 'info')
    forget_the_rule()
    assert run(path).rate('A').failures == 3
    assert len(said(log, 'info')) == 1 and not said(log)


def test_the_rule_goes_along_with_rates_under_a_new_name(tmp_path, log):
    path = tmp_path / 'rates.json'
    settings = {'rates_file': str(path)}
    one = watched(Scripted('aborted'), name='ONE', settings=settings)
    one.machine.execute()
    del one
    watched(Scripted(), name='OTHER', settings=settings)  # it has not run yet
    assert rules(path)['ONE'] == rules(path)['OTHER'] == BY_NAME
    assert not said(log) and not said(log, 'info')
    assert any(each == 'warn' and 'with what ONE has learned. It' in text for each, text in log)


def test_rules_that_make_no_sense_cost_nothing(tmp_path, log):
    path = tmp_path / 'rates.json'
    run(path)
    for wrong in (5, [], {'': 7}, {'': {'by_name': 'x'}}):
        content = dict(json.loads(path.read_text()), failure_rules=wrong)
        path.write_text(json.dumps(content))
        run(path)
        assert rules(path) == {'': BY_NAME}
    assert json.loads(path.read_text())['containers']['']['A']['failures'] == 5
    assert RULE not in json.loads(path.read_text())
