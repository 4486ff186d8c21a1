"""The policies against the tables of doc/policies.md, and what continuous and stepping back mean in
a machine.
"""

import itertools
import json
import os
import subprocess
import sys
import threading

import pytest
from machines import FakeExpert, Scripted, Watched, chain_of, goto, supersede, watched

import smach
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policies import POLICIES, policy_named
from smach_oracle.oracle.decision.policy import (
    FailureContext,
    Menu,
    Past,
    Preconditions,
    Situation,
    draws_of,
)
from smach_oracle.oracle.decision.ways import Way, WayKind
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.history import History
from smach_oracle.oracle.records.visits import Visit, VisitResult

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
PAPER = ('algorithm1', 'prose')
CLASSES = (FailureClass.LOW, FailureClass.MODERATE, FailureClass.HIGH)


def table_of_the_page():
    """{(policy, class, preconditions, continuous): action} as doc/policies.md has it."""
    with open(os.path.join(ROOT, 'doc', 'policies.md'), encoding='utf-8') as page:
        rows = [
            [cell.strip() for cell in line.strip().strip('|').split('|')]
            for line in page
            if line.startswith('|')
        ]
    begin = next(
        index
        for index, row in enumerate(rows)
        if row[:3] == ['class', 'preconditions', 'continuous']
    )
    names = rows[begin][3:]
    table = {}
    for row in itertools.takewhile(lambda row: len(row) == len(rows[begin]), rows[begin + 2 :]):
        for name, action in zip(names, row[3:]):
            table[name, row[0], row[1], row[2]] = action
    return table


TABLE = table_of_the_page()


def test_the_page_covers_every_cell_of_every_policy():
    cells = set(
        itertools.product(
            PAPER, ('LOW', 'MODERATE', 'HIGH'), ('none', 'met', 'not met'), ('no', 'yes')
        )
    )
    assert set(TABLE) == cells


@pytest.mark.parametrize('cell', sorted(TABLE), ids=' '.join)
def test_the_policy_decides_as_the_page_says(cell):
    name, failure_class, preconditions, continuous = cell
    situation = Situation(
        FailureClass[failure_class], Preconditions(preconditions), continuous == 'yes'
    )
    assert POLICIES[name].decide(situation).value.replace('_', ' ') == TABLE[cell]


def machine_in(cell):
    """A machine whose state B fails in the situation of a cell, as the last of its failures.

    Where that is to be a continuous one B fails before, too, and whatever the policy decides then
    leads to B again. The expert supersedes what is asked about the last failure.
    """
    name, failure_class, preconditions, continuous = cell
    again = continuous == 'yes'
    prior = {'LOW': 0.1, 'MODERATE': 0.5, 'HIGH': 0.95}[failure_class]
    lists = {'none': [], 'met': [lambda ud: True], 'not met': [lambda ud: False]}
    answers = [supersede('ok'), supersede('ok')]
    if again and TABLE[name, failure_class, preconditions, 'no'] == 'ask':
        answers.insert(0, goto('B'))
    failing_state = Scripted(*['aborted'] * (1 + again))
    return watched(
        Scripted(),
        failing_state,
        Scripted(),
        expert=FakeExpert(*answers),
        settings={
            'policy': name,
            'memory': 100,
            'states': {'B': {'prior': prior, 'preconditions': lists[preconditions]}},
        },
    )


@pytest.mark.parametrize(
    'cell', sorted(cell for cell in TABLE if cell[1] != 'HIGH' or cell[2] == 'none'), ids=' '.join
)
def test_a_machine_does_what_the_page_says(cell):
    machine = machine_in(cell)
    machine.run()
    action = TABLE[cell].replace(' ', '_')
    target = {'revisit': 'B', 'step_back': 'A', 'ask': ''}[action]
    last = 1 if cell[3] == 'yes' else 0
    assert len(machine.decisions()) == last + 1
    assert machine.decisions()[last] == (action, target)
    assert machine.of(EventKind.DECISION)[last].continuous is (cell[3] == 'yes')
    assert [event.target for event in machine.of(EventKind.JUMP)][last] == (target or 'C')


@pytest.mark.parametrize('name', PAPER)
def test_nothing_is_run_for_a_state_that_fails_mostly(name):
    machine = machine_in((name, 'HIGH', 'met', 'no'))
    assert machine.run() == 'done'
    assert not machine.of(EventKind.PRECONDITION_START)
    assert machine.decisions() == [('ask', '')]


