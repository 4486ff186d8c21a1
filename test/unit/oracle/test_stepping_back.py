"""Steps back that lead out of the failed state's container."""

import pytest
from guarded_machines import chain
from machines import FakeExpert, Gate, Scripted, Watched, supersede

import smach
from smach_oracle.oracle.decision.policy import Action, Policy, Preconditions
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.visits import VisitResult

OUTCOMES = ['done', 'aborted', 'preempted']
SURE = {'memory': 1000}  # it stays LOW, whatever fails


def watched(machine, **settings):
    return Watched(
        machine,
        name='TOP',
        expert=FakeExpert(supersede('ok')),
        settings={**SURE, 'step_back_across': True, **settings},
    )


def decided(machine):
    return [(event.path, event.outcome, event.target) for event in machine.of(EventKind.DECISION)]


def jumped(machine):
    return [
        (event.path, event.target, event.data.get('from'), event.data.get('to'))
        for event in machine.of(EventKind.JUMP)
    ]


def find_and_pick(*script):
    return chain(FIND=Scripted(), PICK=chain(GRASP=Scripted(*script), LIFT=Scripted()))


@pytest.mark.parametrize(
    'across, visits',
    [
        (False, ['FIND', 'PICK', 'GRASP', 'GRASP', 'GRASP', 'LIFT']),
        (True, ['FIND', 'PICK', 'GRASP', 'GRASP', 'FIND', 'PICK', 'GRASP', 'LIFT']),
    ],
)
def test_the_first_state_of_a_nested_machine_steps_back_to_what_ran_before_it(across, visits):
    machine = watched(find_and_pick('aborted', 'aborted'), step_back_across=across)
    assert machine.run() == 'done' and machine.visits() == visits
    if across:
        assert decided(machine)[-1] == ('TOP/PICK', 'step_back', 'TOP/FIND')
        assert jumped(machine)[-1] == ('TOP', 'FIND', 'TOP/PICK/GRASP', None)
        assert machine.of(EventKind.DECISION)[-1].text.endswith(': going back to TOP/FIND')
        assert machine.rate('PICK').failures == 0 and machine.rate('GRASP').recoveries == 2
        assert [visit.result for visit in machine.machine._oracle.records.history.latest()] == [
            VisitResult.SUCCESS,
            VisitResult.PREEMPTED,
            VisitResult.SUCCESS,
            VisitResult.SUCCESS,
        ]


def test_a_state_before_which_something_was_visited_stays_in_its_container():
    machine = watched(
        chain(FIND=Scripted(), PICK=chain(REACH=Scripted(), GRASP=Scripted('aborted', 'aborted')))
    )
    assert machine.run() == 'done'
    assert decided(machine)[-1] == ('TOP/PICK', 'step_back', 'REACH')


def test_where_nothing_ran_before_on_one_level_the_next_one_above_is_gone_to():
    machine = watched(
        chain(FIND=Scripted(), PICK=chain(ARM=chain(GRASP=Scripted('aborted', 'aborted'))))
    )
    assert machine.run() == 'done'
    assert decided(machine)[-1] == ('TOP/PICK/ARM', 'step_back', 'TOP/FIND')


def test_where_nothing_ran_before_at_all_it_is_the_initial_state_of_its_own_container():
    machine = watched(chain(PICK=chain(GRASP=Scripted('aborted', 'aborted'))))
    assert machine.run() == 'done'
    assert decided(machine)[-1] == ('TOP/PICK', 'step_back', 'GRASP')


def test_no_step_back_crosses_a_border():
    both = smach.Concurrence(
        outcomes=OUTCOMES, default_outcome='aborted', outcome_map={'done': {'LEFT': 'done'}}
    )
    with both:
        smach.Concurrence.add('LEFT', chain(GRASP=Scripted('aborted', 'aborted')))
    machine = watched(chain(FIND=Scripted(), BOTH=both))
    assert machine.run() == 'done'
    assert decided(machine)[-1] == ('TOP/BOTH/LEFT', 'step_back', 'GRASP')


def test_with_algorithm1_it_is_the_latest_visit_in_the_container_above():
    machine = watched(find_and_pick('aborted'), policy='algorithm1')
    assert machine.run() == 'done'
    assert decided(machine) == [('TOP/PICK', 'step_back', 'TOP/FIND')]


def test_what_would_be_repeated_on_the_way_is_asked_about():
    machine = watched(
        chain(FIND=Scripted(), POUR=Scripted(), PICK=chain(GRASP=Scripted('aborted', 'aborted'))),
        states={'FIND': {'preconditions': [lambda ud: True]}, 'POUR': {'on_retry': 'confirm'}},
    )
    assert machine.run() == 'done'
    assert decided(machine)[-1] == ('TOP/PICK', 'ask', '')
    assert 'going back to TOP/POUR would repeat POUR' in machine.of(EventKind.DECISION)[-1].text


class Elsewhere(Policy):
    """A policy of a user's: it always goes to one place."""

    name = 'elsewhere'

    def __init__(self, target):
        self.target = target

    def is_continuous(self, context):
        return context.failed_last

    def decide(self, situation):
        return Action.ASK if situation.continuous else Action.STEP_BACK

    def step_back_target(self, context):
        return self.target


