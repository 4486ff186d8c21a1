"""A preempt of a machine that is held: the state is passed by, and its author's clean-up runs."""

import threading

import pytest
from guarded_machines import OUTCOMES, both, chain
from held_machines import Gate, Held, Trail, eventually
from machines import FakeExpert, FakeHealth, goto, waits
from test_short_way import AsksElsewhere
from waiting import wait_for

import smach
from smach_oracle.oracle.records.events import EventKind

CONFIRM = {'states': {'B': {'autonomy': 'confirm'}}}


def by_operator(held):
    held.hand.preempt()


def by_script(held):
    held.machine.request_preempt()


def at_a_breakpoint(held):
    held.hand.set_breakpoint('B')


def stepped_there(held):
    held.hand.pause()
    held.begin()
    held.waits_before('SM_ROOT/A')
    held.hand.step()


def waiting_for_a_confirmation(held):
    held.hand.set_autonomy('B', 'confirm')


@pytest.mark.parametrize(
    'hold, preempt',
    [
        (at_a_breakpoint, by_operator),
        (stepped_there, by_operator),
        (waiting_for_a_confirmation, by_operator),
        (waiting_for_a_confirmation, by_script),
    ],
)
def test_what_the_author_drew_after_preempted_runs_and_the_held_state_does_not(hold, preempt):
    trail = Trail()
    with Held(trail.cleaned()) as held:
        hold(held)
        if not held.running():
            held.begin()
        held.waits_before('SM_ROOT/B')
        preempt(held)
        assert (held.end(), trail.ran) == ('preempted', ['A', 'CLEAN'])
        assert not held.machine.preempt_requested()
        assert len(held.of(EventKind.PREEMPT)) == 1
        passed = held.of(EventKind.TRANSITION)[1]
        assert (passed.state, passed.outcome, passed.target) == ('B', 'preempted', 'CLEAN')
        assert held.rate('B').failures == held.rate('B').successes == 0
        held.hand.remove_breakpoint('B') if hold is at_a_breakpoint else held.hand.set_autonomy(
            'B', 'run'
        )
        held.begin()
        assert (held.end(), trail.ran[2:]) == ('done', ['A', 'B']), 'nothing of it is left'


def test_a_machine_that_an_operator_has_paused_runs_nothing_for_who_else_preempts_it():
    trail = Trail()
    with Held(trail.cleaned()) as held:
        held.hand.set_breakpoint('B')
        held.begin()
        held.waits_before('SM_ROOT/B')
        by_script(held)
        assert (held.end(), trail.ran) == ('preempted', ['A'])


def test_a_state_without_the_outcome_is_not_executed_either():
    trail = Trail()
    machine = trail.cleaned(trail.state('A'), trail.state('B', outcomes=('ok',)))
    with Held(machine, settings=CONFIRM).begin() as held:
        held.waits_before('SM_ROOT/B')
        by_script(held)
        assert (held.end(), trail.ran) == ('preempted', ['A'])


def test_a_state_whose_preempted_leads_to_itself_ends_its_container():
    trail = Trail()
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('B', trail.state('B'), {'ok': 'done', 'preempted': 'B'})
    with Held(machine, settings=CONFIRM).begin() as held:
        held.waits_before('SM_ROOT/B')
        by_script(held)
        assert (held.end(), trail.ran) == ('preempted', [])


def test_a_state_leads_by_preempted_to_what_the_author_calls_it():
    trail = Trail()
    machine = smach.StateMachine(['done', 'preempted', 'stopped'])
    with machine:
        smach.StateMachine.add(
            'B', trail.state('B'), {'ok': 'done', 'preempted': 'stopped', 'aborted': 'stopped'}
        )
    with Held(machine, settings=CONFIRM).begin() as held:
        held.waits_before('SM_ROOT/B')
        by_script(held)
        assert (held.end(), trail.ran) == ('stopped', [])


@pytest.mark.parametrize('preempt', [by_operator, by_script])
@pytest.mark.parametrize('hold', [waiting_for_a_confirmation, at_a_breakpoint])
def test_a_state_that_would_be_held_is_passed_by_where_the_one_before_ignores_the_request(
    hold, preempt
):
    trail, gate = Trail(), Gate(heeds=False)
    machine = trail.cleaned(trail.state('A', gate), trail.state('B'))
    with Held(machine).begin() as held:
        hold(held)
        eventually(gate.entered.is_set)
        preempt(held)
        gate.opened.set()
        assert (held.end(), trail.ran) == ('preempted', ['A', 'CLEAN'])
        assert not held.hand.status().paused, 'the next trial is not paused'


def test_a_stop_that_lifts_a_pause_lets_no_state_run_that_it_held():
    trail, gate = Trail(), Gate(heeds=False)
    machine = trail.cleaned(trail.state('A', gate), trail.state('B'))
    with Held(machine).begin() as held:
        eventually(gate.entered.is_set)
        held.hand.pause()
        held.hand.preempt()
        gate.opened.set()
        assert (held.end(), trail.ran) == ('preempted', ['A', 'CLEAN'])


