"""Iterators on the way of a jump, and in the items of other Iterators."""

import os

import pytest
from branch_machines import Item, inside, iterator_over
from guarded_machines import chain
from machines import FakeExpert, Scripted, Watched, give_up, goto

import smach
from smach_oracle.oracle.records.events import EventKind

ASKS = {'max_recoveries': 0}
ENDS = ('done', 'aborted', 'preempted')
TO_ABORTED = {'loop_outcomes': ['ok'], 'final_outcome_map': {'stuck': 'aborted'}}


def each_of(state, label, items=(1, 2), loop=('done',), ends=ENDS, **contained):
    """An Iterator over a machine or a state; its item is under the key `label`."""
    iterator = smach.Iterator(
        outcomes=list(ends),
        input_keys=[],
        output_keys=[],
        it=list(items),
        it_label=label,
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state(
            label.upper(), state, loop_outcomes=list(loop), **contained
        )
    return iterator


class Notes(smach.State):
    """Notes its items; ends as told for them, once each, then with 'done'."""

    def __init__(self, done, **script):
        smach.State.__init__(self, ['done', 'aborted', 'preempted'], input_keys=['row', 'column'])
        self.done, self.script = done, script

    def execute(self, ud):
        seen = tuple(ud[key] for key in ('row', 'column') if key in ud)
        self.done.append(seen)
        return self.script.pop('_' + '_'.join(map(str, seen)), 'done')


def nothing(question, cancelled, progress):
    """No answer."""


@pytest.mark.parametrize('place', [('TOP/INNER', 'ALL'), ('TOP/INNER/ALL', 'EACH')])
def test_an_iterator_further_down_goes_on_where_an_expert_goes_there(place):
    each = Item(item3=['aborted'])
    inner = inside(iterator_over(each))
    inner.register_input_keys(['done'])
    machine = chain(INNER=inner, LATER=Scripted())
    machine.userdata.done = []
    expert = FakeExpert(goto('LATER', container='TOP'), goto(place[1], container=place[0]))
    machine['LATER'].script.append('aborted')
    assert Watched(machine, name='TOP', expert=expert, settings=ASKS).run() == 'done'
    assert each.tried == [1, 2, 3, 3, 4]


@pytest.mark.parametrize('final', [{}, {'preempted': 'done'}])
def test_an_iterator_that_was_left_goes_on_whatever_its_author_makes_of_its_end(final):
    items = each_of(chain(A=Scripted('ok', 'aborted')), 'item', (1, 2, 3), final_outcome_map=final)
    machine = Watched(
        chain(ALL=items), name='TOP', expert=FakeExpert(goto('ALL', container='TOP')), settings=ASKS
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['ALL', 'A', 'A', 'ALL', 'A', 'A'], 'items 1, 2 and 2, 3'


@pytest.mark.parametrize('is_machine', [True, False])
def test_an_iterator_that_was_left_for_a_failing_item_goes_on_with_it(is_machine):
    """No outcome of the Iterator says that anything was left."""
    work = Scripted('ok', 'aborted')
    items = each_of(
        chain(WORK=work) if is_machine else work,
        'item',
        (1, 2, 3),
        loop=('ok', 'done'),
        ends=['done'],
        final_outcome_map={'aborted': 'done', 'preempted': 'done'},
    )
    machine = chain(ALL=items, A=Scripted('aborted'))
    expert = FakeExpert(goto('A', container='TOP'), goto('ALL'))
    settings = {'policy': 'always_ask', 'author_recoveries': 'override'}
    watched = Watched(machine, name='TOP', expert=expert, settings=settings)
    assert watched.run() == 'done'
    assert work.runs == 4, 'items 1, 2 and 2, 3'
    told = [event.text for event in watched.of(EventKind.WARNING)]
    assert told == ['goes on with item 2 of 3, which is repeated']


def test_an_item_that_ends_under_a_preempt_is_done_again_where_the_iterator_goes_on():
    def fails_when_asked_to_stop(state, ud):
        machine.request_preempt()
        return 'aborted'

    each = Item(item2=[fails_when_asked_to_stop])
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('LOOK', Scripted('ok', 'aborted'), {'ok': 'ALL'})
        items = iterator_over(each, loop_outcomes=['ok', 'aborted'])
        smach.StateMachine.add('ALL', items, {'done': 'done', 'aborted': 'LOOK'})
    watched = Watched(machine, name='TOP', expert=FakeExpert(goto('ALL')), settings=ASKS)
    assert watched.run() == 'done'
    assert each.tried == [1, 2, 2, 3, 4]


def test_what_is_left_of_one_item_is_not_gone_on_with_in_the_next():
    done = []
    columns = each_of(Notes(done, _1_2='aborted'), 'column', (1, 2, 3))
    columns.register_input_keys(['row'])
    row = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'], input_keys=['row'])
    with row:
        smach.StateMachine.add('LOOK', Scripted('ok', 'aborted'), {'ok': 'COLUMNS'})
        smach.StateMachine.add('COLUMNS', columns, {'done': 'done', 'aborted': 'TIDY'})
        smach.StateMachine.add('TIDY', Scripted(), {'ok': 'done'})
    rows = each_of(row, 'row')
    expert = FakeExpert(nothing, goto('COLUMNS'))
    machine = Watched(chain(ROWS=rows), name='TOP', expert=expert, settings=ASKS)
    assert machine.run() == 'done'
    assert [question.failed_state for question in expert.questions] == ['COLUMN', 'LOOK']
    assert done == [(1, 1), (1, 2), (2, 1), (2, 2), (2, 3)], 'no column of row 2 is dropped'


def test_an_item_that_was_given_up_and_passed_over_settles_no_failure_beside_it():
    concurrence = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': {'ALL': 'done', 'BESIDE': 'ok'}},
    )
    left = each_of(chain(A=Scripted('ok', 'aborted')), 'item', loop=('done', 'aborted'))
    with concurrence:
        smach.Concurrence.add('ALL', left)
        smach.Concurrence.add('BESIDE', Scripted('preempted'))
    machine = Watched(
        chain(BOTH=concurrence), name='TOP', settings={'states': {'**/A': {'max_recoveries': 0}}}
    )
    assert machine.run() == 'done'
    assert [(event.state, event.outcome) for event in machine.of(EventKind.DECISION)] == [
        ('A', 'ask'),
        ('BOTH', 'revisit'),
    ]


@pytest.mark.parametrize(
    'back_to, told',
    [
        (
            'FIRST',
            ['TOP/ALL: begins with its first item again: items 1 to 2 that had ended are repeated'],
        ),
        ('ALL', []),
    ],
)
def test_items_that_are_repeated_on_the_authors_way_are_told(log, back_to, told):
    items = each_of(chain(A=Scripted('ok', 'ok', 'aborted')), 'item', (1, 2, 3))
    machine = Watched(
        chain(FIRST=Scripted(), ALL=items),
        name='TOP',
        settings=ASKS,
        expert=FakeExpert(goto(back_to, container='TOP')),
    )
    assert machine.run() == 'done'
    assert machine.visits().count('A') == (6 if told else 4)
    assert [text for level, text in log if 'that had ended' in text] == told


def test_what_was_given_up_in_one_trial_settles_no_failure_of_the_next():
    def items():
        if expert.questions:
            raise ValueError('nothing on the table')
        return [1]

    machine = chain(ALL=each_of(chain(A=Scripted('aborted')), 'item', ()))
    with machine['ALL']:
        smach.Iterator.set_iteritems(items, 'item')
    expert = FakeExpert(give_up('aborted'), nothing)
    watched = Watched(machine, name='TOP', expert=expert, settings=ASKS)
    assert watched.run() == 'aborted'
    with pytest.raises(smach.InvalidUserCodeError):
        watched.run()
    assert [question.failed_state for question in expert.questions] == ['A', 'ALL']


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')),
    reason="upstream's Iterator takes an error for the end of the items",
)
def test_items_that_can_be_had_once_and_raise_end_with_their_own_error():
    def items():
        yield 1
        raise ValueError('dropped')

    machine = chain(ALL=each_of(Scripted('done', outcomes=('done', 'aborted')), 'item', ()))
    with machine['ALL']:
        smach.Iterator.set_iteritems(items(), 'item')
    watched = Watched(machine, name='TOP', settings={'memory': 1000})
    with pytest.raises(smach.InvalidUserCodeError):
        watched.run()
    failures = watched.of(EventKind.FAILURE)
    assert len(failures) > 1 and all('ValueError: dropped' in each.text for each in failures)
    once = 'what it goes through can be iterated only once, and has raised an error'
    assert once in [each.text for each in watched.of(EventKind.WARNING)]


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')),
    reason="upstream's Iterator takes an error for the end of the items",
)
@pytest.mark.parametrize(
    'to, told, done',
    [
        ('ALL', ['goes on behind item 2'], [1, 2]),
        (
            'FIRST',
            ['begins with its first item again: items 1 to 2 that had ended are repeated'],
            [1, 2, 1, 2],
        ),
    ],
)
def test_after_an_error_in_getting_an_item_those_before_are_finished(to, told, done):
    def items():
        calls.append(1)
        yield from (1, 2)
        if not expert.questions:
            raise ValueError('dropped')
        yield 3

    calls, each = [], Item(item3=['stuck'], outcomes=('ok', 'stuck', 'preempted'))
    machine = chain(FIRST=Scripted(), ALL=iterator_over(each, items, **TO_ABORTED))
    machine.userdata.done = []
    expert = FakeExpert(goto(to, container='TOP'), goto('ALL', container='TOP'))
    watched = Watched(machine, name='TOP', expert=expert, settings=ASKS)
    assert watched.run() == 'done'
    assert each.tried == [*done, 3, 3] and watched.machine.userdata.done[-3:] == [1, 2, 3]
    assert len(calls) == 2, 'the items are got again after the error alone'
    warnings = [each.text for each in watched.of(EventKind.WARNING)]
    assert warnings[1:] == [*told, 'goes on with item 3, which is repeated']


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')),
    reason="upstream's Iterator takes an error for the end of the items",
)
def test_an_error_as_the_items_are_got_again_loses_none_of_them():
    def items():
        calls.append(1)
        for item in (1, 2, 3):
            if (len(calls), item) in ((1, 3), (2, 1)):
                raise ValueError('dropped')
            yield item

    calls, each = [], Item(outcomes=('ok', 'stuck', 'preempted'))
    machine = chain(FIRST=Scripted(), ALL=iterator_over(each, items, **TO_ABORTED))
    machine.userdata.done = []
    expert = FakeExpert(goto('ALL', container='TOP'), goto('ALL', container='TOP'))
    watched = Watched(machine, name='TOP', expert=expert, settings=ASKS)
    assert watched.run() == 'done'
    assert watched.machine.userdata.done == [1, 2, 3] and len(expert.questions) == 2


