"""A state that the oracle has entered and that takes much longer than ever before."""

import re
import threading

import pytest
from machines import (
    FakeExpert,
    Gate,
    Scripted,
    Watched,
    chain_of,
    give_up,
    goto,
    in_thread,
    interface,
    supersede,
    watched,
)
from test_time_limits import LimitClock
from waiting import wait_for

import smach
from smach_oracle.oracle.asking.question import AnswerKind, Expert
from smach_oracle.oracle.records.events import EventKind, FailureKind

SOON = {'still_running_s': 0.05, 'still_running_factor': 1}
QUERIES = (
    EventKind.QUERY_OPENED,
    EventKind.QUERY_ANSWERED,
    EventKind.QUERY_CANCELLED,
    EventKind.QUERY_EXPIRED,
)


def asked(*states, expert=None, health=None, **settings):
    """A chain whose first state fails, so that the oracle enters a state."""
    return watched(*states, expert=expert, health=health, settings=dict(SOON, **settings))


def letting_go(gate, answer):
    """An expert who lets the state go, and answers when that is of no use any more."""

    def ask(question, cancelled, progress):
        gate.go.set()
        assert cancelled.wait(20)
        return answer

    return ask


def told(machine):
    """What the bag says about questions."""
    return [(event.kind.name, event.state) for event in machine.of(*QUERIES)]


def longest_of(machine):
    return machine.machine._oracle.record('A').longest_s


def failures(machine):
    return [event.state for event in machine.of(EventKind.FAILURE)]


def test_a_person_is_asked_in_plain_words_and_the_state_runs_on(log):
    gate = Gate()
    expert = FakeExpert(letting_go(gate, None))
    machine = asked(Scripted('aborted', gate), expert=expert)
    assert machine.run() == 'done'
    (question,) = expert.questions
    assert (question.failed_state, question.failure_kind) == ('A', FailureKind.STILL_RUNNING)
    assert re.match(r'A still runs after (under )?[0-9.]+ s; ', question.text)
    assert '; its longest so far was ' in question.text
    assert question.text.endswith('It has no time limit, so it is not abandoned.')
    assert re.match(r'it still runs after (under )?[0-9.]+ s; ', question.reason)
    assert (question.deadline_s, question.interfaces, question.preconditions) == (0.0, (), None)
    assert told(machine) == [('QUERY_OPENED', 'A'), ('QUERY_CANCELLED', 'A')]
    assert machine.of(EventKind.QUERY_CANCELLED)[0].text == 'A has ended'
    assert failures(machine) == ['A']
    said = 'The expert is asked (question {})'.format(question.question_id)
    assert any(level == 'warn' and said in text for level, text in log)


def test_a_state_that_a_person_takes_out_is_preempted():
    heard = []

    def works(state, ud):
        heard.append(wait_for(state.preempt_requested, 20.0))
        return 'preempted'

    machine = asked(Scripted('aborted', works), Scripted(), expert=FakeExpert(goto('B')))
    assert machine.run() == 'done'
    assert heard == [True]


def test_who_waits_on_is_asked_again_after_twice_the_time():
    gate = Gate()
    expert = FakeExpert(goto('A'), goto('A'), letting_go(gate, None))
    machine = asked(Scripted('aborted', gate), expert=expert, still_running_s=0.2)
    assert machine.run() == 'done'
    first, second, third = [
        float(re.findall('[0-9.]+', question.text)[0]) for question in expert.questions
    ]
    # rounded to two digits, and whoever is asked takes a moment
    assert second > 1.8 * first and third > 1.8 * second
    assert told(machine) == [('QUERY_OPENED', 'A'), ('QUERY_ANSWERED', 'A')] * 2 + [
        ('QUERY_OPENED', 'A'),
        ('QUERY_CANCELLED', 'A'),
    ]
    assert [event.target for event in machine.of(EventKind.JUMP)] == ['A']


