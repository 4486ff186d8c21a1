"""What userdata looks like after a jump, and what a recovery's own writes are worth."""

import pytest
from machines import FakeExpert, Scripted, Watched, chain_of, contents, goto, supersede

import smach
from smach_oracle.oracle.records.events import EventKind


def writes(key, value, outcome):
    def step(state, ud):
        ud[key] = value
        return outcome

    return step


def machine_of(b, preconditions=(), a=None, **settings):
    machine = chain_of(a or Scripted(), b, Scripted())
    machine.userdata.x = 'at the start'
    return Watched(machine, preconditions={'B': list(preconditions)}, settings=settings)


IO = {'input_keys': ['x', 'new'], 'output_keys': ['x', 'new']}


def seen_by(*script, **keys):
    """A state that notes its container's userdata at each visit, before it does what it is told."""
    seen = []

    class Noting(Scripted):
        def execute(self, ud):
            seen.append(machine_data[0]())
            return Scripted.execute(self, ud)

    machine_data = [None]
    state = Noting(*script, **keys)
    return state, seen, machine_data


def run(b_script, preconditions=(), expert=None, **settings):
    state, seen, data = seen_by(*b_script, **IO)
    machine = machine_of(state, preconditions, **settings)
    machine.machine.expert = expert
    data[0] = lambda: contents(machine.machine.userdata)
    machine.run()
    return machine, seen


def test_a_jump_restores_userdata_as_it_was_when_the_target_was_entered():
    machine, seen = run([writes('x', 'half done', 'aborted')])
    assert seen == [{'x': 'at the start'}] * 2
    assert machine.of(EventKind.JUMP)[0].data == {'missing_keys': ['new'], 'userdata': 'restore'}


def test_keys_written_since_are_gone_after_a_restore():
    _, seen = run([writes('new', 1, 'aborted')])
    assert 'new' not in seen[1]


def test_keep_leaves_userdata_as_it_is():
    machine, seen = run([writes('x', 'half done', 'aborted')], userdata='keep')
    assert seen[1] == {'x': 'half done'}
    assert machine.of(EventKind.JUMP)[0].data['userdata'] == 'keep'


def test_what_a_callable_precondition_wrote_survives():
    def achieve(ud):
        ud.x = 'achieved'
        ud['new'] = 2
        return True

    _, seen = run([writes('x', 'half done', 'aborted')], [achieve])
    assert seen[1] == {'x': 'achieved', 'new': 2}


def test_what_a_precondition_wrote_survives_though_it_is_what_the_failed_state_wrote():
    """Only the write tells: the object is the same before and after."""
    done = 'half done'

    def achieve(ud):
        ud.x = done
        return True

    _, seen = run([writes('x', done, 'aborted')], [achieve])
    assert seen[1] == {'x': done}


def test_what_a_state_precondition_wrote_survives():
    _, seen = run(
        [writes('x', 'half done', 'aborted')], [Scripted(writes('x', 'achieved', 'ok'), **IO)]
    )
    assert seen[1] == {'x': 'achieved'}


@pytest.mark.parametrize('userdata', ['restore', 'keep'])
def test_what_a_precondition_that_was_not_met_wrote_is_taken_back(userdata):
    """Such as an action state does: it has outputs of an aborted goal, too."""
    for end in ('aborted', ValueError('x')):

        def fail(state, ud, end=end):
            ud.x, ud.new = 'nothing was found', 'neither'
            del ud._data['x']
            if isinstance(end, Exception):
                raise end
            return end

        expert = FakeExpert(supersede('ok'))
        machine, _ = run(
            [writes('x', 'half done', 'aborted')],
            [Scripted(fail, **IO)],
            expert=expert,
            userdata=userdata,
            max_recoveries=1,
        )
        assert machine.of(EventKind.PRECONDITION_END)[0].outcome == 'not met'
        left = {'x': 'at the start' if userdata == 'restore' else 'half done'}
        assert contents(machine.machine.userdata) == left


def test_of_two_preconditions_the_one_that_was_met_keeps_what_it_wrote():
    def both(ud):
        ud.x = 'achieved'
        return True

    def neither(ud):
        ud.x = ud.new = 'half achieved'
        return False

    _, seen = run(['aborted', 'aborted'], [both, neither])
    assert seen[-1] == {'x': 'achieved'}


@pytest.mark.parametrize('achieves', [True, False])
def test_what_a_check_found_is_there_for_what_achieves_it(achieves):
    def check(ud):
        ud.new = 'found'
        return False

    def achieve(ud):
        ud.x = ud.new
        return achieves

    _, seen = run(['aborted'], [(check, achieve)])
    assert seen[1] == ({'x': 'found', 'new': 'found'} if achieves else {'x': 'at the start'})


