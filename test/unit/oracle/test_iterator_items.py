"""Iterators of plain states: an item that fails is recovered as that item."""

import contextlib
import copy

import pytest
from branch_machines import Item, inside, iterator_over
from machines import (
    FakeExpert,
    Gate,
    Scripted,
    Watched,
    chain_of,
    give_up,
    goto,
    in_thread,
    supersede,
)

import smach
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind

ASKS = {'max_recoveries': 0}
# no failure of the item by its name, but one of the Iterator
STUCK = ('ok', 'stuck', 'preempted')
TO_ABORTED = {'loop_outcomes': ['ok'], 'final_outcome_map': {'stuck': 'aborted'}}


def watched(iterator, **wrap):
    return Watched(inside(iterator), name='TOP', **wrap)


def warnings_in(log):
    return [text for level, text in log if level == 'warn']


def test_an_item_that_fails_is_done_again_and_no_other_one():
    each = Item(item2=['aborted'], item4=[ValueError('slipped')])
    machine = watched(iterator_over(each))
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 2, 3, 4, 4]
    assert machine.machine.userdata.done == [1, 2, 3, 4]
    assert [(event.path, event.state, event.text) for event in machine.of(EventKind.FAILURE)] == [
        ('TOP/ALL', 'EACH', 'item 2 of 4'),
        ('TOP/ALL', 'EACH', 'ValueError: slipped; item 4 of 4'),
    ]
    assert machine.rate('EACH').failures == 2


def test_items_that_are_set_anew_are_those_of_the_next_execution():
    each, items = Item(), [1, 2]
    iterator = iterator_over(each, items)
    machine = watched(iterator)
    assert machine.run() == 'done'
    with iterator:
        smach.Iterator.set_iteritems([7, 8], 'item')
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 7, 8]


def test_what_a_failed_try_wrote_is_taken_back_before_the_next():
    def writes(state, ud):
        ud.done = ud.done + ['half']
        return 'aborted'

    machine = watched(iterator_over(Item(item2=[writes])))
    machine.run()
    assert machine.machine.userdata.done == [1, 2, 3, 4]
    kept = watched(iterator_over(Item(item2=[writes])), settings={'userdata': 'keep'})
    kept.run()
    assert kept.machine.userdata.done == [1, 'half', 2, 3, 4]


def test_the_question_is_about_the_item_and_says_where_its_outcomes_lead():
    expert = FakeExpert(goto('EACH'))
    iterator = iterator_over(
        Item(item2=['aborted'], item1=['ok'], outcomes=('ok', 'aborted', 'found', 'preempted')),
        loop_outcomes=['ok'],
        final_outcome_map={'found': 'done'},
    )
    machine = watched(iterator, expert=expert, settings=ASKS)
    assert machine.run() == 'done'
    (question,) = expert.questions
    assert (question.container_path, question.failed_state) == ('TOP/ALL', 'EACH')
    assert 'item 2 of 4' in question.text
    assert question.choices[0].state == 'EACH'
    assert dict(question.supersede_outcomes) == {
        'ok': 'the next item',
        'aborted': 'the end of the iteration, with aborted',
        'found': 'the end of the iteration, with done',
        'preempted': 'the end of the iteration, with preempted',
    }
    assert set(question.give_up_outcomes) == {'ok', 'aborted', 'found', 'preempted'}


@pytest.mark.parametrize(
    'answer, tried, outcome',
    [
        (goto('EACH'), [1, 2, 2, 3, 4], 'done'),
        (supersede('ok'), [1, 2, 3, 4], 'done'),
        (give_up('ok'), [1, 2, 3, 4], 'done'),
        (supersede('preempted'), [1, 2], 'preempted'),
    ],
)
def test_an_expert_does_an_item_again_skips_it_or_breaks(answer, tried, outcome):
    each = Item(item2=['aborted'])
    machine = watched(iterator_over(each), expert=FakeExpert(answer), settings=ASKS)
    assert machine.run() == outcome
    assert each.tried == tried


def test_an_expert_hands_over_what_the_item_would_have_written():
    each = Item(item2=['aborted'])
    machine = watched(
        iterator_over(each),
        settings=ASKS,
        expert=FakeExpert(supersede('ok', outputs={'done': ['by hand']})),
    )
    assert machine.run() == 'done'
    assert machine.machine.userdata.done == ['by hand', 3, 4]


