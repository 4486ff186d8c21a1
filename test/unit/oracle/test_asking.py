"""Questions to the expert: what is asked, what may be answered, and what happens where nobody
answers.
"""

import threading
import time

import pytest
from machines import (
    FakeExpert,
    Scripted,
    Watched,
    chain_of,
    give_up,
    goto,
    in_thread,
    interface,
    offered_hand,
    supersede,
    waits,
    watched,
)

import smach
import smach_oracle.oracle.recovery.inquiry as inquiry
from smach_oracle.oracle.errors import AnswerError, InterfaceError
from smach_oracle.oracle.records.events import EventKind


def asking(*answers, b=None, **settings):
    """A, B, C, where B fails and the expert is asked at once."""
    expert = FakeExpert(*answers)
    settings.setdefault('max_recoveries', 0)
    machine = watched(
        Scripted(), b or Scripted('aborted'), Scripted(), expert=expert, settings=settings
    )
    return machine, expert


def test_the_expert_sends_the_machine_to_any_state():
    machine, _ = asking(goto('C'))
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'B', 'C']
    answered = machine.of(EventKind.QUERY_ANSWERED)[0]
    assert (answered.outcome, answered.target, answered.by) == ('goto', 'C', 'eva')


def test_a_superseded_state_goes_on_where_its_outcome_leads_and_counts_as_neither():
    machine, _ = asking(supersede('ok'))
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'B', 'C']
    row = machine.rate('B')
    assert (row.successes, row.failures, row.rate) == (0, 0, 0.1)
    event = machine.of(EventKind.SUPERSEDE)[0]
    assert (event.state, event.outcome, event.target, event.by) == ('B', 'ok', 'C', 'eva')


def test_a_state_superseded_with_an_outcome_of_the_container_ends_it():
    machine, _ = asking(supersede('aborted'))
    assert machine.run() == 'aborted'


def test_the_expert_gives_up_with_an_outcome_of_the_container():
    machine, _ = asking(give_up('preempted', why='enough'))
    assert machine.run() == 'preempted'
    event = machine.of(EventKind.GIVE_UP)[0]
    assert (event.outcome, event.by, event.text) == ('preempted', 'eva', 'enough')


def test_giving_up_without_an_outcome_ends_as_the_failure_would_have():
    machine, _ = asking(give_up())
    assert machine.run() == 'aborted'
    machine, _ = asking(give_up(), b=Scripted(ValueError('x')))
    with pytest.raises(smach.InvalidUserCodeError):
        machine.run()


def test_the_question_tells_everything():
    machine = watched(
        Scripted(outcomes=('ok', 'aborted')),
        Scripted('aborted', input_keys=['k'], output_keys=['o']),
        expert=FakeExpert(give_up()),
        preconditions={'B': [lambda ud: True]},
        settings={
            'max_recoveries': 1,
            'deadline_s': 60,
            'interfaces': {
                'hand': {'action': 'hand/assist', 'states': ['B']},
                'eye': {'action': 'eye/assist', 'states': ['A']},
            },
        },
    )
    machine.machine['B'].script = ['aborted', 'aborted']
    machine.machine.userdata.k = 3
    machine.run()
    question = machine.machine.expert.questions[0]
    assert (question.failed_state, question.container_path, question.outcome) == (
        'B',
        'SM_ROOT',
        'aborted',
    )
    assert question.trial_id == machine.machine.trial_id
    assert [(visit.state, visit.outcome) for visit in question.history] == [
        ('A', 'ok'),
        ('B', 'aborted'),
        ('B', 'aborted'),
    ]
    assert {choice.state: (choice.visits, choice.preconditions) for choice in question.choices} == {
        'A': (1, ()),
        'B': (2, ('<lambda>',)),
    }
    assert abs(question.rate - 0.28) < 1e-9
    assert question.continuous and question.recoveries == 1
    assert [(choice.outcome, choice.target) for choice in question.supersede_outcomes] == [
        ('aborted', 'aborted'),
        ('ok', 'done'),
        ('preempted', 'preempted'),
    ]
    assert question.output_keys == ('o',)
    assert question.give_up_outcomes == ('aborted', 'done', 'preempted')
    assert [offer.name for offer in question.interfaces] == ['hand']
    assert question.userdata == {'k': 3} and question.input_userdata == {'k': 3}
    assert 59 < question.deadline_s <= 60
    assert question.fallback == 'stop with aborted'
    assert question.reason == 'B failed again after 1 recovery of this trial'


