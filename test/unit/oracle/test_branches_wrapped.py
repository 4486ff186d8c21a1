"""Concurrences and Iterators of a wrapped tree stay what their user holds."""

import copy
import os
import pickle
import signal
import threading

import pytest
from branch_machines import Item, both, inside, iterator_over
from guarded_machines import chain
from machines import FakeExpert, Scripted, Watched, goto
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer, unwrap
from smach_oracle.oracle.records.events import EventKind

ASKS = {'max_recoveries': 0}


class Held(smach.State):
    """A state with an attribute of its own, which can be pickled."""

    def __init__(self):
        smach.State.__init__(self, ['ok', 'aborted', 'preempted'])
        self.answer = 42
        self.runs = 0

    def execute(self, ud):
        self.runs += 1
        return 'aborted' if self.runs == 1 else 'ok'


class MyConcurrence(smach.Concurrence):
    """A class of a user's."""

    def hello(self):
        return sorted(self._states)


def test_the_handles_stay_the_users_objects_at_rest_and_while_it_runs():
    seen = []
    held = Held()

    def looks(state, ud):
        seen.append(
            (
                concurrence['LEFT'],
                concurrence.get_children()['LEFT'],
                concurrence.get_active_states(),
                concurrence.get_initial_states(),
            )
        )
        seen.append(isinstance(concurrence._states['LEFT'], Held))
        seen.append(concurrence._states['LEFT'].answer)
        return 'ok'

    concurrence = both(held, Scripted(looks))
    machine = Watched(inside(concurrence))
    assert isinstance(concurrence, smach.Concurrence)
    assert type(concurrence).__name__ == 'Concurrence'
    assert concurrence['LEFT'] is held and concurrence.get_children() is concurrence._states
    assert machine.run() == 'done'
    (item, child, active, initial), is_held, answer = seen
    assert item is held and child is held and is_held and answer == 42
    assert 'RIGHT' in active and set(initial) == {'LEFT', 'RIGHT'}
    assert concurrence._states['LEFT'] is held and type(held) is Held


def test_the_handles_of_an_iterator_stay_too():
    seen = []

    def looks(state, ud):
        seen.append(
            (
                iterator['EACH'],
                iterator.get_children(),
                iterator.get_active_states(),
                list(iterator._items),
                len(iterator._items),
            )
        )
        return 'ok'

    each = Item(item1=[looks])
    items = [1, 2]
    iterator = iterator_over(each, items=items)
    machine = Watched(inside(iterator))
    assert machine.run() == 'done'
    assert seen == [(each, {'EACH': each}, ['EACH'], [1, 2], 2)]
    assert iterator._items is items and iterator._state is each


class Undeclared(smach.State):
    """Uses keys that it has not registered, as an Iterator lets it."""

    def __init__(self):
        smach.State.__init__(self, ['ok'])

    def execute(self, ud):
        ud.done = ud.done + [ud.item]
        return 'ok'


def test_the_state_of_an_iterator_has_the_userdata_itself():
    machine = Watched(inside(iterator_over(Undeclared(), items=[1, 2])))
    assert machine.run() == 'done' and machine.machine.userdata.done == [1, 2]


def test_a_class_of_the_users_keeps_its_methods():
    concurrence = MyConcurrence(outcomes=['done', 'aborted'], default_outcome='done')
    left = Scripted('aborted')
    with concurrence:
        smach.Concurrence.add('LEFT', left)
    machine = Watched(inside(concurrence))
    assert concurrence.hello() == ['LEFT'] and isinstance(concurrence, MyConcurrence)
    assert machine.run() == 'done' and left.runs == 2


@pytest.mark.parametrize(
    'make',
    [lambda left: both(left, Scripted()), lambda left: iterator_over(left, items=[1, 2])],
    ids=['concurrence', 'iterator'],
)
def test_unwrapped_it_is_as_before(make):
    left = Scripted('aborted', 'aborted')
    container = make(left)
    before = type(container)
    attributes = set(vars(container))
    machine = inside(container)
    OracleContainer.wrap(machine)
    assert set(vars(container)) != attributes
    unwrap(machine)
    assert type(container) is before and set(vars(container)) == attributes
    assert machine.execute() == 'aborted' and left.runs == 1