def test_a_question_that_nobody_can_answer_comes_again():
    gate = Gate()
    expert = FakeExpert(OSError('no connection'), letting_go(gate, None))
    machine = asked(Scripted('aborted', gate), expert=expert)
    assert machine.run() == 'done'
    assert [kind for kind, _ in told(machine)] == [
        'QUERY_OPENED',
        'QUERY_EXPIRED',
        'QUERY_OPENED',
        'QUERY_CANCELLED',
    ]
    assert machine.of(EventKind.QUERY_EXPIRED)[0].text.endswith('; it runs on')


@pytest.mark.parametrize(
    'answer, outcome, visits',
    [
        (goto('B', why='it hangs'), 'done', ['A', 'A', 'B']),
        (supersede('ok'), 'done', ['A', 'A', 'B']),
        (supersede('aborted'), 'aborted', ['A', 'A']),
        (give_up('preempted'), 'preempted', ['A', 'A']),
        (give_up(), 'aborted', ['A', 'A']),
    ],
)
def test_the_state_is_preempted_and_the_machine_goes_as_answered(answer, outcome, visits):
    machine = asked(Scripted('aborted', Gate()), Scripted(), expert=FakeExpert(answer))
    before = machine.rate('A').failures
    assert machine.run() == outcome
    assert machine.visits() == visits
    assert failures(machine) == ['A'] and machine.rate('A').failures == before + 1
    results = [visit.result.name for visit in machine.machine._oracle.records.history.latest()]
    assert results[:2] == [
        'FAILURE',
        'SUPERSEDED' if answer.kind is AnswerKind.SUPERSEDE else 'PREEMPTED',
    ]
    assert not machine.of(EventKind.PREEMPT)
    assert (
        machine.of(EventKind.TRANSITION)[1].state,
        machine.of(EventKind.TRANSITION)[1].target,
    ) == ('A', 'ORACLE')
    assert told(machine) == [('QUERY_OPENED', 'A'), ('QUERY_ANSWERED', 'A')]


@pytest.mark.parametrize('by, who', [('eva', 'eva'), ('', 'the expert')])
def test_the_log_says_by_whose_answer_the_state_is_preempted(by, who, log):
    answer = goto('B')._replace(by=by)
    machine = asked(Scripted('aborted', Gate()), Scripted(), expert=FakeExpert(answer))
    assert machine.run() == 'done'
    assert ('warn', 'SM_ROOT/A: is preempted, as {} answered goto B'.format(who)) in log


def test_the_preempt_is_taken_back_for_the_next_visit():
    hanging = Scripted('aborted', Gate(), 'ok')
    machine = asked(
        hanging,
        Scripted('aborted'),
        expert=FakeExpert(goto('B'), goto('A')),
        states={'B': {'max_recoveries': 0}},
    )
    assert machine.run() == 'done'
    assert not hanging.preempt_requested() and hanging.runs == 3


def test_outputs_of_an_answer_are_written_once_the_state_has_ended():
    def writes(state, ud):
        outcome = Gate()(state, ud)
        ud.box = 'half of it'
        return outcome

    seen = []
    machine = asked(
        Scripted('aborted', writes, output_keys=['box']),
        Scripted(lambda state, ud: seen.append(ud.box) or 'ok', input_keys=['box']),
        expert=FakeExpert(supersede('ok', outputs={'box': 'whole'})),
    )
    assert machine.run() == 'done' and seen == ['whole']


@pytest.mark.parametrize('end', ['ok', None, ValueError('broken by the preempt')])
def test_whatever_the_state_ends_with_is_replaced(end, log):
    def ends(state, ud):
        assert wait_for(state.preempt_requested)
        if isinstance(end, Exception):
            raise end
        return end

    machine = asked(Scripted('aborted', ends), Scripted(), Scripted(), expert=FakeExpert(goto('C')))
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'A', 'C'] and failures(machine) == ['A']
    left_with = machine.of(EventKind.TRANSITION)[1].outcome
    assert left_with == (end if isinstance(end, str) else '')
    counted = [row.outcome for row in machine.machine.transition_counts() if row.to == 'ORACLE']
    assert counted == ['aborted', left_with or 'taken_out']
    assert (machine.rate('A').successes, machine.rate('A').failures) == (0, 1)
    assert any('broken by the preempt' in text for _, text in log) is isinstance(end, Exception)


