"""Every assertion holds where it must, fails where it must, and shows the course of the trial."""

import pytest
from bench_machines import fetch_machine, nested_machine

import smach
from smach_oracle.testing import Bench, expert, fail, give_up, goto, overrun, stub

COURSE = """The trial ended in 'succeeded'. 1 failure, 1 question.
  DETECT  ends in succeeded -> PICK
  PICK    fault: ends in 'aborted' (visit 1)
  PICK    FAILS: fell through aborted
  PICK    decision: {decision}
  PICK    question: {reason}
  PICK    answer by script: goto DETECT
  PICK    jump to DETECT by script
  DETECT  ends in succeeded -> PICK
  PICK    ends in succeeded -> PLACE
  PLACE   ends in succeeded -> succeeded
          the trial ends in succeeded
  a fault that did not happen: PLACE ends in 'aborted' at visit 7"""


def trial_of(machine, faults, *answers, **settings):
    with Bench(machine, faults, expert=expert(*answers), settings=settings) as bench:
        return bench.run()


def asked_trial():
    return trial_of(
        fetch_machine(),
        [fail('PICK', visit=1, outcome='aborted'), fail('PLACE', visit=7, outcome='aborted')],
        goto('DETECT'),
        max_recoveries=0,
    )


def without_times(text):
    return '\n'.join(
        line[:2] + line[13:] if line[2:11].strip()[:1].isdigit() else line
        for line in text.splitlines()
    )


@pytest.fixture(scope='module')
def asked():
    return asked_trial()


@pytest.fixture(scope='module')
def plain():
    return trial_of(fetch_machine(), [])


@pytest.fixture(scope='module')
def lost():
    return trial_of(fetch_machine(), [fail('PICK')], give_up(), max_recoveries=0)


@pytest.fixture(scope='module')
def nested():
    return trial_of(nested_machine(), [fail('PICK', visit=1)])


def test_the_course_of_a_trial_is_a_text(asked):
    (decision,) = asked.decisions
    (question,) = asked.questions
    assert without_times(str(asked)) == COURSE.format(decision=decision, reason=question.reason)
    assert decision.startswith('PICK failed') and 'asking an expert' in decision


HOLD = [
    ('asked', lambda trial: trial.assert_ended_with('succeeded')),
    ('asked', lambda trial: trial.assert_recovered()),
    ('asked', lambda trial: trial.assert_recovered('PICK')),
    ('asked', lambda trial: trial.assert_failed('PICK')),
    ('asked', lambda trial: trial.assert_failed('PICK', times=1)),
    ('asked', lambda trial: trial.assert_failed('PLACE', times=0)),
    ('asked', lambda trial: trial.assert_asked_about('PICK')),
    ('asked', lambda trial: trial.assert_asked_about('PICK', times=1)),
    ('asked', lambda trial: trial.assert_not_asked('PLACE')),
    ('asked', lambda trial: trial.assert_visited(['PICK', 'PLACE'])),
    ('asked', lambda trial: trial.assert_visited('PICK')),
    (
        'asked',
        lambda trial: trial.assert_visited(
            ['DETECT', 'PICK', 'DETECT', 'PICK', 'PLACE'], exactly=True
        ),
    ),
    ('asked', lambda trial: trial.assert_jumped('PICK', to='DETECT')),
    ('plain', lambda trial: trial.assert_no_failures()),
    ('plain', lambda trial: trial.assert_not_asked()),
    ('plain', lambda trial: trial.assert_all_faults_happened()),
    ('nested', lambda trial: trial.assert_failed('KITCHEN/PICK', times=1)),
    ('nested', lambda trial: trial.assert_failed('SM_ROOT/KITCHEN/PICK', times=1)),
    (
        'nested',
        lambda trial: trial.assert_visited(
            ['KITCHEN', 'DETECT', 'KITCHEN/PICK', 'PICK', 'PLACE'], exactly=True
        ),
    ),
]
FAIL = [
    (
        'asked',
        lambda trial: trial.assert_ended_with('aborted'),
        "the trial was to end in 'aborted', and it ended in 'succeeded'",
    ),
    (
        'asked',
        lambda trial: trial.assert_raised(smach.InvalidUserCodeError),
        "the trial was to raise InvalidUserCodeError, and it ended in 'succeeded'",
    ),
    (
        'plain',
        lambda trial: trial.assert_recovered(),
        'a state was to fail and to recover, and nothing failed',
    ),
    (
        'asked',
        lambda trial: trial.assert_recovered('PLACE'),
        'PLACE was to fail and to recover, and it did not fail',
    ),
    (
        'lost',
        lambda trial: trial.assert_recovered('PICK'),
        "the trial was to recover from the failure of PICK, and it ended in 'aborted' after giving "
        'up',
    ),
    ('asked', lambda trial: trial.assert_failed('PLACE'), 'PLACE was to fail, and it did not'),
    (
        'asked',
        lambda trial: trial.assert_failed('PICK', times=2),
        'PICK was to fail 2 times, and it failed 1 time',
    ),
    ('asked', lambda trial: trial.assert_no_failures(), 'nothing was to fail, and these did: PICK'),
    (
        'asked',
        lambda trial: trial.assert_asked_about('PLACE'),
        'the expert was to be asked about PLACE, and was not',
    ),
    (
        'asked',
        lambda trial: trial.assert_asked_about('PICK', times=2),
        'the expert was to be asked about PICK 2 times, and was asked 1 time',
    ),
    (
        'asked',
        lambda trial: trial.assert_not_asked(),
        'the expert was not to be asked, and was asked about PICK',
    ),
    (
        'asked',
        lambda trial: trial.assert_not_asked('PICK'),
        'the expert was not to be asked about PICK, and was asked about PICK',
    ),
    (
        'plain',
        lambda trial: trial.assert_visited(['PICK', 'DETECT']),
        'the trial was to visit PICK, DETECT, and it visited DETECT, PICK, PLACE',
    ),
    (
        'plain',
        lambda trial: trial.assert_visited(['PICK', 'PICK']),
        'the trial was to visit PICK, PICK, and it visited',
    ),
    (
        'plain',
        lambda trial: trial.assert_visited(['PICK', 'PLACE'], exactly=True),
        'the trial was to visit exactly PICK, PLACE, and it visited DETECT, PICK, PLACE',
    ),
    (
        'plain',
        lambda trial: trial.assert_not_visited('PICK'),
        'PICK was not to be visited, and it was',
    ),
    (
        'asked',
        lambda trial: trial.assert_jumped('PICK', to='PLACE'),
        'the oracle was to go from PICK to PLACE; its jumps: PICK to DETECT',
    ),
    (
        'asked',
        lambda trial: trial.assert_all_faults_happened(),
        "all faults were to happen, and these did not: PLACE ends in 'aborted' at visit 7",
    ),
]