def test_a_wrap_that_is_refused_leaves_it_as_before():
    concurrence = both(Scripted(), Scripted())
    machine = inside(concurrence)
    with pytest.raises(Exception, match='LEFTT'):
        OracleContainer.wrap(machine, settings={'states': {'LEFTT': {'prior': 0.5}}})
    assert type(concurrence) is smach.Concurrence and '_oracle_wrapper' not in vars(concurrence)


def test_wrapping_again_gives_new_settings_and_keeps_what_was_learned():
    left = Scripted('aborted', 'ok', 'aborted')
    machine = Watched(inside(both(left, Scripted())), name='TOP')
    assert machine.run() == 'done' and left.runs == 2
    OracleContainer.wrap(machine.machine, settings=ASKS, expert=FakeExpert(goto('LEFT')))
    assert machine.run() == 'done' and left.runs == 4
    assert [event.state for event in machine.of(EventKind.QUERY_ANSWERED)] == ['LEFT']
    assert machine.rate('LEFT').failures == 2


def test_states_added_replaced_and_removed_later_are_noticed_at_the_next_run():
    first = Scripted('aborted')
    concurrence = both(first, Scripted())
    machine = Watched(inside(concurrence), name='TOP')
    new = Scripted('aborted')
    with concurrence:
        smach.Concurrence.add('NEW', new)
    replaced = Scripted('aborted')
    concurrence._states['LEFT'] = replaced
    assert machine.run() == 'done'
    assert (first.runs, new.runs, replaced.runs) == (0, 2, 2)
    del concurrence._states['NEW']
    assert machine.run() == 'done' and new.runs == 2
    assert 'NEW' not in {row.state for row in machine.machine.rates()}


def test_outcomes_registered_later_are_known():
    late = Scripted('aborted', 'extra')
    machine = Watched(inside(both(late, Scripted(), default_outcome='done', outcome_map={})))
    late.register_outcomes(['extra'])
    assert machine.run() == 'done'
    assert [event.outcome for event in machine.of(EventKind.FAILURE)] == ['aborted']


def test_only_what_runs_in_the_tree_has_oracles():
    left = Scripted('aborted', 'aborted')
    concurrence = both(left, Scripted())
    machine = Watched(inside(concurrence))
    assert concurrence.execute() == 'aborted' and left.runs == 1
    assert not machine.events
    machine = Watched(inside(both(left, Scripted())), nested=False, settings={'max_recoveries': 0})
    assert machine.run() == 'aborted' and left.runs == 2


def _can_be_pickled(container):
    try:
        pickle.dumps(container)
    except TypeError:
        return False
    return True


@pytest.mark.parametrize(
    'copied',
    [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))],
    ids=['deep copy', 'pickle'],
)
@pytest.mark.parametrize(
    'make',
    [lambda: both(Held(), Held()), lambda: iterator_over(Held(), items=[1, 2])],
    ids=['concurrence', 'iterator'],
)
def test_a_copy_recovers_inside_its_own_branches(copied, make):
    if not _can_be_pickled(inside(make())):
        pytest.skip('this engine cannot copy a machine')
    machine = OracleContainer.wrap(inside(make()), name='TOP')
    other = copied(machine)
    events = []
    other.events.observers.append(events.append)
    assert other.execute() == 'done'
    assert [event.path for event in events if event.kind is EventKind.FAILURE][0] == 'TOP/ALL'
    mine, its = (each.get_children()['ALL'] for each in (machine, other))
    assert mine is not its and isinstance(its, type(make()))
    assert next(iter(mine.get_children().values())).runs == 0


def test_copied_while_it_runs_it_is_as_at_rest():
    taken = []

    class Takes(smach.State):
        def __init__(self):
            smach.State.__init__(self, ['ok'])

        def execute(self, ud):
            taken.append(copy.copy(iterator))
            return 'ok'

    iterator = iterator_over(Takes(), items=[1, 2])
    assert Watched(inside(iterator)).run() == 'done'
    assert isinstance(taken[0]._state, Takes) and taken[0]._items == [1, 2]
    assert type(taken[0]._items) is list


def test_a_concurrence_that_is_copied_while_it_runs_is_as_at_rest():
    taken = []

    def take(state, ud):
        taken.append(copy.copy(concurrence))
        return 'ok'

    left, right = Scripted(take), Scripted()
    concurrence = both(left, right)
    assert Watched(inside(concurrence)).run() == 'done'
    assert taken[0]._states['LEFT'] is left and taken[0]._states['RIGHT'] is right
    assert type(taken[0]._states['RIGHT']) is Scripted


