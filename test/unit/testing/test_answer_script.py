"""An expert by script answers what its script says, and nothing else."""

import pytest
from bench_machines import OUTCOMES, Works, fetch_machine, nested_machine

import smach
from smach_oracle.testing import (
    Bench,
    ScriptError,
    expert,
    fail,
    give_up,
    goto,
    no_answer,
    supersede,
    use_interface,
)

ASKS = {'max_recoveries': 0}


def trial_with(script, *faults, machine=None, **settings):
    with Bench(
        machine or fetch_machine(),
        faults or [fail('PICK', visit=1)],
        expert=script,
        settings=dict(ASKS, **settings),
    ) as bench:
        return bench.run()


def test_goto_leads_to_a_state():
    trial = trial_with(expert(goto('DETECT')))
    trial.assert_jumped('PICK', to='DETECT').assert_recovered('PICK')


def test_supersede_writes_outputs():
    machine = fetch_machine(pick=Works(output_keys=['grip']))
    trial_with(
        expert(supersede('succeeded', outputs={'grip': 3})), machine=machine
    ).assert_recovered('PICK').assert_visited(['PICK', 'PLACE'])
    assert machine.userdata.grip == 3


def test_giving_up_is_no_recovery():
    trial = trial_with(expert(give_up('preempted'))).assert_ended_with('preempted')
    assert trial.gave_up and not trial.ended_well


def test_no_answer_takes_no_time_and_falls_back():
    trial_with(expert(no_answer()), deadline_s=0, on_no_answer={'goto': 'DETECT'}).assert_jumped(
        'PICK', to='DETECT'
    ).assert_recovered()


def test_an_interface_hands_its_result_over():
    trial = trial_with(
        expert(use_interface('arm', 'succeeded')), interfaces={'arm': {'action': '/arm'}}
    )
    assert 'interface arm ends: succeeded' in str(trial.assert_recovered('PICK'))


def test_answers_come_in_their_order_and_anew_in_each_trial():
    with Bench(
        fetch_machine(),
        [fail('PICK', visit=(1, 2))],
        settings=ASKS,
        expert=expert([goto('DETECT'), goto('PLACE')]),
    ) as bench:
        for _ in range(2):
            bench.run().assert_visited(['DETECT', 'PICK', 'DETECT', 'PICK', 'PLACE'], exactly=True)


def test_a_function_answers_all_questions():
    trial = trial_with(
        expert(lambda question: goto(question.failed_state)),
        fail('PICK', visit=(1, 2)),
        fail('PLACE', visit=1),
    )
    trial.assert_asked_about('PICK', times=2).assert_asked_about('PLACE', times=1)


def test_functions_and_answers_mix_in_a_list():
    script = expert(goto('DETECT', about='PICK'), lambda question: supersede('succeeded'))
    trial = trial_with(script, fail('PICK', visit=(1, 2)))
    trial.assert_recovered().assert_asked_about('PICK', times=2)


def test_a_question_too_many_fails_the_test_with_the_trial():
    with pytest.raises(ScriptError) as raised:
        trial_with(expert(goto('DETECT')), fail('PICK'))
    said = str(raised.value)
    assert 'a question that the script does not expect: the question about SM_ROOT/PICK' in said
    assert 'the script has goto DETECT' in said
    assert 'jump to DETECT by script' in said


def test_an_expert_without_answers_expects_no_question():
    with pytest.raises(ScriptError, match='the script has no answers'):
        trial_with(expert())


def test_a_question_about_another_state_fails_the_test():
    with pytest.raises(
        ScriptError,
        match='expects a question about PLACE, and this is the question about SM_ROOT/PICK',
    ):
        trial_with(expert(goto('DETECT', about='PLACE')))


def test_the_state_asked_about_may_be_given_by_its_path():
    trial = trial_with(
        expert(supersede('succeeded', about='KITCHEN/PICK')),
        machine=nested_machine(),
        escalate=False,
    )
    trial.assert_recovered('KITCHEN/PICK')