def failing(policy, *states, **settings):
    return watched(*states, settings=dict(settings, policy=policy, max_recoveries=50, memory=1000))


def test_algorithm1_steps_back_to_the_latest_visit_without_preconditions():
    machine = Watched(
        chain_of(Scripted(), Scripted(), Scripted('aborted')),
        settings={'policy': 'algorithm1', 'states': {'B': {'preconditions': [bool]}}},
    )
    machine.run()
    assert machine.decisions() == [('step_back', 'A')]


def test_algorithm1_counts_earlier_visits_of_the_failed_state_itself():
    machine = failing('algorithm1', Scripted('aborted', 'aborted'), Scripted())
    machine.run()
    assert machine.decisions() == [('step_back', 'A'), ('step_back', 'A')]
    machine = failing('algorithm1', Scripted(), Scripted('aborted'), Scripted('aborted'))
    machine.run()
    assert machine.decisions() == [('step_back', 'A'), ('step_back', 'B')]


def test_algorithm1_steps_back_to_the_initial_state_where_no_visit_was_without_preconditions():
    machine = Watched(
        chain_of(Scripted(), Scripted('aborted')),
        settings={
            'policy': 'algorithm1',
            'states': {'A': {'preconditions': [bool]}, 'B': {'preconditions': [lambda ud: True]}},
        },
    )
    machine.run()
    assert machine.decisions() == [('step_back', 'A')]


def test_algorithm1_calls_a_failure_continuous_though_the_state_succeeded_in_between():
    def run(policy):
        a, b = Scripted('aborted', 'ok', 'aborted'), Scripted('back', outcomes=('ok', 'back'))
        machine = Watched(
            loop_of(a, b), settings={'policy': policy, 'states': {'A': {'prior': 0.1}}}
        )
        machine.run()
        return [event.continuous for event in machine.of(EventKind.FAILURE)]

    assert run('algorithm1') == [False, True]
    assert run('prose') == [False, False]


def loop_of(a, b):
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', a, {'ok': 'B'})
        smach.StateMachine.add('B', b, {'ok': 'done', 'back': 'A'})
    return machine


def test_a_failure_of_another_state_in_between_ends_continuity():
    machine = failing(
        'prose', Scripted(), Scripted('aborted', 'ok', 'aborted'), Scripted('aborted', 'ok', 'ok')
    )
    machine.run()
    assert [event.continuous for event in machine.of(EventKind.FAILURE)][:2] == [False, False]


def test_prose_steps_back_to_the_state_that_succeeded_last_before_the_failing_began():
    machine = failing('prose', Scripted(), Scripted(), Scripted('aborted', 'aborted', 'aborted'))
    machine.run()
    assert machine.decisions() == [('revisit', 'C'), ('step_back', 'B'), ('step_back', 'B')]
    assert machine.visits() == ['A', 'B', 'C', 'C', 'B', 'C', 'B', 'C']


def test_prose_keeps_its_goal_while_the_state_keeps_failing():
    """From the goal another way may lead back: what succeeds on it is no goal."""
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add(
            'A', Scripted('ok', 'way', 'way', outcomes=('ok', 'way')), {'ok': 'S', 'way': 'X'}
        )
        smach.StateMachine.add('X', Scripted(outcomes=('ok',)), {'ok': 'S'})
        smach.StateMachine.add('S', Scripted('aborted', 'aborted', 'aborted'), {'ok': 'done'})
    machine = Watched(machine, settings={'policy': 'prose', 'memory': 1000})
    machine.run()
    assert machine.decisions() == [('revisit', 'S'), ('step_back', 'A'), ('step_back', 'A')]


def test_prose_steps_back_to_a_new_goal_once_the_state_has_succeeded():
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Scripted(), {'ok': 'B'})
        smach.StateMachine.add('B', Scripted('aborted', 'ok', 'aborted'), {'ok': 'C'})
        smach.StateMachine.add(
            'C', Scripted('back', outcomes=('ok', 'back')), {'ok': 'done', 'back': 'B'}
        )
    machine = Watched(
        machine,
        settings={
            'policy': 'prose',
            'memory': 1000,
            'states': {'B': {'preconditions': [lambda ud: False]}},
        },
    )
    machine.run()
    assert machine.decisions() == [('step_back', 'A'), ('step_back', 'C')]


def test_prose_steps_back_to_the_initial_state_where_nothing_succeeded_before():
    machine = failing('prose', Scripted('aborted', 'aborted'), Scripted())
    machine.run()
    assert machine.decisions() == [('revisit', 'A'), ('step_back', 'A')]