def test_the_count_of_items_is_not_told_once_there_are_more():
    def grows(state, ud):
        items.append(2)
        return 'ok'

    items = [1]
    watched = Watched(inside(iterator_over(Item(item1=[grows], item2=['aborted']), items)))
    assert watched.run() == 'done'
    assert [event.text for event in watched.of(EventKind.FAILURE)] == ['item 2']


def test_an_iterator_of_a_wrapped_machine_can_be_executed_alone():
    each = Item()
    iterator = iterator_over(each, (1, 2))
    iterator.userdata.done = []
    watched = Watched(inside(iterator))
    assert iterator.execute(None) == 'done' and iterator.userdata.done == [1, 2]
    assert watched.run() == 'done' and each.tried == [1, 2, 1, 2]


def test_an_item_counts_among_the_keys_that_a_state_finds():
    inner = chain(LOOK=Scripted(), HOLD=Scripted(input_keys=['item', 'grip']))
    inner.register_input_keys(['item'])
    expert = FakeExpert(give_up())
    machine = chain(FIND=Scripted('aborted'), ALL=each_of(inner, 'item'))
    Watched(machine, name='TOP', expert=expert, settings=ASKS).run()
    missing = {choice.state: choice.missing_keys for choice in expert.questions[0].choices}
    assert missing['HOLD'] == ('grip',)