def test_a_state_that_ignores_its_preempt_is_waited_for_and_the_log_says_so(log):
    said = threading.Event()

    def ignores(state, ud):
        assert said.wait(20), 'nobody said that it ignores the preempt'
        return 'ok'

    machine = asked(
        Scripted('aborted', ignores), Scripted(), expert=FakeExpert(goto('B')), grace_period_s=0.05
    )
    machine.machine.events.observers.append(
        lambda event: 'does not heed its preempt' in event.text and said.set()
    )
    assert machine.run() == 'done' and machine.visits() == ['A', 'A', 'B']
    assert any(level == 'warn' and 'the machine waits for its end' in text for level, text in log)


def test_answers_that_do_not_fit_are_refused_and_asked_again():
    expert = FakeExpert(interface('hand'), goto('NOWHERE'), goto('B'))
    machine = asked(
        Scripted('aborted', Gate()),
        Scripted(),
        expert=expert,
        interfaces={'hand': {'action': 'hand/assist'}},
    )
    assert machine.run() == 'done'
    assert len(expert.questions) == 3 and machine.visits() == ['A', 'A', 'B']


def test_without_an_expert_the_log_warns_once(log):
    gate = Gate()
    machine = asked(Scripted('aborted', gate))
    run = in_thread(machine.run)
    assert wait_for(lambda: machine.of(EventKind.WARNING))
    assert not gate.go.wait(0.3)  # six times as long as it takes to ask
    gate.go.set()
    assert run.result() == 'done'
    (warning,) = machine.of(EventKind.WARNING)
    assert warning.text.startswith('A still runs after ') and 'asked' not in warning.text
    assert sum('still runs after' in text for _, text in log) == 1
    assert not machine.of(*QUERIES)


def test_a_state_that_the_machine_came_to_by_itself_is_left_alone():
    def takes_long(state, ud):
        assert not threading.Event().wait(0.3)  # six times as long as it takes to ask
        return 'ok'

    expert = FakeExpert()
    machine = asked(
        Scripted('aborted', takes_long),
        Scripted(takes_long),
        expert=expert,
        states={'A': {'time_limit_s': 20.0}},
    )
    assert machine.run() == 'done' and not expert.questions
    machine = asked(Scripted(takes_long), expert=expert)
    assert machine.run() == 'done' and not expert.questions


def test_a_state_that_has_never_ended_is_asked_about_after_the_seconds_alone():
    gate = Gate()
    expert = FakeExpert(goto('B'), letting_go(gate, None))
    machine = asked(
        Scripted('aborted'),
        Scripted(gate),
        expert=expert,
        still_running_factor=1000,
        states={'A': {'max_recoveries': 0}},
    )
    assert machine.run() == 'done'
    assert [question.failed_state for question in expert.questions] == ['A', 'B']
    assert expert.questions[1].text.count('how long it took before is not known') == 1


def test_it_may_take_ten_times_its_longest_visit():
    expert = FakeExpert(goto('A'))

    def takes(state, ud):
        assert not threading.Event().wait(0.2)
        return 'aborted'

    machine = asked(Scripted(takes, takes), expert=expert, still_running_factor=10.0)
    assert machine.run() == 'done' and not expert.questions


