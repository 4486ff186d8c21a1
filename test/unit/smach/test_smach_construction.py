"""Building containers: with blocks, mistakes, callbacks, sequences, and what happens to the
caller's own objects.
"""

import copy
import pickle

import pytest
from smach_states import Fixed, Scripted, concurrence, machine, naming, that_name

import smach


def test_add_goes_to_the_innermost_open_container_whoever_it_is_called_on():
    outer, inner = smach.StateMachine(['done']), smach.StateMachine(['done'])
    with outer:
        assert outer.is_opened()
        with inner:
            outer.add('INNER', Fixed())
            assert inner.is_opened() and not outer.is_opened()
        smach.StateMachine.add('OUTER', Fixed())
    assert list(inner.get_children()) == ['INNER'] and list(outer.get_children()) == ['OUTER']
    assert not outer.is_opened()


def test_add_without_an_open_container_of_the_kind_is_an_error():
    with pytest.raises(smach.InvalidStateError, match='container'):
        smach.StateMachine.add('A', Fixed())
    with smach.StateMachine(['done']):
        for kind in (smach.Sequence, smach.Concurrence):
            with pytest.raises(smach.InvalidStateError, match=kind.__name__):
                kind.add('A', Fixed())


def test_assert_opened_and_closing_the_wrong_one():
    outer, inner = smach.StateMachine(['done']), smach.StateMachine(['done'])
    with pytest.raises(smach.InvalidConstructionError, match='open me'):
        outer.assert_opened('open me')
    outer.open()
    inner.open()
    with pytest.raises(smach.InvalidStateError):
        outer.close()


@pytest.mark.improvement
def test_an_error_inside_a_with_block_closes_the_container(said):
    sm = smach.StateMachine(['done'])
    with pytest.raises(ZeroDivisionError):
        with sm:
            raise ZeroDivisionError
    assert not sm.is_opened()
    assert any('Traceback' in text for text in said('err'))


def test_opened_with_arguments():
    sm = smach.StateMachine(['done'])
    with sm.opened(speed=1) as opened:
        assert opened is sm and sm.is_opened() and sm._context_kwargs == {'speed': 1}
        smach.StateMachine.add('A', Fixed())
    assert sm.execute() == 'done'


def test_a_label_used_twice_and_a_transition_from_an_unregistered_outcome_are_errors():
    with smach.StateMachine(['done']):
        smach.StateMachine.add('A', Fixed())
        with pytest.raises(smach.InvalidStateError, match=naming('A')):
            smach.StateMachine.add('A', Fixed())
        with pytest.raises(smach.InvalidTransitionError, match=naming('x', 'B', 'done')):
            smach.StateMachine.add('B', Fixed(), {'x': 'A'})


def test_leaving_an_inconsistent_machine_is_logged_at_once(said):
    machine(('A', Fixed('x'), {'x': 'NOWHERE'}))
    assert that_name(['A', 'NOWHERE'], said('err'))


@pytest.mark.improvement
def test_the_callers_dictionaries_and_the_defaults_stay_untouched():
    transitions, outcomes = {}, ['x']
    machine(('A', Fixed('done'), transitions))
    iterator = smach.Iterator(outcomes, [], [], it=[1])
    assert (
        transitions == {}
        and outcomes == ['x']
        and 'exhausted' in iterator.get_registered_outcomes()
    )
    first = smach.State(['a'])
    first._input_keys.add('key')
    assert smach.State(['a'])._input_keys == set()


@pytest.mark.improvement
def test_a_single_string_of_keys_is_refused_with_the_remedy():
    with pytest.raises(
        TypeError, match=r"input_keys must be a list of keys, not the single string 'key'"
    ):
        smach.State(['a'], input_keys='key')


def test_one_string_of_outcomes_means_its_letters():
    assert sorted(smach.State(outcomes='ab').get_registered_outcomes()) == ['a', 'b']


