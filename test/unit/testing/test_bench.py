"""The bench runs a machine under the oracle and gives it back."""

import threading

import pytest
from bench_machines import (
    BUILDERS,
    OUTCOMES,
    Works,
    concurrence_machine,
    fetch_machine,
    nested_machine,
)

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.asking.question import Expert
from smach_oracle.oracle.errors import TrialError
from smach_oracle.testing import (
    Bench,
    FaultError,
    TrialLimitError,
    crash,
    expert,
    fail,
    goto,
    hang,
    overrun,
)
from smach_oracle.testing import bench as bench_module


@pytest.mark.parametrize('build', BUILDERS)
def test_a_failure_in_every_kind_of_container_is_recovered_from(build):
    machine = build()
    with Bench(machine, [fail('PICK', visit=1, outcome='aborted')]) as bench:
        trial = bench.run()
        trial.assert_recovered('PICK').assert_failed('PICK', times=1).assert_not_asked()
        trial.assert_ended_with('succeeded').assert_all_faults_happened()
    assert type(machine) is type(build()) and machine.execute() == 'succeeded'


def test_a_machine_comes_off_the_bench_as_it_was():
    machine = nested_machine()
    with Bench(machine) as bench:
        bench.run()
        assert isinstance(machine, OracleContainer)
    for each in (machine, machine['KITCHEN']):
        assert type(each) is smach.StateMachine and 'ORACLE' not in each.get_children()
    assert not hasattr(machine, '_oracle')


def test_a_wrapped_machine_keeps_its_oracle_its_settings_and_its_expert():
    own = expert(goto('DETECT'))
    machine = OracleContainer.wrap(
        fetch_machine(), settings={'max_recoveries': 2}, expert=own, name='FETCH'
    )
    with Bench(machine, [fail('PICK')], settings={'max_recoveries': 0}) as bench:
        assert oracle_of(machine).settings.defaults.max_recoveries == 0
        bench.run([fail('PICK', visit=1)]).assert_asked_about('PICK', times=1).assert_recovered()
    oracle = oracle_of(machine)
    assert oracle.settings.defaults.max_recoveries == 2
    assert (oracle.expert, oracle.path, oracle.events.observers) == (own, 'FETCH', [])


def test_a_wrapped_machine_without_other_settings_has_its_own():
    machine = OracleContainer.wrap(fetch_machine(), settings={'max_recoveries': 0})
    with Bench(machine, [fail('PICK', visit=1)], expert=expert(goto('DETECT'))) as bench:
        bench.run().assert_asked_about('PICK').assert_visited(['PICK', 'DETECT', 'PICK'])


def test_a_rates_file_is_left_alone(tmp_path):
    rates = tmp_path / 'rates.json'
    machine = OracleContainer.wrap(fetch_machine(), settings={'rates_file': str(rates)})
    with Bench(machine, [fail('PICK', visit=1)]) as bench:
        bench.run().assert_recovered()
    assert not rates.exists()
    assert oracle_of(machine).settings.rates_file == str(rates)


def test_each_trial_counts_its_visits_and_may_have_faults_of_its_own():
    with Bench(fetch_machine(), [fail('PICK', visit=1)]) as bench:
        for _ in range(2):
            bench.run().assert_failed('PICK', times=1)
        bench.run([crash('PLACE', visit=1)]).assert_failed('PLACE')
        bench.run([]).assert_no_failures()


def test_a_machine_inside_a_wrapped_one_is_refused():
    machine = OracleContainer.wrap(nested_machine())
    with pytest.raises(TrialError, match='SM_ROOT/KITCHEN is wrapped inside another machine'):
        Bench(machine['KITCHEN'])


class HangsForGood(Works):
    """A state of the user's that ignores a preempt, until the test lets it go."""

    def __init__(self):
        Works.__init__(self)
        self.go = threading.Event()

    def execute(self, userdata):
        assert self.go.wait(60)
        return 'succeeded'


def test_a_state_of_ones_own_that_hangs_for_good_does_not_hang_the_test(monkeypatch):
    monkeypatch.setattr(bench_module, '_GRACE_S', 0.1)
    pick = HangsForGood()
    machine = fetch_machine(pick=pick)
    bench = Bench(machine, limit_s=1.5)
    with pytest.raises(TrialLimitError, match='PICK    is entered'):
        bench.run()
    with pytest.raises(TrialError, match='the machine runs already'):
        bench.run()
    pick.go.set()
    for thread in threading.enumerate():
        if thread.name == 'smach_oracle test bench':
            thread.join(20)
    bench.close()
    assert type(machine) is smach.StateMachine


def test_userdata_is_put_in_before():
    seen = []

    class Looks(Works):
        def execute(self, userdata):
            seen.append(userdata.cup)
            return 'succeeded'

    with Bench(fetch_machine(detect=Looks(input_keys=['cup']))) as bench:
        bench.run(userdata={'cup': 'red'})
    assert seen == ['red']


