"""Faults in machines of every kind, which stay as they were."""

import subprocess
import sys
import threading

import pytest
from bench_machines import (
    BUILDERS,
    Works,
    concurrence_machine,
    fetch_machine,
    iterator_machine,
    nested_machine,
)

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.testing import FaultError, crash, fail, faults, hang, overrun, stub
from smach_oracle.testing.places import places_of


def state_of(machine, label):
    return next(place.state for place in places_of(machine) if place.label == label)


def everything_in(machine):
    """What a machine consists of, as far as faults could change it."""
    places = places_of(machine)
    return [
        (place.path, id(place.state), type(place.state), 'execute' in vars(place.state))
        for place in places
    ] + [type(machine)]


@pytest.mark.parametrize('build', BUILDERS)
@pytest.mark.parametrize('wrapped', [False, True])
def test_a_fault_happens_in_every_kind_of_container_and_leaves_no_trace(build, wrapped):
    machine = OracleContainer.wrap(build()) if wrapped else build()
    machine.execute()
    before = everything_in(machine)
    runs = state_of(machine, 'PICK').runs
    with faults(machine, [fail('PICK', outcome='aborted')]) as injection:
        assert machine.execute() == 'aborted'
    assert state_of(machine, 'PICK').runs == runs
    assert injection.armed[0].happened >= 1
    assert everything_in(machine) == before
    assert machine.execute() == 'succeeded'


@pytest.mark.parametrize('build', BUILDERS)
def test_an_exception_leaves_every_kind_of_container_as_one_of_a_state_does(build):
    machine = build()
    with faults(machine, [crash('PICK', error=ZeroDivisionError('planted'))]):
        with pytest.raises(smach.InvalidUserCodeError):
            machine.execute()
    assert 'execute' not in vars(state_of(machine, 'PICK'))


def hang_until_preempted(machine, label):
    entered = threading.Event()
    with faults(machine, [hang(label)]) as injection:
        injection._report = lambda place, visit, what, text: what == 'fault' and entered.set()
        call = threading.Thread(target=machine.execute)
        call.start()
        assert entered.wait(20) and call.is_alive()
        machine.request_preempt()
        call.join(20)
        assert not call.is_alive()


@pytest.mark.parametrize('build', BUILDERS)
def test_a_state_that_hangs_waits_for_its_preempt(build):
    machine = build()
    hang_until_preempted(machine, 'PICK')
    assert state_of(machine, 'PICK').runs == 0
    assert machine.execute() == 'succeeded'


@pytest.mark.parametrize(
    'build, label',
    [(nested_machine, 'KITCHEN'), (concurrence_machine, 'BOTH'), (iterator_machine, 'EACH')],
)
@pytest.mark.parametrize('fault', [fail, crash, hang])
def test_a_container_fails_as_a_state_does_and_works_the_next_time(build, label, fault):
    machine = OracleContainer.wrap(
        build(), settings={'states': {label: {'time_limit_s': 1.0 if fault is hang else 60}}}
    )
    with faults(machine, [fault(label, visit=1)]) as injection:
        assert machine.execute() == 'succeeded'
    assert injection.armed[0].happened == 1
    assert state_of(machine, 'PICK').runs == (3 if build is iterator_machine else 1)


def test_a_fault_happens_at_its_visit_alone():
    machine = iterator_machine()
    with faults(machine, [fail('PICK', visit=2, outcome='aborted')]):
        assert machine.execute() == 'aborted'
    assert state_of(machine, 'PICK').runs == 1


def test_several_visits_may_fail():
    machine = OracleContainer.wrap(fetch_machine())
    with faults(machine, [fail('PICK', visit=range(1, 4))]) as injection:
        assert machine.execute() == 'succeeded'
    assert injection.armed[0].happened == 3


def test_of_several_faults_at_one_visit_the_first_happens():
    machine = fetch_machine()
    both = [fail('PICK', visit=2, outcome='aborted'), fail('PICK', outcome='preempted')]
    with faults(machine, both) as injection:
        assert [machine.execute(), machine.execute()] == ['preempted', 'aborted']
    assert [armed.happened for armed in injection.armed] == [1, 1]