@pytest.mark.parametrize('name, check', HOLD)
def test_an_assertion_holds_and_returns_the_trial(name, check, request):
    trial = request.getfixturevalue(name)
    assert check(trial) is trial


@pytest.mark.parametrize('name, check, said', FAIL)
def test_an_assertion_fails_with_a_sentence_and_the_course(name, check, said, request):
    trial = request.getfixturevalue(name)
    with pytest.raises(AssertionError) as raised:
        check(trial)
    sentence, _, course = str(raised.value).partition('\n')
    assert sentence.startswith(said)
    assert course == str(trial)


@pytest.mark.parametrize(
    'check',
    [
        lambda trial: trial.assert_recovered('PIKC'),
        lambda trial: trial.assert_failed('PIKC'),
        lambda trial: trial.assert_asked_about('PIKC'),
        lambda trial: trial.assert_not_asked('PIKC'),
        lambda trial: trial.assert_visited(['PIKC']),
        lambda trial: trial.assert_not_visited('PIKC'),
        lambda trial: trial.assert_jumped('PIKC', to='DETECT'),
    ],
)
def test_a_state_that_is_nowhere_is_refused(check, plain):
    with pytest.raises(AssertionError, match="no state 'PIKC'; there are DETECT, PICK, PLACE"):
        check(plain)


def test_a_wrong_answer_of_the_decision_is_in_the_text(lost):
    assert 'gives up by script' in str(lost) and "ended in 'aborted' after giving up" in str(lost)


def test_a_long_trial_is_shown_by_its_beginning_and_its_end():
    trial = trial_of(
        fetch_machine(), [fail('PLACE', visit=range(1, 41))], lambda question: goto('PLACE')
    )
    lines = str(trial).splitlines()
    assert len(lines) < 100 and 'lines left out' in str(trial)
    assert 'DETECT  ends in' in lines[1] and 'the trial ends in' in lines[-1]


def test_a_failed_assertion_points_at_the_line_of_the_test():
    trial = asked_trial()
    with pytest.raises(AssertionError) as raised:
        trial.assert_not_asked()
    hidden = [entry.frame.f_locals.get('__tracebackhide__', False) for entry in raised.traceback]
    assert hidden[0] is False and all(hidden[1:])


def test_a_stub_is_told_and_need_not_happen():
    trial = trial_of(fetch_machine(), [stub('DETECT'), fail('PICK'), stub('PLACE')], give_up())
    trial.assert_all_faults_happened()
    assert "DETECT  stub: stands for its work: ends in 'succeeded' (visit 1)" in str(trial)
    assert 'did not happen' not in str(trial)


def test_a_trial_took_less_than_a_time():
    trial = trial_of(fetch_machine(), [overrun('PICK', 0.2)])
    assert 0.2 <= trial.duration_s < 20.0
    assert trial.assert_took_less_than(20.0) is trial
    with pytest.raises(AssertionError, match='was to take less than 0.1 s, and it took 0'):
        trial.assert_took_less_than(0.1)