def test_without_an_expert_the_question_is_noted_and_no_time_passes():
    with Bench(fetch_machine(), [fail('PICK')], settings={'max_recoveries': 0}) as bench:
        trial = bench.run()
    trial.assert_asked_about('PICK', times=1).assert_ended_with('aborted')
    (question,) = trial.questions
    assert question.failed_state == 'PICK' and 'DETECT' in [
        choice.state for choice in question.choices
    ]


def test_an_expert_of_ones_own_is_asked():
    class Own(Expert):
        def ask(self, question, cancelled, progress):
            return goto('DETECT').answer

    with Bench(
        fetch_machine(), [fail('PICK', visit=1)], expert=Own(), settings={'max_recoveries': 0}
    ) as bench:
        bench.run().assert_jumped('PICK', to='DETECT').assert_recovered('PICK')


def test_an_error_of_the_machine_is_in_the_trial():
    machine = smach.StateMachine(['succeeded'])
    with machine:
        smach.StateMachine.add('PICK', Works(['succeeded']))
    with Bench(machine, [crash('PICK')], settings={'max_recoveries': 0}) as bench:
        trial = bench.run().assert_raised(smach.InvalidUserCodeError)
    assert trial.outcome is None and not trial.ended_well


def test_a_fault_that_fits_no_state_leaves_the_machine_bare():
    machine = fetch_machine()
    with pytest.raises(FaultError, match="no state 'PIKC' .*; there are DETECT, PICK, PLACE"):
        Bench(machine, [fail('PIKC')])
    assert type(machine) is smach.StateMachine
    with Bench(machine) as bench:
        with pytest.raises(FaultError, match='PICK has no outcome'):
            bench.run([fail('PICK', outcome='lost')])


def test_a_hang_with_a_time_limit_is_an_overrun():
    with Bench(
        fetch_machine(),
        [hang('PICK', visit=1)],
        settings={'states': {'PICK': {'time_limit_s': 1.0}}},
    ) as bench:
        trial = bench.run().assert_recovered('PICK').assert_failed('PICK', times=1)
    assert 'FAILS: time limit' in str(trial)


def test_a_state_that_takes_longer_than_its_limit_fails():
    with Bench(
        fetch_machine(),
        [overrun('PICK', 600, visit=1)],
        settings={'states': {'PICK': {'time_limit_s': 1.0}}},
    ) as bench:
        bench.run().assert_recovered('PICK')


def test_a_hang_for_good_is_let_go_at_the_end_of_the_trial():
    threads = set(threading.enumerate())
    with Bench(
        fetch_machine(),
        [hang('PICK', visit=1, for_good=True)],
        settings={'states': {'PICK': {'time_limit_s': 0.05, 'grace_period_s': 0.05}}},
    ) as bench:
        trial = bench.run()
    trial.assert_failed('PICK').assert_asked_about('PICK')  # it still runs: it cannot be entered
    for thread in set(threading.enumerate()) - threads:
        thread.join(20)
        assert not thread.is_alive()


@pytest.mark.parametrize('for_good', [False, True])
def test_a_trial_that_does_not_end_says_how_far_it_came(for_good):
    machine = nested_machine()
    with Bench(machine, [hang('PICK', for_good=for_good)], limit_s=1.5) as bench:
        with pytest.raises(TrialLimitError) as raised:
            bench.run()
    with Bench(machine) as bench:
        bench.run().assert_ended_with('succeeded')
    said = str(raised.value)
    assert 'did not end within 1.5 s' in said
    assert 'KITCHEN/DETECT  ends in succeeded -> PICK' in said
    assert 'fault: hangs' in said
    assert not machine.is_running()


def test_a_state_beside_another_recovers_by_itself():
    with Bench(concurrence_machine(), [crash('BOTH/PICK', visit=1)]) as bench:
        trial = bench.run().assert_recovered('BOTH/PICK').assert_failed('BOTH/PICK', times=1)
    assert trial.visits().count('BOTH/LOOK') == 1, 'the other one does not run again'
    assert 'FAILS: exception (RuntimeError: a fault of this test)' in str(trial)


def test_states_without_an_oracle_are_seen_though_no_event_tells_of_them():
    with Bench(
        concurrence_machine(), [crash('BOTH/PICK', visit=1)], settings={'nested': False}
    ) as bench:
        trial = bench.run().assert_recovered('BOTH').assert_failed('BOTH/PICK', times=1)
    assert trial.visits().count('BOTH/LOOK') == 2
    assert 'raises RuntimeError: a fault of this test' in str(trial)


class OwnMachine(smach.StateMachine):
    """A machine of the user's class."""

    def __init__(self):
        smach.StateMachine.__init__(self, OUTCOMES)
        with self:
            smach.StateMachine.add('PICK', Works())


def test_a_class_of_ones_own_stays_that():
    machine = OwnMachine()
    with Bench(machine, [fail('PICK', visit=1)]) as bench:
        bench.run().assert_recovered()
    assert type(machine) is OwnMachine