class OwnConcurrence(smach.Concurrence):
    """A user's class that executes by itself."""

    def execute(self, *args):
        return smach.Concurrence.execute(self, *args)


class OwnIterator(smach.Iterator):
    """The same."""

    def execute(self, *args):
        return smach.Iterator.execute(self, *args)


def of_class(kind, container):
    container.__class__ = kind
    return container


OWN = pytest.mark.parametrize(
    'make',
    [
        lambda state: of_class(OwnConcurrence, both(state, Held())),
        lambda state: of_class(OwnIterator, iterator_over(state, items=[1, 2])),
    ],
    ids=['concurrence', 'iterator'],
)


@OWN
@pytest.mark.parametrize(
    'copied',
    [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))],
    ids=['deep copy', 'pickle'],
)
def test_a_copy_of_a_class_of_the_users_recovers_inside_its_own_branches(make, copied):
    if not _can_be_pickled(inside(make(Held()))):
        pytest.skip('this engine cannot copy a machine')
    machine = OracleContainer.wrap(inside(make(Held())))
    other = copied(machine)
    mine, its = (each.get_children()['ALL'] for each in (machine, other))
    assert other.execute() == 'done' and mine is not its
    assert isinstance(its, (OwnConcurrence, OwnIterator))
    assert all(each.runs > 1 for each in its.get_children().values())
    assert not any(each.runs for each in mine.get_children().values())


@OWN
def test_a_container_of_a_users_class_shows_its_own_states_while_it_runs(make):
    def take(state, ud):
        taken.append(copy.copy(container))
        seen.update(container.get_children())
        found.append(container[label])
        return 'ok'

    taken, seen, found, each = [], {}, [], Scripted(take)
    container = make(each)
    label, *_ = before = container.get_children()
    assert Watched(inside(container)).run() == 'done'
    assert (seen, found) == (before, [each])
    (copied,) = taken
    assert set(map(type, copied.get_children().values())) <= {Scripted, Held}
    assert vars(copied).get('_items', [1, 2]) == [1, 2]
    assert type(vars(copied).get('_items', [])) is list
    if isinstance(container, OwnIterator):
        assert copied._state is each


def test_rates_of_the_branches_of_one_concurrence_are_kept_in_one_file(tmp_path):
    file = str(tmp_path / 'rates.json')
    machine = Watched(
        inside(both(Scripted('aborted'), Scripted('aborted', 'aborted'))),
        settings={'rates_file': file},
        name='TOP',
    )
    assert machine.run() == 'done'
    other = Watched(inside(both(Scripted(), Scripted())), settings={'rates_file': file}, name='TOP')
    assert other.run() == 'done'
    assert (other.rate('LEFT').failures, other.rate('RIGHT').failures) == (1, 2)


def test_an_attribute_of_a_state_is_not_hidden_while_it_runs():
    """A class of a user's reads its states where they are kept."""

    class Reads(smach.Concurrence):
        def execute(self, parent_ud=None):
            for each in self._states.values():
                found.append((each.state, each.branch, copy.copy(each).state))
            return super().execute(parent_ud)

    found = []
    concurrence = both(Scripted(), Scripted())
    concurrence.__class__ = Reads
    for state in concurrence.get_children().values():
        state.state, state.branch = 'open', 'left'
    assert Watched(inside(concurrence)).run() == 'done'
    assert found == [('open', 'left', 'open')] * 2


