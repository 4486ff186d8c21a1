"""The budget of a whole trial: recoveries, minutes, questions."""

import copy
import threading

import pytest
from fake_clock import FakeClock
from guarded_machines import chain, deciders, sentences
from machines import FakeExpert, FakeWaiting, Scripted, Watched, give_up, goto, waits

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.machine.trial_budget import TrialBudget
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.facts import Decider
from smach_oracle.oracle.recovery import inquiry
from smach_oracle.oracle.scope.clock import Clock
from smach_oracle.oracle.settings.checks import Budget
from smach_oracle.oracle.settings.settings import Settings


def failing(*answers, budget, times=100, **settings):
    """LOOK, and PICK that fails so often; the machine, watched, and its expert."""
    expert = FakeExpert(*answers)
    states = chain(LOOK=Scripted(), PICK=Scripted(*['aborted'] * times))
    return Watched(
        states,
        expert=expert,
        settings=dict({'memory': 1000, 'max_recoveries': 50, 'budget': budget}, **settings),
    ), expert


def test_it_is_checked():
    assert Settings.from_dict({'budget': {'minutes': 2}}).budget == Budget(minutes=2.0)
    assert Settings.from_dict({'budget': None}).budget == Budget()
    assert Settings.from_dict({'budget': Budget(questions=1)}).budget.questions == 1
    nothing = {'recoveries': None, 'minutes': None, 'questions': None}
    assert Settings.from_dict({'budget': nothing}).budget == Budget()


@pytest.mark.parametrize(
    'given, key, allowed',
    [
        ({'recoveries': -1}, 'budget.recoveries', 'a whole number from 0'),
        ({'recoveries': True}, 'budget.recoveries', 'a whole number from 0'),
        ({'questions': 1.5}, 'budget.questions', 'a whole number from 0'),
        ({'minutes': 0}, 'budget.minutes', 'a number of minutes above 0'),
        ({'minutes': 'ten'}, 'budget.minutes', 'a number of minutes above 0'),
        ({'hours': 1}, 'budget.hours', 'one of the keys recoveries, minutes, questions'),
        (5, 'budget', 'a mapping'),
    ],
)
def test_what_is_no_budget_is_refused(given, key, allowed):
    with pytest.raises(SettingsError) as told:
        Settings.from_dict({'budget': given})
    assert told.value.key == key and told.value.allowed == allowed


def test_it_is_the_machines_not_a_states():
    with pytest.raises(SettingsError, match='states.PICK.budget'):
        Settings.from_dict({'states': {'PICK': {'budget': {'recoveries': 1}}}})


# -- recoveries


def test_when_the_recoveries_are_spent_the_expert_is_asked():
    machine, expert = failing(give_up(), budget={'recoveries': 2})
    assert machine.run() == 'aborted'
    assert [action for action, _ in machine.decisions()] == ['revisit', 'step_back', 'ask']
    assert sentences(machine)[-1] == (
        "PICK keeps failing after going back to LOOK (3 of its last 3); the trial's 2 recoveries "
        'are spent: asking an expert, 300 s'
    )
    assert deciders(machine)[-1] == Decider.BUDGET
    assert expert.questions[0].reason.endswith("the trial's 2 recoveries are spent")


@pytest.mark.parametrize(
    'recoveries, told',
    [(0, 'this trial is allowed no recoveries'), (1, "the trial's 1 recovery is spent")],
)
def test_no_precondition_is_run_then(recoveries, told):
    clear = Scripted()
    machine, _ = failing(
        give_up(), budget={'recoveries': recoveries}, states={'PICK': {'preconditions': [clear]}}
    )
    assert machine.run() == 'aborted'
    assert clear.runs == recoveries
    assert told in sentences(machine)[-1]


def test_what_an_expert_decides_costs_no_recovery():
    machine, expert = failing(
        goto('PICK'), goto('PICK'), goto('PICK'), give_up(), times=4, budget={'recoveries': 1}
    )
    assert machine.run() == 'done'
    assert [action for action, _ in machine.decisions()] == ['revisit', 'ask', 'ask', 'ask']


def test_a_new_trial_has_all_of_it_again():
    machine, expert = failing(give_up(), give_up(), budget={'recoveries': 1, 'questions': 1})
    assert machine.run() == machine.run() == 'aborted'
    assert [action for action, _ in machine.decisions()] == ['revisit', 'ask'] * 2
    assert len(expert.questions) == 2


