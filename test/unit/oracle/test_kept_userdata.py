"""Userdata that a recovery wrote stay in their container: a restore in one above keeps none."""

import pytest
from guarded_machines import chain
from machines import FakeExpert, Scripted, Watched, goto

import smach
from smach_oracle.oracle.machine.userdata import WriteWatch
from smach_oracle.oracle.records.events import EventKind

IO = {'input_keys': ['x'], 'output_keys': ['x']}
LEFT = {'memory': 1000, 'step_back_across': True}
ASKS = {'max_recoveries': 0}
UNSURE = {'prior': 0.5, 'memory': 1000}  # it asks where a precondition is not met


def achieve(ud):
    """A precondition that writes a key of the failed state's container."""
    ud.x = 'achieved'
    return True


def finding(seen):
    """A state that notes x at each visit, and writes it."""

    def find(state, ud):
        seen.append(ud.x if 'x' in ud else None)
        ud.x = 'found'
        return 'ok'

    return Scripted(find, find, find, **IO)


def nested(**states):
    """A chain with x among its input and output keys."""
    machine = chain(**states)
    machine.register_io_keys(['x'])
    return machine


def run(machine, *answers, preconditions=None, **settings):
    machine.userdata.x = 'at the start'
    watched = Watched(
        machine,
        name='TOP',
        expert=FakeExpert(*answers),
        settings=settings,
        preconditions=preconditions,
    )
    assert watched.run() == 'done'
    return watched


def grasp(*script):
    """A state that ends as told."""
    return Scripted(*script, **IO)


@pytest.mark.parametrize(
    'answers, settings, failures',
    [
        ((), LEFT, 2),
        ((goto('FIND', container='TOP'),), UNSURE, 1),
        ((None,), {**UNSURE, 'on_no_answer': {'goto': '/FIND'}}, 1),
    ],
    ids=['the policy steps back', 'the expert says where', 'nobody answers'],
)
def test_a_container_that_is_left_keeps_what_its_preconditions_wrote(answers, settings, failures):
    seen = []
    machine = chain(
        FIND=finding(seen), PICK=nested(GRASP=grasp(*['aborted'] * failures), LIFT=Scripted())
    )
    watched = run(
        machine,
        *answers,
        **settings,
        preconditions={
            'PICK/GRASP': [achieve] if settings is LEFT else [achieve, lambda ud: False]
        },
    )
    assert 'met' in [event.outcome for event in watched.of(EventKind.PRECONDITION_END)]
    assert seen == ['at the start', 'at the start']


def test_an_expert_s_outputs_stay_in_the_container_that_is_left():
    seen = []
    machine = chain(FIND=finding(seen), PICK=nested(GRASP=grasp('aborted'), LIFT=Scripted()))
    run(machine, goto('FIND', container='TOP', outputs={'x': 'told'}), **ASKS)
    assert seen == ['at the start', 'at the start']


def test_a_level_above_that_decides_keeps_what_its_own_preconditions_wrote():
    seen = []
    machine = chain(
        FIND=finding(seen),
        PICK=nested(ARM=nested(GRASP=grasp('aborted', 'aborted'), LIFT=Scripted())),
    )
    watched = run(
        machine,
        escalate=True,
        **LEFT,
        states={'GRASP': {'prior': 0.5}, 'ARM': {'preconditions': [achieve, lambda ud: False]}},
    )
    assert watched.of(EventKind.JUMP)[-1].target == 'FIND'
    assert seen == ['at the start', 'at the start']


def test_within_its_container_what_a_precondition_wrote_survives():
    seen = []
    machine = chain(FIND=finding(seen), GRASP=grasp('aborted', 'aborted'))
    run(machine, states={'GRASP': {'preconditions': [achieve]}}, memory=1000)
    assert seen == ['at the start', 'achieved']


def test_a_value_that_a_precondition_leaves_as_it_is_counts_as_written_after_the_next_one():
    def confirms(ud):
        ud.x = ud.x
        return True

    def looks(ud):
        return True

    def writes(state, ud):
        seen.append(ud.x)
        ud.x = 'written'
        return 'aborted' if len(seen) == 1 else 'ok'

    seen = []
    run(chain(A=Scripted(writes, writes, **IO)), preconditions={'A': [confirms, looks]})
    assert seen == ['at the start', 'written']


def test_what_another_branch_has_written_since_is_not_taken_back():
    machine = smach.StateMachine(['done'])
    watch = WriteWatch(machine, ())
    watch.begin()
    watch.gate['x'] = 'by a precondition that is met'
    begun = watch.begin()
    machine.userdata.x = 'by another branch'
    watch.gate['y'] = 'by one that is not met'
    watch.take_back_own(begun)
    assert machine.userdata.x == 'by another branch'
    assert 'y' not in machine.userdata
