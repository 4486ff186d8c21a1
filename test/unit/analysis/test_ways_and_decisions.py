"""Which way was gone after a failure, and by which decision: read from recorded trials."""

import pytest
from test_by_state import DONE, story, ways_of
from test_way_reader import ALL, Answers, NoWait, Scripted

import smach
from smach_oracle import analysis
from smach_oracle.analysis.by_state.follower import states_of
from smach_oracle.analysis.trials import load_by_state
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.ros.recorder import TrialRecorder


def recorded(folder, machine, **more):
    """Run a machine under the oracle. Return what the rows say, and the counts by state."""
    OracleContainer.wrap(machine, name='TOP', **more)
    oracle_of(machine).waiting = NoWait()
    recorder = TrialRecorder(str(folder), warn=pytest.fail)
    recorder.attach(machine)
    assert machine.execute() == 'succeeded'
    assert recorder.close(20.0)
    (counts,) = load_by_state([str(folder)]).states.values()
    return analysis.read(folder), counts


def machine_with(*labels_and_states):
    machine = smach.StateMachine(ALL)
    with machine:
        for label, state in labels_and_states:
            smach.StateMachine.add(label, state)
    return machine


@pytest.mark.parametrize('is_machine', [False, True])
def test_a_state_may_be_recovered_after_an_expert_has_done_its_work_for_an_earlier_item(
    is_machine, tmp_path
):
    pick = Scripted(*['aborted'] * 4, 'succeeded', 'aborted')
    items = smach.Iterator(
        ALL, [], [], it=[1, 2, 3], it_label='item', exhausted_outcome='succeeded'
    )
    with items:
        each = machine_with(('PICK', pick)) if is_machine else pick
        smach.Iterator.set_contained_state('EACH', each, loop_outcomes=['succeeded'])
    trials, counts = recorded(
        tmp_path,
        machine_with(('ALL', items)),
        expert=Answers(DONE),
        settings={'policy': 'prose'},
    )
    found = counts.states['TOP/ALL/EACH' + '/PICK' * is_machine]
    assert found.not_recovered == 0
    assert ways_of(found) == {'trying it again': (1, 3, 0), 'expert: did its work': (1, 0, 0)}
    last = trials.decisions()[-1]
    assert (last.decision, last.way, last.helped) == ('revisit', 'trying it again', True)
    assert len(counts.times.to_resume) == 1 and counts.times.to_resume[0] < counts.robot_s


def test_the_jump_by_the_outcome_that_an_expert_chose_is_no_way_of_its_own():
    jump = (EventKind.JUMP, {'target': 'PLACE', 'by': 'ann'})
    failed, done = (EventKind.FAILURE, {}), (EventKind.SUPERSEDE, {'target': 'PLACE'})
    found = states_of(story((EventKind.STATE_START, {}), failed, done, jump))
    assert list(found.states['TOP/PICK'].ways) == ['expert: did its work']
    ended = (EventKind.SUPERSEDE, {'target': 'succeeded'})
    asked = (EventKind.QUERY_OPENED, {'query_id': 'q'})  # it was held back, and did not begin
    found = states_of(story((EventKind.STATE_START, {}), failed, ended, asked, jump))
    ways = ['expert: did its work', 'expert: going to PLACE']
    assert sorted(found.states['TOP/PICK'].ways) == ways


def test_the_robot_goes_on_as_the_work_of_the_expert_ends_the_container():
    asked, fields = {'query_id': 'q'}, {'query_id': 'q', 'outcome': 'supersede'}
    found = states_of(
        story(
            (EventKind.STATE_START, {}),
            (EventKind.FAILURE, {}),
            (EventKind.QUERY_OPENED, asked),
            (EventKind.QUERY_ANSWERED, fields),
            (EventKind.SUPERSEDE, {'target': 'succeeded'}),
            (EventKind.STATE_START, {}),
            (EventKind.FAILURE, {}),
            (EventKind.DECISION, {'outcome': 'revisit'}),
            (EventKind.JUMP, {'target': 'PICK'}),
        )
    )
    assert found.times.to_resume == [2.0]


def test_a_way_belongs_to_the_level_whose_oracle_decided_it(tmp_path):
    arm = machine_with(('GRASP', Scripted('aborted', 'aborted')))
    machine = smach.StateMachine(ALL)
    with machine:
        smach.StateMachine.add('LOOK', Scripted(), {'succeeded': 'ARM'})
        smach.StateMachine.add('ARM', arm)
    states = {'GRASP': {'moderate_from': 0.1}}
    settings = {'policy': 'algorithm1', 'tree': {'escalate': True}, 'states': states}
    trials, counts = recorded(tmp_path, machine, settings=settings)
    assert [(row.state, row.decision, row.way, row.helped) for row in trials.decisions()] == [
        ('TOP/ARM/GRASP', 'step_back', 'trying it again', False),
        ('TOP/ARM/GRASP', 'ask', '', None),
        ('TOP/ARM', 'step_back', 'going back to LOOK', True),
    ]
    assert [(row.state, row.way) for row in trials.failures()] == [
        ('TOP/ARM/GRASP', 'trying it again'),
        ('TOP/ARM/GRASP', ''),
        ('TOP/ARM', 'going back to LOOK'),
    ]
    grasp, around = counts.states['TOP/ARM/GRASP'], counts.states['TOP/ARM']
    assert (grasp.not_recovered, ways_of(grasp)) == (1, {'trying it again': (0, 1, 0)})
    assert (around.not_recovered, ways_of(around)) == (0, {'going back to LOOK': (1, 0, 0)})