def test_preconditions_that_ran_before_are_told():
    expert = FakeExpert(give_up())
    machine = watched(
        Scripted('aborted', 'aborted'),
        expert=expert,
        preconditions={'A': [lambda ud: False]},
        settings={'prior': 0.5},
    )
    machine.run()
    assert expert.questions[0].tried == (
        'precondition <lambda>: not met (<lambda> returned False)',
    )


@pytest.mark.parametrize(
    'wrong',
    [
        goto('NOWHERE'),
        goto('ORACLE'),
        goto(''),
        supersede('nonsense'),
        give_up('nonsense'),
        interface('none'),
        supersede('ok', outputs={'k': 1}),
        AnswerError('cannot decode'),
        InterfaceError('gone before it was chosen'),
    ],
)
def test_an_answer_that_does_not_fit_is_warned_of_and_asked_again_under_a_new_id(wrong):
    machine, expert = asking(wrong, goto('C'))
    assert machine.run() == 'done'
    assert len(machine.of(EventKind.WARNING)) == 1
    first, second = expert.questions
    assert first.question_id != second.question_id
    assert second.deadline_s <= first.deadline_s
    assert [event.query_id for event in machine.of(EventKind.QUERY_OPENED)] == [
        first.question_id,
        second.question_id,
    ]


def test_the_id_of_a_question_keeps_its_old_name_with_a_warning():
    machine, expert = asking(goto('C'))
    machine.run()
    (question,) = expert.questions
    with pytest.warns(FutureWarning, match='query_id is now called question_id') as told:
        assert question.query_id == question.question_id
    assert told[0].filename == __file__


def test_after_the_first_answer_that_does_not_fit_it_asks_again_at_once(clock):
    machine, expert = asking(goto('NOWHERE'), goto('C'), deadline_s=0.5)
    assert machine.run() == 'done'
    first, second = expert.questions
    assert second.deadline_s == first.deadline_s


@pytest.mark.parametrize('deadline_s, told', [(0, ''), (30, ', 30 s'), (0.5, ', 0.5 s')])
def test_a_decision_to_ask_says_how_long_the_expert_has(deadline_s, told):
    machine, _ = asking(goto('B'), deadline_s=deadline_s)
    assert machine.run() == 'done'
    assert machine.of(EventKind.DECISION)[0].text.endswith(': asking an expert' + told)


def test_nonsense_without_end_ends_at_the_deadline_and_does_not_spin():
    machine, expert = asking(*[goto('NOWHERE')] * 10000, deadline_s=0.3)
    assert machine.run() == 'aborted'
    assert len(expert.questions) < 12
    assert len(machine.of(EventKind.QUERY_EXPIRED)) == 1


def test_nonsense_does_not_spin_where_there_is_no_deadline():
    times_s = []

    def answer(question, cancelled, progress):
        times_s.append(time.monotonic())
        return goto('NOWHERE' if len(times_s) < 4 else 'B')

    machine, _ = asking(*[answer] * 4, deadline_s=0)
    assert machine.run() == 'done'
    assert times_s[3] - times_s[1] > 0.5, 'it waits longer after each'