def test_an_overrun_comes_before_the_work():
    machine = fetch_machine()
    with faults(machine, [overrun('PICK', 0.05)]):
        assert machine.execute() == 'succeeded'
    assert state_of(machine, 'PICK').runs == 1


def test_an_overrun_that_is_preempted_does_no_work():
    machine = OracleContainer.wrap(
        fetch_machine(), settings={'states': {'PICK': {'time_limit_s': 0.05, 'max_recoveries': 0}}}
    )
    with faults(machine, [overrun('PICK', 600)]):
        assert machine.execute() == 'aborted'
    assert state_of(machine, 'PICK').runs == 0


def test_outputs_are_written():
    pick = Works(output_keys=['grip'])
    machine = fetch_machine(pick=pick)
    with faults(machine, [fail('PICK', outcome='succeeded', outputs={'grip': 'empty'})]):
        assert machine.execute() == 'succeeded'
    assert machine.userdata.grip == 'empty'


def outcomes_at(seed, trials=40):
    machine = fetch_machine()
    with faults(machine, [fail('PICK', probability=0.5, seed=seed)]):
        return [machine.execute() for _ in range(trials)]


def test_a_probability_gives_the_same_faults_from_the_same_seed():
    assert outcomes_at(1) == outcomes_at(1) != outcomes_at(2)
    assert {'succeeded', 'aborted'} == set(outcomes_at(1))


def test_the_same_object_under_two_labels_fails_under_one():
    shared = Works()
    machine = fetch_machine(pick=shared, place=shared)
    with faults(machine, [fail('PLACE')]):
        assert machine.execute() == 'aborted'
    assert shared.runs == 1


def test_a_run_as_precondition_is_no_visit():
    machine = OracleContainer.wrap(fetch_machine(), preconditions={'PICK': ['DETECT']})
    with faults(machine, [fail('PICK', visit=1), fail('DETECT', visit=2)]) as injection:
        assert machine.execute() == 'succeeded'
    assert [armed.happened for armed in injection.armed] == [1, 0]
    assert state_of(machine, 'DETECT').runs == 2


def test_an_execute_that_was_patched_before_stays_patched():
    machine = fetch_machine()
    state = state_of(machine, 'PICK')
    state.execute = patched = lambda userdata: 'aborted'
    with faults(machine, [fail('PICK', visit=1, outcome='preempted')]):
        assert machine.execute() == 'preempted'
        assert machine.execute() == 'aborted'
    assert state.execute is patched


def test_a_machine_may_be_wrapped_while_faults_are_in_it():
    machine = nested_machine()
    with faults(machine, [fail('PICK', visit=1)]) as injection:
        assert OracleContainer.wrap(machine).execute() == 'succeeded'
    assert injection.armed[0].happened == 1


@pytest.mark.parametrize(
    'fault, said',
    [
        (
            lambda: fail('PIKC'),
            "a fault: there is no state 'PIKC' (did you mean 'PICK'?); there are KITCHEN, "
            'KITCHEN/DETECT, KITCHEN/PICK, KITCHEN/PLACE',
        ),
        (lambda: fail('HALL/PICK'), "there is no state 'HALL/PICK'"),
        (
            lambda: fail('PICK', outcome='abroted'),
            "a fault: KITCHEN/PICK has no outcome 'abroted' (did you mean 'aborted'?); "
            "name one of 'aborted', 'preempted', 'succeeded'",
        ),
        (lambda: 'PICK', "'PICK' is not a fault; make one with fail, crash, hang, overrun or stub"),
    ],
)
def test_a_fault_that_fits_no_state_names_what_is_there(fault, said):
    machine = nested_machine()
    before = everything_in(machine)
    with pytest.raises(FaultError) as refused:
        with faults(machine, [fail('PLACE'), fault()]):
            raise AssertionError('it was taken')
    assert said in str(refused.value)
    assert everything_in(machine) == before


def test_a_name_that_is_like_none_is_not_guessed_at():
    with pytest.raises(FaultError, match="no state 'WASH_THE_DISHES'; there are"):
        faults(nested_machine(), [fail('WASH_THE_DISHES')]).__enter__()


LITTLE_TEST = """
import smach
from smach_oracle.testing import Bench, fail

def test_it():
    machine = smach.StateMachine(['succeeded', 'aborted'])
    with machine:
        pick = smach.CBState(lambda userdata: 'succeeded', ['succeeded', 'aborted'])
        smach.StateMachine.add('PICK', pick)
    Bench(machine, [fail('PIKC')])
"""