def test_it_is_one_for_all_containers():
    inner = chain(REACH=Scripted(*['aborted'] * 9))
    machine = Watched(
        chain(LOOK=Scripted('aborted'), INNER=inner),
        expert=FakeExpert(give_up()),
        settings={'memory': 1000, 'budget': {'recoveries': 2}},
    )
    assert machine.run() == 'aborted'
    assert [(event.path, event.outcome) for event in machine.of(EventKind.DECISION)] == [
        ('SM_ROOT', 'revisit'),
        ('SM_ROOT/INNER', 'revisit'),
        ('SM_ROOT/INNER', 'ask'),
    ]
    assert sentences(machine)[2] == (
        "REACH keeps failing after trying it again (2 of its last 2); the trial's 2 recoveries "
        'are spent: asking an expert, 300 s'
    )


def test_a_fallback_to_a_state_costs_a_recovery():
    machine, _ = failing(max_recoveries=0, on_no_answer='goto:LOOK', budget={'recoveries': 0})
    assert machine.run() == 'aborted'
    assert not machine.of(EventKind.JUMP)
    machine, _ = failing(max_recoveries=2, on_no_answer='goto:LOOK', budget={'recoveries': 3})
    assert machine.run() == 'aborted'
    assert [event.target for event in machine.of(EventKind.JUMP)] == ['PICK', 'LOOK', 'LOOK']
    assert "the trial's 3 recoveries are spent; stopping" in machine.of(EventKind.WARNING)[-1].text


def test_the_branches_of_a_concurrence_share_it():
    """Both fail at once, again and again; no recovery is spent twice."""
    barrier = threading.Barrier(4)

    def fails(state, ud):
        if state.runs == 1:
            barrier.wait(20)
        return 'aborted'

    branches = {name: chain(REACH=Scripted(*[fails] * 30)) for name in 'ABCD'}
    concurrence = smach.Concurrence(
        outcomes=['done', 'aborted'], default_outcome='aborted', outcome_map={}
    )
    with concurrence:
        for name, branch in branches.items():
            smach.Concurrence.add(name, branch)
    machine = Watched(
        chain(BOTH=concurrence),
        expert=FakeExpert(),
        settings={'memory': 1000, 'max_recoveries': 50, 'budget': {'recoveries': 10}},
    )
    assert machine.run() == 'aborted'
    assert len(machine.of(EventKind.JUMP)) == 10


# -- questions


def test_when_the_questions_are_spent_nobody_is_asked():
    machine, expert = failing(goto('PICK'), goto('PICK'), max_recoveries=0, budget={'questions': 1})
    assert machine.run() == 'aborted'
    assert len(expert.questions) == len(machine.of(EventKind.QUERY_OPENED)) == 1
    assert sentences(machine)[-1] == (
        'PICK failed (2 of its last 2), and no recovery of it is '
        "allowed: asking nobody, since the trial's 1 question is "
        'spent'
    )
    assert machine.of(EventKind.GIVE_UP)[0].text == "the trial's 1 question is spent"


def test_what_is_configured_for_no_answer_is_done_then():
    machine, expert = failing(
        max_recoveries=0, times=1, on_no_answer='goto:PICK', budget={'questions': 0}
    )
    assert machine.run() == 'done'
    assert not expert.questions
    assert machine.of(EventKind.JUMP)[0].text == 'this trial is allowed no questions'


def test_a_question_put_again_counts_once():
    machine, expert = failing(
        goto('NOWHERE'), goto('PICK'), max_recoveries=0, times=1, budget={'questions': 1}
    )
    assert machine.run() == 'done'
    assert len(expert.questions) == 2


def test_a_failure_on_which_the_level_above_decides_is_no_question():
    inner = chain(REACH=Scripted('aborted', 'aborted'))
    expert = FakeExpert()
    machine = Watched(
        chain(INNER=inner),
        expert=expert,
        settings={
            'escalate': True,
            'memory': 1000,
            'budget': {'questions': 0, 'recoveries': 2},
            'states': {'REACH': {'prior': 0.5}},
        },
    )
    assert machine.run() == 'done' and not expert.questions
    assert machine.decisions() == [('revisit', 'REACH'), ('ask', ''), ('revisit', 'INNER')]


# -- minutes


def passing(clock, minutes, outcome='aborted'):
    """A step of a state that takes so long and ends so."""

    def step(state, ud):
        clock.advance(60.0 * minutes)
        return outcome

    return step


