"""An item that is done again finds the userdata as they were when it began, and is an event."""

import pytest
from machines import FakeExpert, Scripted, Watched, goto, supersede

import smach
from smach_oracle.oracle.records.events import EventKind

OUTCOMES = ['done', 'stuck', 'aborted', 'preempted']


class Adds(smach.State):
    """Adds 1 to `total`, and the item to `names`, and then ends as told for that visit."""

    def __init__(self, *script, in_place=False):
        smach.State.__init__(
            self, ['ok', 'stuck', 'preempted'], io_keys=['total', 'names'], input_keys=['item']
        )
        self.script = list(script)
        self.in_place = in_place

    def execute(self, ud):
        ud.total = ud.total + 1
        if self.in_place:
            ud.names.append(ud.item)
        else:
            ud.names = [*ud.names, ud.item]
        step = self.script.pop(0) if self.script else 'ok'
        return step(self) if callable(step) else step


def over(state, items=(1, 2, 3), label='item', loop=('ok', 'done')):
    """An Iterator with the keys total and names, whose break outcome `stuck` is a failure."""
    iterator = smach.Iterator(
        OUTCOMES,
        ['total', 'names'],
        ['total', 'names'],
        it=items,
        it_label=label,
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state(
            'EACH', state, loop_outcomes=list(loop), final_outcome_map={'stuck': 'aborted'}
        )
    return iterator


def machine_of(iterator, first=False):
    machine = smach.StateMachine(OUTCOMES)
    machine.userdata.total, machine.userdata.names = 0, []
    with machine:
        if first:
            smach.StateMachine.add('FIRST', Scripted(), {'ok': 'ALL'})
        smach.StateMachine.add('ALL', iterator, {'done': 'done'})
    return machine


def total_of(machine, *answers, **settings):
    settings.setdefault('memory', 1000)  # it stays LOW, and is entered again
    watched = Watched(machine, name='TOP', expert=FakeExpert(*answers), settings=settings)
    assert watched.run() == 'done'
    return watched, (machine.userdata.total, machine.userdata.names)


def told(watched):
    return [
        (event.path, event.state, event.text)
        for event in watched.of(EventKind.WARNING)
        if 'repeated' in event.text
    ]


WITH_2 = [('TOP', 'ALL', 'goes on with item 2 of 3, which is repeated')]


def test_an_item_that_failed_after_it_wrote_counts_once():
    watched, left = total_of(machine_of(over(Adds('ok', 'stuck'))))
    assert left == (3, [1, 2, 3])
    assert told(watched) == WITH_2


def test_what_was_changed_inside_is_taken_back_under_deep_copied_keys():
    _, left = total_of(
        machine_of(over(Adds('ok', 'stuck', in_place=True))), deep_copy_keys=['names']
    )
    assert left == (3, [1, 2, 3])


def test_an_item_may_be_repeated_more_than_once():
    watched, left = total_of(
        machine_of(over(Adds('ok', 'stuck', 'stuck', 'ok', 'stuck'))), max_recoveries=9
    )
    assert left == (3, [1, 2, 3])
    assert told(watched) == 2 * WITH_2 + [
        ('TOP', 'ALL', 'goes on with item 3 of 3, which is repeated')
    ]


def test_keys_that_are_not_given_from_above_are_taken_back_too():
    iterator = over(Adds('ok', 'stuck'))
    iterator._input_keys = {'names'}
    iterator.userdata.total = 0
    _, left = total_of(machine_of(iterator))
    assert left == (3, [1, 2, 3])


def test_a_machine_in_the_iterator_counts_once_for_an_item():
    inner = smach.StateMachine(
        ['done', 'stuck', 'preempted'], ['total', 'names', 'item'], ['total', 'names']
    )
    with inner:
        smach.StateMachine.add('ADD', Adds(), {'ok': 'THEN'})
        smach.StateMachine.add(
            'THEN', Scripted('ok', 'stuck', outcomes=('ok', 'stuck')), {'ok': 'done'}
        )
    watched, left = total_of(machine_of(over(inner, loop=('done',))))
    assert left == (3, [1, 2, 3])
    assert told(watched) == WITH_2


@pytest.mark.parametrize('fails_at', range(4))
def test_an_iterator_in_an_iterator_counts_each_of_its_items_once(fails_at):
    inner = smach.Iterator(
        ['done', 'stuck', 'preempted'],
        ['total', 'names'],
        ['total', 'names'],
        it=['a', 'b'],
        it_label='item',
        exhausted_outcome='done',
    )
    with inner:
        smach.Iterator.set_contained_state(
            'IN', Adds(*fails_at * ['ok'], 'stuck'), loop_outcomes=['ok']
        )
    _, left = total_of(machine_of(over(inner, (1, 2), 'outer', loop=('done',))))
    assert left == (4, ['a', 'b', 'a', 'b'])


@pytest.mark.parametrize(
    'to, repeated',
    [
        ('ALL', WITH_2),
        (
            'FIRST',
            [('TOP', 'ALL', 'begins with its first item again: item 1 that had ended is repeated')],
        ),
    ],
)
def test_one_that_is_left_by_a_jump_counts_each_item_once(to, repeated):
    inner = smach.StateMachine(
        ['done', 'aborted', 'preempted'], ['total', 'names', 'item'], ['total', 'names']
    )
    with inner:
        smach.StateMachine.add('ADD', Adds(), {'ok': 'THEN', 'stuck': 'aborted'})
        smach.StateMachine.add('THEN', Scripted('ok', 'aborted'), {'ok': 'done'})
    watched, left = total_of(
        machine_of(over(inner, loop=('done',)), first=True),
        goto(to, container='TOP'),
        max_recoveries=0,
    )
    assert left == (3, [1, 2, 3])
    assert told(watched) == repeated


def test_with_keep_what_the_unfinished_item_wrote_stays():
    _, left = total_of(machine_of(over(Adds('ok', 'stuck'))), userdata='keep')
    assert left == (4, [1, 2, 2, 3])


def test_an_item_that_was_finished_before_an_error_keeps_what_it_wrote():
    class Late:
        """Its second item can be had at the second try."""

        tries = 0

        def __iter__(self):
            self.tries += 1
            yield 1
            if self.tries == 1:
                raise ValueError('no second one yet')
            yield 2

    machine = machine_of(over(Adds(), Late()))
    _, left = total_of(machine)
    # to upstream's engine the error is the end of the items
    assert left in ((2, [1, 2]), (1, [1]))


class Named(list):
    """A list that is not one to everybody."""


class Touchy(list):
    """Nobody can tell whether two of them are equal."""

    def __eq__(self, other):
        raise ValueError('which of them?')


@pytest.mark.parametrize(
    'given, written, copied, left',
    [
        ([], None, ['names'], [1, 2, 3]),
        ([], ['new'], ['names'], ['new', 2, 3]),
        ([], Named(), ['names'], [2, 3]),
        (Touchy(), None, ['names'], [2, 3]),
        (Touchy(), None, [], [1, 2, 3]),
    ],
    ids=['as before', 'another', 'of another class', 'not comparable', 'the same object'],
)
def test_what_is_given_from_above_replaces_it_where_that_is_not_as_before(
    given, written, copied, left
):
    def writes(ud):
        if written is not None:
            ud.names = written
        return True

    machine = machine_of(over(Adds('ok', 'stuck')))
    machine.userdata.names = given
    states = {'ALL': {'preconditions': [writes]}}
    total_of(machine, states=states, deep_copy_keys=copied)
    assert machine.userdata.names == left


def test_one_that_has_failed_after_its_last_item_begins_again():
    each = Scripted()
    iterator = over(each, items=(1, 2))
    iterator._exhausted_outcome = 'aborted'
    total_of(machine_of(iterator), goto('ALL'), supersede('done'), max_recoveries=0)
    assert each.runs == 4


def test_the_machine_says_behind_which_item_none_can_be_got():
    def items():
        yield 1
        raise ValueError('dry')

    machine = machine_of(over(Scripted(), items=items()))
    settings, expert = {'max_recoveries': 0}, FakeExpert(supersede('done'))
    watched = Watched(machine, name='TOP', settings=settings, expert=expert)
    assert watched.run() == 'done'
    texts = [event.text for event in watched.of(EventKind.WARNING)]
    assert texts == ["cannot get the item behind item 1: ValueError('dry')"]


def test_an_iterator_that_goes_on_takes_what_was_changed_above_it_meanwhile():
    def change(question, cancelled, progress):
        machine.userdata.total = 100
        return goto('ALL', container='TOP')

    machine = machine_of(over(Adds('ok', 'stuck')))
    _, left = total_of(machine, change, policy='always_ask', userdata='keep')
    assert left == (102, [1, 2, 2, 3])


def test_an_iterator_whose_state_was_exchanged_as_it_began_goes_on_too():
    def exchange(*args):
        with iterator:
            smach.Iterator.set_contained_state(
                'EACH', second, loop_outcomes=['ok'], final_outcome_map={'stuck': 'aborted'}
            )

    second = Adds('ok', 'stuck')
    iterator = over(Adds())
    iterator.register_start_cb(exchange)
    watched, left = total_of(machine_of(iterator))
    assert left[1] == [1, 2, 2, 3] and told(watched) == WITH_2


def test_an_iterator_whose_userdata_is_thrown_away_takes_what_is_given_from_above():
    def throw_away(question, cancelled, progress):
        iterator.userdata = smach.UserData()
        return goto('ALL', container='TOP')

    iterator = over(Scripted('ok', 'stuck', outcomes=('ok', 'stuck')))
    watched, left = total_of(machine_of(iterator), throw_away, policy='always_ask', userdata='keep')
    assert left == (0, []) and iterator.userdata.total == 0
    assert told(watched) == WITH_2
