"""What the oracle may do in each state, told before anything runs."""

import pytest

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policy import Action
from smach_oracle.oracle.prospects import good_outcome, prospects_of
from smach_oracle.oracle.settings.settings import Settings

OUTCOMES = ['succeeded', 'aborted', 'preempted']


class Never(smach.State):
    """Is not to be executed."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES)

    def execute(self, userdata):
        raise AssertionError('it runs')


def machine():
    """HOME leads to PICK, PICK to an inner machine; HELP is the author's own recovery of PICK."""
    inner, top = smach.StateMachine(OUTCOMES), smach.StateMachine(OUTCOMES)
    with inner:
        smach.StateMachine.add('PUT', Never())
    with top:
        smach.StateMachine.add('HOME', Never(), {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', Never(), {'succeeded': 'PLACE', 'aborted': 'HELP'})
        smach.StateMachine.add('HELP', Never(), {'succeeded': 'HOME'})
        smach.StateMachine.add('PLACE', inner)
    return top


def told(settings):
    """The prospects of the machine by state label."""
    containers = prospects_of(OracleContainer.wrap(machine(), settings=settings, name='TOP'))
    assert [each.path for each in containers] == ['TOP', 'TOP/PLACE']
    assert [(each.initial, each.is_top) for each in containers] == [('HOME', True), ('PUT', False)]
    return {state.label: state for each in containers for state in each.states}


def outcome(state, name):
    return next(each for each in state.outcomes if each.outcome == name)


def test_a_container_begins_where_it_was_set_to_begin():
    wrapped = OracleContainer.wrap(machine())
    wrapped.set_initial_state(['PICK'])
    assert [each.initial for each in prospects_of(wrapped)] == ['PICK', 'PUT']
    empty = OracleContainer.wrap(smach.StateMachine(OUTCOMES))
    assert [each.initial for each in prospects_of(empty)] == ['']


def test_outcomes_lead_where_the_author_drew_them():
    states = told({})
    assert set(states) == {'HOME', 'PICK', 'HELP', 'PLACE', 'PUT'}
    assert outcome(states['HOME'], 'succeeded')[1:4] == (('PICK', True), False, False)
    assert outcome(states['HOME'], 'aborted')[1:4] == (('aborted', False), True, False)
    assert outcome(states['PICK'], 'aborted')[1:4] == (('HELP', True), True, True)
    assert not outcome(states['PUT'], 'preempted').is_failure


def test_an_authors_recovery_that_the_settings_override_is_the_oracles():
    states = told({'states': {'PICK': {'author_recoveries': 'override'}}})
    assert outcome(states['PICK'], 'aborted')[2:4] == (True, False)


def test_the_actions_are_those_of_the_policy():
    low, moderate, high = FailureClass.LOW, FailureClass.MODERATE, FailureClass.HIGH
    states = told({'states': {'HELP': {'max_recoveries': 0}, 'PICK': {'preconditions': ['HOME']}}})
    assert (
        states['HOME'].actions
        == states['PICK'].actions
        == (
            (low, (Action.REVISIT, Action.STEP_BACK)),
            (moderate, (Action.REVISIT, Action.ASK)),
            (high, (Action.ASK,)),
        )
    )
    assert {actions for _, actions in states['HELP'].actions} == {(Action.ASK,)}
    listing = told({'policy': 'algorithm1', 'states': {'PICK': {'preconditions': ['HOME']}}})
    assert dict(listing['HOME'].actions)[low] == (Action.STEP_BACK,)
    assert dict(listing['PICK'].actions)[low] == (Action.REVISIT, Action.STEP_BACK)


@pytest.mark.parametrize(
    ('most', 'actions'),
    [
        (1, (Action.REVISIT, Action.STEP_BACK)),
        (3, (Action.REVISIT, Action.STEP_BACK)),
        (4, (Action.REVISIT, Action.STEP_BACK, Action.ASK)),
    ],
)
def test_the_actions_are_those_of_each_failure_up_to_the_last_recovery(most, actions):
    """ladder tries once, steps back three times, and then asks."""
    states = told({'policy': 'ladder', 'max_recoveries': most})
    assert dict(states['HOME'].actions)[FailureClass.LOW] == actions


@pytest.mark.parametrize('on_retry', ['confirm', 'never'])
def test_of_a_state_that_is_not_repeated_by_itself_the_oracle_asks(on_retry):
    settings = {'states': {'PICK': {'on_retry': on_retry}, 'PLACE/PUT': {'on_retry': on_retry}}}
    states = told(settings)
    assert {actions for _, actions in states['PICK'].actions} == {(Action.ASK,)}
    assert (Action.ASK,) not in dict(states['HOME'].actions[:2]).values()
    top, inner = prospects_of(OracleContainer.wrap(machine(), settings=settings, name='TOP'))
    assert (top.guarded, inner.guarded) == (('PICK', 'PLACE/PUT'), ('PUT',))


def test_without_recoveries_in_the_budget_the_oracle_asks_everywhere():
    for state in told({'budget': {'recoveries': 0}}).values():
        assert {actions for _, actions in state.actions} == {(Action.ASK,)}


def test_a_good_outcome_is_no_failure_and_a_preempt_only_where_there_is_no_other():
    def good(*outcomes):
        return good_outcome(smach.StateMachine(list(outcomes)), Settings())

    assert good('aborted', 'done', 'succeeded') == 'succeeded'
    assert good('aborted', 'preempted', 'some_failed', 'through') == 'through'
    assert good('aborted', 'preempted') == 'preempted'
    assert good('aborted', 'failed') is None


def test_branches_are_told_with_where_their_outcomes_lead():
    tour = smach.Iterator(
        OUTCOMES, [], [], it=[1, 2], it_label='item', exhausted_outcome='succeeded'
    )
    with tour:
        smach.Iterator.set_contained_state('VISIT', Never(), loop_outcomes=['succeeded'])
    both = smach.Concurrence(
        OUTCOMES,
        'succeeded',
        outcome_map={'aborted': {'LEFT': 'aborted'}, 'succeeded': {'RIGHT': 'aborted'}},
    )
    with both:
        smach.Concurrence.add('LEFT', Never())
        smach.Concurrence.add('RIGHT', Never())
    top = smach.StateMachine(OUTCOMES)
    with top:
        smach.StateMachine.add('TOUR', tour, {'succeeded': 'BOTH'})
        smach.StateMachine.add('BOTH', both)
    settings = {'states': {'TOUR/*': {'memory': 3}, 'RIGHT': {'author_recoveries': 'keep'}}}
    containers = prospects_of(OracleContainer.wrap(top, settings=settings, name='TOP'))
    assert [(each.path, each.initial, each.has_branches, each.machine) for each in containers] == [
        ('TOP', 'TOUR', False, top),
        ('TOP/TOUR', 'VISIT', True, tour),
        ('TOP/BOTH', 'LEFT, RIGHT', True, both),
    ]
    states = {state.label: state for each in containers for state in each.states}
    assert states['VISIT'].settings.memory == 3
    assert outcome(states['VISIT'], 'succeeded').route.target == 'the next item'
    assert outcome(states['VISIT'], 'aborted')[1:4] == (
        ('the end of the iteration, with aborted', True),
        True,
        False,
    )
    assert not outcome(states['LEFT'], 'aborted').author_recovers
    assert outcome(states['RIGHT'], 'aborted').author_recovers, 'the map has foreseen it'


def test_a_step_back_may_run_what_leads_to_a_state_the_nearest_first():
    states = told({})
    assert states['PLACE'].before == ('PICK', 'HOME', 'HELP')
    assert states['PUT'].before == states['PUT'].kinds == ()
    across = told({'step_back_across': True})
    assert across['PUT'].before == ('/PICK', '/HOME', '/HELP')


def chain(*labels, **drawn):
    """A machine of these states, one behind the other. `drawn`: other transitions of them."""
    sm = smach.StateMachine(OUTCOMES)
    with sm:
        for label, following in zip(labels, (*labels[1:], 'succeeded')):
            state = drawn.get(label, Never())
            further = {} if isinstance(state, smach.State) else state
            state = Never() if isinstance(state, dict) else state
            smach.StateMachine.add(label, state, {'succeeded': following, **further})
    return sm


def split(machine, label, guarded, **settings):
    """What a step back from a state may run again, and what it may not, where some are guarded."""
    states = {each: {'on_retry': 'confirm'} for each in guarded}
    wrapped = OracleContainer.wrap(machine, settings={'states': states, **settings}, name='TOP')
    found = {state.label: state for each in prospects_of(wrapped) for state in each.states}
    return found[label].before, found[label].not_before


def test_a_step_back_does_not_go_to_what_would_repeat_a_guarded_state():
    assert split(chain('A', 'B', 'C', 'D', 'E'), 'E', ['C']) == (('D',), ('C', 'B', 'A'))
    assert split(chain('A', 'B', 'C', 'D', 'E'), 'E', []) == (('D', 'C', 'B', 'A'), ())
    assert split(chain('A', 'B', 'C', 'D', 'E'), 'C', ['E']) == (('B', 'A'), ())
    assert split(chain('A', 'B', 'C'), 'C', ['C']) == ((), ('B', 'A'))


def test_what_leads_around_a_guarded_state_may_run_again():
    around = chain('A', 'B', 'C', 'D', A={'aborted': 'C'})
    assert split(around, 'D', ['B']) == (('C', 'A'), ('B',))


@pytest.mark.parametrize('inner', ['BRANCH', 'BOTH/BRANCH', 'BOTH'])
def test_a_guarded_branch_of_a_concurrence_on_the_way_is_repeated_too(inner):
    both = smach.Concurrence(OUTCOMES, 'succeeded')
    with both:
        smach.Concurrence.add('BRANCH', Never())
        smach.Concurrence.add('OTHER', Never())
    assert split(chain('A', 'BOTH', 'C', 'D', BOTH=both), 'D', [inner]) == (('C',), ('BOTH', 'A'))


def test_a_container_on_the_way_is_repeated_only_if_it_must_come_to_its_guarded_state():
    through, around = chain('X', 'Y'), chain('X', 'Y', X={'aborted': 'succeeded'})
    assert split(chain('A', 'GET', 'C', GET=through), 'C', ['Y']) == ((), ('GET', 'A'))
    assert split(chain('A', 'GET', 'C', GET=around), 'C', ['GET/Y']) == (('GET', 'A'), ())


def test_a_guarded_state_of_a_container_keeps_the_places_outside_from_being_gone_to():
    ways = {'policy': 'escalating'}
    task = chain('HOME', 'GET', GET=chain('X', 'Y', 'Z'))
    assert split(task, 'Z', ['Y'], **ways) == ((), ('Y', 'X', '/HOME'))
    task = chain('HOME', 'GET', GET=chain('X', 'Y', 'Z'))
    assert split(task, 'Z', ['GET'], **ways) == (('Y', 'X'), ('/HOME',))
    task = chain('HOME', 'LOOK', 'GET', GET=chain('X', 'Y', 'Z'))
    assert split(task, 'Z', ['HOME'], **ways) == (('Y', 'X', '/LOOK'), ('/HOME',))


def test_a_way_that_on_retry_always_blocks_is_not_on_the_menu_that_is_told():
    settings = {'policy': 'escalating', 'states': {'PICK': {'on_retry': 'never'}}}
    kinds = {label: [kind.value for kind in state.kinds] for label, state in told(settings).items()}
    assert kinds['PUT'] == ['again', 'wait']
    settings = {'policy': 'escalating', 'states': {'HOME': {'on_retry': 'never'}}}
    kinds = {label: [kind.value for kind in state.kinds] for label, state in told(settings).items()}
    assert kinds['PUT'] == ['again', 'wait', 'step_back']


def test_the_menu_of_a_state_is_told_before_anything_runs():
    settings = {'policy': 'escalating', 'states': {'PLACE': {'preconditions': ['HOME']}}}
    kinds = {label: [kind.value for kind in state.kinds] for label, state in told(settings).items()}
    assert kinds['PLACE'] == ['again', 'wait', 'prepare', 'step_back', 'start']
    assert kinds['PUT'] == ['again', 'wait', 'step_back', 'top'], 'it is its own start'
    assert told(settings)['PUT'].before == ('/PICK', '/HOME', '/HELP')
