"""The policies that go by no rates, against the table of doc/policies.md and in machines."""

import itertools
import os
import threading

import pytest
from machines import (
    FakeExpert,
    FakeWaiting,
    Scripted,
    Watched,
    chain_of,
    in_thread,
    supersede,
    watched,
)

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.decision import policies
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policies import POLICIES, policy_named
from smach_oracle.oracle.decision.policy import Action, Past, Preconditions, Situation
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.settings.settings import Settings

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
BASELINES = sorted(policy.name for policy in policies.BASELINES)
NEVER_ASK = ('restart', 'retry', 'step_back')
FAILS = ['aborted'] * 20


def table_of_the_page():
    """{(policy, recoveries before): action} as doc/policies.md has it."""
    with open(os.path.join(ROOT, 'doc', 'policies.md'), encoding='utf-8') as page:
        rows = [
            [cell.strip() for cell in line.strip().strip('|').split('|')]
            for line in page
            if line.startswith('|')
        ]
    begin = next(index for index, row in enumerate(rows) if row[0] == 'recoveries before')
    names = rows[begin][1:]
    body = itertools.takewhile(lambda row: row[0].isdigit(), rows[begin + 2 :])
    return {
        (name, int(row[0])): action.replace(' ', '_')
        for row in body
        for name, action in zip(names, row[1:])
    }


TABLE = table_of_the_page()


def failing(policy, *more, fails=FAILS, **settings):
    """A chain A, B, C whose B fails; waits take no time."""
    machine = watched(
        Scripted(),
        Scripted(*fails),
        Scripted(),
        *more,
        settings={'policy': policy, 'max_recoveries': 50, **settings},
    )
    oracle_of(machine.machine).waiting = FakeWaiting()
    return machine


def situation(recoveries=0, restarts=0, **past):
    return Situation(
        FailureClass.LOW, Preconditions.NONE, False, Past(recoveries, restarts, **past)
    )


def test_the_page_covers_each_baseline_but_the_one_that_draws():
    assert {name for name, _ in TABLE} == set(BASELINES) - {'random'}
    assert {count for _, count in TABLE} == set(range(5))


@pytest.mark.parametrize('cell', sorted(TABLE), ids=str)
def test_a_baseline_decides_as_the_page_says(cell):
    name, count = cell
    assert POLICIES[name].decide(situation(count, count)).value == TABLE[cell]


@pytest.mark.parametrize('name', sorted({name for name, _ in TABLE}))
def test_a_machine_does_what_the_page_says_until_it_gives_up_or_asks(name):
    expected = []
    for count in range(5):
        expected.append(TABLE[name, count])
        if expected[-1] in ('ask', 'give_up'):
            break
    expert = FakeExpert(supersede('ok'))
    machine = failing(name)
    machine.machine.expert = expert
    outcome = machine.run()
    assert [action for action, _ in machine.decisions()] == expected
    assert outcome == ('done' if expected[-1] == 'ask' else 'aborted')
    assert len(expert.questions) == (expected[-1] == 'ask')


@pytest.mark.parametrize('name', BASELINES)
def test_a_baseline_runs_no_preconditions(name):
    machine = failing(name, states={'B': {'preconditions': [lambda ud: True]}}, on_no_answer='stop')
    machine.run()
    assert machine.decisions() and not machine.of(EventKind.PRECONDITION_START)


def test_step_back_leads_to_the_state_that_succeeded_last():
    machine = failing('step_back')
    machine.run()
    assert machine.visits() == ['A', 'B', 'A', 'B', 'A', 'B']


def test_retry_counts_for_each_state_alone():
    machine = watched(
        Scripted('aborted', 'aborted'), Scripted('aborted', 'aborted'), settings={'policy': 'retry'}
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'A', 'A', 'B', 'B', 'B']


# -- parameters


