"""A soak finds the failures that never recover, and each of its trials can be run again."""

import pytest
from bench_machines import OUTCOMES, Works, concurrence_machine, fetch_machine, nested_machine

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.testing import Bench, FaultError, FaultKind, expert, goto, soak, soak_trial


class PicksOnce(Works):
    """Succeeds at its first visit alone: there is one cup."""

    def execute(self, userdata):
        Works.execute(self, userdata)
        return 'succeeded' if self.runs == 1 else 'aborted'


def machine_with_one_cup():
    """Where PLACE fails, the cup is on the floor: nothing helps any more."""
    return fetch_machine(pick=PicksOnce())


CUP_IS_LOST = {'PLACE': [lambda userdata: False]}  # the hand is empty


def test_a_failure_that_never_recovers_is_found_and_named():
    report = soak(machine_with_one_cup, trials=60, seed=5, preconditions=CUP_IS_LOST)
    assert [(row.state, row.kind) for row in report.never_recovered] == [
        ('PLACE', 'exception'),
        ('PLACE', "outcome 'aborted'"),
    ]
    row = report.never_recovered[1]
    assert row.recovered == 0 and row.trials == len(row.not_recovered) > 5
    assert {each.state for each in report.always_recovered} == {'DETECT', 'PICK'}
    said = str(report)
    assert 'Never recovered:\n  PLACE: exception: 0 of ' in said
    assert "PLACE: outcome 'aborted': 0 of {} recovered".format(row.trials) in said
    assert "which ended in 'aborted' after giving up" in said
    assert 'Always recovered:\n  DETECT: exception: ' in said
    with pytest.raises(AssertionError) as raised:
        report.assert_every_failure_can_recover()
    assert str(raised.value) == 'some failures never recover\n' + said


def test_a_trial_can_be_run_again_alone():
    report = soak(machine_with_one_cup, trials=20, seed=5, preconditions=CUP_IS_LOST)
    number = report.never_recovered[0].not_recovered[0]
    assert 'report.again({})'.format(number) in str(report)
    alone = soak_trial(machine_with_one_cup, number, seed=5, preconditions=CUP_IS_LOST)
    for trial in (report.again(number), alone):
        trial.assert_failed('PLACE').assert_visited(['PICK', 'PLACE', 'PICK'])
        trial.assert_ended_with('aborted')
    with pytest.raises(ValueError, match='no trial 21; the soak has 1 to 20'):
        report.again(21)


def test_a_state_that_no_trial_reaches_is_named():
    def build():
        machine = fetch_machine()
        with machine:
            smach.StateMachine.add('ELSEWHERE', Works())
        return machine

    report = soak(build, trials=10, states=['ELSEWHERE', 'PICK'])
    assert report.not_visited == ('ELSEWHERE',)
    assert 'Not visited without a fault: ELSEWHERE.' in str(report)
    assert {row.state for row in report.rows} == {'PICK'}


def test_the_same_seed_gives_the_same_report():
    texts = [str(soak(nested_machine, trials=30, seed=seed)) for seed in (1, 1, 2)]
    assert texts[0] == texts[1] != texts[2]


def test_where_all_recover_nothing_is_found():
    report = soak(concurrence_machine, trials=20).assert_all_recovered()
    assert report.assert_every_failure_can_recover() is report
    assert {row.state for row in report.rows} == {'BOTH/PICK', 'BOTH/LOOK'}
    assert 'Never recovered' not in str(report)


def learned_by(machine):
    return [row._replace(recoveries=0) for row in oracle_of(machine).rates()]


@pytest.mark.parametrize('wrapped', [False, True])
def test_each_trial_finds_the_machine_as_it_was(wrapped):
    machine = fetch_machine(detect=Works(output_keys=['n']))
    machine.userdata.n = 1
    if wrapped:
        OracleContainer.wrap(machine)
        with Bench(machine) as bench:
            bench.run()
        learned = learned_by(machine)
    soak(machine, trials=30, states=['PICK'])
    assert machine.userdata._data == {'n': 1}
    assert isinstance(machine, OracleContainer) is wrapped
    if wrapped:
        assert learned_by(machine) == learned


