"""Policies measured on machines with hidden causes: what is counted, and what it costs."""

import itertools

import pytest
from hidden_causes.costs import Prices, difference, standard_error, summarise
from hidden_causes.many import Runner
from hidden_causes.orders import WAYS, Arm, Ordered, Shuffled
from hidden_causes.person import Remedy
from hidden_causes.plan import DONE, MACHINE, Box, Leaf
from hidden_causes.running import CUT_OFF, FAILED, FALSE, TRUE, Bed, Trial, run_machine
from hidden_causes.search import LONGEST, best_order
from hidden_causes.world import Condition, Disturbance, Work
from hidden_worlds import EXACT, causes_of, chain_of

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.decision.policy import Action, Past, Preconditions, Situation
from smach_oracle.oracle.records.events import EventKind

POSE = Condition('pose', {'LOOK': 1.0}, is_goal=False)
PICKED = Condition('picked', {'PICK': 1.0}, is_goal=True)
LIGHT = Condition('light', holds_at_first=True)


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    yield
    smach.set_shutdown_check(lambda: False)


def bed_of(policy, conditions, needs, breaks=(), settings=None, **work):
    """LOOK takes a minute, and PICK two. It needs conditions, of which some are broken once."""
    causes = causes_of(
        conditions,
        {'LOOK': Work(takes_s=60.0), 'PICK': Work(tuple(needs), takes_s=120.0, **work)},
        [Disturbance('d', 'PICK', 1.0, tuple(breaks))] if breaks else [],
    )
    mix = EXACT._replace(again=0.0)
    return Bed(chain_of('LOOK', 'PICK'), causes, policy, mix, settings or {})


def chosen(*ways):
    return Ordered(ways)


def one_trial(bed):
    with bed:
        return bed.trial(0)


def test_a_trial_without_failure_costs_its_time():
    trial = one_trial(bed_of(chosen('ask'), [POSE, PICKED], ['pose']))
    assert trial == Trial(TRUE, 0, 0, 0, pytest.approx(3.0), 0.0, 0)
    assert Prices().cost(trial) == pytest.approx(3.0)


def test_without_an_oracle_a_failure_costs_the_trial():
    trial = one_trial(bed_of(None, [LIGHT, PICKED], ['light'], ['light']))
    assert trial == Trial(FAILED, 1, 0, 0, pytest.approx(3.0), 0.0, 0)
    assert Prices().cost(trial) == pytest.approx(63.0)
    assert trial.is_failing and trial.is_lost and trial.needed_person


def test_a_person_comes_looks_acts_and_sends_the_machine_on():
    trial = one_trial(bed_of(chosen('ask'), [LIGHT, PICKED], ['light'], ['light']))
    # LOOK 1, PICK 2, arrival 3, a look 2, an act 3, PICK 2
    assert trial == Trial(TRUE, 1, 1, 0, pytest.approx(13.0), pytest.approx(5.0), 0)
    assert Prices().cost(trial) == pytest.approx(13.0 + 5 * 5.0)
    assert trial.needed_person and not trial.is_lost


def test_a_step_back_costs_the_states_that_come_again():
    trial = one_trial(bed_of(chosen('step_back', 'ask'), [POSE, PICKED], ['pose'], ['pose']))
    assert trial == Trial(TRUE, 1, 0, 1, pytest.approx(6.0), 0.0, 0)
    assert not trial.needed_person


@pytest.mark.parametrize('way, minutes', [('restart', 4.0), ('step_back', None)])
def test_a_restart_goes_as_far_back_as_there_is_and_starts_with_the_userdata_of_then(way, minutes):
    causes = causes_of(
        [Condition('power', {'SWITCH': 1.0}, is_by_hand=False), PICKED],
        {
            'SWITCH': Work(takes_s=30.0, appends_to='seen'),
            'LOOK': Work(takes_s=30.0),
            'PICK': Work(('power',), takes_s=60.0, reads='seen'),
        },
        [Disturbance('d', 'PICK', 1.0, ('power',))],
    )
    box, settings = chain_of('SWITCH', 'LOOK', 'PICK'), {'userdata': 'keep'}
    mix = EXACT._replace(again=0.0)
    with Bed(box, causes, chosen(way, 'give_up'), mix, settings) as bed:
        trial = bed.trial(0)
        assert bed.machine.userdata.seen == ['round 0']
    if minutes is None:
        assert trial.ended == FAILED, 'one state back is not far enough'
    else:
        assert trial == Trial(TRUE, 1, 0, 1, pytest.approx(minutes), 0.0, 0)