@pytest.mark.parametrize('deadline_s, ends', [(0, 'done'), (2.0, 'aborted')])
def test_the_pauses_after_nonsense_double_up_to_a_second_or_the_deadline(deadline_s, ends, clock):
    asked_s = [clock.now()]

    def answer(question, cancelled, progress):
        asked_s.append(clock.now())
        return goto('NOWHERE' if len(asked_s) < 9 else 'B')

    machine, _ = asking(*[answer] * 8, deadline_s=deadline_s)
    assert machine.run() == ends
    asked_s.append(clock.now())
    pauses_s = [later - before for before, later in zip(asked_s, asked_s[1:])]
    long_s = [1.0, 1.0, 1.0, 0.0] if ends == 'done' else [0.6]
    assert pauses_s == pytest.approx([0.0, 0.0, 0.2, 0.4, 0.8, *long_s])


def test_without_an_expert_the_machine_stops_at_once_with_the_original_outcome():
    machine = watched(Scripted('aborted'), settings={'max_recoveries': 0, 'deadline_s': 0})
    assert machine.run() == 'aborted'
    assert not machine.of(EventKind.QUERY_OPENED)
    assert [event.outcome for event in machine.of(EventKind.GIVE_UP)] == ['aborted']


@pytest.mark.parametrize(
    'fallback, outcome, visits',
    [
        ('stop', 'aborted', ['A', 'B']),
        ({'goto': 'C'}, 'done', ['A', 'B', 'C']),
        ('give_up:preempted', 'preempted', ['A', 'B']),
        ('goto:NOWHERE', 'aborted', ['A', 'B']),
        ({'give_up': 'nonsense'}, 'aborted', ['A', 'B']),
    ],
)
def test_a_question_nobody_answers_falls_back(fallback, outcome, visits):
    machine, expert = asking(on_no_answer=fallback, deadline_s=5)
    assert machine.run() == outcome
    assert machine.visits() == visits
    assert len(machine.of(EventKind.QUERY_EXPIRED)) == 1
    assert bool(machine.of(EventKind.WARNING)) is (
        fallback in ('goto:NOWHERE', {'give_up': 'nonsense'})
    )


def test_a_fallback_does_not_lead_to_what_cannot_be_entered():
    machine, _ = asking(on_no_answer='goto:A', states={'A': {'on_retry': 'never'}})
    assert machine.run() == 'aborted'
    (warning,) = machine.of(EventKind.WARNING)
    assert 'was done in this trial and must not be repeated (on_retry: never)' in warning.text


def test_a_fallback_that_goes_to_an_outcome_goes_nowhere():
    machine, expert = asking(on_no_answer='goto:preempted')
    assert machine.run() == 'aborted'
    assert expert.questions[0].fallback == 'stop with aborted'
    (warning,) = machine.of(EventKind.WARNING)
    assert "cannot go to 'preempted': no such state; there are" in warning.text


@pytest.mark.parametrize(
    'settings, told',
    [
        ({'deadline_s': 7}, 'within 7 s: stop'),
        ({'deadline_s': 7, 'on_no_answer': 'goto:C'}, 'within 7 s: goto C'),
        ({'deadline_s': 0}, 'it waits on'),
    ],
)
def test_the_log_says_that_the_machine_waits_and_for_how_long(log, settings, told):
    machine, _ = asking(goto('C'), **settings)
    machine.run()
    asked = machine.of(EventKind.QUERY_OPENED)[0]
    assert [text for level, text in log if level == 'warn' and 'the expert is asked' in text] == [
        'SM_ROOT/B: the expert is asked (question {}); without an answer {}'.format(
            asked.query_id, told
        )
    ]


def test_falling_back_to_a_state_has_an_end_when_nobody_ever_answers():
    machine = watched(
        Scripted(*['aborted'] * 100), settings={'on_no_answer': 'goto:A', 'max_recoveries': 2}
    )
    assert machine.run() == 'aborted'
    assert 'gone there 2 times' in machine.of(EventKind.WARNING)[-1].text
    assert machine.run() == 'aborted'  # the next trial begins again
    assert 'gone there 2 times' in machine.of(EventKind.WARNING)[-1].text


def test_a_state_that_is_never_repeated_falls_back_to_another_one_once():
    machine = watched(
        Scripted(*['aborted'] * 100), settings={'on_no_answer': 'goto:A', 'max_recoveries': 0}
    )
    assert machine.run() == 'aborted'
    assert machine.visits() == ['A', 'A']


