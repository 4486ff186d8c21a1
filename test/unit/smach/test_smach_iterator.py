"""One state, once for each item."""

import pytest
from smach_states import Scripted, machine

import smach


def iterate(
    work,
    it=(1, 2, 3),
    outcomes=('done', 'failed', 'preempted', 'exhausted'),
    label='n',
    **contained,
):
    made = smach.Iterator(list(outcomes), [], [], it=it, it_label=label)
    with made:
        smach.Iterator.set_contained_state('BODY', Scripted(work), **contained)
    return made


def taking(items, outcome='done'):
    def work(state, ud):
        items.append(ud.n)
        return outcome(ud.n) if callable(outcome) else outcome

    return work


@pytest.mark.parametrize(
    'it', [[1, 2, 3], (1, 2, 3), range(1, 4), lambda: [1, 2, 3], iter([1, 2, 3])]
)
def test_every_item_is_visited_and_the_end_is_exhausted(it, said):
    items = []
    assert iterate(taking(items), it, loop_outcomes=['done']).execute() == 'exhausted'
    assert items == [1, 2, 3]
    assert [text.split(' of ')[0] for text in said('info')] == [
        'Iterating 1',
        'Iterating 2',
        'Iterating 3',
    ]


def test_no_items_is_exhausted_and_a_callable_is_called_anew_in_each_run():
    assert iterate(lambda state, ud: 'done', []).execute() == 'exhausted'
    items = []
    again = iterate(taking(items), lambda: iter([1]), loop_outcomes=['done'])
    again.execute()
    again.execute()
    assert items == [1, 1]


@pytest.mark.parametrize(
    'given',
    [
        {'loop_outcomes': ['done']},
        {'break_outcomes': ['failed']},
        {'loop_outcomes': ['done'], 'break_outcomes': ['failed']},
    ],
)
def test_a_break_outcome_stops_and_is_the_outcome(given):
    items = []
    iterator = iterate(taking(items, lambda n: 'failed' if n == 2 else 'done'), **given)
    assert iterator.execute() == 'failed' and items == [1, 2]


def test_without_loop_and_break_outcomes_the_first_outcome_ends_it():
    items = []
    assert iterate(taking(items)).execute() == 'done' and items == [1]


def test_the_final_outcome_map_applies_to_break_and_exhaustion():
    broken = iterate(
        taking([], 'failed'), loop_outcomes=['done'], final_outcome_map={'failed': 'done'}
    )
    assert broken.execute() == 'done'
    exhausted = iterate(
        taking([]), loop_outcomes=['done'], final_outcome_map={'exhausted': 'failed'}
    )
    assert exhausted.execute() == 'failed'


def test_the_contained_state_works_on_the_iterators_own_userdata():
    def work(state, ud):
        ud.total = ud.total + ud.n
        return 'done'

    iterator = iterate(work, loop_outcomes=['done'])
    iterator.userdata.total = 0
    iterator.register_output_keys(['total'])
    parent = smach.UserData()
    assert iterator.execute(parent) == 'exhausted' and parent.total == 6


def test_the_exhausted_outcome_need_not_be_listed():
    iterator = iterate(taking([]), outcomes=('failed', 'preempted', 'done'), loop_outcomes=['done'])
    sm = machine(('IT', iterator, {'exhausted': 'done'}))
    assert sm.execute() == 'done'


def test_an_unregistered_outcome_stops_where_loop_outcomes_are_given():
    assert iterate(taking([], 'surprise'), loop_outcomes=['done']).execute() == 'surprise'


def test_an_exception_in_the_state_surfaces_as_user_code_error():
    with pytest.raises(smach.InvalidUserCodeError, match='ZeroDivisionError'):
        iterate(lambda state, ud: 1 // 0).execute()


@pytest.mark.improvement
def test_an_exception_in_the_iterable_is_an_error_not_the_end():
    def items():
        yield 1
        raise ValueError('no more paper')

    iterator = iterate(lambda state, ud: 'done', items, loop_outcomes=['done'])
    with pytest.raises(smach.InvalidUserCodeError, match='no more paper'):
        iterator.execute()
    assert iterator.get_active_states() == []


@pytest.mark.parametrize('serviced', [True, False])
def test_a_preempt_stops_after_the_item_with_its_outcome(serviced):
    items = []

    def work(state, ud):
        items.append(ud.n)
        iterator.request_preempt()
        assert state.preempt_requested()
        if serviced:
            state.service_preempt()
        return 'done'

    iterator = iterate(work, loop_outcomes=['done'])
    assert iterator.execute() == 'done' and items == [1] and not iterator.preempt_requested()


@pytest.mark.improvement
def test_a_preempt_the_state_ignored_does_not_meet_its_next_run():
    flags = []

    def work(state, ud):
        flags.append(state.preempt_requested())
        iterator.request_preempt()
        return 'done'

    iterator = iterate(work, loop_outcomes=['done'])
    iterator.execute()
    iterator.execute()
    assert flags == [False, False]


def test_a_shutdown_stops_between_items(monkeypatch):
    items = []
    monkeypatch.setattr(smach, 'is_shutdown', lambda: len(items) == 2)
    assert iterate(taking(items), loop_outcomes=['done']).execute() == 'done'
    assert items == [1, 2]


def test_set_iteritems_and_an_empty_label():
    items = []
    iterator = smach.Iterator(['done', 'exhausted'], [], [])
    with iterator:
        smach.Iterator.set_iteritems([7], 'n')
        smach.Iterator.set_contained_state(
            '', Scripted(taking(items), ['done']), loop_outcomes=['done']
        )
    assert iterator.execute() == 'exhausted' and items == [7]


def test_callbacks_edges_and_children():
    heard = []
    iterator = iterate(
        taking([]), [1, 2], loop_outcomes=['done'], final_outcome_map={'failed': 'done'}
    )
    iterator.register_start_cb(lambda ud, states: heard.append(states))
    iterator.register_transition_cb(lambda ud, states: heard.append(iterator.get_active_states()))
    iterator.register_termination_cb(lambda ud, states, outcome: heard.append(outcome))
    iterator.execute()
    assert heard == [['BODY'], ['BODY'], ['BODY'], 'exhausted']
    edges = {tuple(edge) for edge in iterator.get_internal_edges()}
    assert edges == {
        ('done', 'BODY', 'BODY'),
        ('failed', 'BODY', 'done'),
        ('preempted', 'BODY', None),
    }
    assert list(iterator.get_children()) == iterator.get_initial_states() == ['BODY']
    with pytest.raises(KeyError):
        iterator['OTHER']


def test_an_outcome_that_is_neither_a_break_nor_a_registered_one_ends_the_iteration():
    items = []
    state = Scripted(taking(items, 'odd'), ['ok', 'bad'])
    iterator = smach.Iterator(
        ['ok', 'bad', 'done'], [], [], it=[1, 2], it_label='n', exhausted_outcome='done'
    )
    with iterator:
        smach.Iterator.set_contained_state('STATE', state, break_outcomes=['bad'])
    assert iterator.execute() == 'odd'
    assert items == [1]
