"""Preconditions that name a state of another container of the tree, by its path."""

import threading

import pytest
from guarded_machines import OUTCOMES, both, chain
from machines import FakeExpert, Scripted, Watched, contents, give_up, in_thread, supersede
from test_wrapped_changes import needs_constants

import smach
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind


def ends(watched):
    return [
        (event.path, event.state, event.target, event.outcome, event.text)
        for event in watched.of(EventKind.PRECONDITION_END)
    ]


def wrapped(machine, state, *preconditions, states=None, **more):
    settings = {'states': {state: {'preconditions': list(preconditions)}, **(states or {})}}
    return Watched(machine, name='TOP', settings=settings, **more)


def each(state):
    iterator = smach.Iterator(
        outcomes=list(OUTCOMES),
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state('EACH', state, loop_outcomes=['done', 'ok'])
    return iterator


@pytest.mark.parametrize('name', ['/LOOK', 'SEE/LOOK', 'PICK/SEE/LOOK'])
def test_a_state_above_beside_or_below_is_run_and_is_no_visit(name):
    look = Scripted()
    states = {
        '/LOOK': {'LOOK': look, 'PICK': chain(GRASP=Scripted('aborted'))},
        'SEE/LOOK': {
            'SEE': chain(FIRST=Scripted(), LOOK=look),
            'PICK': chain(GRASP=Scripted('aborted')),
        },
        'PICK/SEE/LOOK': {'PICK': chain(SEE=chain(LOOK=look), GRASP=Scripted('aborted'))},
    }
    watched = wrapped(chain(**states[name]), 'GRASP', name)
    assert watched.run() == 'done'
    assert look.runs == 2
    assert ends(watched) == [('TOP/PICK', 'GRASP', name, 'met', '')]
    assert watched.visits().count('LOOK') == 1 and watched.rate('LOOK').successes == 1


def test_a_state_of_a_machine_that_was_never_executed_is_run():
    tool = Scripted()
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add('PICK', Scripted('aborted'), {'ok': 'done'})
        smach.StateMachine.add('REPAIR', chain(CLEAN=Scripted(), TOOL=tool), {'done': 'PICK'})
    watched = wrapped(machine, 'PICK', 'REPAIR/TOOL')
    assert watched.run() == 'done' and tool.runs == 1
    assert watched.visits() == ['PICK', 'PICK']


def mapped_machine(see, look_at, grasp):
    """TOP: SEE (LOOK) -> PICK (ARM (GRASP)): the pose that LOOK finds goes to GRASP."""
    seeing = smach.StateMachine(outcomes=OUTCOMES, input_keys=['what'], output_keys=['where'])
    with seeing:
        smach.StateMachine.add(
            'LOOK', see, {'ok': 'done'}, remapping={'thing': 'what', 'pose': 'where'}
        )
    arm = smach.StateMachine(outcomes=OUTCOMES, input_keys=['target'])
    with arm:
        smach.StateMachine.add('GRASP', grasp, {'ok': 'done'}, remapping={'at': 'target'})
    pick = smach.StateMachine(outcomes=OUTCOMES, input_keys=['goal'])
    with pick:
        smach.StateMachine.add('ARM', arm, {'done': 'done'}, remapping={'target': 'goal'})
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add(
            'SEE', seeing, {'done': 'PICK'}, remapping={'what': 'cup', 'where': 'cup_pose'}
        )
        smach.StateMachine.add('PICK', pick, {'done': 'done'}, remapping={'goal': 'cup_pose'})
    machine.userdata.cup = look_at
    return machine


def see_with(poses, outcomes=()):
    outcomes = list(outcomes)

    def see(state, ud):
        ud.pose = (ud.thing, poses.pop(0))
        return outcomes.pop(0) if outcomes else 'ok'

    return Scripted(*[see] * 9, input_keys=['thing'], output_keys=['pose'])


def grasp_seeing(seen, *script):
    def grasp(outcome):
        return lambda state, ud: seen.append(ud.at) or outcome

    return Scripted(*[grasp(outcome) for outcome in script], input_keys=['at'])


def test_userdata_go_where_the_remappings_of_the_author_lead():
    seen = []
    watched = wrapped(
        mapped_machine(see_with([1, 2]), 'red', grasp_seeing(seen, 'aborted', 'ok')),
        'GRASP',
        'SEE/LOOK',
    )
    assert watched.run() == 'done'
    assert seen == [('red', 1), ('red', 2)], 'what LOOK has found again reaches GRASP'
    assert watched.machine.userdata.cup_pose == ('red', 2)


def test_what_an_unmet_one_wrote_is_taken_back():
    seen = []
    machine = mapped_machine(
        see_with([1, 2, 3], ['ok', 'aborted']), 'red', grasp_seeing(seen, 'aborted', 'ok')
    )
    seeing = machine.get_children()['SEE']
    watched = wrapped(machine, 'GRASP', 'SEE/LOOK')
    assert watched.run() == 'done'
    assert ends(watched)[0][3:] == ('not met', "ended with 'aborted'")
    assert seen == [('red', 1), ('red', 1)]
    assert seeing.userdata.where == ('red', 1)


def test_what_was_handed_down_to_an_unmet_one_is_taken_back():
    """Two containers lie above LOOK. Nothing of the way down to it stays in either."""
    look = Scripted('aborted', 'ok', input_keys=['x'])
    inner = chain(LOOK=look)
    middle = chain(INNER=inner)
    for container in (inner, middle):
        container.register_input_keys(['x'])
    top = chain(MIDDLE=middle, PICK=Scripted('ok', 'aborted'))
    top.userdata.x = 1
    machine = wrapped(top, 'PICK', 'MIDDLE/INNER/LOOK', expert=FakeExpert(give_up()))
    smach.StateMachine.set_initial_state(top, ['PICK'])
    top.get_children()['PICK'].script = ['aborted']
    machine.run()
    assert look.runs == 1
    assert (list(middle.userdata.keys()), list(inner.userdata.keys())) == ([], [])


def test_a_machine_of_another_container_that_fails_as_a_precondition_asks_nobody():
    expert = FakeExpert(supersede('ok'))
    see = chain(AIM=chain(FOCUS=Scripted('ok', 'aborted', 'aborted', 'aborted')))
    watched = wrapped(
        chain(SEE=see, PICK=chain(GRASP=Scripted('aborted'))),
        'GRASP',
        'SEE/AIM',
        states={'FOCUS': {'max_recoveries': 0}},
        expert=expert,
    )
    assert watched.run() == 'done' and not expert.questions
    assert ends(watched)[0][3] == 'not met'
    assert 'it runs as a precondition' in watched.of(EventKind.GIVE_UP)[0].text


def test_a_preempt_ends_it():
    entered = threading.Event()

    def look(state, ud):
        entered.set()
        for _ in range(2000):
            if state.preempt_requested():
                state.service_preempt()
                return 'preempted'
            threading.Event().wait(0.01)
        return 'ok'

    watched = wrapped(
        chain(SEE=chain(LOOK=Scripted('ok', look)), PICK=chain(GRASP=Scripted('aborted'))),
        'GRASP',
        'SEE/LOOK',
    )
    run = in_thread(watched.run)
    assert entered.wait(20)
    watched.machine.request_preempt()
    assert run.result() == 'preempted'
    assert not watched.machine.get_children()['SEE'].preempt_requested()


def test_what_runs_beside_is_not_met():
    failed, over = threading.Event(), threading.Event()

    def beside(state, ud):
        failed.set()
        assert over.wait(20)
        return 'ok'

    def fail(state, ud):
        assert failed.wait(20)
        return 'aborted'

    def then(state, ud):
        over.set()
        return 'ok'

    machine = both(
        LEFT=chain(L=Scripted(fail, then)), RIGHT=chain(R=Scripted(beside), S=Scripted())
    )
    watched = wrapped(chain(BOTH=machine), 'L', 'BOTH/RIGHT/S')
    try:
        watched.machine.events.observers.append(
            lambda event: over.set() if event.kind is EventKind.PRECONDITION_END else None
        )
        assert watched.run() == 'done'
    finally:
        over.set()
    assert ends(watched)[0][3:] == ('not met', 'TOP/BOTH/RIGHT runs at this time')


def test_one_of_two_branches_runs_a_state_that_both_need():
    """The other one does not run it at the same time."""
    meet = threading.Barrier(2)
    inside = threading.Semaphore(1)

    def fail(state, ud):
        meet.wait(20)
        return 'aborted'

    def look(state, ud):
        assert inside.acquire(blocking=False), 'it is executed twice at a time'
        threading.Event().wait(0.02)
        inside.release()
        return 'ok'

    machine = chain(
        LOOK=Scripted('ok', *[look] * 20),
        BOTH=both(LEFT=chain(L=Scripted(fail)), RIGHT=chain(R=Scripted(fail))),
    )
    watched = Watched(
        machine,
        name='TOP',
        settings={'states': {'L': {'preconditions': ['/LOOK']}, 'R': {'preconditions': ['/LOOK']}}},
    )
    assert watched.run() == 'done'
    assert 'met' in [end[3] for end in ends(watched)]
    assert all(end[4] in ('', 'is being run as a precondition already') for end in ends(watched))


def test_a_branch_may_need_a_state_elsewhere():
    look = Scripted()
    watched = wrapped(chain(LOOK=look, ALL=each(Scripted('aborted'))), 'ALL/EACH', '/LOOK')
    assert watched.run() == 'done' and look.runs == 2
    assert ends(watched) == [('TOP/ALL', 'EACH', '/LOOK', 'met', '')]


def test_none_is_run_in_a_machine_that_is_not_executed():
    """A script executes the nested machine by itself."""
    look = Scripted()
    pick = chain(GRASP=Scripted('aborted'))
    watched = wrapped(chain(SEE=chain(LOOK=look), PICK=pick), 'GRASP', 'SEE/LOOK')
    assert pick.execute() == 'done'
    assert not look.runs
    assert ends(watched)[0][3:] == ('not met', "'SEE/LOOK' cannot be run: there is no such state")


def test_none_is_run_in_a_machine_of_two_containers_that_the_other_one_holds():
    """A script executes the second of them by itself."""
    shared = chain(LOOK=Scripted())
    pick = chain(GRASP=Scripted('aborted'), SEE=shared)
    watched = wrapped(chain(FIRST=chain(SEE=shared), PICK=pick), 'GRASP', 'FIRST/SEE/LOOK')
    assert pick.execute() == 'done'
    assert ends(watched)[-1][3:] == (
        'not met',
        'TOP/FIRST/SEE/LOOK is in no container that is being executed',
    )


@pytest.mark.parametrize('guarded, sees_before', [('SEE', False), ('POUR', True)])
def test_what_is_new_or_may_be_repeated_is_run(guarded, sees_before):
    see = {'SEE': chain(LOOK=Scripted())}
    pick = {'POUR': Scripted(), 'PICK': chain(GRASP=Scripted('aborted'))}
    watched = wrapped(
        chain(**({**see, **pick} if sees_before else {**pick, **see})),
        'GRASP',
        'SEE/LOOK',
        states={guarded: {'on_retry': 'confirm'}},
        expert=FakeExpert(give_up()),
    )
    watched.run()
    assert [each[3] for each in ends(watched)] == ['met']


def test_a_state_that_is_not_repeated_by_itself_is_not_met():
    pour = Scripted()
    watched = wrapped(
        chain(SEE=chain(POUR=pour), PICK=chain(GRASP=Scripted('aborted'))),
        'GRASP',
        'SEE/POUR',
        states={'SEE': {'on_retry': 'confirm'}},
        expert=FakeExpert(give_up()),
    )
    watched.run()
    assert pour.runs == 1
    assert ends(watched)[0][3:] == (
        'not met',
        'TOP/SEE was done in this trial and is not repeated by itself',
    )


@pytest.mark.parametrize(
    'state, name, why',
    [
        ('GRASP', 'SEE/NOTHING', 'there is no such state'),
        ('GRASP', 'NOTHING', 'there is no such state'),
        ('GRASP', 'SEE/LOKO', 'there is no such state (did you mean SEE/LOOK?)'),
        ('GRASP', 'LIFTT', 'there is no such state (did you mean LIFT?)'),
        ('GRASP', 'GRAPS', 'there is no such state'),  # the state itself does not count
        ('GRASP', 'PICK/GRASP', 'it is the state itself'),
        ('GRASP', '/PICK', 'it is a container around the state, and runs meanwhile'),
        ('GRASP', 'LOOK', 'in other containers there is ALL/EACH/LOOK, SEE/LOOK'),
        (
            'GRASP',
            'ALL/EACH/LOOK',
            'it is in an Iterator, and there is no item where it is run alone',
        ),
        ('GRASP', 'DO/PLAIN', 'a state of a Concurrence or an Iterator cannot be run alone'),
        ('DO/PLAIN', 'LOOK', 'in other containers there is ALL/EACH/LOOK, SEE/LOOK'),
    ],
)
def test_what_cannot_be_is_refused(state, name, why):
    machine = chain(
        SEE=chain(LOOK=Scripted()),
        ALL=each(chain(LOOK=Scripted())),
        PICK=chain(GRASP=Scripted(), LIFT=Scripted()),
        DO=both(PLAIN=Scripted()),
    )
    with pytest.raises(SettingsError) as raised:
        wrapped(machine, state, name)
    assert raised.value.key == 'states.{}.preconditions'.format(state.rpartition('/')[2])
    assert 'is not allowed: {}; allowed: '.format(why) in str(raised.value)


def test_a_state_of_the_same_name_in_another_container_can_be_one():
    look = Scripted()
    machine = chain(SEE=chain(LOOK=look), PICK=chain(LOOK=Scripted('aborted')))
    watched = wrapped(machine, 'PICK/LOOK', '/SEE/LOOK')
    assert watched.run() == 'done' and look.runs == 2


def test_what_cannot_be_is_no_harm_where_settings_are_not_strict():
    watched = wrapped(chain(PICK=chain(GRASP=Scripted('aborted'))), 'GRASP', '/PICK', strict=False)
    assert watched.run() == 'done'
    assert 'it is a container around the state' in ends(watched)[0][4]


def test_of_two_states_of_one_name_the_one_at_the_path_is_run():
    looks = Scripted(), Scripted()
    machine = chain(PICK=chain(LOOK=looks[0]), MOVE=chain(LOOK=looks[1]), GRASP=Scripted('aborted'))
    settings = {'states': {'GRASP': {'preconditions': ['MOVE/LOOK']}}}
    assert Watched(machine, settings=settings).run() == 'done'
    assert [each.runs for each in looks] == [1, 2]


def test_a_branch_that_names_itself_by_its_label_alone_names_no_state():
    machine = chain(
        BOTH=both(LEFT=Scripted(outcomes=('done', 'aborted')), RIGHT=chain(A=Scripted()))
    )
    with pytest.raises(SettingsError, match="LEFT'.*: there is no such state"):
        Watched(machine, settings={'states': {'BOTH/LEFT': {'preconditions': ['LEFT']}}})


def test_what_an_unmet_one_of_a_container_around_wrote_is_taken_back():
    look = Scripted(
        'ok',
        lambda state, ud: (setattr(ud, 'x', 2), setattr(ud, 'y', 3), 'aborted')[2],
        output_keys=['x', 'y'],
    )
    top = chain(LOOK=look, PICK=chain(GRASP=Scripted('aborted')))
    top.userdata.x = 1
    machine = wrapped(top, 'GRASP', '/LOOK')
    assert machine.run() == 'done' and look.runs == 2
    assert contents(machine.machine.userdata) == {'x': 1}


def test_what_one_of_a_container_around_wrote_survives_a_step_back():
    """LOOK writes what is there already. FIRST was entered with something else."""
    seen = []

    def writes(state, ud):
        ud.x = 2
        return 'ok'

    def first(state, ud):
        seen.append(ud.x)
        return writes(state, ud)

    pick = smach.StateMachine(OUTCOMES, input_keys=['x'])
    with pick:
        smach.StateMachine.add('FIRST', Scripted(first, first, io_keys=['x']), {'ok': 'GRASP'})
        smach.StateMachine.add('GRASP', Scripted('aborted', 'aborted'), {'ok': 'done'})
    top = chain(LOOK=Scripted('ok', writes, writes, output_keys=['x']), PICK=pick)
    top.userdata.x = 1
    settings = {'memory': 1000, 'states': {'GRASP': {'preconditions': ['/LOOK']}}}
    machine = Watched(top, settings=settings)
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'GRASP'), ('step_back', 'FIRST')]
    assert seen == [1, 2]