def test_registering_adds_to_outcomes_and_keys():
    state = smach.State(['a'], io_keys=['both'])
    state.register_outcomes(['b'])
    state.register_input_keys(['in'])
    state.register_output_keys(['out'])
    state.register_io_keys(['more'])
    assert sorted(state.get_registered_outcomes()) == ['a', 'b']
    assert sorted(state.get_registered_input_keys()) == ['both', 'in', 'more']
    assert sorted(state.get_registered_output_keys()) == ['both', 'more', 'out']


def test_a_state_without_execute_says_so():
    with pytest.raises(NotImplementedError):
        smach.State(['a']).execute(None)


def test_a_callback_state_passes_arguments_and_takes_the_interface_of_its_callback():
    @smach.cb_interface(outcomes=['done'], input_keys=['a'], output_keys=['b'])
    def work(ud, first, second=0):
        ud.b = ud.a + first + second
        return 'done'

    state = smach.CBState(work, [10], {'second': 100}, outcomes=['other'])
    assert smach.has_smach_interface(work) and not smach.has_smach_interface(len)
    assert sorted(state.get_registered_outcomes()) == ['done', 'other']
    sm = machine(('A', state, {'other': 'done'}))
    sm.userdata.a = 1
    assert sm.execute() == 'done' and sm.userdata.b == 111


def test_callbacks_hear_of_start_transitions_and_end():
    heard = []
    sm = machine(('A', Fixed('x'), {'x': 'B'}), ('B', Fixed('done'), None))
    sm.register_start_cb(lambda ud, states, *args: heard.append(('start', states, args)), [1])
    sm.register_transition_cb(
        lambda ud, states, *args: heard.append(('transition', states, args)), cb_args=[2]
    )
    sm.register_termination_cb(
        lambda ud, states, outcome, *args: heard.append(('end', states, outcome, args)), [3]
    )
    sm.execute()
    assert heard == [
        ('start', ['A'], (1,)),
        ('transition', ['B'], (2,)),
        ('end', ['B'], 'done', (3,)),
    ]