@pytest.mark.parametrize(
    'answer, said',
    [
        (goto('DETECCT'), "no state 'DETECCT' to go to"),
        (supersede('done'), "no outcome 'done' to supersede it with"),
        (supersede('succeeded', outputs={'x': 1}), 'PICK has no output keys x'),
        (give_up('lost'), "no outcome 'lost' to give up with"),
        (use_interface('arm', 'succeeded'), "no interface 'arm' is on offer"),
    ],
)
def test_an_answer_that_does_not_fit_fails_the_test(answer, said):
    with pytest.raises(ScriptError) as raised:
        trial_with(expert(answer))
    assert 'the answer of the script does not fit' in str(raised.value)
    assert said in str(raised.value)


def test_a_function_that_raises_fails_the_test():
    with pytest.raises(ScriptError, match='the script failed at .* KeyError'):
        trial_with(expert(lambda question: {}[question.failed_state]))


def test_what_is_no_answer_is_refused_at_once():
    with pytest.raises(ScriptError, match="'DETECT' is not an answer; give goto, supersede"):
        expert('DETECT')


def test_answers_that_nobody_needed_are_counted():
    script = expert(goto('DETECT'), goto('DETECT'))
    trial_with(script).assert_recovered()
    assert script.left == 1


def two_rooms():
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('KITCHEN', fetch_machine(), {'succeeded': 'HALL'})
        smach.StateMachine.add('HALL', fetch_machine(), {'succeeded': 'TABLE'})
        smach.StateMachine.add('TABLE', Works())
    return machine


@pytest.mark.parametrize('state', ['KITCHEN/PICK', 'SM_ROOT/KITCHEN/PICK'])
def test_goto_leads_to_a_state_of_another_container_by_its_path(state):
    trial = trial_with(expert(goto(state)), fail('TABLE', visit=1), machine=two_rooms())
    trial.assert_jumped('TABLE', to='KITCHEN/PICK').assert_ended_with('succeeded')
    trial.assert_visited(['KITCHEN/PICK', 'HALL/PICK', 'TABLE', 'KITCHEN/PICK', 'TABLE'])


def test_a_label_that_several_other_containers_have_needs_its_path():
    with pytest.raises(ScriptError, match='it is in SM_ROOT/HALL, SM_ROOT/KITCHEN: name'):
        trial_with(expert(goto('PICK')), fail('TABLE', visit=1), machine=two_rooms())


def three_levels():
    inner = smach.StateMachine(OUTCOMES)
    with inner:
        smach.StateMachine.add('GRASP', Works(), {'succeeded': 'succeeded'})
    middle = smach.StateMachine(OUTCOMES)
    with middle:
        smach.StateMachine.add('ARM', inner, {'succeeded': 'succeeded'})
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('PICK', middle, {'succeeded': 'TABLE'})
        smach.StateMachine.add('TABLE', Works())
    return machine


@pytest.mark.parametrize(
    'container, ended',
    [
        ('PICK', 'SM_ROOT/PICK'),
        ('SM_ROOT/PICK', 'SM_ROOT/PICK'),
        ('SM_ROOT', 'SM_ROOT'),
        ('ARM', 'SM_ROOT/PICK/ARM'),
        ('PICK/ARM', 'SM_ROOT/PICK/ARM'),
        ('', 'SM_ROOT/PICK/ARM'),
    ],
)
def test_a_level_above_may_be_given_up(container, ended):
    trial = trial_with(
        expert(give_up('succeeded', container=container)),
        fail('GRASP', visit=1),
        machine=three_levels(),
    )
    trial.assert_ended_with('succeeded')
    (given_up,) = [event for event in trial.events if event.kind.name == 'GIVE_UP']
    assert (given_up.path, given_up.outcome) == (ended, 'succeeded')
    assert ('TABLE' in trial.visits()) == (container != 'SM_ROOT')


@pytest.mark.parametrize(
    'answer, said',
    [
        (give_up('lost', container='PICK'), "SM_ROOT/PICK has no outcome 'lost' to give up with"),
        (give_up(container='PICK'), "SM_ROOT/PICK has no outcome '' to give up with"),
        (
            give_up('succeeded', container='TABLE'),
            "TABLE has no outcome 'succeeded' to give up with",
        ),
    ],
)
def test_a_level_that_cannot_be_given_up_so_fails_the_test(answer, said):
    with pytest.raises(ScriptError) as raised:
        trial_with(expert(answer), fail('GRASP', visit=1), machine=three_levels())
    assert said in str(raised.value)