def test_a_machine_that_a_precondition_executes_by_hand_asks_nobody():
    hand = chain(CLOSE=Scripted('aborted'))
    machine = Watched(
        chain(PICK=Scripted('aborted'), HAND=hand),
        expert=FakeExpert(supersede('ok')),
        preconditions={'PICK': [lambda userdata: hand.execute() == 'done']},
        settings={'states': {'CLOSE': {'max_recoveries': 0}}},
    )
    assert machine.run() == 'done'
    assert [event.outcome for event in machine.of(EventKind.PRECONDITION_END)] == ['not met']
    assert not machine.of(EventKind.QUERY_OPENED)


def test_what_it_did_not_write_is_not_handed_to_the_machine_above():
    def write(key, value):
        def step(state, ud):
            ud[key] = value
            return 'ok'

        return Scripted(step, step, output_keys=['pose', 'cup'])

    seeing = smach.StateMachine(outcomes=OUTCOMES, output_keys=['pose', 'cup'])
    with seeing:
        smach.StateMachine.add('LOOK', write('pose', 'found'), {'ok': 'done'})
    seeing.userdata.cup = 'unknown'
    machine = chain(SEE=seeing, PAINT=write('cup', 'red'), PICK=Scripted('aborted'))
    watched = wrapped(machine, 'PICK', 'SEE/LOOK')
    assert watched.run() == 'done' and len(ends(watched)) == 1
    assert contents(watched.machine.userdata) == {'pose': 'found', 'cup': 'red'}