@pytest.mark.parametrize('kind', ['start', 'transition', 'termination'])
def test_an_exception_in_a_callback_is_logged_and_the_machine_goes_on(kind, said):
    sm = machine(('A', Fixed('x'), {'x': 'B'}), ('B', Fixed('done'), None))
    getattr(sm, 'register_%s_cb' % kind)(lambda *args: 1 // 0)
    assert sm.execute() == 'done'
    assert any(text.startswith('Could not execute %s callback' % kind) for text in said('err'))


def test_a_callback_may_write_userdata():
    sm = machine(('A', Scripted(lambda state, ud: ud.a, input_keys=['a']), None))
    sm.register_start_cb(lambda ud, states: setattr(ud, 'a', 'done'))
    assert sm.execute() == 'done'


def test_a_sequence_connects_its_states_unless_told_otherwise():
    sequence = smach.Sequence(['ok', 'failed'], 'ok')
    with sequence:
        smach.Sequence.add('A', Scripted('ok', ['ok', 'failed']))
        smach.Sequence.add('B', Scripted('ok', ['ok', 'failed']), {'ok': 'D'})
        smach.Sequence.add('C', Scripted('failed', ['ok', 'failed']))
        smach.Sequence.add('D', Scripted('ok', ['ok', 'failed']))
    assert sequence.execute() == 'ok'
    to = {(label, outcome): target for outcome, label, target in sequence.get_internal_edges()}
    assert (to['A', 'ok'], to['B', 'ok'], to['C', 'ok'], to['D', 'ok']) == ('B', 'D', 'D', None)


@pytest.mark.improvement
def test_a_sequence_says_which_state_cannot_be_followed_yet(said):
    with smach.Sequence(['ok', 'other'], 'ok'):
        smach.Sequence.add('A', Fixed('other'))
        smach.Sequence.add('B', Fixed('ok'))
    assert any("State 'A' of the sequence is followed by 'B' once" in text for text in said('err'))


def test_add_auto_connects_to_the_state_added_next():
    sm = smach.StateMachine(['done'])
    with sm:
        smach.StateMachine.add_auto('A', Scripted('y', ['x', 'y']), ['x', 'y'])
        smach.StateMachine.add('B', Fixed('done'))
        with pytest.raises(smach.InvalidStateError):
            smach.StateMachine.add_auto('C', Fixed('done'), ['nope'])
    assert sorted(sm.get_internal_edges(), key=str)[-2:] == [('x', 'A', 'B'), ('y', 'A', 'B')]


@pytest.mark.improvement
@pytest.mark.parametrize(
    'copier', [copy.copy, copy.deepcopy, lambda sm: pickle.loads(pickle.dumps(sm))]
)
def test_copies_and_pickles_of_whole_trees_run(copier):
    inner = machine(('I', Fixed('done'), None))
    inner.userdata.a = [1]
    both = concurrence({'X': Fixed(), 'Y': inner})
    iterator = smach.Iterator(['done', 'exhausted', 'failed', 'preempted'], [], [], it=[1, 2])
    with iterator:
        smach.Iterator.set_contained_state('BOTH', both, loop_outcomes=['done'])
    sm = machine(('IT', iterator, {'exhausted': 'done'}))
    assert sm.execute() == 'done'
    twin = copier(sm)
    assert twin.execute() == 'done' and not twin.is_running()
    twin.request_preempt()
    assert twin.preempt_requested() and not sm.preempt_requested()


def test_names_and_submodules_that_scripts_import():
    from smach import concurrence as concurrence_module
    from smach import (
        container,
        exceptions,
        iterator,
        log,
        sequence,
        state,
        state_machine,
        user_data,
        util,
    )

    assert state_machine.StateMachine is smach.StateMachine and state.CBState is smach.CBState
    assert (container.Container, sequence.Sequence, iterator.Iterator) == (
        smach.Container,
        smach.Sequence,
        smach.Iterator,
    )
    assert concurrence_module.Concurrence is smach.Concurrence
    assert user_data.Remapper is smach.Remapper
    assert log.set_loggers is smach.set_loggers and util.cb_interface is smach.cb_interface
    assert exceptions.InvalidUserCodeError is smach.InvalidUserCodeError


def test_errors_are_logged_where_they_are_made(said):
    smach.InvalidStateError('what went wrong')
    assert said('err') == ['InvalidStateError: what went wrong']


def test_set_loggers_and_the_shutdown_check_replace_what_is_called(monkeypatch):
    for name in ('loginfo', 'logwarn', 'logdebug', 'logerr', 'is_shutdown'):
        monkeypatch.setattr(smach, name, getattr(smach, name))
    heard = []
    smach.set_loggers(*[lambda text, level=level: heard.append((level, text)) for level in 'iwde'])
    smach.set_shutdown_check(lambda: True)
    smach.loginfo('a')
    smach.logwarn('b')
    smach.logdebug('c')
    smach.logerr('d')
    assert heard == [('i', 'a'), ('w', 'b'), ('d', 'c'), ('e', 'd')] and smach.is_shutdown() is True


def test_a_sequence_goes_on_by_a_connector_outcome_that_is_registered_late():
    first = Fixed('other')
    sequence = smach.Sequence(['ok', 'other'], 'ok')
    with sequence:
        smach.Sequence.add('A', first)
        smach.Sequence.add('B', Fixed('other'))
    first.register_outcomes(['ok'])
    first.outcome = 'ok'
    assert sequence.execute() == 'other'


def test_nothing_is_logged_where_standard_output_is_closed(monkeypatch):
    from smach import log

    monkeypatch.setattr('sys.stdout', None)
    loggers = (log.loginfo, log.logwarn, log.logdebug, log.logerr)
    assert [logger('nobody reads this') for logger in loggers] == [None] * 4
