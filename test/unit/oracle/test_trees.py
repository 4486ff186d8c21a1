"""Nested machines: wrapped at any depth, escalating, concurrent."""

import pytest
from machines import FakeExpert, Scripted, Watched, chain_of, goto, supersede

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind, FailureKind


def around(label, child, target='done'):
    """A machine that holds one child."""
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add(label, child, {'done': target})
    return machine


def iterator_of(child, count):
    iterator = smach.Iterator(
        outcomes=['done', 'aborted', 'preempted'],
        input_keys=[],
        output_keys=[],
        it=list(range(count)),
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state('EACH', child, loop_outcomes=['done'])
    return iterator


def concurrence_of(**children):
    concurrence = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': dict.fromkeys(children, 'done')},
    )
    with concurrence:
        for label, child in children.items():
            smach.Concurrence.add(label, child)
    return concurrence


def sequence_of(*states, connector='ok'):
    sequence = smach.Sequence(
        outcomes=['done', 'aborted', 'preempted'], connector_outcome=connector
    )
    with sequence:
        for index, state in enumerate(states):
            last = {connector: 'done'} if index == len(states) - 1 else {}
            smach.Sequence.add('S{}'.format(index), state, last)
    return sequence


def test_a_failure_in_a_nested_machine_is_recovered_there():
    inner = chain_of(Scripted(), Scripted('aborted'))
    machine = Watched(around('INNER', inner), name='TOP')
    assert machine.run() == 'done'
    (failure,) = machine.of(EventKind.FAILURE)
    assert (failure.path, failure.state) == ('TOP/INNER', 'B')
    assert machine.visits() == ['INNER', 'A', 'B', 'B']


@pytest.mark.parametrize(
    'between, path',
    [
        (lambda child: iterator_of(child, 2), 'TOP/MIDDLE/EACH'),
        (lambda child: concurrence_of(LEFT=child, RIGHT=chain_of(Scripted())), 'TOP/MIDDLE/LEFT'),
        (lambda child: sequence_of(chain_of(Scripted()), child, connector='done'), 'TOP/MIDDLE/S1'),
    ],
)
def test_machines_inside_every_kind_of_container_are_wrapped(between, path):
    inner = chain_of(Scripted('aborted'))
    machine = Watched(around('MIDDLE', between(inner)), name='TOP')
    assert isinstance(inner, OracleContainer)
    assert inner.path == path
    assert machine.run() == 'done'
    assert [event.path for event in machine.of(EventKind.FAILURE)] == [path]


def test_a_sequence_is_wrapped_as_the_state_machine_it_is():
    sequence = sequence_of(Scripted(), Scripted('aborted'), Scripted())
    machine = Watched(sequence)
    assert isinstance(sequence, smach.Sequence)
    assert machine.run() == 'done'
    assert machine.visits() == ['S0', 'S1', 'S1', 'S2']


def test_nested_machines_stay_as_they_are_where_told():
    inner = chain_of(Scripted('aborted'))
    machine = Watched(around('INNER', inner), nested=False)
    assert not isinstance(inner, OracleContainer)
    assert machine.run() == 'done'
    assert machine.of(EventKind.FAILURE)[0].state == 'INNER'
    again = chain_of(Scripted())
    Watched(around('INNER', again), settings={'nested': False})
    assert not isinstance(again, OracleContainer)


def test_an_exception_below_is_handed_up_with_its_traceback():
    inner = chain_of(Scripted(ValueError('no grasp')))
    machine = Watched(around('INNER', inner), settings={'max_recoveries': 0})
    with pytest.raises(smach.InvalidUserCodeError, match='(?s)Traceback.*no grasp'):
        machine.run()
    assert [event.failure_kind for event in machine.of(EventKind.FAILURE)] == [
        FailureKind.EXCEPTION
    ] * 2


def test_without_escalation_the_inner_oracle_asks_itself():
    inner = chain_of(Scripted('aborted'))
    expert = FakeExpert(supersede('ok'))
    machine = Watched(
        around('INNER', inner),
        name='TOP',
        expert=expert,
        settings={'max_recoveries': 0, 'escalate': False},
    )
    assert machine.run() == 'done'
    assert expert.questions[0].container_path == 'TOP/INNER'