def test_a_preempt_that_takes_its_time_to_arrive_lets_the_clean_up_run():
    trail = Trail()

    class Slow(smach.StateMachine):
        def request_preempt(self):
            smach.StateMachine.request_preempt(self)
            assert wait_for(lambda: cleaned.is_set(), 20)

    cleaned = threading.Event()
    machine = Slow(OUTCOMES)
    with machine:
        smach.StateMachine.add('B', trail.state('B'), {'ok': 'done', 'preempted': 'CLEAN'})
        smach.StateMachine.add(
            'CLEAN',
            trail.state('CLEAN', lambda state, ud: cleaned.set() or 'ok'),
            {'ok': 'preempted'},
        )
    held = Held(machine)
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/B')
        held.hand.preempt()
        assert (held.end(), trail.ran) == ('preempted', ['CLEAN'])


@pytest.mark.parametrize('place', ['SM_ROOT/INNER/B', 'SM_ROOT/INNER/A', 'SM_ROOT/INNER'])
@pytest.mark.parametrize('preempt', [by_operator, by_script])
def test_of_nested_machines_the_clean_up_of_each_level_runs(place, preempt):
    trail = Trail()
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('FIRST', trail.state('FIRST'), {'ok': 'INNER'})
        smach.StateMachine.add('INNER', trail.cleaned(), {'preempted': 'TOP_CLEAN'})
        smach.StateMachine.add('TOP_CLEAN', trail.state('TOP_CLEAN'), {'ok': 'preempted'})
    held = Held(machine)
    held.hand.set_autonomy(place, 'confirm')
    with held.begin():
        held.waits_before(place)
        preempt(held)
        assert held.end() == 'preempted'
    assert trail.ran == ['FIRST', *(['A'] if place.endswith('B') else []), 'CLEAN', 'TOP_CLEAN']


def test_a_machine_that_is_held_whose_first_state_has_no_way_of_its_own_is_not_entered():
    trail = Trail()
    machine = trail.cleaned(trail.state('A'), chain(IN=trail.state('IN', outcomes=('ok',))))
    with Held(machine, settings=CONFIRM).begin() as held:
        held.waits_before('SM_ROOT/B')
        by_script(held)
        assert (held.end(), trail.ran) == ('preempted', ['A', 'CLEAN'])


@pytest.mark.parametrize('preempt', [by_operator, by_script])
def test_a_branch_of_a_concurrence_is_passed_by_and_the_others_are_preempted(preempt):
    trail, gate = Trail(), Gate()
    machine = trail.cleaned(
        trail.state('A'),
        both(LEFT=trail.state('LEFT'), RIGHT=trail.state('RIGHT', gate), DEEP=trail.cleaned()),
    )
    machine['B']._outcome_map['preempted'] = dict.fromkeys(('LEFT', 'RIGHT', 'DEEP'), 'preempted')
    held = Held(machine)
    for place in ('LEFT', 'DEEP/B'):
        held.hand.set_autonomy('SM_ROOT/B/' + place, 'confirm')
    with held.begin():
        held.waits_before('SM_ROOT/B/LEFT', 'SM_ROOT/B/DEEP/B')
        eventually(gate.entered.is_set)
        preempt(held)
        assert held.end() == 'preempted'
    assert sorted(trail.ran) == ['A', 'A', 'CLEAN', 'CLEAN', 'RIGHT']
    assert trail.ran[-1] == 'CLEAN'


@pytest.mark.parametrize('is_machine', [True, False])
def test_an_item_of_an_iterator_is_passed_by(is_machine):
    trail = Trail()
    each = smach.Iterator(OUTCOMES, [], [], it=[1, 2], exhausted_outcome='done')
    item = trail.cleaned() if is_machine else trail.state('B')
    with each:
        smach.Iterator.set_contained_state('ITEM', item, loop_outcomes=['ok', 'done'])
    held = Held(trail.cleaned(trail.state('A'), each))
    place = 'SM_ROOT/B/ITEM' + ('/B' if is_machine else '')
    held.hand.set_autonomy(place, 'confirm')
    with held.begin():
        held.waits_before(place)
        by_script(held)
        assert held.end() == 'preempted'
    assert trail.ran == ['A', *(['A', 'CLEAN'] if is_machine else []), 'CLEAN']


def asked(machine):
    return Held(machine, expert=FakeExpert(waits), settings={'max_recoveries': 0}), (
        EventKind.QUERY_OPENED
    )


def unwell(machine):
    return Held(
        machine, health=FakeHealth('', *['unwell'] * 9999), settings={'health_settle_s': 0.0}
    ), EventKind.WARNING


@pytest.mark.parametrize('hold', [asked, unwell])
@pytest.mark.parametrize('preempt', [by_operator, by_script])
def test_a_recovery_that_is_preempted_goes_where_the_failed_state_would(hold, preempt):
    trail = Trail()
    held, kind = hold(trail.cleaned(trail.state('A'), trail.state('B', 'aborted')))
    with held.begin():
        eventually(lambda: held.of(kind) or held.of(EventKind.HEALTH_WAIT_START))
        preempt(held)
        assert (held.end(), trail.ran) == ('preempted', ['A', 'B', 'CLEAN'])