def test_at_the_deadline_itself_nobody_is_asked_again(clock):
    def too_late_and_unfit(question, cancelled, progress):
        clock.advance(question.deadline_s)
        return goto('NOWHERE')

    machine, expert = asking(too_late_and_unfit, goto('C'), deadline_s=8.0)
    assert machine.run() == 'aborted'
    assert len(expert.questions) == 1
    assert len(machine.of(EventKind.QUERY_EXPIRED)) == 1


def test_an_expert_who_sleeps_past_the_deadline_is_taken_the_question_from(monkeypatch):
    monkeypatch.setattr(inquiry, '_OVERTIME_S', 0.1)
    monkeypatch.setattr(inquiry, '_PATIENCE_S', 9.0)
    machine, _ = asking(waits, deadline_s=0.1)
    begin = time.monotonic()
    assert machine.run() == 'aborted'
    assert time.monotonic() - begin < 10
    assert len(machine.of(EventKind.QUERY_EXPIRED)) == 1
    assert not machine.of(EventKind.QUERY_CANCELLED) and not machine.of(EventKind.WARNING)


def test_an_experts_port_that_breaks_is_no_answer():
    machine, _ = asking(RuntimeError('socket closed'))
    assert machine.run() == 'aborted'
    assert 'socket closed' in machine.of(EventKind.WARNING)[0].text
    assert machine.of(EventKind.QUERY_EXPIRED)[0].text.startswith("the expert's port failed")


def test_an_interface_whose_port_breaks_ends_the_question():
    machine = offered_hand(FakeExpert(interface('hand'), goto('B'), interface=lambda *args: 1 / 0))
    assert machine.run() == 'aborted'
    assert 'ZeroDivisionError' in machine.of(EventKind.WARNING)[0].text
    assert machine.of(EventKind.QUERY_EXPIRED)[0].text.startswith("the expert's port failed")


def test_claims_are_told():
    def claims(question, cancelled, progress):
        progress('claimed', 'eva', '')
        progress('released', 'eva', 'lunch')
        return goto('C')

    machine, _ = asking(claims)
    machine.run()
    claimed, released = machine.of(EventKind.QUERY_CLAIMED, EventKind.QUERY_RELEASED)
    assert (claimed.by, released.text) == ('eva', 'lunch')
    assert claimed.query_id == released.query_id != ''


def test_an_interface_supersedes_the_state_with_what_it_returns():
    machine = watched(
        Scripted('aborted', output_keys=['pose']),
        Scripted(),
        settings={'max_recoveries': 0, 'interfaces': {'hand': {'action': 'hand/assist'}}},
        expert=FakeExpert(
            interface('hand'), interface=lambda *args: supersede('ok', outputs={'pose': 1})
        ),
    )
    assert machine.run() == 'done'
    assert machine.machine.userdata.pose == 1
    start, end = machine.of(EventKind.INTERFACE_START, EventKind.INTERFACE_END)
    assert (start.target, end.outcome) == ('hand', 'ok')
    assert machine.rate('A').failures == 0


def test_after_an_interface_that_fails_the_expert_is_asked_again_and_told():
    expert = FakeExpert(interface('hand'), goto('B'))
    machine = offered_hand(expert)
    assert machine.run() == 'done'
    assert expert.questions[1].tried == ('interface hand: failed',)


def test_beyond_its_recoveries_a_state_asks_whatever_the_policy_says():
    ran = []
    expert = FakeExpert(supersede('ok'))
    machine = watched(
        Scripted(),
        Scripted(*['aborted'] * 3),
        expert=expert,
        settings={'memory': 1000, 'max_recoveries': 2},
        preconditions={'B': [lambda ud: ran.append(1) or True]},
    )
    assert machine.run() == 'done'
    assert len(ran) == 2, 'nothing is run for the third'
    assert [action for action, _ in machine.decisions()] == ['revisit', 'step_back', 'ask']


