"""The menu of a failure, the streak of ways that were gone, and machines that go them."""

import pytest
from machines import FakeExpert, FakeWaiting, Scripted, Watched, goto, supersede, watched
from reporting_machines import BAD, made

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policies import policy_named
from smach_oracle.oracle.decision.policy import Menu, Past, Preconditions, Situation
from smach_oracle.oracle.decision.ways import Prices, StreakSoFar, Way, WayKind
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.settings.settings import Settings

FAILS = ['aborted'] * 30
ENDS = ['done', 'aborted', 'preempted']


def at_once(machine):
    """Have waits take no time. Return the machine."""
    oracle_of(machine.machine).waiting = FakeWaiting()
    return machine


def failing(count, *, fails=FAILS, at=-1, **wrap):
    """A chain of `count` states, the last of which fails."""
    states = [Scripted() for _ in range(count)]
    states[at] = Scripted(*fails)
    settings = {'policy': 'escalating', 'max_recoveries': 50, **wrap.pop('settings', {})}
    return at_once(watched(*states, settings=settings, **wrap))


def orders(machine):
    """Return the way that each decision has taken, None for a question."""
    return [(each.data['order'] or [None])[0] for each in machine.of(EventKind.DECISION)]


def menu_at(machine, number=0):
    return {
        way['target'] if way['back'] else (way['kind'], way['wait_s']): way
        for way in machine.of(EventKind.DECISION)[number].data['menu']
    }


def test_it_tries_the_cheapest_way_first_then_dearer_ones_and_then_asks():
    expert = FakeExpert(supersede('ok'))
    machine = failing(5, expert=expert)
    assert machine.run() == 'done'
    assert orders(machine) == ['again', 'wait 10 s', 'from C', 'from A', None]
    assert machine.visits() == list('ABCDEEECDEABCDE')
    assert oracle_of(machine.machine).waiting.waited == [(10.0, 'waiting')]
    assert '4 attempts have not helped' in expert.questions[0].reason
    assert expert.questions[0].tried == (
        'trying it again',
        'trying it again after 10 s',
        'going back to C',
        'going back to A',
    )


def test_the_menu_goes_back_one_two_four_and_to_the_start():
    machine = failing(10, fails=['aborted'])
    machine.run()
    menu = menu_at(machine)
    assert [key for key in menu if isinstance(key, str)] == ['I', 'H', 'F', 'B', 'A']
    assert menu['A']['kind'] == 'start' and menu['A']['back'] == 9
    assert list(menu['F']['repeats']) == ['I', 'H', 'G', 'F']


def test_a_state_that_was_not_visited_is_on_no_menu():
    machine = failing(5, at=2, fails=['aborted'])
    machine.run()
    assert {'A', 'B'} == {key for key in menu_at(machine) if isinstance(key, str)}


def test_a_success_ends_the_streak():
    machine = failing(3, fails=['aborted', 'ok', 'aborted'], at=1)
    machine.machine.set_initial_state(['A'])
    assert machine.run() == 'done'
    assert machine.run() == 'done'
    assert orders(machine) == ['again', 'again']