@pytest.mark.parametrize(
    'loops', [{'loop_outcomes': ['ok', 'aborted']}, {'break_outcomes': ['preempted']}]
)
def test_a_failing_outcome_that_loops_goes_on_and_says_which_item_is_passed_over(log, loops):
    each = Item(item2=['aborted'])
    machine = watched(iterator_over(each, **loops), expert=FakeExpert(), settings=ASKS)
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 3, 4]
    assert not machine.of(EventKind.DECISION)
    assert [event.state for event in machine.of(EventKind.FAILURE)] == ['EACH']
    (warning,) = machine.of(EventKind.WARNING)
    assert 'item 2 of 4 is passed over with aborted' in warning.text
    assert any('item 2 of 4 is passed over' in text for text in warnings_in(log))


def test_a_failing_outcome_that_is_mapped_to_a_good_one_is_the_authors():
    each = Item(item2=['aborted'])
    machine = watched(
        iterator_over(each, loop_outcomes=['ok'], final_outcome_map={'aborted': 'done'}),
        settings=ASKS,
    )
    assert machine.run() == 'done'
    assert each.tried == [1, 2] and not machine.of(EventKind.DECISION)
    assert not machine.of(EventKind.WARNING), 'no item was passed over'


def test_a_failing_outcome_that_is_mapped_to_another_failure_is_the_oracles():
    each = Item(item2=['stuck'], outcomes=('ok', 'stuck', 'preempted'))
    machine = watched(
        iterator_over(each, loop_outcomes=['ok'], final_outcome_map={'stuck': 'aborted'}),
        settings={'failure_outcomes': ['stuck']},
    )
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 2, 3, 4]


def test_with_override_a_loop_outcome_is_the_oracles_too():
    each = Item(item2=['aborted'])
    machine = watched(
        iterator_over(each, loop_outcomes=['ok', 'aborted']),
        settings={'author_recoveries': 'override'},
    )
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 2, 3, 4]


def test_an_observed_iterator_runs_as_bare():
    each = Item(item2=['aborted'])
    machine = watched(iterator_over(each), recover=False)
    assert machine.run() == 'aborted'
    assert each.tried == [1, 2]
    assert [event.state for event in machine.of(EventKind.FAILURE)][0] == 'EACH'


@pytest.mark.parametrize(
    'items',
    [
        lambda: [1, 2, 3, 4],
        lambda: (each for each in (1, 2, 3, 4)),
        lambda: lambda: [1, 2, 3, 4],
        lambda: lambda: (each for each in (1, 2, 3, 4)),
    ],
    ids=['list', 'generator', 'function', 'generator function'],
)
@pytest.mark.parametrize('userdata', ['restore', 'keep'])
def test_entered_again_by_the_oracle_it_goes_on_with_the_item_that_was_not_finished(
    items, userdata
):
    each = Item(item3=['stuck'], outcomes=STUCK)
    machine = watched(
        iterator_over(each, items=items(), **TO_ABORTED), settings={'userdata': userdata}
    )
    assert machine.run() == 'done'
    assert [event.state for event in machine.of(EventKind.FAILURE)] == ['ALL']
    assert each.tried == [1, 2, 3, 3, 4]
    assert machine.machine.userdata.done == [1, 2, 3, 4], 'what finished items made stays'


def test_entered_by_its_author_it_begins_anew():
    each = Item(item3=['stuck'], outcomes=STUCK)
    machine = Watched(
        inside(iterator_over(each, **TO_ABORTED), transitions={'done': 'done', 'aborted': 'ALL'})
    )
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 3, 1, 2, 3, 4]


def test_after_a_good_end_it_begins_anew():
    each = Item()
    machine = inside(iterator_over(each, items=[1, 2]), transitions={'done': 'AFTER'})
    with machine:
        smach.StateMachine.add('AFTER', Scripted('aborted'), {'ok': 'done'})
    machine = Watched(machine, settings=ASKS, expert=FakeExpert(goto('ALL')))
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 1, 2]


def test_in_another_trial_it_begins_anew():
    each = Item(item2=['stuck', 'ok', 'stuck'], outcomes=STUCK)
    machine = watched(iterator_over(each, items=[1, 2], **TO_ABORTED), settings=ASKS)
    assert machine.run() == 'aborted'
    machine.machine.expert = FakeExpert(goto('ALL'))
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 1, 2]


@pytest.mark.parametrize(
    'items, tried', [(iter([1, 2]), [1, 2]), (lambda: iter([1, 2]), [1, 2, 1, 2])]
)
def test_items_that_can_be_had_only_once_are_spoken_of_in_the_next_trial(log, items, tried):
    each = Item()
    machine = watched(iterator_over(each, items=items))
    assert machine.run() == 'done' and not warnings_in(log)
    assert machine.run() == 'done' and each.tried == tried
    assert ['only once' in text for text in warnings_in(log)] == [True] * (tried == [1, 2])