def test_recoveries_are_counted_anew_in_each_trial():
    machine = watched(
        Scripted('aborted', 'ok', 'aborted', 'ok'), settings={'max_recoveries': 1, 'memory': 1000}
    )
    assert [machine.run(), machine.run()] == ['done', 'done']
    assert machine.rate('A').recoveries == 1


def test_a_preempt_takes_the_question_back():
    machine, _ = asking(waits, deadline_s=0)
    asked = threading.Event()
    machine.machine.events.observers.append(
        lambda event: asked.set() if event.kind is EventKind.QUERY_OPENED else None
    )
    run = in_thread(machine.run)
    assert asked.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert len(machine.of(EventKind.QUERY_CANCELLED)) == 1
    for each in (machine.machine, machine.machine.get_children()['ORACLE']):
        assert each.preempt_requested() is False
    assert machine.run() == 'done', 'the next run is not preempted'


def test_an_answer_that_comes_after_a_preempt_is_none():
    def too_late(question, cancelled, progress):
        machine.machine.request_preempt()
        return goto('B') if cancelled.wait(20) else None

    machine, _ = asking(too_late)
    assert machine.run() == 'preempted'
    assert machine.visits() == ['A', 'B']
    assert machine.of(EventKind.QUERY_CANCELLED) and not machine.of(EventKind.QUERY_ANSWERED)


def test_an_interface_that_is_chosen_after_a_preempt_is_not_started():
    started = []

    def too_late(question, cancelled, progress):
        machine.machine.request_preempt()
        return interface('hand') if cancelled.wait(20) else None

    machine = offered_hand(FakeExpert(too_late, interface=lambda *args: started.append(args)))
    assert machine.run() == 'preempted'
    assert not started and not machine.of(EventKind.QUERY_ANSWERED, EventKind.INTERFACE_START)


def test_a_preempt_as_the_question_expires_comes_before_what_is_done_then():
    machine, _ = asking(on_no_answer='goto:C')
    machine.machine.events.observers.append(
        lambda event: (
            machine.machine.request_preempt() if event.kind is EventKind.QUERY_EXPIRED else None
        )
    )
    assert machine.run() == 'preempted'
    assert machine.visits() == ['A', 'B'] and not machine.of(EventKind.GIVE_UP, EventKind.WARNING)


def test_a_shutdown_takes_the_question_back(monkeypatch):
    machine, _ = asking(waits, deadline_s=0)
    asked = threading.Event()
    machine.machine.events.observers.append(
        lambda event: asked.set() if event.kind is EventKind.QUERY_OPENED else None
    )
    run = in_thread(machine.run)
    assert asked.wait(10)
    monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
    assert run.result(10) == 'preempted'
    assert machine.of(EventKind.QUERY_CANCELLED)[0].text == 'shutdown'


def test_an_interface_is_cancelled_by_a_preempt():
    running = threading.Event()

    def works(offer, question, cancelled, progress):
        running.set()
        assert cancelled.wait(10)

    machine = watched(
        Scripted('aborted'),
        expert=FakeExpert(interface('hand'), interface=works),
        settings={'max_recoveries': 0, 'deadline_s': 0, 'interfaces': {'hand': {'action': 'a'}}},
    )
    run = in_thread(machine.run)
    assert running.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert len(machine.of(EventKind.INTERFACE_END)) == 1


def test_the_expert_may_be_attached_later():
    machine = Watched(chain_of(Scripted('aborted')), settings={'max_recoveries': 0})
    machine.machine.expert = FakeExpert(supersede('ok'))
    assert machine.run() == 'done'


def test_the_questions_of_each_trial_are_numbered():
    machine, expert = asking(goto('C'), goto('NOWHERE'), goto('C'))
    machine.machine.get_children()['B'].script *= 2
    trials = []
    for _ in range(2):
        assert machine.run() == 'done'
        trials.append(machine.machine.trial_id)
    first, second = trials
    numbered = [first + '-1', second + '-1', second + '-2']
    assert [question.question_id for question in expert.questions] == numbered