def test_failures_of_another_state_do_not_end_the_streak():
    a, b = Scripted('ok', 'ok', 'aborted'), Scripted(*FAILS[:4])
    machine = at_once(watched(a, b, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    # B, B, B, back to A, which fails itself, B: the streak of B goes on
    assert orders(machine)[:3] == ['again', 'wait 10 s', 'from A']
    assert 'again' not in orders(machine)[4:]


def test_a_question_ends_the_streak():
    expert = FakeExpert(goto('A'), supersede('ok'))
    machine = failing(5, expert=expert)
    assert machine.run() == 'done'
    taken = orders(machine)
    first = taken.index(None)
    assert first == 4 and taken[5] == 'again'


def test_a_trial_has_eight_attempts():
    expert = FakeExpert(*[goto('A')] * 2, supersede('ok'))
    machine = failing(5, expert=expert)
    assert machine.run() == 'done'
    assert orders(machine).index(None) == 4 and len(orders(machine)) == 11
    assert "the trial's 8 attempts are spent" in expert.questions[-1].reason


def test_where_nobody_can_be_asked_a_way_may_cost_as_much_as_a_lost_trial():
    situation = Situation(
        FailureClass.LOW,
        Preconditions.NONE,
        True,
        menu=Menu((Way(WayKind.STEP_BACK, 'A', minutes=30.0),), has_expert=True),
    )
    policy = policy_named('escalating')
    assert not policy.order(situation)
    assert policy.order(situation._replace(menu=situation.menu._replace(has_expert=False)))


# -- containers


def nested(inner, **settings):
    """TOP: HOME, GET; GET: LOOK, GRASP."""
    get = smach.StateMachine(outcomes=ENDS)
    with get:
        smach.StateMachine.add('LOOK', Scripted(), {'ok': 'GRASP'})
        smach.StateMachine.add('GRASP', inner, {'ok': 'done'})
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('HOME', Scripted(), {'ok': 'GET'})
        smach.StateMachine.add('GET', get, {'done': 'done'})
    return at_once(Watched(top, settings={'policy': 'escalating', **settings}))


def test_the_states_of_the_containers_around_are_on_the_menu():
    machine = nested(Scripted('aborted'))
    assert machine.run() == 'done'
    menu = menu_at(machine)
    assert [key for key in menu if isinstance(key, str)] == ['LOOK', '/HOME']
    assert list(menu['/HOME']['repeats']) == ['LOOK', '/HOME']


def test_the_visits_after_a_failure_that_is_reported_are_those_of_its_own_container():
    work = made(
        [
            ('WORK', Scripted('failed', outcomes=BAD), {'ok': 'done', 'failed': 'TELL'}),
            ('TELL', Scripted(outcomes=('said',)), {'said': 'failed'}),
        ]
    )
    top = made(
        [('LOOK', Scripted(outcomes=('ok',)), {'ok': 'ARM'}), ('ARM', work, {'done': 'done'})]
    )
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    assert [key for key in menu_at(machine) if isinstance(key, str)] == ['/LOOK']


def test_a_streak_goes_on_where_its_own_way_has_left_the_container():
    machine = nested(Scripted(*FAILS[:4]))
    assert machine.run() == 'done'
    assert orders(machine) == ['again', 'wait 10 s', 'from /HOME', 'from LOOK']
    again, home = ['GRASP'] * 2, ['HOME', 'GET', 'LOOK', 'GRASP']
    assert machine.visits() == [*home, *again, *home, 'LOOK', 'GRASP']


def test_a_streak_ends_with_the_execution_of_its_container():
    def stop(state, ud):
        get.request_preempt()
        state.service_preempt()
        return 'preempted'

    machine = nested(Scripted('aborted', stop, 'aborted'))
    get = machine.machine.get_children()['GET']
    machine.machine._transitions['GET']['preempted'] = 'HOME'
    assert machine.run() == 'done'
    assert orders(machine) == ['again', 'again']


def test_a_streak_that_a_way_had_left_begins_again_in_the_next_trial():
    def stop(state, ud):
        machine.machine.request_preempt()
        state.service_preempt()
        return 'preempted'

    machine = nested(Scripted(*FAILS[:4]))
    machine.machine.get_children()['HOME'].script = ['ok', stop]
    assert machine.run() == 'preempted'
    assert orders(machine) == ['again', 'wait 10 s', 'from /HOME']
    assert machine.run() == 'done'
    assert orders(machine)[3:] == ['again']


def test_a_way_out_is_blocked_where_the_author_goes_on_from_there():
    inner = Scripted(*FAILS)
    get = smach.StateMachine(outcomes=ENDS)
    with get:
        smach.StateMachine.add('GRASP', inner, {'ok': 'done'})
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('HOME', Scripted(), {'ok': 'GET'})
        smach.StateMachine.add('GET', get, {'done': 'done', 'aborted': 'CLEAN'})
        smach.StateMachine.add('CLEAN', Scripted(), {'ok': 'done'})
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    assert 'CLEAN' in machine.visits() and machine.visits().count('HOME') == 1
    assert 'author goes on' in menu_at(machine)['/HOME']['blocked']


def test_attempts_within_are_attempts_of_the_state_around():
    policy = policy_named('escalating')
    way = Way(WayKind.AGAIN, 'GET')
    spent = Situation(
        FailureClass.LOW,
        Preconditions.NONE,
        True,
        menu=Menu((way,), StreakSoFar(('wait 10 s',), 4)),
    )
    assert not policy.order(spent) and policy.why(spent) == '4 attempts have not helped'


def test_no_way_leaves_a_concurrence():
    branch = Scripted(*FAILS[:2])
    both = smach.Concurrence(ENDS, 'aborted', outcome_map={'done': {'L': 'ok', 'R': 'ok'}})
    with both:
        smach.Concurrence.add('L', branch)
        smach.Concurrence.add('R', Scripted())
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('HOME', Scripted(), {'ok': 'BOTH'})
        smach.StateMachine.add('BOTH', both, {'done': 'done'})
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    for event in machine.of(EventKind.DECISION):
        assert {way['kind'] for way in event.data['menu']} == {'again', 'wait'}


def test_each_item_of_an_iterator_has_a_streak_of_its_own():
    state = Scripted('aborted', 'ok', 'aborted', 'ok')
    items = smach.Iterator(
        ['ok', 'aborted', 'preempted'],
        [],
        [],
        it=lambda: [1, 2],
        it_label='n',
        exhausted_outcome='ok',
    )
    with items:
        smach.Iterator.set_contained_state('EACH', state, loop_outcomes=['ok'])
    top = smach.StateMachine(outcomes=['ok', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('ALL', items)
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'ok'
    assert orders(machine) == ['again', 'again']


# -- userdata


@pytest.mark.parametrize(
    'given, kept', [({}, True), ({'userdata': 'keep'}, True), ({'userdata': 'restore'}, False)]
)
def test_userdata_is_kept_unless_the_user_has_set_it(given, kept):
    def note(ud):
        ud.tried = ud.tried + 1 if 'tried' in ud else 1
        return 'ok' if ud.tried > 1 else 'aborted'

    top = smach.StateMachine(outcomes=['ok', 'aborted'])
    top.userdata.tried = 0
    with top:
        smach.StateMachine.add(
            'ACT',
            smach.CBState(
                note, outcomes=['ok', 'aborted'], input_keys=['tried'], output_keys=['tried']
            ),
        )
    machine = at_once(Watched(top, settings={'policy': 'escalating', **given}))
    assert machine.run() == ('ok' if kept else 'aborted')
    assert machine.of(EventKind.JUMP)[0].data['userdata'] == ('keep' if kept else 'restore')


def test_other_policies_restore_as_ever():
    machine = failing(2, fails=['aborted'], settings={'policy': 'prose'})
    machine.run()
    assert machine.of(EventKind.JUMP)[0].data['userdata'] == 'restore'


# -- preconditions, guards


def test_preconditions_are_a_way_and_where_they_are_not_met_the_next_one_is_gone():
    asked = []
    machine = failing(
        3,
        settings={'states': {'C': {'preconditions': [lambda ud: asked.append(1)]}}},
        expert=FakeExpert(supersede('ok')),
    )
    assert machine.run() == 'done'
    assert len(asked) > 1, 'it may hold the next time'
    taken = orders(machine)
    assert 'prepare' not in taken and len(taken) == 5 and taken[-1] is None
    assert '0x' not in machine.of(EventKind.DECISION)[1].text


def test_a_guarded_state_is_not_entered_again_by_itself():
    machine = failing(
        4,
        settings={'states': {'C': {'on_retry': 'confirm'}}},
        expert=FakeExpert(supersede('ok')),
    )
    assert machine.run() == 'done'
    assert machine.visits().count('C') == 1
    assert 'would repeat C' in menu_at(machine)['C']['blocked']


def test_prices_can_be_set_and_are_checked():
    assert Settings.from_dict({'cost': {'harm': 0}}).cost == Prices(harm=0.0)
    with pytest.raises(ValueError, match='cost.harm.*from 0'):
        failing(2, settings={'cost': {'harm': -1}})
    with pytest.raises(ValueError, match='cost.minute.*robot_minute'):
        failing(2, settings={'cost': {'minute': 1}})


def test_a_streak_that_takes_longer_than_three_usual_trials_is_asked_about():
    policy, way = policy_named('escalating'), Way(WayKind.AGAIN, 'A')
    situation = Situation(
        FailureClass.LOW,
        Preconditions.NONE,
        True,
        Past(usual_minutes=2.0),
        Menu((way,), StreakSoFar((), 1, 6.5)),
    )
    assert policy.why(situation) == 'its attempts take longer than 3 trials'
    assert policy.order(situation._replace(past=Past(usual_minutes=None)))


def test_a_step_back_leads_to_no_state_from_which_the_machine_would_not_come_back():
    """HOME goes to X and Y, or to Z. Y has failed and was left for HOME, which went to Z then."""
    ways = Scripted('ok', 'other', outcomes=('ok', 'other', 'aborted'))
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('HOME', ways, {'ok': 'X', 'other': 'Z'})
        smach.StateMachine.add('X', Scripted(), {'ok': 'Y'})
        smach.StateMachine.add('Y', Scripted(*FAILS[:3]), {'ok': 'done'})
        smach.StateMachine.add('Z', Scripted(*FAILS[:2]), {'ok': 'done'})
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    machine.run()
    of_z = [each for each in machine.of(EventKind.DECISION) if each.state == 'Z']
    assert of_z
    for event in of_z:
        assert {way['target'] for way in event.data['menu']} == {'Z', 'HOME'}


@pytest.mark.parametrize('is_blocked', [True, False])
def test_a_way_out_is_blocked_by_what_is_drawn_behind_the_containers_that_it_leaves_alone(
    is_blocked,
):
    """INNER ends aborted; MID goes on from there, or ends itself, and TOP goes on from MID."""
    inner = smach.StateMachine(outcomes=ENDS)
    with inner:
        smach.StateMachine.add('GRASP', Scripted('aborted'), {'ok': 'done'})
    mid = smach.StateMachine(outcomes=ENDS)
    with mid:
        smach.StateMachine.add('LOOK', Scripted(), {'ok': 'GET'})
        drawn = {'aborted': 'CLEAN'} if is_blocked else {}
        smach.StateMachine.add('GET', inner, {'done': 'done', **drawn})
        smach.StateMachine.add('CLEAN', Scripted(), {'ok': 'done'})
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('HOME', Scripted(), {'ok': 'MID'})
        smach.StateMachine.add('MID', mid, {'done': 'done', 'aborted': 'HELP'})
        smach.StateMachine.add('HELP', Scripted(), {'ok': 'done'})
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    menu = menu_at(machine)
    assert bool(menu['/MID/LOOK']['blocked']) is is_blocked
    assert menu['/HOME']['blocked'], 'that would leave MID, behind which there is HELP'


def test_a_high_rate_is_no_reason_to_ask_where_a_level_above_may_decide():
    machine = nested(Scripted(*FAILS), escalate=True, high_from=0.05, moderate_from=0.05)
    machine.run()
    taken = [(each.path, each.outcome) for each in machine.of(EventKind.DECISION)]
    assert any(path.count('/') == 0 for path, _ in taken), taken


def test_a_step_back_in_a_loop_does_not_leave_the_round():
    """NEXT, PICK, PLACE, MORE, and again from NEXT. PICK fails in the second round."""
    more = Scripted('more', 'ok', outcomes=('more', 'ok', 'aborted'))
    pick = Scripted('ok', *FAILS[:2], 'ok')
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('NEXT', Scripted(), {'ok': 'PICK'})
        smach.StateMachine.add('PICK', pick, {'ok': 'PLACE'})
        smach.StateMachine.add('PLACE', Scripted(), {'ok': 'MORE'})
        smach.StateMachine.add('MORE', more, {'more': 'NEXT', 'ok': 'done'})
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    assert {way['target'] for way in machine.of(EventKind.DECISION)[0].data['menu']} == {
        'PICK',
        'NEXT',
    }
    assert machine.visits()[-3:] == ['PICK', 'PLACE', 'MORE']


def test_a_state_that_may_end_the_loop_is_on_no_menu_of_a_later_round():
    following = Scripted('ok', 'ok', 'over', outcomes=('ok', 'over', 'aborted'))
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('NEXT', following, {'ok': 'LOOK', 'over': 'done'})
        smach.StateMachine.add('LOOK', Scripted(), {'ok': 'PICK'})
        smach.StateMachine.add('PICK', Scripted('ok', *FAILS[:2], 'ok'), {'ok': 'NEXT'})
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    assert {way['target'] for way in machine.of(EventKind.DECISION)[0].data['menu']} == {
        'PICK',
        'LOOK',
    }


def test_a_list_that_was_appended_to_in_place_is_restored_only_if_it_is_copied():
    def put(ud):
        ud.placed.append('cup')
        return 'ok'

    def tidy(ud):
        return 'ok' if len(machine.visits()) > 5 else 'aborted'

    for given, left in (
        ({}, ['cup', 'cup']),
        ({'userdata': 'restore'}, ['cup', 'cup']),
        ({'userdata': 'restore', 'deep_copy_keys': ['placed']}, ['cup']),
    ):
        top = smach.StateMachine(outcomes=['ok', 'aborted'])
        top.userdata.placed = []
        keys = {'input_keys': ['placed'], 'output_keys': ['placed']}
        with top:
            smach.StateMachine.add(
                'PUT', smach.CBState(put, outcomes=['ok'], **keys), {'ok': 'TIDY'}
            )
            smach.StateMachine.add('TIDY', smach.CBState(tidy, outcomes=['ok', 'aborted'], **keys))
        machine = at_once(Watched(top, settings={'policy': 'escalating', **given}))
        assert machine.run() == 'ok' and 'from PUT' in orders(machine)
        assert top.userdata.placed == left, given