@pytest.mark.parametrize(
    'settings',
    [{'still_running_s': 0}, {'states': {'A': {'time_limit_s': 0.2}}, 'max_recoveries': 1}],
)
def test_a_time_limit_rules_and_zero_asks_never(settings):
    gate = Gate()
    machine = asked(Scripted('aborted', gate), **settings)
    run = in_thread(machine.run)
    assert gate.entered.wait(10)
    assert not gate.go.wait(0.3)
    gate.go.set()
    run.result()
    assert not machine.of(EventKind.WARNING, *QUERIES[1:])


@pytest.mark.parametrize('stop', ['preempt', 'shutdown'])
def test_a_preempt_or_a_shutdown_takes_the_question_back(stop, monkeypatch):
    gate = Gate()
    cancelled_in_time = []

    def ask(question, cancelled, progress):
        if stop == 'preempt':
            machine.machine.request_preempt()
        else:
            monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        cancelled_in_time.append(cancelled.wait(10))
        if stop == 'shutdown':  # a preempt ends the state itself
            gate.go.set()

    machine = asked(Scripted('aborted', gate), Scripted(), expert=FakeExpert(ask))
    machine.run()
    assert wait_for(lambda: cancelled_in_time == [True])
    assert machine.visits() == ['A', 'A']
    assert [kind for kind, _ in told(machine)] == ['QUERY_OPENED', 'QUERY_CANCELLED']


@pytest.mark.parametrize('stop, why', [('preempt', 'preempted'), ('shutdown', 'shutdown')])
def test_a_question_that_is_taken_back_while_the_state_runs_says_why(stop, why, monkeypatch):
    def stays(state, ud):
        assert wait_for(lambda: machine.of(EventKind.QUERY_CANCELLED))
        return 'preempted'

    def ask(question, cancelled, progress):
        if stop == 'preempt':
            machine.machine.request_preempt()
        else:
            monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        assert cancelled.wait(10)

    machine = asked(Scripted('aborted', stays), expert=FakeExpert(ask))
    machine.run()
    assert [event.text for event in machine.of(EventKind.QUERY_CANCELLED)] == [why]


@pytest.mark.parametrize('stop', ['preempt', 'shutdown'])
def test_a_preempt_or_a_shutdown_goes_before_an_answer(stop, monkeypatch):
    def ends(state, ud):
        assert wait_for(state.preempt_requested)
        if stop == 'preempt':
            machine.machine.request_preempt()
        else:
            monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        state.service_preempt()
        return 'preempted'

    machine = asked(Scripted('aborted', ends), Scripted(), expert=FakeExpert(goto('B')))
    assert machine.run() == 'preempted' and machine.visits() == ['A', 'A']
    assert [event.target for event in machine.of(EventKind.TRANSITION)] == ['ORACLE', 'preempted']


def both_branches(*scripts):
    both = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': {'LEFT': 'done', 'RIGHT': 'done'}},
    )
    with both:
        for label, script in zip(('LEFT', 'RIGHT'), scripts):
            smach.Concurrence.add(label, chain_of(Scripted(*script)))
    top = smach.StateMachine(outcomes=['done', 'aborted'])
    with top:
        smach.StateMachine.add('BOTH', both)
    return top


class Meeting(Expert):
    """Answers once two questions are open at the same time."""

    def __init__(self, answers):
        self.answers = answers
        self.begun = threading.Barrier(2)

    def ask(self, question, cancelled, progress):
        self.begun.wait(10)
        return self.answers[question.container_path.split('/')[-1]]


def test_two_questions_may_be_open_at_once():
    left, right = Gate(), Gate()
    expert = Meeting({'LEFT': supersede('ok'), 'RIGHT': goto('A')})
    machine = Watched(
        both_branches(['aborted', left], ['aborted', right]), expert=expert, settings=SOON
    )
    run = in_thread(machine.run)
    assert wait_for(lambda: len(machine.of(EventKind.SUPERSEDE)) == 1)
    expert.begun = threading.Barrier(1)
    right.go.set()
    assert run.result() == 'done'
    assert len({event.query_id for event in machine.of(EventKind.QUERY_OPENED)}) >= 2