def test_what_an_unmet_precondition_wrote_past_its_view_is_taken_back():
    machine = machine_of(
        Scripted('aborted', **IO), [lambda ud: setattr(holder[0].userdata, 'x', 'half achieved')]
    )
    holder = [machine.machine]
    machine.run()
    assert machine.machine.userdata.x == 'at the start'


def test_what_an_unmet_precondition_changed_inside_a_deep_copied_key_is_taken_back():
    machine = chain_of(Scripted(), Scripted('aborted', **IO), Scripted())
    machine.userdata.x = ['at the start']
    Watched(
        machine,
        preconditions={'B': [lambda ud: ud.x.append('half achieved')]},
        settings={'deep_copy_keys': ['x'], 'userdata': 'restore'},
    ).run()
    assert machine.userdata.x == ['at the start']


@pytest.mark.parametrize('is_met_before', [False, True])
def test_what_was_taken_back_in_a_deep_copied_key_does_not_count_as_written(is_met_before):
    def add(state, ud):
        seen.append(list(ud.x))
        ud.x.append('a')
        return 'ok'

    before = [lambda ud: ud.x.append('achieved') or True]
    seen, machine = [], chain_of(Scripted(add, add, **IO), Scripted('aborted', **IO))
    machine.userdata.x = ['start']
    Watched(
        machine,
        preconditions={'B': before * is_met_before + [lambda ud: ud.x.append('half achieved')]},
        settings={'deep_copy_keys': ['x'], 'policy': 'algorithm1', 'prior': 0.5},
    ).run()
    again = ['start', 'a', 'achieved'] if is_met_before else ['start']
    assert seen == [['start'], again]


def test_an_unmet_one_leaves_the_object_under_a_deep_copied_key_where_it_did_not_change_it():
    machine = chain_of(Scripted(), Scripted('aborted', **IO), Scripted())
    machine.userdata.x = x = ['at the start']
    asked, settings = [], {'deep_copy_keys': ['x', 'absent'], 'userdata': 'keep'}
    preconditions = {'B': [lambda ud: asked.append(ud.x)]}
    Watched(machine, preconditions=preconditions, settings={**settings, 'prior': 0.5}).run()
    assert asked[0] is machine.userdata.x is x


def test_what_a_met_one_changed_there_before_stays():
    machine = chain_of(Scripted(), Scripted('aborted', **IO), Scripted())
    machine.userdata.x = ['at the start']
    Watched(
        machine,
        preconditions={
            'B': [
                lambda ud: ud.x.append('achieved') or True,
                lambda ud: ud.x.append('half achieved'),
            ]
        },
        settings={'deep_copy_keys': ['x']},
    ).run()
    assert machine.userdata.x == ['at the start', 'achieved']


def test_what_a_nested_machine_as_precondition_wrote_survives():
    inner = chain_of(Scripted(writes('x', 'achieved', 'ok'), **IO), output_keys=['x'])
    machine = chain_of(Scripted(), Scripted(writes('x', 'half done', 'aborted'), **IO), Scripted())
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'A'})
    machine.userdata.x = 'at the start'
    Watched(machine, preconditions={'B': ['INNER']}).run()
    assert machine.userdata.x == 'achieved'


def test_what_a_precondition_wrote_past_its_view_survives():
    machine = machine_of(
        Scripted(writes('x', 'half done', 'aborted'), **IO),
        [lambda ud: setattr(holder[0].userdata, 'x', 'achieved') or True],
    )
    holder = [machine.machine]
    machine.run()
    assert machine.machine.userdata.x == 'achieved'


def test_what_a_precondition_removed_stays_removed():
    def remove(ud):
        del ud._data['x']
        return True

    _, seen = run(['aborted'], [remove])
    assert seen[1] == {}


def test_what_a_precondition_removed_past_its_view_stays_removed():
    machine = machine_of(
        Scripted('aborted', **IO), [lambda ud: holder[0].userdata._data.pop('x') is not None]
    )
    holder = [machine.machine]
    machine.run()
    assert contents(machine.machine.userdata) == {}


def test_what_the_expert_wrote_survives():
    expert = FakeExpert(goto('B', outputs={'x': 'by hand'}))
    _, seen = run([writes('x', 'half done', 'aborted')], expert=expert, max_recoveries=0)
    assert seen[1] == {'x': 'by hand'}


def test_superseding_hands_on_the_experts_outputs_by_the_states_remapping():
    machine = smach.StateMachine(outcomes=['done', 'aborted'])
    with machine:
        smach.StateMachine.add(
            'A',
            Scripted('aborted', output_keys=['mine']),
            {'ok': 'done', 'preempted': 'aborted'},
            remapping={'mine': 'yours'},
        )
    Watched(
        machine,
        expert=FakeExpert(supersede('ok', outputs={'mine': 7})),
        settings={'max_recoveries': 0},
    ).run()
    assert contents(machine.userdata) == {'yours': 7}