def test_what_was_learned_in_one_trial_is_not_known_in_the_next():
    machine = OracleContainer.wrap(fetch_machine())
    report = soak(
        machine,
        trials=30,
        states=['PICK'],
        most_in_row=1,
        settings={'moderate_from': 0.25, 'high_from': 0.3},
    )
    assert not any(trial.asked for trial in report.trials)


def test_a_failure_at_every_visit_needs_the_expert():
    report = soak(
        fetch_machine,
        trials=10,
        states=['PICK'],
        most_in_row=None,
        expert=expert(lambda question: goto('PLACE')),
    )
    assert report.assert_all_recovered() and all(trial.asked for trial in report.trials)
    assert 'the expert asked in' in str(report)


def test_sometimes_is_neither_never_nor_always():
    report = soak(
        fetch_machine,
        trials=30,
        states=['PICK'],
        most_in_row=2,
        kinds=[FaultKind.OUTCOME],
        settings={'max_recoveries': 1},
    )
    (row,) = report.sometimes_recovered
    assert 0 < row.recovered < row.trials
    assert report.assert_every_failure_can_recover()
    with pytest.raises(AssertionError, match='some trials did not recover'):
        report.assert_all_recovered()


def test_hangs_and_overruns_go_with_time_limits():
    report = soak(
        fetch_machine,
        trials=4,
        states=['PICK'],
        most_in_row=1,
        overrun_s=600,
        kinds=[FaultKind.HANG, FaultKind.OVERRUN],
        settings={'states': {'PICK': {'time_limit_s': 0.7}}},
    )
    assert report.assert_all_recovered()
    assert {row.kind for row in report.rows} == {'hang', 'overrun'}


def test_a_trial_that_does_not_end_counts_as_not_recovered():
    report = soak(fetch_machine, trials=1, states=['PICK'], kinds=['hang'], limit_s=1.5)
    assert 'the trial did not end within 1.5 s' in str(report)
    assert [row.kind for row in report.never_recovered] == ['hang']


def test_a_machine_that_fails_by_itself_is_no_machine_to_soak():
    broken = smach.StateMachine(OUTCOMES)
    with broken:
        smach.StateMachine.add('PICK', Works(['aborted']))
    broken['PICK'].execute = lambda userdata: 'aborted'
    with pytest.raises(AssertionError, match='does not end well even without a fault'):
        soak(broken, trials=1)


@pytest.mark.parametrize(
    'machine, more, said',
    [
        (fetch_machine, {'states': ['PIKC']}, "a soak: there is no state 'PIKC' (did you mean"),
        (lambda: 3, {}, '3 is no StateMachine, nor a function that builds one'),
        (lambda: fetch_machine(), {'states': ['PICK'], 'kinds': []}, 'nothing can fail by no kind'),
    ],
)
def test_what_cannot_be_soaked_is_refused(machine, more, said):
    with pytest.raises(FaultError) as refused:
        soak(machine, trials=1, **more)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    'given',
    [{'trials': 0}, {'trials': -1}, {'most_in_row': 0}, {'trials': 2.0}, {'most_in_row': True}],
)
def test_a_soak_that_would_show_nothing_is_refused(given):
    name, value = list(given.items())[0]
    with pytest.raises(FaultError, match='{} is {!r}; give a whole number'.format(name, value)):
        soak(fetch_machine, **dict({'trials': 2}, **given))


def test_a_trial_of_a_soak_has_a_number_from_1():
    with pytest.raises(FaultError, match='number is 0'):
        soak_trial(fetch_machine, 0)


def test_one_name_is_not_read_letter_by_letter():
    with pytest.raises(FaultError, match="kinds: 'none' .*; allowed is a list of outcome"):
        soak(machine_with_one_cup, trials=1, kinds='none')