def around(label, child):
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add(label, child, {'done': 'done'})
    return outer


def test_limits_around_run_on_and_take_the_question_back(monkeypatch):
    clock = LimitClock(monkeypatch)
    clock.asked = threading.Event()
    clock.end(1, clock.asked)  # the limit of X is over as soon as somebody is asked

    def ask(question, cancelled, progress):
        clock.asked.set()
        assert cancelled.wait(20), 'the limit has stood still'

    machine = Watched(
        around('X', chain_of(Scripted('aborted', Gate()))),
        expert=FakeExpert(ask),
        settings=dict(SOON, states={'X': {'time_limit_s': 30.0}}),
    )
    assert machine.run() == 'done' and failures(machine) == ['A', 'X']
    assert told(machine) == [('QUERY_OPENED', 'A'), ('QUERY_CANCELLED', 'A')]


def test_a_state_in_which_a_person_is_asked_does_not_count_as_still_running():
    def ask(question, cancelled, progress):
        assert not cancelled.wait(1.5)
        return supersede('ok')

    expert = FakeExpert(goto('X'), ask)
    machine = Watched(
        around('X', chain_of(Scripted('aborted', 'aborted'))),
        expert=expert,
        settings=dict(SOON, still_running_s=1.0, max_recoveries=0),
    )
    assert machine.run() == 'done' and failures(machine) == ['A', 'A']
    assert [question.failed_state for question in expert.questions] == ['A', 'A']


def test_a_nested_machine_that_hangs_is_preempted_as_a_whole():
    inner = chain_of(Scripted('aborted', Gate()))
    machine = Watched(
        around('X', inner),
        expert=FakeExpert(goto('X'), supersede('done')),
        settings=dict(SOON, max_recoveries=0),
    )
    assert machine.run() == 'done'
    assert not inner.preempt_requested()
    assert [event.state for event in machine.of(EventKind.QUERY_ANSWERED)] == ['A', 'X']


def test_the_clocks_thread_lives_only_while_a_state_runs():
    clocks = []

    def looks(state, ud):
        clocks.extend(
            thread for thread in threading.enumerate() if 'smach_oracle alarm clock' in thread.name
        )
        return 'ok'

    before = set(threading.enumerate())  # some of tests before may still end
    machine = asked(Scripted('aborted', looks), still_running_s=60.0)
    assert machine.run() == 'done'
    clocks = [clock for clock in clocks if clock not in before]
    assert [clock.daemon for clock in clocks] == [True], 'it keeps no program from its end'
    assert wait_for(lambda: clocks[0] not in threading.enumerate())


def test_a_visit_that_was_cut_short_says_nothing_of_how_long_the_state_takes():
    """One that overran, that was taken out, or that a preempt has ended."""
    overran = Watched(
        chain_of(Scripted(Gate(), 'ok')),
        expert=FakeExpert(give_up('preempted')),
        settings={'states': {'A': {'time_limit_s': 0.05}}, 'max_recoveries': 0},
    )
    first = []  # what the visit that failed has taken, as the second one still runs
    expert = FakeExpert(lambda *_: first.append(longest_of(taken_out)) or goto('B'))
    taken_out = asked(Scripted('aborted', Gate()), Scripted(), expert=expert)
    preempted = watched(Scripted(Gate()))
    assert overran.run() == 'preempted' and taken_out.run() == 'done'
    run = in_thread(preempted.run)
    preempted.machine.request_preempt()
    assert run.result() == 'preempted'
    assert [longest_of(each) for each in (overran, taken_out, preempted)] == [None, *first, None]


def test_a_visit_that_has_ended_by_itself_says_how_long_the_state_takes():
    machine = watched(Scripted(lambda state, ud: threading.Event().wait(0.05) or 'ok'))
    assert machine.run() == 'done'
    assert longest_of(machine) >= 0.05