@pytest.mark.parametrize(
    'target, told, visits',
    [
        ('SEE/LOOK', 'TOP/SEE/LOOK', ['SEE', 'LOOK', 'PICK', 'ARM', 'MOVE', 'REACH', 'GRASP']),
        ('/SEE', 'TOP/SEE', ['SEE', 'AIM', 'LOOK', 'PICK', 'ARM', 'MOVE', 'REACH', 'GRASP']),
        ('PICK/ARM/REACH', 'TOP/PICK/ARM/REACH', ['ARM', 'REACH', 'GRASP']),
        ('GRASP', 'GRASP', ['GRASP']),
        ('PICK/GRASP', 'GRASP', ['GRASP']),
    ],
)
def test_a_policy_may_name_a_place_of_any_container(target, told, visits):
    machine = Watched(
        chain(
            SEE=chain(AIM=Scripted(), LOOK=Scripted()),
            PICK=chain(ARM=chain(MOVE=Scripted(), REACH=Scripted()), GRASP=Scripted('aborted')),
        ),
        name='TOP',
    )
    pick = machine.machine.get_children()['PICK']
    pick._oracle.in_force.policy = Elsewhere(target)
    assert machine.run() == 'done'
    assert decided(machine) == [('TOP/PICK', 'step_back', told)]
    assert machine.visits()[machine.visits().index('GRASP') + 1 :] == visits


def test_a_policy_that_names_no_place_asks():
    machine = Watched(find_and_pick('aborted'), name='TOP', expert=FakeExpert(supersede('ok')))
    machine.machine.get_children()['PICK']._oracle.in_force.policy = Elsewhere('KITCHEN/LOOK')
    assert machine.run() == 'done'
    assert decided(machine) == [('TOP/PICK', 'ask', '')]
    assert (
        "there is no state 'KITCHEN/LOOK' to go back to" in machine.of(EventKind.DECISION)[0].text
    )


def test_a_policy_of_a_level_above_may_name_a_place_of_any_container():
    machine = watched(
        chain(
            SEE=chain(AIM=Scripted(), LOOK=Scripted()),
            PICK=chain(ARM=chain(GRASP=Scripted('aborted', 'aborted'))),
        )
    )
    machine.machine.get_children()['PICK']._oracle.in_force.policy = Elsewhere('SEE/LOOK')
    assert machine.run() == 'done'
    assert decided(machine)[-1] == ('TOP/PICK/ARM', 'step_back', 'TOP/SEE/LOOK')


def test_a_level_above_that_decides_may_step_back_further_still():
    machine = watched(
        chain(FIND=Scripted(), PICK=chain(ARM=chain(GRASP=Scripted('aborted', 'aborted')))),
        escalate=True,
        states={'GRASP': {'prior': 0.5}, 'ARM': {'preconditions': [lambda ud: False]}},
    )
    assert machine.run() == 'done'
    assert decided(machine)[-1] == ('TOP/PICK', 'step_back', 'TOP/FIND')
    assert machine.rate('ARM').failures == 1
    assert machine.visits()[-4:] == ['FIND', 'PICK', 'ARM', 'GRASP']


def test_no_state_of_an_earlier_execution_of_the_container_is_stepped_back_to():
    states = {'A': Scripted('ok', 'aborted'), 'B': Scripted(), 'C': Scripted()}
    more = Scripted('again', outcomes=('ok', 'again'))
    top = smach.StateMachine(outcomes=OUTCOMES)
    with top:
        smach.StateMachine.add('N', chain(**states), {'done': 'MORE'})
        smach.StateMachine.add('MORE', more, {'again': 'N', 'ok': 'done'})
    machine = Watched(top, settings={'policy': 'algorithm1'})
    assert machine.run() == 'done'
    assert machine.visits() == ['N', 'A', 'B', 'C', 'MORE', 'N', 'A', 'A', 'B', 'C', 'MORE']


def test_a_policy_is_told_how_the_preconditions_stand():
    """Of a state that has none, one that has not met its own, and one that has."""
    seen = []

    class Sees(Elsewhere):
        def decide(self, situation):
            seen.append(situation.preconditions)
            return Action.REVISIT

        def runs_preconditions(self, failure_class):
            return True

    preconditions = {'B': [lambda ud: False], 'C': [lambda ud: True]}
    machine = Watched(
        chain(A=Scripted('aborted'), B=Scripted('aborted'), C=Scripted('aborted')),
        preconditions=preconditions,
    )
    machine.machine._oracle.in_force.policy = Sees('A')
    assert machine.run() == 'done'
    assert seen == [Preconditions.NONE, Preconditions.NOT_MET, Preconditions.MET]


def test_what_still_runs_on_the_way_down_is_named_by_its_own_path():
    gate = Gate()

    def goes_on(question, cancelled, progress):
        gate.go.set()
        return supersede('done')

    see = chain(LOOK=Scripted(lambda state, ud: 'ok' if gate.go.wait(20) else 'aborted'))
    machine = Watched(
        chain(SEE=see),
        name='TOP',
        expert=FakeExpert(goes_on),
        settings={'states': {'SEE': {'time_limit_s': 0.1, 'grace_period_s': 0.0}}},
    )
    machine.machine._oracle.in_force.policy = Elsewhere('SEE/LOOK')
    assert machine.run() == 'done'
    (told,) = [event.text for event in machine.of(EventKind.DECISION) if event.path == 'TOP']
    assert 'TOP/SEE still runs' in told and 'TOP/SEE/LOOK' not in told