def test_a_wait_costs_its_time_and_no_real_time():
    with bed_of(
        chosen('wait', 'ask'), [LIGHT._replace(heals_s=180.0), PICKED], ['light'], ['light']
    ) as bed:
        trials = [bed.trial(number) for number in range(40)]
    cured = [trial for trial in trials if (trial.attempts, trial.questions) == (1, 0)]
    # LOOK 1, PICK 2, a wait of half a minute, PICK 2
    assert cured == [Trial(TRUE, 1, 0, 1, pytest.approx(5.5), 0.0, 0)] * max(1, len(cured))
    assert {trial.attempts for trial in trials} == {0, 1}, 'at times it heals before PICK looks'


def test_harm_costs_its_price():
    worse = LIGHT._replace(worse=1.0, worsens='harm')
    trial = one_trial(bed_of(chosen('retry', 'ask'), [worse, PICKED], ['light'], ['light']))
    # LOOK 1, PICK 2 and 2, arrival 3, a look 2, an act 3, PICK 2
    assert trial == Trial(TRUE, 2, 1, 1, pytest.approx(15.0), pytest.approx(5.0), 1)
    assert Prices().cost(trial) == pytest.approx(15.0 + 25.0 + 30.0)


def test_a_false_success_is_a_lost_trial_that_no_policy_sees():
    unseen = LIGHT._replace(noticed=0.0)
    trial = one_trial(bed_of(chosen('ask'), [unseen, PICKED], ['light'], ['light']))
    assert trial == Trial(FALSE, 0, 0, 0, pytest.approx(3.0), 0.0, 0)
    assert trial.is_lost and trial.needed_person and not trial.is_failing


def test_where_nothing_helps_the_person_gives_up():
    hopeless = LIGHT._replace(is_by_hand=False)
    trial = one_trial(bed_of(chosen('ask'), [hopeless, PICKED], ['light'], ['light']))
    # LOOK 1, PICK 2, arrival 3, a look 2
    assert trial == Trial(FAILED, 1, 1, 0, pytest.approx(8.0), pytest.approx(2.0), 0)


def test_the_person_sends_the_machine_where_it_helps():
    lost = POSE._replace(is_by_hand=False)
    trial = one_trial(bed_of(chosen('ask'), [lost, PICKED], ['pose'], ['pose']))
    # LOOK 1, PICK 2, arrival 3, a look 2, LOOK 1, PICK 2
    assert trial == Trial(TRUE, 1, 1, 0, pytest.approx(11.0), pytest.approx(2.0), 0)


def test_the_person_knows_what_cures():
    def remedy(*conditions, works=None):
        causes = causes_of(
            conditions,
            {'ARMS': Work(), 'LOOK': Work(), 'PICK': Work(('light',)), **(works or {})},
        )
        bed = Bed(chain_of('ARMS', 'LOOK', 'PICK'), causes, chosen('ask'), EXACT)
        bed.world.spoil('light')
        return bed.person.remedy_of('TOP/PICK'), bed.world.heals_in_s('light')

    found, due_s = remedy(LIGHT._replace(heals_s=20.0))
    assert found == Remedy(wait_s=due_s) and 0.0 < due_s < 120.0
    assert remedy(LIGHT._replace(heals_s=1e7))[0] == Remedy(mend=('light',))
    hopeless = remedy(LIGHT._replace(heals_s=1e7, is_by_hand=False))[0]
    assert hopeless == Remedy(is_hopeless=True)
    made = Condition('light', {'LOOK': 1.0})
    assert remedy(made)[0] == Remedy(enter=('TOP/LOOK',))
    aside = Condition('aside', {'ARMS': 1.0})
    needs_both = {'LOOK': Work(('aside',))}
    assert set(remedy(made, aside, works=needs_both)[0].enter) == {'TOP/LOOK', 'TOP/ARMS'}
    for_good = aside._replace(makers={}, is_by_hand=False)
    assert remedy(made, for_good, works=needs_both)[0] == Remedy(mend=('light',))
    # one hopeless cause is enough, whatever else could be mended
    two = {'PICK': Work(('light', 'arm'))}
    arm = LIGHT._replace(name='arm', holds_at_first=False)
    both = remedy(LIGHT._replace(is_by_hand=False), arm, works=two)[0]
    assert both == Remedy(mend=('arm',), is_hopeless=True)