def test_a_state_that_is_not_to_be_repeated_is_passed_by_at_a_preempt():
    trail = Trail()

    def preempted_too_late(state, ud):
        held.machine.request_preempt()
        return 'ok'

    machine = trail.cleaned(trail.state('A', 'ok', preempted_too_late), trail.state('B', 'aborted'))
    held = Held(
        machine,
        expert=FakeExpert(goto('A')),
        settings={'max_recoveries': 0, 'states': {'B': {'on_retry': 'never'}}},
    )
    with held.begin():
        assert held.end() == 'preempted'
    assert trail.ran == ['A', 'B', 'A', 'CLEAN']


def with_clean_ups(trail, ends):
    """PICK, each of whose states has a clean-up of its own, or ends it so; FIND leads to it."""
    inner = smach.StateMachine([*OUTCOMES, 'stopped'])
    with inner:
        for label, following in (('X', 'Y'), ('Y', 'done')):
            target = ends or 'CLEAN_' + label
            smach.StateMachine.add(
                label, trail.state(label), {'ok': following, 'preempted': target}
            )
        for label in ('CLEAN_X', 'CLEAN_Y'):
            smach.StateMachine.add(label, trail.state(label), {'ok': 'preempted'})
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('FIND', trail.state('FIND', 'aborted', 'ok'), {'ok': 'PICK'})
        smach.StateMachine.add('PICK', inner, {'stopped': 'PUT_BACK'})
        smach.StateMachine.add('PUT_BACK', trail.state('PUT_BACK'), {'ok': 'preempted'})
    return machine


def led_to_y(machine):
    expert = FakeExpert(goto('Y', container='SM_ROOT/PICK'))
    held = Held(machine, expert=expert, settings={'max_recoveries': 0})
    held.hand.set_breakpoint('PICK')
    return held.begin()


@pytest.mark.parametrize('ends, cleans', [('', 'CLEAN_Y'), ('stopped', 'PUT_BACK')])
def test_a_machine_that_was_led_within_cleans_up_behind_the_state_it_was_led_to(ends, cleans):
    trail = Trail()
    with led_to_y(with_clean_ups(trail, ends)) as held:
        held.waits_before('SM_ROOT/PICK')
        held.hand.remove_breakpoint('PICK')
        by_operator(held)
        assert (held.end(), trail.ran) == ('preempted', ['FIND', cleans])


def test_a_state_from_which_an_operator_sends_the_machine_is_begun_from_its_start_later():
    trail = Trail()
    with led_to_y(with_clean_ups(trail, '')) as held:
        held.waits_before('SM_ROOT/PICK')
        held.hand.remove_breakpoint('PICK')
        held.hand.go_to('SM_ROOT', 'FIND')
        held.hand.resume()
        assert (held.end(), trail.ran) == ('done', ['FIND', 'FIND', 'X', 'Y'])


def test_a_machine_in_a_second_place_is_passed_by_as_one_that_has_no_oracle():
    trail = Trail()
    inner = trail.cleaned()
    machine = chain(FIRST=chain(X=inner), Y=inner, LAST=trail.state('LAST'))
    with Held(machine).begin() as held:
        assert held.end() == 'done' and trail.ran == ['A', 'B'] * 2 + ['LAST']
        held.hand.set_breakpoint('SM_ROOT/Y')
        held.begin()
        held.waits_before('SM_ROOT/Y')
        held.hand.preempt()
        assert (held.end(), trail.ran[5:]) == ('preempted', ['A', 'B'])


def test_a_stop_that_only_the_machine_around_knows_of_ends_one_before_a_held_state():
    trail = Trail()

    def ask(state, ud):
        machine.is_asked = True
        return 'ok'

    inner = trail.cleaned(trail.state('A', ask), trail.state('B'))
    machine = AsksElsewhere(OUTCOMES)
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'done'})
    settings = {'states': {'INNER/B': {'autonomy': 'confirm'}}}
    with Held(machine, settings=settings).begin() as held:
        assert (held.end(), trail.ran) == ('preempted', ['A'])


class Services(AsksElsewhere):
    """Has its own way to service a stop, too."""

    def service_preempt(self):
        self.is_asked = False
        AsksElsewhere.service_preempt(self)


def test_a_class_that_ends_before_a_held_state_services_the_stop_in_its_own_way():
    trail = Trail()

    def ask(state, ud):
        machine.is_asked = True
        return 'ok'

    machine = Services(OUTCOMES)
    with machine:
        smach.StateMachine.add('A', trail.state('A', ask), {'ok': 'B'})
        smach.StateMachine.add('B', trail.state('B', outcomes=('ok',)), {'ok': 'done'})
    with Held(machine, settings=CONFIRM).begin() as held:
        assert (held.end(), trail.ran, machine.is_asked) == ('preempted', ['A'], False)
