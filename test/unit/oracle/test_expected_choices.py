"""What a question says is to be expected of each choice, and which one it recommends."""

import threading

from machines import FakeExpert, FakeWaiting, Scripted, goto, supersede, watched
from waiting import wait_for

from smach_oracle.oracle import oracle_of

FAILS = ['aborted'] * 30


def asking(*answers, fails=FAILS, count=3, **settings):
    """A chain of states, the last of which fails, and which asks at once after what it knows."""
    expert = FakeExpert(*answers)
    states = [Scripted() for _ in range(count)]
    states[-1] = Scripted(*fails)
    machine = watched(
        *states,
        settings={'policy': 'escalating', 'max_recoveries': 0, **settings},
        expert=expert,
    )
    return machine, expert


def choices(question):
    return {each.state: each for each in question.choices}


def test_nothing_is_expected_of_what_was_never_tried():
    machine, expert = asking(supersede('ok'))
    assert machine.run() == 'done'
    assert all(
        (each.helped, each.tried, each.helped_s, each.recommended) == (0, 0, 0.0, '')
        for each in expert.questions[0].choices
    )


def test_a_choice_says_how_often_going_there_has_helped():
    answers = goto('C'), goto('B'), goto('C'), goto('B'), supersede('ok')
    machine, expert = asking(*answers, fails=['aborted', 'aborted', 'ok'] * 2 + FAILS)
    for _ in range(3):
        assert machine.run() == 'done'
    told = choices(expert.questions[-1])
    assert (told['B'].helped, told['B'].tried) == (2, 2)
    assert (told['C'].helped, told['C'].tried) == (0, 2)
    assert told['A'].tried == 0
    assert {label: each.recommended for label, each in told.items() if each.recommended} == {
        'B': 'it has helped 2 of 2 times after such a failure'
    }


def test_what_helped_after_another_kind_of_failure_counts_where_nothing_else_is_known():
    b = Scripted('lost', 'ok', 'lost', 'ok', 'failed', outcomes=('ok', 'lost', 'failed'))
    expert = FakeExpert(goto('A'), goto('A'), supersede('ok'))
    machine = watched(
        Scripted(),
        b,
        outcomes=['done', 'lost', 'failed', 'aborted', 'preempted'],
        settings={'policy': 'escalating', 'max_recoveries': 0},
        expert=expert,
    )
    for _ in range(3):
        assert machine.run() == 'done'
    assert choices(expert.questions[-1])['A'].tried == 2


def test_one_time_recommends_nothing():
    machine, expert = asking(goto('B'), supersede('ok'), fails=['aborted', 'ok', *FAILS])
    for _ in range(2):
        assert machine.run() == 'done'
    told = choices(expert.questions[-1])
    assert told['B'].tried == 1 and not told['B'].recommended


def test_what_repeats_a_state_that_is_not_to_be_repeated_is_not_recommended():
    machine, expert = asking(
        goto('B'),
        goto('B'),
        supersede('ok'),
        fails=['aborted', 'ok'] * 2 + FAILS,
        states={'B': {'on_retry': 'confirm'}},
    )
    for _ in range(3):
        assert machine.run() == 'done'
    told = choices(expert.questions[-1])
    assert told['B'].helped == 2 and told['B'].repeats and not told['B'].recommended


def test_what_was_in_vain_a_moment_ago_is_not_recommended():
    """Going back to A has helped twice, and has not helped this time."""
    fails = ['aborted', 'aborted', 'aborted', 'ok'] * 2 + FAILS
    machine, expert = asking(supersede('ok'), fails=fails, count=2, max_recoveries=50)
    oracle_of(machine.machine).waiting = FakeWaiting()
    for _ in range(3):
        assert machine.run() == 'done'
    told = choices(expert.questions[-1])['A']
    assert (told.way, told.helped, told.tried, told.recommended) == ('from A', 2, 3, '')


def test_what_cannot_be_entered_now_is_not_recommended(clock):
    """B still runs, though its time is over."""
    released = threading.Event()

    def hangs(state, ud):
        clock.advance(31)
        assert wait_for(state.preempt_requested)
        clock.advance(31)
        assert released.wait(20)
        return 'ok'

    expert = FakeExpert(goto('B'), goto('B'), goto('C'), supersede('ok'))
    machine = watched(
        Scripted(),
        Scripted(*['ok'] * 4, hangs),
        Scripted(*['aborted', 'ok'] * 2, 'aborted'),
        settings={
            'policy': 'escalating',
            'max_recoveries': 0,
            'states': {'B': {'time_limit_s': 30.0, 'grace_period_s': 30.0}},
        },
        expert=expert,
    )
    for _ in range(3):
        assert machine.run() == 'done'
    released.set()
    told = choices(expert.questions[-1])['B']
    assert told.blocked and (told.helped, told.tried, told.recommended) == (2, 2, '')


def test_a_choice_has_the_minutes_of_the_way_that_leads_there(clock):
    def takes(outcome):
        return lambda state, ud: clock.advance(30.0) or outcome

    expert = FakeExpert(supersede('ok'))
    machine = watched(
        Scripted(takes('ok')),
        Scripted(takes('aborted')),
        Scripted(),
        settings={'policy': 'escalating', 'max_recoveries': 0},
        expert=expert,
    )
    assert machine.run() == 'done'
    told = {label: each.minutes for label, each in choices(expert.questions[0]).items()}
    assert told == {'B': 0.5, 'A': 1.0, 'C': 0.0}


def test_what_the_policy_has_repeated_counts_for_the_choice_of_the_failed_state():
    fails = ['aborted', 'ok'] * 2 + FAILS
    machine, expert = asking(supersede('ok'), fails=fails, max_recoveries=1)
    for _ in range(3):
        assert machine.run() == 'done'
    told = choices(expert.questions[-1])['C']
    assert told.helped == 2 and told.tried >= 2