def test_an_inner_machine_run_by_itself_is_a_trial_and_asks_itself():
    inner = chain_of(Scripted('aborted'))
    machine = Watched(
        around('INNER', inner), expert=FakeExpert(supersede('ok')), settings={'max_recoveries': 0}
    )
    assert inner.execute() == 'done'
    assert machine.kinds()[0] == 'TRIAL_START' and machine.kinds()[-1] == 'TRIAL_END'


def test_what_a_machine_recalls_of_its_failures_lasts_for_the_trial_and_its_chain_for_one_execution(
):  # fmt: skip
    inner = chain_of(Scripted(), Scripted('aborted', 'ok', 'aborted', 'aborted', 'ok'))
    machine = Watched(
        around('MIDDLE', iterator_of(inner, 2)), settings={'max_recoveries': 2, 'memory': 1000}
    )
    machine.run()
    assert machine.rate('B').recoveries == 2
    assert [action for action, _ in machine.decisions()][:2] == ['revisit', 'revisit']


def test_failures_in_concurrent_machines_do_not_disturb_each_other():
    children = {
        'M{}'.format(index): chain_of(Scripted(), Scripted(*['aborted', 'ok'] * 40))
        for index in range(6)
    }
    concurrence = concurrence_of(**children)
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('ALL', concurrence, {'done': 'done'})
    machine = Watched(machine, name='TOP')
    for _ in range(20):
        assert machine.run() == 'done'
    by_trial = {}
    for event in machine.events:
        by_trial.setdefault(event.trial_id, []).append(event.seq)
    assert len(by_trial) == 20
    assert all(seqs == list(range(len(seqs))) for seqs in by_trial.values()), (
        'numbered without gap, in order'
    )
    rows = {(row.path, row.state): row for row in machine.machine.rates()}
    for label in children:
        row = rows['TOP/ALL/' + label, 'B']
        assert (row.failures, row.successes) == (20, 20)
    assert all(not event.continuous for event in machine.of(EventKind.FAILURE))


def test_settings_reach_a_state_by_label_and_by_path():
    left, right = chain_of(Scripted()), chain_of(Scripted())
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('LEFT', left, {'done': 'RIGHT'})
        smach.StateMachine.add('RIGHT', right, {'done': 'done'})
    machine = Watched(
        machine, name='TOP', settings={'states': {'A': {'prior': 0.2}, 'LEFT/A': {'prior': 0.3}}}
    )
    rates = {(row.path, row.state): row.rate for row in machine.machine.rates()}
    assert rates['TOP/LEFT', 'A'] == pytest.approx(0.3)
    assert rates['TOP/RIGHT', 'A'] == pytest.approx(0.2)


def test_settings_for_a_state_that_is_nowhere_are_refused_with_those_there_are():
    with pytest.raises(SettingsError, match='states.PIKC.*INNER, INNER/A'):
        Watched(
            around('INNER', chain_of(Scripted())), settings={'states': {'PIKC': {'prior': 0.5}}}
        )


def test_an_interface_for_a_state_that_is_nowhere_is_refused_or_where_not_strict_warned_of(log):
    settings = {'interfaces': {'hand': {'action': '/hand', 'states': ['INNER/A', 'PIKC']}}}
    with pytest.raises(SettingsError, match=r"interfaces\.hand\.states: 'PIKC'.*A, INNER, INNER/A"):
        OracleContainer.wrap(around('INNER', chain_of(Scripted())), settings=settings)
    OracleContainer.wrap(around('INNER', chain_of(Scripted())), settings=settings, strict=False)
    assert [text for level, text in log if level == 'warn' and 'PIKC' in text]


def test_an_oracle_container_built_inside_another_joins_its_tree():
    inner = OracleContainer(
        outcomes=['done', 'aborted', 'preempted'], settings={'max_recoveries': 0}
    )
    with inner:
        OracleContainer.add('A', Scripted('aborted'), {'ok': 'done'})
    outer = OracleContainer(
        outcomes=['done', 'aborted', 'preempted'], name='TOP', expert=FakeExpert(goto('INNER'))
    )
    with outer:
        OracleContainer.add('INNER', inner, {'done': 'done'})
    events = []
    outer.events.observers.append(events.append)
    assert outer.execute() == 'done'
    assert inner.path == 'TOP/INNER'
    assert inner.settings.defaults.max_recoveries == 0, 'its own settings stay its own'
    assert {event.path for event in events} == {'TOP', 'TOP/INNER'}
    assert not inner.is_top and outer.is_top