def test_the_person_sends_the_machine_to_no_state_aside_and_is_not_led_in_circles():
    causes = causes_of(
        [
            Condition('a', {'LOOK': 1.0}, is_by_hand=False),
            Condition('b', {'PICK': 1.0, 'ASIDE': 1.0}, is_by_hand=False),
        ],
        {'LOOK': Work(('b',)), 'PICK': Work(('a',)), 'ASIDE': Work()},
    )
    chain = chain_of('LOOK', 'PICK', 'ASIDE')
    aside = chain.children[2]._replace(is_aside=True)
    box = chain._replace(children=chain.children[:2] + (aside,))
    person = Bed(box, causes, chosen('ask'), EXACT).person
    assert person.remedy_of('TOP/PICK').is_hopeless
    assert person.remedy_of('TOP/ASIDE') == Remedy()


def test_the_person_does_the_work_of_a_state_about_which_the_oracle_asks_again():
    trial = one_trial(bed_of(chosen('ask'), [LIGHT, PICKED], ['light'], noise=1.0))
    # the third time the person does it: LOOK 1, three times PICK 2, arrival 3 and a look 2, work 3
    assert trial == Trial(TRUE, 3, 3, 0, pytest.approx(25.0), pytest.approx(9.0), 0)


def test_a_trial_without_end_is_cut_off():
    trial = one_trial(
        bed_of(
            chosen('retry'),
            [LIGHT, PICKED],
            ['light'],
            noise=1.0,
            settings={'max_recoveries': 10**6},
        )
    )
    assert trial.ended == CUT_OFF and trial.robot_min == pytest.approx(61.0, abs=2.0)
    assert trial.is_lost


def test_after_a_trial_that_was_cut_off_the_next_one_begins_as_usual():
    endless = {'max_recoveries': 10**6}
    with bed_of(chosen('retry'), [LIGHT, PICKED], ['light'], ['light'], endless) as bed:
        trials = [bed.trial(number) for number in range(3)]
    assert [trial.ended for trial in trials] == [CUT_OFF] * 3
    assert {trial.failures for trial in trials} == {30}


def test_a_loop_that_an_author_drew_goes_on_as_without_an_oracle_until_it_is_cut_off(monkeypatch):
    """Machine 13 enters M4 again whenever it is aborted, which lasts in its third trial."""
    warned = []
    monkeypatch.setattr(smach, 'logwarn', warned.append)
    (*_, bare) = run_machine(13, Arm('bare'), 3)
    assert bare.ended == CUT_OFF and bare.failures > 500
    warned.clear()
    (*_, trial) = run_machine(13, Arm('escalating'), 3)
    assert trial.ended == CUT_OFF and trial.attempts <= 8 and trial.questions == 0
    assert trial.failures == pytest.approx(bare.failures, rel=0.1)
    loops = [text for text in warned if 'TOP/M4: keeps failing' in text]
    assert len(loops) == 1 and 'and back again' in loops[0]


def test_each_trial_begins_with_a_person_who_has_not_been_asked():
    with bed_of(chosen('ask'), [LIGHT, PICKED], ['light'], ['light']) as bed:
        trials = [bed.trial(number) for number in range(EXACT.most_questions + 2)]
    assert [(trial.ended, trial.questions) for trial in trials] == [(TRUE, 1)] * len(trials)


def test_the_oracle_hears_what_a_state_says_of_its_failure():
    texts = []
    with bed_of(chosen('ask'), [LIGHT, PICKED], ['light'], ['light']) as bed:
        bed.machine.events.observers.append(
            lambda event: event.kind is EventKind.FAILURE and texts.append(event.text)
        )
        bed.trial(0)
    assert texts == ['not light']


def test_a_state_with_several_failing_outcomes_ends_by_its_text():
    leaf = Leaf(
        'TOP/PICK',
        (DONE,),
        ('aborted', 'lost'),
        False,
        {DONE: DONE, 'aborted': 'aborted', 'lost': 'lost'},
    )
    box = Box('TOP', MACHINE, (leaf,), ('aborted', 'lost'), {})
    names = ['light{}'.format(number) for number in range(30)]
    causes = causes_of(
        [LIGHT._replace(name=name, noticed=1.0) for name in names],
        {'PICK': Work(tuple(names))},
        [Disturbance(name, 'PICK', 0.05, (name,)) for name in names],
    )
    ends = {}
    with Bed(box, causes, None, EXACT) as bed:
        state = bed.machine.get_children()['PICK']
        bed.machine.register_termination_cb(
            lambda ud, states, outcome: ends.setdefault(state.text, set()).add(outcome)
        )
        for number in range(150):
            state.text = ''
            bed.trial(number)
    del ends['']  # without a failure
    outcomes = [each for found in ends.values() for each in found]
    assert all(len(found) == 1 for found in ends.values())
    assert outcomes.count('aborted') > outcomes.count('lost') > 0