def test_what_is_no_outcome_is_not_told_as_one():
    class Counts(smach.Concurrence):
        def execute(self, parent_ud=None):
            super().execute(parent_ud)
            return 5

    concurrence = both(Scripted(), Scripted())
    concurrence.__class__ = Counts
    machine = Watched(inside(concurrence), recover=False)
    with pytest.raises(smach.InvalidTransitionError):
        machine.run()
    ends = [each for each in machine.of(EventKind.CONTAINER_END) if each.path.endswith('ALL')]
    assert [(each.outcome, each.text) for each in ends] == [('', '')]


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')),
    reason="upstream's Concurrence waits for a branch without end",
)
def test_a_branch_that_a_thread_was_left_in_has_its_oracle_again():
    """Ctrl-C leaves a state behind that has heeded its preempt and works on."""

    def works_on(state, ud):
        assert wait_for(state.preempt_requested)
        state.service_preempt()
        waits_for.wait(20.0)
        return 'ok'

    def presses_ctrl_c(state, ud):
        os.kill(os.getpid(), signal.SIGINT)
        assert wait_for(state.preempt_requested)
        return 'preempted'

    waits_for = threading.Event()
    left = Scripted(works_on, 'aborted')
    right = Scripted(presses_ctrl_c)
    machine = Watched(inside(both(left, right)))
    try:
        with pytest.raises(KeyboardInterrupt):
            machine.run()
        assert machine.run() == 'done'
    finally:
        waits_for.set()
    assert (left.runs, right.runs) == (3, 2), 'its failure was not recovered in the branch'


def test_a_branch_that_cannot_be_preempted_is_named(log):
    class Refuses(Scripted):
        def request_preempt(self):
            raise ValueError('mine')

    begun = threading.Event()

    def left(state, userdata):
        begun.set()
        return wait_for(lambda: 'raised' in str(log)) and 'ok'

    # a state that has not begun raises in the container, as bare
    other = Scripted(lambda state, userdata: begun.wait(10.0) and 'aborted')
    machine = Watched(
        inside(both(Refuses(left), other, child_termination_cb=lambda outcomes: True)),
        settings=ASKS,
    )
    machine.run()
    (said,) = [text for level, text in log if level == 'err' and 'mine' in text]
    assert said.startswith("Preempting state 'LEFT' raised:") and 'Traceback' in said


def test_a_shallow_copy_has_branches_of_its_own():
    concurrence = both(Scripted('ok', 'aborted'), Scripted())
    assert Watched(inside(concurrence), name='TOP').run() == 'done'
    other = Watched(inside(copy.copy(concurrence)), name='OTHER')
    assert other.run() == 'done'
    assert [(each.path, each.state) for each in other.of(EventKind.FAILURE)] == [
        ('OTHER/ALL', 'LEFT')
    ]


def test_only_the_branches_that_are_named_have_an_oracle_of_their_own():
    machine = inside(both(Scripted(), Scripted()), 'BOTH')
    wrapped = OracleContainer.wrap(machine, nested=['BOTH/LEFT'])
    assert [wrapped.execute(), wrapped.execute()] == ['done', 'done']
    assert {row.state: row.successes for row in wrapped.rates()} == {'BOTH': 2, 'LEFT': 2}


def test_an_iterator_without_an_oracle_begins_again():
    each = Item(item2=['aborted'])
    machine = Watched(inside(iterator_over(each)), nested=False)
    assert machine.run() == 'done'
    assert each.tried == [1, 2, 1, 2, 3, 4]


def test_a_copy_that_a_state_executes_tells_nothing_of_branches():
    concurrence, ended = both(Scripted(), Scripted()), []

    def by_hand(state, ud):
        ended.append(copy.copy(concurrence).execute(smach.UserData()))
        return 'ok'

    machine = Watched(chain(HAND=Scripted(by_hand), BOTH=concurrence), name='TOP')
    assert (machine.run(), ended) == ('done', ['done'])
    starts = [event.path for event in machine.of(EventKind.CONTAINER_START)]
    assert starts == ['TOP', 'TOP/BOTH']


def test_an_item_that_raises_has_failed_though_no_outcome_leads_to_the_next():
    each = Item(item1=[ValueError('slipped')])
    iterator = iterator_over(
        each, outcomes=('ok', 'aborted', 'preempted', 'done'), loop_outcomes=[]
    )
    machine = Watched(inside(iterator, transitions={'ok': 'done'}))
    assert (machine.run(), each.tried) == ('done', [1, 1])
    assert [event.state for event in machine.of(EventKind.FAILURE)] == ['EACH']


def test_an_iterator_that_is_executed_by_hand_goes_through_all_its_items():
    each = Item(item2=['aborted'])
    iterator = iterator_over(each)
    machine = OracleContainer.wrap(inside(iterator), recover=False)
    assert machine.execute() == 'aborted'
    userdata = smach.UserData()
    userdata.done = []
    assert iterator.execute(userdata) == 'done'
    assert each.tried == [1, 2, 1, 2, 3, 4]