def test_nobody_is_asked_about_what_fails_anywhere_in_a_precondition():
    expert = FakeExpert()
    machine = chain(SEE=chain(ARM=chain(LOOK=Scripted('ok', 'aborted'))), PICK=Scripted('aborted'))
    states = {'LOOK': {'max_recoveries': 0}}
    watched = wrapped(machine, 'PICK', 'SEE', expert=expert, states=states)
    assert watched.run() == 'done'
    assert not expert.questions
    assert [event.outcome for event in watched.of(EventKind.PRECONDITION_END)] == ['not met']


def test_a_machine_that_is_run_as_a_precondition_steps_back_within_itself_alone():
    see = chain(FIRST=Scripted('ok', 'aborted'), LAST=Scripted())
    machine = chain(SEE=see, MOVE=Scripted(), PICK=Scripted('aborted'))
    settings = {
        'policy': 'algorithm1',
        'step_back_across': True,
        'states': {'PICK': {'preconditions': ['SEE']}},
    }
    watched = Watched(machine, settings=settings)
    assert watched.run() == 'done'
    assert watched.decisions() == [('step_back', 'FIRST'), ('step_back', 'MOVE')]


@needs_constants
def test_a_precondition_in_a_machine_finds_its_constants_there_as_when_the_machine_begins():
    seen = []

    def look(state, ud):
        seen.append(ud.side)
        return 'ok'

    see = smach.StateMachine(OUTCOMES, input_keys=['side'])
    with see:
        smach.StateMachine.add('LOOK', Scripted(look, look, input_keys=['side']), {'ok': 'done'})
    turn = Scripted(lambda state, ud: setattr(ud, 'side', 'right') or 'ok', output_keys=['side'])
    top = chain(SEE=see, TURN=turn, PICK=Scripted('aborted'))
    top._constants['SEE'] = {'side': 'left'}
    assert wrapped(top, 'PICK', 'SEE/LOOK').run() == 'done'
    assert seen == ['left', 'left']


def test_what_a_precondition_in_a_machine_takes_away_there_is_not_handed_up():
    def look(state, ud):
        ud.pose = 'half'
        see.userdata = smach.UserData()
        return 'ok'

    see = smach.StateMachine(OUTCOMES, output_keys=['pose'])
    with see:
        smach.StateMachine.add('LOOK', Scripted('ok', look, output_keys=['pose']), {'ok': 'done'})
    see.userdata.pose = 'seen'
    machine = wrapped(chain(SEE=see, PICK=Scripted('aborted')), 'PICK', 'SEE/LOOK')
    assert machine.run() == 'done' and [end[3] for end in ends(machine)] == ['met']
    assert contents(machine.machine.userdata) == {'pose': 'seen'}
