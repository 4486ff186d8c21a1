"""What a person chooses from, beside the menu that a policy chooses from: told alike."""

import threading

import pytest
from fake_clock import FakeClock
from machines import FakeExpert, Gate, Scripted, Watched, give_up, supersede, watched
from test_still_running import SOON, letting_go
from test_ways import FAILS, at_once, failing

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.records.events import EventKind, FailureKind

ENDS = ['done', 'aborted', 'preempted']


def asked_about(count, policy='always_ask', **more):
    """Return the first question about the last state of a chain, and the machine."""
    expert = FakeExpert(supersede('ok'))
    machine = failing(count, expert=expert, settings={'policy': policy, **more})
    assert machine.run() == 'done'
    return expert.questions[0], machine


def ways_of(question):
    return {choice.state: choice.way for choice in question.choices}


@pytest.mark.parametrize('policy', ['always_ask', 'prose', 'escalating'])
def test_a_choice_has_the_key_of_the_way_of_the_menu_that_leads_there(policy):
    question, _ = asked_about(5, policy)
    assert ways_of(question) == {
        'A': 'from A',
        'B': '',  # 3 states back, which no way is: a person may choose it
        'C': 'from C',
        'D': 'from D',
        'E': 'again',
    }


def test_a_choice_takes_as_long_as_the_way_that_leads_there():
    fake_clock = FakeClock()  # it stands from the decision on, until the question is made
    expert = FakeExpert(supersede('ok'))
    fails = [lambda state, ud: fake_clock.advance(30.0) or 'aborted'] * len(FAILS)
    machine = failing(5, fails=fails, expert=expert, settings={'policy': 'escalating'})
    oracle_of(machine.machine).count_work_by(fake_clock)
    assert machine.run() == 'done'
    (question,) = expert.questions
    menu = machine.of(EventKind.DECISION)[-1].data['menu']
    for choice in question.choices:
        minutes = [way['minutes'] for way in menu if way['target'] == choice.state]
        assert choice.minutes == pytest.approx(minutes[0] if minutes else 0.0)
        assert bool(choice.minutes) == bool(choice.way)


def test_the_ways_stay_those_of_the_streak_while_it_goes_on():
    # it has stepped back to C and to A meanwhile, so that D, which was visited last, is 1 back
    question, machine = asked_about(5, 'escalating')
    assert set(machine.of(EventKind.DECISION)[-1].data['streak']['tried']) <= set(
        ways_of(question).values()
    ) | {'wait 10 s'}


def test_a_state_that_was_not_visited_is_a_choice_and_no_way():
    expert = FakeExpert(supersede('ok'))
    machine = failing(5, at=2, expert=expert, settings={'policy': 'always_ask'})
    assert machine.run() == 'done'
    assert ways_of(expert.questions[0]) == {
        'A': 'from A',
        'B': 'from B',
        'C': 'again',
        'D': '',
        'E': '',
    }


def test_the_places_of_other_containers_have_the_keys_of_the_menu_too():
    get, put = smach.StateMachine(outcomes=ENDS), smach.StateMachine(outcomes=ENDS)
    with get:
        smach.StateMachine.add('HOME', Scripted(), {'ok': 'GRASP'})
        smach.StateMachine.add('GRASP', Scripted(*FAILS), {'ok': 'done'})
    with put:
        smach.StateMachine.add('DROP', Scripted(), {'ok': 'done'})
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('HOME', Scripted(), {'ok': 'GET'})
        smach.StateMachine.add('GET', get, {'done': 'PUT'})
        smach.StateMachine.add('PUT', put, {'done': 'done'})
    expert = FakeExpert(supersede('ok'))
    machine = at_once(Watched(top, settings={'policy': 'always_ask'}, expert=expert))
    assert machine.run() == 'done'
    found = {
        '/'.join((each.container.strip('/'), each.state)): each.way
        for each in expert.questions[0].choices
        if each.way
    }
    root = expert.questions[0].container_path.split('/')[0]
    assert found == {
        '/HOME': 'from HOME',
        '/GRASP': 'again',
        root + '/HOME': 'from /HOME',
    }


@pytest.mark.parametrize('on_retry', ['confirm', 'never'])
def test_what_would_be_repeated_blocks_the_ways_and_is_said_of_the_choices(on_retry):
    states = {'C': {'on_retry': on_retry}}
    question, machine = asked_about(5, 'escalating', states=states)
    menu = {way['target']: way for way in machine.of(EventKind.DECISION)[-1].data['menu']}
    repeating = {choice.state for choice in question.choices if choice.repeats}
    assert repeating == {'A', 'B', 'C'}
    assert {'A', 'C'} == {target for target, way in menu.items() if way['blocked']}
    for choice in question.choices:
        assert all(name in menu[choice.state]['blocked'] for name in choice.repeats if choice.way)


def test_what_cannot_be_entered_is_told_alike_of_ways_and_choices():
    let_go = threading.Event()
    expert = FakeExpert(supersede('ok'))
    machine = failing(
        3,
        at=1,
        fails=[lambda state, ud: 'ok' if let_go.wait(20) else 'aborted'],  # deaf to a preempt
        expert=expert,
        settings={'states': {'B': {'time_limit_s': 0.1, 'grace_period_s': 0.1}}},
    )
    assert machine.run() == 'done'
    let_go.set()
    (question,) = expert.questions
    menu = machine.of(EventKind.DECISION)[0].data['menu']
    (again,) = [way for way in menu if way['kind'] == 'again']
    choice = next(each for each in question.choices if each.state == 'B')
    assert choice.way == 'again'
    assert choice.blocked and again['blocked'] == 'B ' + choice.blocked


def test_a_state_that_still_runs_has_no_ways_yet():
    gate = Gate()
    expert = FakeExpert(letting_go(gate, None))
    machine = failing(
        3, at=1, fails=['aborted', gate], expert=expert, settings=dict(SOON, policy='prose')
    )
    assert machine.run() == 'done'
    (question,) = expert.questions
    assert question.failure_kind is FailureKind.STILL_RUNNING
    assert set(ways_of(question).values()) == {''}


def test_a_choice_of_the_failed_state_tells_how_often_it_was_entered_again():
    expert = FakeExpert(give_up())
    settings = {'policy': 'escalating', 'max_recoveries': 1}
    watched(Scripted('aborted', 'aborted'), settings=settings, expert=expert).run()
    (question,) = expert.questions
    told = {each.state: (each.tried, each.helped) for each in question.choices}
    assert told['A'] == (1, 0)