def test_an_iterator_keeps_what_came_to_its_userdata_since_it_began():
    def writes(state, ud):
        ud.note = 'of item 2'
        return 'aborted'

    each = Item(item2=[writes])
    each.register_io_keys(['note'])
    items = iterator_over(each)
    items.register_io_keys(['note'])
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('LOOK', Scripted('ok', 'aborted'), {'ok': 'ALL'})
        smach.StateMachine.add('ALL', items, {'done': 'done', 'aborted': 'LOOK'})
    expert = FakeExpert(give_up('aborted'), goto('ALL'))
    watched = Watched(machine, name='TOP', expert=expert, settings={**ASKS, 'userdata': 'keep'})
    assert watched.run() == 'done'
    assert each.tried == [1, 2, 2, 3, 4] and machine.userdata.note == 'of item 2'


class Served:
    """Makes the items each time, and has a length of its own."""

    def __call__(self):
        return [1, 2, 3]

    def __len__(self):
        return 7


def test_what_makes_the_items_may_have_a_length_of_its_own(log):
    machine = inside(iterator_over(Item(item2=['aborted']), items=Served()))
    expert = FakeExpert(goto('ALL', container='TOP'))
    watched = Watched(machine, name='TOP', expert=expert, settings=ASKS)
    assert watched.run() == 'done'
    assert watched.machine.userdata.done == [1, 2, 3]
    assert any('goes on with item 2 of 3' in text for _, text in log)
    assert not any('has changed' in text for _, text in log)