def test_an_author_leads_back_twice_in_a_trial_at_most_and_a_list_takes_that_for_no_double():
    leads = {DONE: 'PICK', 'again': 'LOOK', 'aborted': 'aborted'}
    chain = chain_of('LOOK', 'PICK')
    look = Leaf('TOP/LOOK', (DONE, 'again'), ('aborted',), False, leads)
    box = chain._replace(children=(look, chain.children[1]))
    causes = causes_of(
        [PICKED],
        {
            'LOOK': Work(takes_s=60.0, appends_to='seen'),
            'PICK': Work(takes_s=60.0, reads='seen'),
        },
    )
    with Bed(box, causes, chosen('ask'), EXACT._replace(loops=1.0)) as bed:
        trials = [bed.trial(number) for number in range(3)]
    assert trials == [Trial(TRUE, 0, 0, 0, pytest.approx(4.0), 0.0, 0)] * 3


# -- the userdata


@pytest.mark.parametrize('userdata, ended', [('restore', FAILED), ('keep', TRUE)])
def test_a_restore_erases_what_a_script_has_noted_of_its_tries(userdata, ended):
    variant = LIGHT._replace(variant=2)
    bed = bed_of(
        chosen('retry', 'retry', 'retry', 'give_up'),
        [variant, PICKED],
        ['light'],
        ['light'],
        settings={'userdata': userdata},
    )
    assert one_trial(bed).ended == ended


@pytest.mark.parametrize(
    'userdata, in_place, is_double',
    [
        ('keep', False, True),
        ('restore', False, False),
        ('keep', True, True),
        ('restore', True, True),
    ],
)
def test_what_a_state_appends_counts_twice_where_it_is_kept(userdata, in_place, is_double):
    causes = causes_of(
        [POSE, LIGHT, PICKED],
        {
            'LOOK': Work(takes_s=60.0, appends_to='seen', in_place=in_place),
            'PICK': Work(('light',), takes_s=120.0, reads='seen'),
        },
        [Disturbance('d', 'PICK', 1.0, ('light',))],
    )
    settings = {'userdata': userdata}
    bed = Bed(chain_of('LOOK', 'PICK'), causes, chosen('step_back', 'ask'), EXACT, settings)
    with bed:
        # light is broken at the first PICK alone, and a person has mended it: PICK comes again
        bed.trial(0)
        assert (len(bed.machine.userdata.seen) > 1) is is_double


# -- policies


def situation(recoveries, trial=0):
    return Situation(
        FailureClass.LOW, Preconditions.NONE, False, Past(recoveries=recoveries, trial=trial)
    )


def test_an_order_is_followed_way_by_way_and_its_last_one_stays():
    arm = Arm('order:retry,wait,restart,ask')
    policy = arm.policy(3)
    assert arm.name == 'order:retry,wait,restart,ask' and not arm.is_bare
    assert Arm('bare').is_bare and Arm('bare').policy(3) is None
    decided = [policy.decide(situation(recoveries)) for recoveries in range(6)]
    assert decided == [
        Action.REVISIT,
        Action.REVISIT,
        Action.RESTART,
        Action.ASK,
        Action.ASK,
        Action.ASK,
    ]
    assert [policy.wait_s(situation(number)) for number in range(6)] == [0.0, 30.0] + [0.0] * 4
    assert set(policy.may_do(situation(0))) == set(decided)


def test_each_order_is_drawn_as_often_and_stays_for_its_trial():
    policy = Shuffled('seed')
    counts = {}
    for trial in range(2400):
        order = tuple(policy.order(situation(0, trial)))
        assert order == tuple(policy.order(situation(3, trial)))
        counts[order] = counts.get(order, 0) + 1
    assert len(counts) == 24 and min(counts.values()) > 60 and max(counts.values()) < 140
    assert [tuple(Shuffled('other').order(situation(0, trial))) for trial in range(9)] != [
        tuple(policy.order(situation(0, trial))) for trial in range(9)
    ]


def test_a_policy_that_draws_draws_otherwise_on_each_machine_unless_it_is_told_how():
    own, other = (Arm('random').policy(seed) for seed in (1, 2))
    assert own.seed != other.seed
    assert Arm('random:seed=5').policy(1).seed == Arm('random:seed=5').policy(2).seed == 5


@pytest.mark.parametrize(
    'name', ['guess', 'order:', 'order:retry,guess', 'ladder:height=3', 'prose:wait_s=3']
)
def test_a_policy_that_does_not_exist_is_refused_with_what_there_is(name):
    with pytest.raises(ValueError) as error:
        Arm(name)
    assert name in str(error.value) and len(str(error.value)) > len(name) + 10