def machine_of(*states, outcomes=('done', 'aborted', 'preempted')):
    """A machine of (label, state, transitions) triples."""
    machine = smach.StateMachine(outcomes=list(outcomes))
    with machine:
        for label, state, transitions in states:
            smach.StateMachine.add(label, state, transitions)
    return machine


def continuous_failures(machine, label):
    return [event.continuous for event in machine.of(EventKind.FAILURE) if event.state == label]


@pytest.mark.parametrize('policy', PAPER)
def test_a_failure_in_a_sibling_of_a_concurrence_breaks_no_continuity(policy):
    """The first example of the page."""
    reached_twice, driven = threading.Event(), threading.Event()

    def reach_again(state, ud):
        reached_twice.set()
        assert driven.wait(20)
        return 'aborted'

    def drive(state, ud):
        assert reached_twice.wait(20)
        return 'aborted'

    def drive_again(state, ud):
        driven.set()
        return 'ok'

    both = smach.Concurrence(outcomes=['done'], default_outcome='done')
    with both:
        smach.Concurrence.add(
            'ARM', machine_of(('REACH', Scripted('aborted', reach_again), {'ok': 'done'}))
        )
        smach.Concurrence.add(
            'BASE', machine_of(('DRIVE', Scripted(drive, drive_again), {'ok': 'done'}))
        )
    machine = Watched(machine_of(('BOTH', both, {'done': 'done'})), settings={'policy': policy})
    assert machine.run() == 'done'
    assert [event.state for event in machine.of(EventKind.FAILURE)] == ['REACH', 'DRIVE', 'REACH']
    assert continuous_failures(machine, 'REACH') == [False, True]
    assert continuous_failures(machine, 'DRIVE') == [False]


@pytest.mark.parametrize('policy', PAPER)
def test_a_failure_of_the_machine_around_breaks_no_continuity(policy):
    arm = machine_of(('REACH', Scripted('aborted', 'aborted', 'aborted'), {'ok': 'done'}))
    machine = Watched(
        machine_of(('ARM', arm, {'done': 'done'})),
        settings={
            'policy': policy,
            'memory': 1000,
            'escalate': True,
            'states': {'REACH': {'prior': 0.5}},
        },
    )
    machine.run()
    assert [event.state for event in machine.of(EventKind.FAILURE)] == [
        'REACH',
        'REACH',
        'ARM',
        'REACH',
        'ARM',
    ]
    assert continuous_failures(machine, 'REACH') == [False, True, True]


def test_prose_keeps_the_initial_state_as_its_goal_whatever_succeeds_while_the_state_fails():
    machine = Watched(
        machine_of(
            (
                'S',
                Scripted('lost', 'aborted', 'aborted', outcomes=('ok', 'lost', 'aborted')),
                {'ok': 'done', 'lost': 'SEARCH'},
            ),
            ('SEARCH', Scripted(outcomes=('ok',)), {'ok': 'S'}),
        ),
        settings={
            'policy': 'prose',
            'memory': 1000,
            'states': {'S': {'failure_outcomes': ['lost']}},
        },
    )
    assert machine.run() == 'done'
    assert continuous_failures(machine, 'S') == [False, True, True]
    assert machine.decisions() == [('step_back', 'S'), ('step_back', 'S')]


def test_prose_looks_its_goal_up_anew_where_the_container_is_executed_again():
    history = History(10)

    def visit(state, result=VisitResult.SUCCESS):
        history.visited(Visit(state, '', result), False)

    def fails(state):
        goal = history.failure_context(state, 'INIT', 0).succeeded_before
        history.failed(state, 0)
        visit(state, VisitResult.FAILURE)
        return goal

    history.begin_trial()
    visit('A')
    assert (fails('S'), fails('S')) == ('A', 'A')
    history.begin_execution()
    assert history.failing_since('S', 0), 'it is the same trial'
    visit('B')
    first = fails('S')
    visit('C')
    assert (first, fails('S')) == ('B', 'B')
    history.begin_execution()
    assert fails('S') is None
    visit('D')
    assert fails('S') is None


def test_a_preempted_or_failed_visit_is_no_goal_of_a_step_back():
    context = FailureContext('S', 'INIT', True, True, None, None)
    assert POLICIES['prose'].step_back_target(context) == 'INIT'
    assert POLICIES['algorithm1'].step_back_target(context) == 'INIT'