def test_when_the_minutes_are_over_it_ends_as_without_an_oracle(clock):
    clear, expert = Scripted(), FakeExpert(goto('PICK'))
    states = chain(PICK=Scripted(passing(clock, 1), passing(clock, 29), passing(clock, 0)))
    machine = Watched(
        states,
        expert=expert,
        settings={
            'memory': 1000,
            'budget': {'minutes': 30},
            'on_no_answer': 'goto:PICK',
            'states': {'PICK': {'preconditions': [clear]}},
        },
    )
    assert machine.run() == 'aborted'
    assert machine.decisions() == [('revisit', 'PICK')] and clear.runs == 1
    assert machine.of(EventKind.GIVE_UP)[0].text == (
        "PICK keeps failing after trying it again (2 of its last 2); the trial's 30 minutes are "
        'over: the machine ends as without an oracle'
    )
    assert not expert.questions
    assert machine.run() == 'done', 'the next trial has minutes of its own'


def test_the_log_says_so_too(clock, log):
    machine = Watched(
        chain(PICK=Scripted(passing(clock, 31))), name='TOP', settings={'budget': {'minutes': 30}}
    )
    assert machine.run() == 'aborted'
    (told,) = [text for level, text in log if level == 'warn' and 'without an oracle' in text]
    assert told.startswith('TOP/PICK failed') and "the trial's 30 minutes are over" in told


def test_an_exception_is_raised_then(clock):
    def late(state, ud):
        clock.advance(61)
        raise ValueError('no grasp')

    machine = Watched(chain(PICK=Scripted(late)), settings={'budget': {'minutes': 1}})
    with pytest.raises(smach.InvalidUserCodeError, match='no grasp'):
        machine.run()
    assert "the trial's 1 minute is over" in machine.of(EventKind.GIVE_UP)[0].text


def test_preconditions_that_outlast_the_minutes_are_followed_by_no_recovery(clock):
    slow = Scripted(passing(clock, 2, 'ok'))
    machine, expert = failing(budget={'minutes': 1}, states={'PICK': {'preconditions': [slow]}})
    assert machine.run() == 'aborted'
    assert slow.runs == 1 and not machine.decisions()


def test_a_deadline_at_the_very_end_is_not_without_end(clock):
    budget = TrialBudget(clock)
    budget.begin(Budget(minutes=1))
    clock.advance(60)
    deadline_s, is_cut = budget.within(0)
    assert 0 < deadline_s < 0.1 and is_cut


@pytest.mark.parametrize('deadline_s', [300.0, 0])
def test_a_question_is_open_no_longer_than_the_trial(clock, deadline_s):
    def too_late(question, cancelled, progress):
        clock.advance(90)
        return None

    machine, expert = failing(
        too_late,
        max_recoveries=0,
        deadline_s=deadline_s,
        on_no_answer='goto:PICK',
        budget={'minutes': 1.5},
    )
    assert machine.run() == 'aborted'
    assert expert.questions[0].deadline_s == pytest.approx(90, abs=20)
    assert expert.questions[0].fallback == 'stop with aborted'
    assert sentences(machine)[0].endswith("asking an expert, 90 s, which are the trial's last")
    assert machine.of(EventKind.GIVE_UP)[0].text == (
        "no answer by the deadline; the trial's 1.5 minutes are over"
    )


def test_a_deadline_within_the_minutes_stays(clock):
    machine, expert = failing(
        goto('PICK'), max_recoveries=0, times=1, deadline_s=30, budget={'minutes': 1}
    )
    assert machine.run() == 'done'
    assert expert.questions[0].deadline_s == pytest.approx(30, abs=20)
    assert sentences(machine)[0].endswith('asking an expert, 30 s')


def test_an_open_question_is_taken_back_when_the_minutes_are_over(monkeypatch):
    monkeypatch.setattr(inquiry, '_OVERTIME_S', 0.1)
    machine, expert = failing(waits, max_recoveries=0, deadline_s=0, budget={'minutes': 0.005})
    assert machine.run() == 'aborted'
    assert "the trial's 0.005 minutes are over" in machine.of(EventKind.QUERY_EXPIRED)[0].text


def test_what_is_spent_does_not_travel_with_a_copy():
    machine, _ = failing(give_up(), budget={'recoveries': 1})
    machine.run()
    assert machine.machine._oracle.tree.budget.why_no_recovery()
    assert not copy.deepcopy(machine.machine)._oracle.tree.budget.why_no_recovery()


def test_the_time_of_work_stands_still_while_a_person_is_asked():
    clock = FakeClock()
    budget = TrialBudget(clock)
    budget.begin(Budget())
    clock.advance(60)
    with budget.work_time.paused():
        clock.advance(3600)
    clock.advance(60)
    budget.end()
    assert (budget.work_time.now(), budget.usual_minutes) == (120.0, 2.0)
    assert budget.time.now() == 3720.0