def test_a_jump_to_a_state_never_entered_restores_nothing():
    machine, _ = run(
        [writes('x', 'half done', 'aborted')], expert=FakeExpert(goto('C')), max_recoveries=0
    )
    assert machine.machine.userdata.x == 'half done'
    assert machine.of(EventKind.JUMP)[0].data['userdata'] == 'keep'


def test_in_place_changes_stay_unless_the_key_is_named_for_a_deep_copy():
    def grow(state, ud):
        ud.x.append('half done')
        return 'aborted'

    def after(**settings):
        state = Scripted(grow, **IO)
        machine = chain_of(Scripted(), state)
        machine.userdata.x = ['start']
        Watched(machine, settings=settings).run()
        return machine.userdata.x

    assert after() == ['start', 'half done']
    assert after(deep_copy_keys=['x']) == ['start']


def test_a_precondition_that_changes_a_deep_copied_key_in_place_is_heard():
    machine = chain_of(Scripted(), Scripted('aborted'))
    machine.userdata.x = ['start']
    Watched(
        machine,
        preconditions={'B': [lambda ud: ud.x.append('achieved') or True]},
        settings={'deep_copy_keys': ['x']},
    ).run()
    assert machine.userdata.x == ['start', 'achieved']


def test_what_cannot_be_deep_copied_is_kept_by_reference_and_said(log):
    import threading

    machine = chain_of(Scripted(), Scripted('aborted'))
    machine.userdata.x = lock = threading.Lock()
    assert Watched(machine, settings={'deep_copy_keys': ['x', 'absent']}).run() == 'done'
    assert machine.userdata.x is lock
    assert any('deep-copied' in text for level, text in log if level == 'warn')


def test_a_snapshot_holds_references():
    big = bytearray(10)
    machine = chain_of(Scripted(), Scripted('aborted'))
    machine.userdata.x = big
    Watched(machine).run()
    assert machine.userdata.x is big


def test_the_dictionary_that_a_script_holds_on_to_is_restored_in_place():
    machine = machine_of(Scripted(writes('x', 'half done', 'aborted'), **IO))
    held = machine.machine.userdata._data
    machine.run()
    assert machine.machine.userdata._data is held
    assert held == {'x': 'at the start'}


def test_missing_input_keys_of_the_target_are_said_before_the_jump():
    expert = FakeExpert(goto('C'))
    machine = chain_of(
        Scripted(), Scripted('aborted'), Scripted(input_keys=['grasp', 'x'], outcomes=('ok',))
    )
    machine.userdata.x = 1
    machine = Watched(machine, expert=expert, settings={'max_recoveries': 0})
    machine.run()
    choice = {choice.state: choice.missing_keys for choice in expert.questions[0].choices}
    assert choice == {'A': (), 'B': (), 'C': ('grasp',)}
    jump = machine.of(EventKind.JUMP)[0]
    assert jump.data['missing_keys'] == ['grasp']
    warning = machine.of(EventKind.WARNING)[0]
    assert 'grasp' in warning.text and warning.seq < jump.seq


def test_userdata_of_an_earlier_execution_is_not_restored():
    state = Scripted('ok', writes('x', 'half done', 'aborted'), **IO)
    machine = machine_of(state, a=Scripted('ok', goto_c, 'ok'))
    machine.run()
    machine.machine.userdata.x = 'second run'
    machine.run()
    assert machine.machine.userdata.x == 'second run'


def goto_c(state, ud):
    return 'ok'


@pytest.mark.parametrize('shared', [False, True])
def test_replaced_dictionaries_and_shared_userdata_are_respected(shared):
    other = smach.UserData()
    other.x = 'other'

    def swap(state, ud):
        if shared:
            machine.userdata = other
        else:
            machine.userdata._data = other._data
        return 'ok'

    machine = chain_of(Scripted(swap), Scripted(writes('x', 'half done', 'aborted'), 'ok', **IO))
    assert Watched(machine).run() == 'done'
    assert other.x == 'other'


def test_a_dictionary_replaced_before_a_later_visit_is_restored():
    seen = []

    def replace(state, ud):
        machine.userdata._data = {'x': 'new {}'.format(len(seen))}
        return 'again'

    def work(state, ud):
        seen.append(ud.x)
        if len(seen) == 2:
            ud.x = 'half done'
            return 'aborted'
        return 'done' if len(seen) == 3 else 'again'

    machine = smach.StateMachine(['done', 'aborted'])
    machine.userdata.x = 'old'
    with machine:
        smach.StateMachine.add('A', Scripted(replace, replace, outcomes=['again']), {'again': 'B'})
        failing = Scripted(work, work, work, outcomes=['again', 'done', 'aborted'], **IO)
        smach.StateMachine.add('B', failing, {'again': 'A'})
    assert Watched(machine).run() == 'done'
    assert seen == ['new 0', 'new 1', 'new 1']