class Looks(smach.State):
    """Has declared no key. Notes the item if it finds it nevertheless."""

    def __init__(self):
        smach.State.__init__(self, ['ok', 'aborted', 'preempted'])
        self.found = []

    def execute(self, ud):
        try:
            self.found.append(ud.item)
        except (AttributeError, KeyError, smach.InvalidUserCodeError):
            self.found.append(None)
        return 'ok'


def test_a_state_finds_what_its_iterator_gives_it_with_an_oracle_and_without():
    bare, wrapped = Looks(), Looks()
    assert inside(iterator_over(bare)).execute() == 'done'
    assert Watched(inside(iterator_over(wrapped))).run() == 'done'
    assert bare.found == wrapped.found


def test_a_precondition_of_an_item_finds_its_own_keys_alone():
    given = Looks()
    machine = inside(iterator_over(Item(item1=['aborted'])))
    settings = {'states': {'EACH': {'preconditions': [given]}}}
    assert Watched(machine, settings=settings).run() == 'done'
    assert given.found == [None]


def test_an_iterator_that_is_executed_without_the_one_around_it_repeats_none_of_its_items(log):
    def by_hand(state, ud):
        assert columns.execute(smach.UserData()) == 'done'
        return 'ok'

    each = Scripted('ok', 'aborted')
    columns = each_of(chain(A=each), 'column', (1, 2, 3))
    machine = chain(ROWS=each_of(columns, 'row'), LAST=Scripted(by_hand))
    expert = FakeExpert(goto('LAST', container='TOP'))
    assert Watched(machine, name='TOP', expert=expert, settings=ASKS).run() == 'done'
    assert each.runs == 5
    assert not [text for _, text in log if 'repeated' in text]


class Numbered(smach.Iterator):
    """A user's class that returns a number where it has not come to its end."""

    def execute(self, parent_ud=None):
        outcome = smach.Iterator.execute(self, parent_ud)
        return outcome if outcome == 'done' else 7


def test_items_that_are_repeated_are_told_where_the_end_before_was_no_outcome(log):
    each = Scripted('ok', 'found', outcomes=('ok', 'found'))
    items = Numbered(
        ['done', 'preempted'], [], [], it=[1, 2], it_label='item', exhausted_outcome='done'
    )
    with items:
        smach.Iterator.set_contained_state(
            'EACH', each, loop_outcomes=['ok'], final_outcome_map={'found': 'preempted'}
        )
    expert = FakeExpert(goto('FIRST'))
    machine = Watched(chain(FIRST=Scripted(), ALL=items), name='TOP', expert=expert, settings=ASKS)
    assert machine.run() == 'done'
    told = 'TOP/ALL: begins with its first item again: item 1 that had ended is repeated'
    assert [text for level, text in log if 'that had ended' in text] == [told]