def test_the_best_order_is_found_where_each_way_has_a_price_of_its_own():
    wanted = ('retry', 'step_back', 'ask')

    def cost(order):
        wrong = sum(a != b for a, b in itertools.zip_longest(order, wanted))
        return wrong + 0.1 * len(order)

    found = best_order(cost)
    assert found.order == wanted and found.cost == pytest.approx(0.3)
    assert found.tried < 80


def test_no_order_that_is_tried_is_too_long_or_ends_otherwise():
    seen = []

    def cost(order):
        seen.append(order)
        return -len(order)

    assert len(best_order(cost).order) == LONGEST
    assert {order[-1] for order in seen} == {'ask', 'give_up'}
    assert all(len(order) <= LONGEST and set(order) <= set(WAYS) for order in seen)
    assert len(seen) == len(set(seen))


# -- prices and sums


def test_costs_are_summed_up_by_machine():
    good = Trial(TRUE, 0, 0, 0, 10.0, 0.0, 0)
    bad = Trial(FALSE, 2, 1, 3, 20.0, 4.0, 1)
    summary = summarise([[good, good], [good, bad]], Prices())
    assert summary.trials == 4 and summary.failing == summary.lost == summary.person == 0.25
    assert (summary.true_success, summary.false_success) == (0.75, 0.25)
    assert (summary.attempts, summary.robot_min, summary.harm) == (0.75, 12.5, 0.25)
    assert (summary.questions, summary.expert_min) == (0.25, 1.0)
    # 10, and the mean of 10 and 20 + 20 + 60 + 30
    assert summary.cost == pytest.approx((10.0 + 70.0) / 2)
    assert summary.error == pytest.approx(30.0)
    more, error = difference([[bad], [good]], [[good], [good]], Prices())
    assert (more, error) == (pytest.approx(60.0), pytest.approx(60.0))
    assert standard_error([5.0]) == 0.0


def test_each_price_is_halved_and_doubled_alone():
    changed = Prices().changed()
    assert len(changed) == 9 and changed['as given'] == Prices()
    assert changed['half lost_trial'] == Prices(lost_trial=30.0)
    assert changed['double harm'] == Prices(harm=60.0)


# -- whole runs


ARMS = ('bare', 'prose', 'ladder', 'shuffled', 'order:retry,step_back,restart,ask')


def test_the_same_seed_gives_the_same_trials_whatever_the_jobs():
    # 3 has a Concurrence or an Iterator among the first seeds, as do some of the others
    with Runner(1) as alone, Runner(2) as two:
        for arm in ARMS:
            first = alone.run(arm, range(8), 6)
            again = two.run(arm, range(8), 6)
            assert [ran.trials for ran in first] == [ran.trials for ran in again], arm
            assert [ran.seed for ran in again] == list(range(8))


@pytest.mark.parametrize('name', ['escalating', 'any_way'])
def test_a_policy_that_goes_by_ways_has_its_menu_and_its_own_userdata(name):
    told = []
    with bed_of(Arm(name).policy(3), [POSE, PICKED], ['pose'], ['pose']) as bed:
        oracle_of(bed.machine).events.observers.append(told.append)
        trial = bed.trial(0)
    assert trial.ended == TRUE and 0 < trial.attempts <= 4
    jumps = [event.data['userdata'] for event in told if event.kind is EventKind.JUMP]
    assert jumps and set(jumps) == {POLICIES[name].userdata}
    assert all(event.data['menu'] for event in bed.events)


def test_a_policy_that_goes_by_ways_goes_by_the_prices_of_the_command():
    def attempts(**prices):
        with Runner(1) as runner:
            ran = runner.run('escalating', [3], 10, {'cost': {**Prices()._asdict(), **prices}})
        return sum(trial.attempts for trial in ran[0].trials)

    assert attempts(robot_minute=0, expert_minute=0) == 0 < attempts()


def test_policies_meet_the_same_first_failure():
    def failing(arm):
        return [trial.is_failing for seed in range(15) for trial in run_machine(seed, Arm(arm), 1)]

    wanted = failing('bare')
    assert any(wanted) and not all(wanted)
    for arm in ARMS[1:]:
        assert failing(arm) == wanted


def test_the_script_is_wrapped_as_it_is():
    causes = causes_of([LIGHT, PICKED], {'LOOK': Work(), 'PICK': Work()})
    with Bed(chain_of('LOOK', 'PICK'), causes, None) as bed:
        assert type(bed.machine) is smach.StateMachine
    with Bed(chain_of('LOOK', 'PICK'), causes, chosen('ask')) as bed:
        assert isinstance(bed.machine, smach.StateMachine)
        assert bed.machine.settings.userdata is None and bed.machine.expert is bed.person