def test_items_that_change_meanwhile_are_spoken_of(log):
    items = [1, 2, 3]
    each = Item(item2=['stuck'], item3=['stuck'], outcomes=STUCK)

    def grows(question, cancelled, progress):
        items.append(4)
        return goto('ALL')

    machine = watched(
        iterator_over(each, items=items, **TO_ABORTED),
        expert=FakeExpert(grows, goto('ALL')),
        settings=ASKS,
    )
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 2, 3, 3, 4]
    assert sum('had 3 items, and has 4' in text for text in warnings_in(log)) == 1


def test_an_item_that_cannot_be_got_is_spoken_of_and_none_is_dropped(log):
    class Items:
        broken = True

        def __iter__(self):
            yield from (1, 2)
            if self.broken:
                self.broken = False
                raise OSError('no list')
            yield from (3, 4)

    each = Item()
    machine = watched(
        iterator_over(each, items=Items()), expert=FakeExpert(goto('ALL')), settings=ASKS
    )
    assert machine.run() == 'done'
    assert any('OSError' in text for text in warnings_in(log))
    assert each.tried in ([1, 2, 3, 4], [1, 2]), 'upstream takes the error for the end'


class Listed(list):
    """A user's own list of items."""

    owner = 'eva'


def test_a_user_who_looks_at_what_it_goes_through_sees_what_was_given():
    class Looks(smach.Iterator):
        seen = ()

        def execute(self, parent_ud=None):
            return super().execute(parent_ud)

        def look(self):
            items = self._items
            self.seen = (len(items), items[1], bool(items), items.owner, repr(items), str(items))
            assert not hasattr(items, 'friend') and not hasattr(items, '_owner')
            assert copy.copy(items)[1] == 5

    def look(state, ud):
        iterator.look()
        return 'ok'

    iterator = Looks(['done', 'aborted', 'preempted'], [], [], Listed([4, 5]), 'item', 'done')
    with iterator:
        smach.Iterator.set_contained_state('EACH', Scripted(look, look), loop_outcomes=['ok'])
    assert watched(iterator, settings=ASKS).run() == 'done'
    assert iterator.seen == (2, 5, True, 'eva', '[4, 5]', '[4, 5]')


def test_a_first_item_that_cannot_be_got_is_spoken_of(log):
    def items():
        raise OSError('no list')
        yield 1

    machine = watched(iterator_over(Item(), items=items), settings=ASKS)
    with contextlib.suppress(smach.InvalidUserCodeError):  # upstream takes it for the end
        machine.run()
    assert any('cannot get the item behind the beginning: OSError' in each for _, each in log)


def test_a_preempt_while_an_item_is_asked_about_ends_the_iteration():
    def preempts(question, cancelled, progress):
        machine.machine.request_preempt()
        assert cancelled.wait(20)

    each = Item(item2=['aborted'])
    machine = watched(iterator_over(each), expert=FakeExpert(preempts), settings=ASKS)
    assert machine.run() == 'preempted'
    assert each.tried == [1, 2]
    assert machine.run() == 'done', 'no request is left behind'


def test_a_preempt_reaches_the_item_that_runs():
    gate = Gate()
    each = Item(item2=[gate])
    machine = watched(iterator_over(each))
    call = in_thread(machine.run)
    assert gate.entered.wait(20)
    machine.machine.request_preempt()
    assert call.result() == 'preempted'
    assert each.tried == [1, 2]


def test_an_overrun_of_an_item_is_recovered_and_what_it_writes_late_is_dropped():
    gate = Gate()

    def late(state, ud):
        gate(state, ud)
        ud.done = ['late']
        return 'ok'

    each = Item(item2=[late])
    machine = watched(
        iterator_over(each),
        settings={'states': {'ALL/EACH': {'time_limit_s': 0.2, 'grace_period_s': 5.0}}},
    )
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 2, 3, 4]
    assert machine.machine.userdata.done == [1, 2, 3, 4]