@pytest.mark.parametrize(
    'given, name, parameters',
    [
        ('ladder', 'ladder', {}),
        ({'name': 'ladder'}, 'ladder', {}),
        ({'name': 'ladder', 'wait_s': 5}, 'ladder', {}),  # as the default
        ({'name': 'ladder', 'wait_s': 2, 'tries': 3}, 'ladder', {'wait_s': 2.0, 'tries': 3}),
        ({'name': 'restart', 'times': 1}, 'restart', {'times': 1}),
    ],
)
def test_a_policy_is_set_by_its_name_or_with_parameters(given, name, parameters):
    settings = Settings.from_dict({'policy': given})
    assert (settings.policy, settings.policy_parameters) == (name, parameters)


@pytest.mark.parametrize(
    'given, match',
    [
        ({'times': 2}, 'policy: .*with its name'),
        ({'name': 'guess'}, 'policy.name: .*always_ask'),
        ({'name': 'prose', 'times': 2}, 'policy.times: .*one of the keys name'),
        ({'name': 'restart', 'wait_s': 2}, 'policy.wait_s: .*name, times'),
        ({'name': 'restart', 'times': -1}, 'policy.times: .*whole number from 0'),
        ({'name': 'restart', 'times': 1.5}, 'policy.times: .*whole number'),
        ({'name': 'ladder', 'wait_s': float('inf')}, 'policy.wait_s: .*3600'),
    ],
)
def test_what_is_wrong_with_a_policy_is_told_with_its_key(given, match):
    with pytest.raises(SettingsError, match=match):
        Settings.from_dict({'policy': given})


def test_parameters_are_told_at_the_start_of_a_trial_where_they_are_not_the_defaults():
    machine = failing({'name': 'ladder', 'wait_s': 2, 'tries': 1})
    machine.run()
    told = machine.of(EventKind.TRIAL_START)[0].data['settings']
    assert (told['policy'], told['policy.wait_s'], 'policy.tries' in told) == ('ladder', 2.0, False)


@pytest.mark.parametrize('policy, goes_by_ways', [('retry', False), ('escalating', True)])
def test_costs_are_told_at_the_start_of_a_trial_whose_policy_goes_by_them(policy, goes_by_ways):
    machine = failing(policy)
    machine.run()
    told = machine.of(EventKind.TRIAL_START)[0].data['settings']
    of_all = {'memory', 'estimator', 'prior', 'moderate_from', 'high_from', 'max_recoveries'}
    costs = {key for key in told if key.startswith('cost.')}
    assert told.keys() - costs == {'policy', *of_all}
    assert bool(costs) == goes_by_ways


@pytest.mark.parametrize('name', sorted(POLICIES))
def test_a_policy_does_by_itself_as_with_its_default_parameters(name):
    defaults = POLICIES[name].parameters
    assert vars(policy_named(name, defaults)) == vars(policy_named(name))
    settings = Settings.from_dict({'policy': dict(defaults, name=name)})
    assert not settings.policy_parameters


@pytest.mark.parametrize('times', [0, 1, 4])
def test_times_is_how_often(times):
    machine = failing({'name': 'retry', 'times': times})
    assert machine.run() == 'aborted'
    assert machine.visits() == ['A'] + ['B'] * (1 + times)


# -- those that ask nobody


@pytest.mark.parametrize('name', NEVER_ASK)
@pytest.mark.parametrize(
    'settings',
    [{'max_recoveries': 0}, {'budget': {'recoveries': 0}}, {'on_retry': 'confirm'}],
    ids=str,
)
def test_who_asks_nobody_gives_up_where_others_ask(name, settings):
    expert = FakeExpert(supersede('ok'))
    machine = failing(name, **settings)
    machine.machine.expert = expert
    assert machine.run() == 'aborted'
    assert machine.decisions() == [('give_up', '')]
    assert machine.visits() == ['A', 'B'] and not expert.questions
    assert machine.of(EventKind.DECISION)[0].text.endswith('giving up, and asking nobody')