def test_pytest_leaves_out_the_frames_of_the_kit(tmp_path):
    (tmp_path / 'test_little.py').write_text(LITTLE_TEST)
    told = subprocess.run(
        [sys.executable, '-m', 'pytest', '-p', 'no:cacheprovider', str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
    ).stdout
    assert "did you mean 'PICK'?" in told
    assert not any(file in told for file in ('places.py', 'injection.py', 'bench.py', 'faults.py'))


def test_a_stub_stands_for_the_work_of_a_state_and_faults_come_first():
    machine = fetch_machine()
    state_of(machine, 'PICK').register_output_keys(['grasp'])
    with faults(machine, [stub('PICK', grasp='from above'), fail('PICK', visit=1)]) as injection:
        assert machine.execute() == 'aborted'
        assert 'grasp' not in machine.userdata
        assert machine.execute() == 'succeeded'
    assert machine.userdata.grasp == 'from above'
    assert [armed.happened for armed in injection.armed] == [1, 1]
    assert state_of(machine, 'PICK').runs == 0


@pytest.mark.parametrize('name', ['PICK', 'KITCHEN/PICK', 'SM_ROOT/KITCHEN/PICK'])
def test_a_state_goes_by_its_label_and_its_path(name):
    machine = nested_machine()
    with faults(machine, [fail(name)]):
        assert machine.execute() == 'aborted'


def test_a_label_that_is_there_twice_needs_its_path():
    machine = smach.StateMachine(['succeeded', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('LEFT', fetch_machine(), {'succeeded': 'RIGHT'})
        smach.StateMachine.add('RIGHT', fetch_machine())
    with pytest.raises(FaultError, match='2 states; say which: LEFT/PICK, RIGHT/PICK'):
        with faults(machine, [fail('PICK')]):
            raise AssertionError('it was taken')
    with faults(machine, [fail('RIGHT/PICK')]):
        assert machine.execute() == 'aborted'
    assert machine['LEFT']['PICK'].runs == 1 and machine['RIGHT']['PICK'].runs == 0


def test_an_outcome_is_to_be_named_where_several_are_failures_or_none():
    machine = fetch_machine(
        pick=Works(['succeeded', 'slip_failed', 'grasp_failed']),
        place=Works(['succeeded', 'dropped']),
    )
    with pytest.raises(
        FaultError,
        match='PICK has 2 outcomes that are named like a failure; name '
        "one of 'grasp_failed', 'slip_failed', 'succeeded'",
    ):
        faults(machine, [fail('PICK')]).__enter__()
    with pytest.raises(FaultError, match='PLACE has no outcomes that are named like a failure'):
        faults(machine, [fail('PLACE')]).__enter__()


@pytest.mark.parametrize(
    'make, said',
    [
        (lambda: fail('PICK', visit=0), 'visit 0 is not there; the first visit is 1'),
        (lambda: hang('PICK', visit=[2, -1]), 'visit -1 is not there'),
        (lambda: crash('PICK', visit=[]), 'the first visit is 1'),
        (lambda: fail('PICK', probability=1.5), 'probability 1.5 is not within 0 to 1'),
        (lambda: overrun('PICK', -1), '-1 s is not a time'),
    ],
)
def test_what_no_fault_can_be_is_refused_at_once(make, said):
    with pytest.raises(FaultError) as refused:
        make()
    assert said in str(refused.value) and 'PICK' in str(refused.value)


@pytest.mark.parametrize(
    'fault, words',
    [
        (fail('PICK', visit=2, outcome='aborted'), "PICK ends in 'aborted' at visit 2"),
        (crash('PICK'), "PICK raises RuntimeError('a fault of this test') at every visit"),
        (hang('A/B', for_good=True), 'A/B hangs for good at every visit'),
        (hang('PICK', visit=(1, 3)), 'PICK hangs until it is preempted at visit 1, 3'),
        (
            overrun('PICK', 2.5, probability=0.25),
            'PICK takes 2.5 s longer at every visit with probability 0.25',
        ),
    ],
)
def test_a_fault_reads_as_a_sentence(fault, words):
    assert str(fault) == words