def test_the_time_of_work_goes_by_a_clock_of_its_own_and_the_minutes_do_not():
    clock, work = FakeClock(), FakeClock(5.0)
    budget = TrialBudget(clock)
    budget.count_work_by(work)
    budget.begin(Budget(minutes=2))
    clock.advance(60)
    work.advance(600)
    with budget.paused():
        work.advance(600)
    budget.end()
    assert (budget.work_time.now(), budget.usual_minutes) == (600.0, 10.0)
    assert (budget.time.now(), budget.left_s(), budget.within(90.0)) == (60.0, 60.0, (60.0, True))


def test_a_menu_a_way_and_a_streak_have_the_minutes_of_the_clock_of_work():
    fake_clock = FakeClock()

    def takes(outcome):
        return lambda state, userdata: fake_clock.advance(30.0) or outcome

    pick = Scripted(takes('aborted'), takes('aborted'), takes('ok'))
    machine = Watched(
        chain(LOOK=Scripted(takes('ok'), takes('ok'), takes('ok')), PICK=pick),
        settings={'policy': 'escalating'},
    )
    oracle = oracle_of(machine.machine)
    oracle.count_work_by(fake_clock)
    oracle.waiting = FakeWaiting()
    assert machine.run() == 'done'
    first, second = (event.data for event in machine.of(EventKind.DECISION))
    minutes = {way['kind']: way['minutes'] for way in first['menu']}
    assert (minutes['again'], minutes['wait']) == (0.5, pytest.approx(0.5 + 60.0 / 60.0))
    assert (first['streak']['minutes'], second['streak']['minutes']) == (0.0, 0.5)
    record = machine.machine._oracle.record('PICK')
    assert record.ways_so_far()[0].minutes == 0.5
    assert machine.machine._oracle.tree.budget.usual_minutes in (2.0, 2.5)


def test_of_several_threads_none_takes_more_than_a_policy_makes_do_with():
    budget = TrialBudget(Clock())
    budget.begin(Budget())
    assert [budget.take_recovery(object(), 2) for _ in range(3)] == [
        '',
        '',
        "the trial's 2 attempts are spent",
    ]
    assert budget.recoveries == 2


def test_the_usual_time_is_the_median_of_the_latest_twenty_trials():
    clock = FakeClock()
    budget = TrialBudget(clock)
    assert budget.usual_minutes is None
    for minutes in [3] * 11 + [1] * 10:
        budget.begin(Budget())
        clock.advance(60.0 * minutes)
        budget.end()
    assert budget.usual_minutes == pytest.approx(2.0)


def test_a_store_of_an_earlier_version_has_no_time_of_work():
    budget = TrialBudget(FakeClock())
    budget.go_on([3, 1, 60.0, 45.0])
    assert budget.spent() == [3, 1, 60.0, 45.0]
    budget.begin(Budget())
    budget.go_on([3, 1, 60.0])
    assert budget.spent() == [3, 1, 60.0, 60.0]


def test_where_the_trial_and_the_policy_make_do_with_as_much_the_budget_is_named():
    budget = TrialBudget(FakeClock())
    budget.begin(Budget(recoveries=1))
    assert not budget.take_recovery('A', 1)
    assert budget.take_recovery('B', 1) == "the trial's 1 recovery is spent"


def test_a_recovery_that_is_set_aside_is_nobody_elses_and_stored_once_it_is_made():
    budget, one, two, three = TrialBudget(FakeClock()), object(), object(), object()
    budget.begin(Budget(recoveries=2))
    assert [budget.take_recovery(taker) for taker in (one, one, two)] == [''] * 3
    assert budget.take_recovery(three) and budget.spent()[0] == 0
    budget.settle_recovery(one, True)
    budget.settle_recovery(two, False)
    assert budget.spent()[0] == budget.recoveries == 1
    assert not budget.take_recovery(three)


def test_a_recovery_of_an_earlier_trial_takes_nothing_from_this_one():
    budget, earlier, now = TrialBudget(FakeClock()), object(), object()
    for taker in (earlier, now):
        budget.begin(Budget(recoveries=1))
        assert not budget.take_recovery(taker)
    budget.settle_recovery(earlier, False)
    assert budget.take_recovery(object()), 'the only one is set aside'
    budget.settle_recovery(now, True)
    assert budget.spent()[0] == budget.recoveries == 1