def test_continuity_ends_with_the_trial():
    machine = failing('prose', Scripted('aborted', 'ok', 'aborted'), Scripted())
    machine.run()
    machine.run()
    assert [event.continuous for event in machine.of(EventKind.FAILURE)] == [False, False]


def test_the_class_is_that_after_the_failure_and_the_failure_event_tells_that_before():
    machine = watched(
        Scripted('aborted'), settings={'memory': 1, 'prior': 0.0, 'on_no_answer': 'give_up:done'}
    )
    machine.run()
    failure, decision = machine.of(EventKind.FAILURE, EventKind.DECISION)
    assert (failure.failure_class, failure.rate) == (FailureClass.LOW, 0.0)
    assert (decision.failure_class, decision.rate) == (FailureClass.HIGH, 1.0)


def test_an_unknown_policy_is_refused_by_name():
    with pytest.raises(SettingsError, match='policy.*guess.*algorithm1, .*prose'):
        policy_named('guess')


@pytest.mark.parametrize(
    'module',
    [
        'errors',
        'decision.policies',
        'decision.policy',
        'decision.failure_rate',
        'settings.settings',
        'settings.failing_outcomes',
        'settings.preconditions',
        'records.history',
        'records.events',
        'records.visits',
        'machine.state_record',
        'asking.question',
    ],
)
def test_the_pure_parts_need_no_smach(module):
    code = 'import sys, smach_oracle.oracle.{}; sys.exit("smach" in sys.modules)'.format(module)
    environment = dict(os.environ, PYTHONPATH=os.path.join(ROOT, 'src'))
    assert subprocess.call([sys.executable, '-c', code], env=environment) == 0


def test_a_history_goes_on_as_it_was_told():
    """S has failed, then T, which an expert takes back after the program was stopped."""
    history = History(10)
    history.visited(Visit('A', '', VisitResult.SUCCESS), False)
    for state in 'ST':
        history.failed(state, 0)
        history.visited(Visit(state, '', VisitResult.FAILURE), False)
    again = History(10)
    told = json.loads(json.dumps(history.told()))
    again.take_over(history.latest(), 3, told, lambda label: True)
    assert again.told() == history.told()
    again.supersede('T', 'ok', False)
    assert again.failure_context('S', 'INIT', 0) == history.failure_context(
        'S', 'INIT', 0
    )._replace(failed_last=True, failing_since=True)
    assert not again.context_since('S', 'INIT', 0).failed_last
    again.take_over((), 0, told, lambda label: label != 'T')
    assert not again.failing_since('S', 0), 'the latest failure is of a state that is gone'


@pytest.mark.parametrize('told', [[None, None, None, 1], [None], [None, None, None, ['S']]])
def test_a_history_that_cannot_be_read_is_refused(told):
    with pytest.raises(ValueError, match='history'):
        History(10).take_over((), 0, told, lambda label: True)


def test_what_earlier_versions_have_told_of_a_history_is_read():
    """The latest failure, and the one before it, or none."""
    history = History(10)
    told = ['S', 'A', None, ['S', 0, 'A', True], [None, 0, None, False]]
    history.take_over((), 0, told, lambda label: True)
    assert history.failing_since('S', 0)
    assert not history.context_since('S', 'INIT', 0).failed_last
    assert history.succeeded_before('S', 0) == 'A'


@pytest.mark.parametrize(
    ('name', 'spent', 'why'),
    [
        ('retry', 2, 'its 2 retries are spent'),
        ('step_back', 2, 'its 2 steps back are spent'),
        ('ladder', 4, 'its 1 retry and 3 steps back are spent'),
    ],
)
def test_a_baseline_says_why_it_ends_once_it_does(name, spent, why):
    def situation(recoveries):
        past = Past(recoveries=recoveries)
        return Situation(FailureClass.LOW, Preconditions.NONE, False, past)

    policy = policy_named(name)
    assert [policy.why(situation(before)) for before in range(spent)] == [''] * spent
    assert policy.why(situation(spent)) == why


def test_a_draw_that_is_just_the_chance_swaps_no_ways():
    drawn = draws_of(0, Past()).random()
    ways = Way(WayKind.AGAIN, 'A', minutes=1.0), Way(WayKind.STEP_BACK, 'B', 1, minutes=2.0)
    given = Situation(FailureClass.LOW, Preconditions.NONE, False, menu=Menu(ways))
    choice = policy_named('escalating', {'explore': drawn}).choose(given)
    assert choice.ways == ways and choice.chance == 1.0 - drawn