def test_a_machine_nested_in_it_after_wrapping_is_wrapped_at_the_next_run():
    machine = Watched(chain_of(Scripted()))
    inner = chain_of(Scripted('aborted'))
    with machine.machine:
        smach.StateMachine.add('INNER', inner, {'done': 'done'})
    machine.machine.set_initial_state(['INNER'])
    assert machine.run() == 'done'
    assert isinstance(inner, OracleContainer)
    assert machine.of(EventKind.FAILURE)[0].path == 'SM_ROOT/INNER'


def test_a_shared_nested_machine_under_two_labels():
    inner = chain_of(Scripted('aborted', 'ok', 'aborted', 'ok'))
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('FIRST', inner, {'done': 'SECOND'})
        smach.StateMachine.add('SECOND', inner, {'done': 'done'})
    machine = Watched(machine)
    assert machine.run() == 'done'
    assert len(machine.of(EventKind.FAILURE)) == 2


def test_the_trial_is_told_apart_from_its_containers():
    machine = Watched(around('INNER', chain_of(Scripted())), name='TOP')
    machine.run()
    assert [
        (event.kind.name, event.path, event.outcome)
        for event in machine.of(
            EventKind.TRIAL_START,
            EventKind.TRIAL_END,
            EventKind.CONTAINER_START,
            EventKind.CONTAINER_END,
        )
    ] == [
        ('TRIAL_START', 'TOP', ''),
        ('CONTAINER_START', 'TOP', ''),
        ('CONTAINER_START', 'TOP/INNER', ''),
        ('CONTAINER_END', 'TOP/INNER', 'done'),
        ('CONTAINER_END', 'TOP', 'done'),
        ('TRIAL_END', 'TOP', 'done'),
    ]


def test_an_iterator_item_that_the_oracle_below_recovers_counts_as_done():
    inner = chain_of(Scripted('ok', 'aborted', 'ok', 'ok'))
    machine = Watched(around('ALL', iterator_of(inner, 3)))
    assert machine.run() == 'done'
    assert len(machine.of(EventKind.FAILURE)) == 1


def test_a_machine_that_is_nested_in_one_top_machine_after_another_belongs_to_the_one_that_runs():
    shared = chain_of(Scripted(*['aborted', 'ok'] * 3))
    first = Watched(around('INNER', shared), name='FIRST', settings={'oracle_label': 'HELP'})
    second = Watched(around('INNER', shared), name='SECOND', recover=True)
    for machine, name, meta in (
        (first, 'FIRST', 'HELP'),
        (second, 'SECOND', 'ORACLE'),
        (first, 'FIRST', 'HELP'),
    ):
        del machine.events[:]
        assert machine.run() == 'done'
        assert {event.path for event in machine.events} == {name, name + '/INNER'}
        assert len({event.trial_id for event in machine.events}) == 1
        assert [event.seq for event in machine.events] == list(range(len(machine.events)))
        assert machine.kinds().count('TRIAL_START') == 1 and machine.kinds()[-1] == 'TRIAL_END'
        assert set(shared.get_children()) == {'A', meta}


def test_a_plain_machine_is_filled_through_the_containers_class():
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        OracleContainer.add('A', Scripted(), {'ok': 'done'})
        with pytest.raises(SettingsError, match='these settings in an OracleContainer'):
            OracleContainer.add('B', Scripted(), {'ok': 'done'}, prior=0.1)
    assert list(machine.get_children()) == ['A']


def test_an_initial_state_may_come_with_userdata():
    machine = OracleContainer(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        OracleContainer.add('A', Scripted(), {'ok': 'done'})
    given = smach.UserData()
    given.cup = 'blue'
    machine.set_initial_state(['A'], given)
    assert machine.userdata.cup == 'blue'