def test_an_iterator_in_an_iterator_goes_on_inside_the_unfinished_item():
    tried = []

    class Cell(smach.State):
        def __init__(self):
            smach.State.__init__(self, ['ok', 'stuck'], input_keys=['row', 'column'])

        def execute(self, ud):
            tried.append((ud.row, ud.column))
            return 'stuck' if tried.count((2, 2)) == 1 and tried[-1] == (2, 2) else 'ok'

    columns = smach.Iterator(
        outcomes=['ok', 'aborted'],
        input_keys=['row'],
        output_keys=[],
        it=[1, 2, 3],
        it_label='column',
        exhausted_outcome='ok',
    )
    with columns:
        smach.Iterator.set_contained_state(
            'CELL', Cell(), loop_outcomes=['ok'], final_outcome_map={'stuck': 'aborted'}
        )
    rows = smach.Iterator(
        outcomes=['done', 'aborted'],
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='row',
        exhausted_outcome='done',
    )
    with rows:
        smach.Iterator.set_contained_state('COLUMNS', columns, loop_outcomes=['ok'])
    expert = FakeExpert(goto('ROWS'))
    machine = Watched(
        inside(rows, 'ROWS', outcomes=('done', 'aborted')), name='TOP', expert=expert, settings=ASKS
    )
    assert machine.run() == 'done'
    assert tried == [(1, 1), (1, 2), (1, 3), (2, 1), (2, 2), (2, 2), (2, 3)]
    assert expert.questions[0].failed_state == 'ROWS'


def test_the_question_says_the_items_of_all_levels():
    columns = smach.Iterator(
        outcomes=['ok', 'aborted'],
        input_keys=['row'],
        output_keys=[],
        it='abc',
        it_label='column',
        exhausted_outcome='ok',
    )
    with columns:
        smach.Iterator.set_contained_state(
            'CELL', Scripted(*['ok'] * 4, 'aborted'), loop_outcomes=['ok']
        )
    rows = smach.Iterator(
        outcomes=['done', 'aborted'],
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='row',
        exhausted_outcome='done',
    )
    with rows:
        smach.Iterator.set_contained_state('COLUMNS', columns, loop_outcomes=['ok'])
    expert = FakeExpert(goto('CELL'))
    machine = Watched(
        inside(rows, 'ROWS', outcomes=('done', 'aborted')), name='TOP', expert=expert, settings=ASKS
    )
    assert machine.run() == 'done'
    assert expert.questions[0].container_path == 'TOP/ROWS/COLUMNS'
    assert expert.questions[0].text == 'item 2 of 3 of item 2 of 2'


def test_a_machine_in_an_iterator_says_the_item_and_the_iterator_goes_on_with_it():
    runs = Scripted('ok', 'gone', 'aborted', outcomes=('ok', 'gone', 'aborted'))
    inner = chain_of(runs, outcomes=('done', 'gone', 'aborted'))
    iterator = smach.Iterator(
        outcomes=['finished', 'aborted'],
        input_keys=[],
        output_keys=[],
        it='abc',
        it_label='item',
        exhausted_outcome='finished',
    )
    with iterator:
        smach.Iterator.set_contained_state(
            'EACH', inner, loop_outcomes=['done'], final_outcome_map={'gone': 'aborted'}
        )
    expert = FakeExpert(goto('INNER'), goto('A'))
    machine = Watched(
        inside(iterator, 'INNER', {'finished': 'done'}, ('done', 'aborted')),
        name='TOP',
        expert=expert,
        settings=ASKS,
    )
    assert machine.run() == 'done'
    assert [question.failed_state for question in expert.questions] == ['INNER', 'A']
    assert expert.questions[1].text == 'item 2 of 3'
    assert runs.runs == 5, 'a, b gone, b failed, b, c'


def test_a_precondition_of_an_item_is_a_function_or_a_state_and_its_check_runs():
    checked = []

    def clear(ud):
        checked.append(ud.item)
        return True

    each = Item(item2=['aborted'])
    machine = watched(iterator_over(each), preconditions={'ALL/EACH': [clear]})
    assert machine.run() == 'done'
    assert checked == [2]
    with pytest.raises(SettingsError, match='(?s)preconditions'):
        watched(iterator_over(Item()), preconditions={'ALL/EACH': ['ALL']})


def test_labels_that_are_preconditions_of_another_state_of_this_label_are_no_matter():
    each = Item(item2=['aborted'])
    machine = inside(iterator_over(each), transitions={'done': 'EACH'})
    with machine:
        smach.StateMachine.add('EACH', Scripted('aborted'), {'ok': 'done'})
        smach.StateMachine.add('HOME', Scripted(), {'ok': 'done'})
    machine = Watched(machine, preconditions={'EACH': ['HOME']})
    assert machine.run() == 'done'
    assert [event.target for event in machine.of(EventKind.PRECONDITION_START)] == ['HOME']
    assert each.tried == [1, 2, 2, 3, 4]


def test_nobody_answers_and_the_item_ends_the_iteration_as_bare():
    each = Item(item2=['aborted'])
    machine = watched(iterator_over(each), settings=ASKS)
    assert machine.run() == 'aborted'
    assert each.tried == [1, 2]