@pytest.mark.parametrize('name', NEVER_ASK)
def test_no_level_above_recovers_from_what_was_given_up(name):
    inner = chain_of(Scripted(*FAILS))
    top = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('IN', inner, {'done': 'done'})
    machine = Watched(top, settings={'policy': {'name': name, 'times': 1}, 'escalate': True})
    assert machine.run() == 'aborted'
    assert len(machine.decisions()) == 2
    assert inner._states['A'].runs == 2


def test_an_exception_that_is_given_up_is_raised():
    machine = watched(
        Scripted(*[KeyError('no')] * 3), settings={'policy': {'name': 'retry', 'times': 1}}
    )
    with pytest.raises(smach.InvalidUserCodeError, match='no'):
        machine.run()


# -- ladder


def test_the_ladder_waits_through_the_clock_that_was_handed_in():
    machine = failing('ladder', fails=['aborted', 'aborted'])
    waiting = oracle_of(machine.machine).waiting = FakeWaiting()
    assert machine.run() == 'done'
    assert waiting.waited == [(5.0, 'waiting')]
    assert machine.visits() == ['A', 'B', 'B', 'A', 'B', 'C']
    assert 'in 5 s trying it again' in machine.of(EventKind.DECISION)[0].text


def test_a_preempt_ends_the_wait():
    """By the machine's own clock: the wait is an hour."""
    waiting = threading.Event()
    machine = watched(Scripted('aborted'), settings={'policy': {'name': 'ladder', 'wait_s': 3600}})
    machine.machine.events.observers.append(
        lambda event: waiting.set() if event.kind == EventKind.DECISION else None
    )
    call = in_thread(machine.run)
    assert waiting.wait(20)
    machine.machine.request_preempt()
    assert call.result() == 'preempted'
    assert machine.visits() == ['A']


def test_a_preempt_while_time_passes_elsewhere_ends_the_recovery():
    machine = failing('ladder')
    oracle_of(machine.machine).waiting = FakeWaiting(machine.machine.request_preempt)
    assert machine.run() == 'preempted'
    assert machine.visits() == ['A', 'B']


def test_the_last_minute_of_a_trial_ends_the_wait():
    machine = watched(
        Scripted('aborted'),
        settings={'policy': {'name': 'ladder', 'wait_s': 3600}, 'budget': {'minutes': 0.002}},
    )
    assert in_thread(machine.run).result() == 'aborted'
    assert machine.visits() == ['A']


# -- random


def drawn(seed, trials=1):
    machine = failing(
        {'name': 'random', 'seed': seed}, on_no_answer={'goto': 'B'}, fails=['aborted'] * 2000
    )
    machine.machine.execute()
    for _ in range(trials - 1):
        machine.machine.execute()
    return [event.outcome for event in machine.of(EventKind.DECISION)]


def test_random_draws_alike_under_one_seed_and_otherwise_under_another():
    one = drawn(3)
    assert one == drawn(3)
    assert len({tuple(drawn(seed)) for seed in range(8)}) == 8
    assert set(itertools.chain(*(drawn(seed) for seed in range(8)))) == {
        'revisit',
        'step_back',
        'ask',
    }


def test_the_second_trial_draws_as_the_first_one_under_the_next_seed():
    first = drawn(7)
    assert drawn(7, trials=2) == first + drawn(8)


def test_each_action_is_as_likely():
    policy = policy_named('random')
    counts = dict.fromkeys(policy.actions, 0)
    for number in range(3000):
        counts[policy.decide(situation(place='TOP/B {}'.format(number)))] += 1
    assert min(counts.values()) > 900


def test_random_is_asked_what_it_may_do():
    assert POLICIES['random'].may_do(situation()) == (Action.REVISIT, Action.STEP_BACK, Action.ASK)


def test_a_wrapped_machine_may_be_given_a_baseline_in_code():
    machine = OracleContainer.wrap(chain_of(Scripted('aborted')), settings={'policy': 'retry'})
    assert machine.execute() == 'done'
