"""Which containers are seen, under which paths, and what is reported of them."""

import copy
import gc
import pickle
import weakref

import pytest

import smach

pytest.importorskip('rospy')
from smach_common.introspection.container_watch import (
    CALLBACK_LISTS,
    ContainerTree,
    is_watched,
)


class Step(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['next'])

    def execute(self, ud):
        return 'next'


def chain(*labels):
    machine = smach.StateMachine(outcomes=['next'])
    with machine:
        for label, follower in zip(labels, labels[1:] + ('next',)):
            smach.StateMachine.add(label, Step(), {'next': follower})
    return machine


def holding(label, state):
    machine = smach.StateMachine(outcomes=['next'])
    with machine:
        smach.StateMachine.add(label, state)
    return machine


@pytest.fixture
def seen():
    return []


@pytest.fixture
def tree(seen):
    return ContainerTree(
        lambda watch, info, states, ud: seen.append((watch.paths[0], info, states))
    )


def test_start_transitions_and_end_are_reported_in_order(tree, seen):
    machine = chain('A', 'B')
    tree.add_root('/R', machine)
    machine.execute()
    assert seen == [
        ('/R', 'START', ['A']),
        ('/R', 'TRANSITION', ['B']),
        ('/R', 'TERMINATION next', ['None']),
    ]


def test_nothing_is_reported_while_nobody_listens(seen):
    listeners = []
    tree = ContainerTree(lambda watch, info, states, ud: seen.append(info), lambda: bool(listeners))
    machine = chain('A')
    tree.add_root('/R', machine)
    machine.execute()
    assert seen == []
    listeners.append(1)
    machine.execute()
    assert seen == ['START', 'TERMINATION next']


def test_containers_of_every_kind_are_found_at_any_depth(tree):
    iterator = smach.Iterator(
        outcomes=['next'], input_keys=[], output_keys=[], it=[1], exhausted_outcome='next'
    )
    with iterator:
        smach.Iterator.set_contained_state('BODY', chain('X'), loop_outcomes=['next'])
    concurrence = smach.Concurrence(outcomes=['next'], default_outcome='next')
    with concurrence:
        smach.Concurrence.add('LEFT', iterator)
        smach.Concurrence.add('RIGHT', Step())
    tree.add_root('/R', holding('SIDE', concurrence))
    assert sorted(tree.by_path) == ['/R', '/R/SIDE', '/R/SIDE/LEFT', '/R/SIDE/LEFT/BODY']


def test_one_container_under_two_labels_has_two_paths_and_reports_once(tree, seen):
    inner, machine = chain('X'), smach.StateMachine(outcomes=['next'])
    with machine:
        smach.StateMachine.add('ONE', inner, {'next': 'TWO'})
        smach.StateMachine.add('TWO', inner)
    tree.add_root('/', machine)
    assert tree.by_path['/ONE'].paths == ['/ONE', '/TWO']
    inner.execute()
    assert len(seen) == 2


def test_what_is_added_later_is_found_and_what_is_cleared_falls_silent(tree, seen):
    machine = chain('A')
    tree.add_root('/R', machine)
    with machine:
        smach.StateMachine.add('LATE', chain('X'), {'next': 'next'})
    tree.refresh()
    assert '/R/LATE' in tree.by_path
    tree.clear()
    machine.execute()
    assert (tree.by_path, seen) == ({}, [])
    tree.add_root('/AGAIN', machine)
    machine.execute()
    assert [path for path, _, _ in seen] == ['/AGAIN', '/AGAIN']


def test_watched_machine_can_be_pickled_and_its_copy_reports_nothing(tree, seen):
    machine = chain('A')
    tree.add_root('/R', machine)
    assert pickle.loads(pickle.dumps(machine)).execute() == 'next'
    assert seen == []


def test_jump_is_taken_once_and_forgotten_at_the_end(tree, seen):
    machine = chain('A', 'B', 'C')
    tree.add_root('/R', machine)
    tree.by_path['/R'].jump_to = 'C'
    machine.execute()
    assert [states for _, _, states in seen] == [['A'], ['C'], ['None']]
    del seen[:]
    machine.execute()
    assert [states for _, _, states in seen] == [['A'], ['B'], ['C'], ['None']]


def callbacks_of(*containers):
    return [list(getattr(each, name)) for each in containers for name in CALLBACK_LISTS]


def test_what_is_cleared_has_its_own_callbacks_again_and_no_others(tree):
    inner = chain('X')
    machine = holding('IN', inner)
    heard = []
    machine.register_start_cb(lambda ud, states: heard.append(states))
    before = callbacks_of(machine, inner)
    other = ContainerTree(lambda *args: None)
    for _ in range(3):
        tree.add_root('/R', machine)
        other.add_root('/OTHER', machine)
        assert is_watched(machine)
        tree.clear()
        assert is_watched(machine), 'the other tree follows it still'
        other.clear()
    assert not is_watched(machine)
    assert callbacks_of(machine, inner) == before
    machine.execute()
    assert heard == [['IN']]


def test_a_callback_that_takes_another_tree_away_keeps_no_callback_from_its_turn(tree):
    machine, heard = chain('A'), []
    machine.register_start_cb(lambda ud, states: tree.clear())
    tree.add_root('/R', machine)
    machine.register_start_cb(lambda ud, states: heard.append(states))
    machine.execute()
    assert heard == [['A']]


def test_a_container_that_is_taken_out_is_let_go(tree):
    machine, inner = holding('IN', chain('X')), chain('Y')
    tree.add_root('/R', machine)
    gone = weakref.ref(machine['IN'])
    machine._states['IN'] = inner
    tree.refresh()
    gc.collect()
    assert gone() is None
    assert tree.by_path['/R/IN'].container is inner


def test_a_copy_of_a_watched_machine_is_not_watched(tree):
    machine = chain('A')
    tree.add_root('/R', machine)
    assert is_watched(machine)
    assert not is_watched(copy.deepcopy(machine))


class Broken(smach.StateMachine):
    """Cannot say what is in it."""

    def get_children(self):
        raise AttributeError('not yet built')


class Uninitialised(smach.Container):
    """Never called Container.__init__."""

    def __init__(self):
        smach.State.__init__(self, outcomes=['next'])

    def get_children(self):
        return {}


@pytest.mark.parametrize('kind', [lambda: Broken(outcomes=['next']), Uninitialised])
def test_a_broken_container_hides_no_other(kind, tree, seen):
    machine = chain('A', 'B')
    with machine:
        smach.StateMachine.add('BROKEN', kind(), {'next': 'next'})
        smach.StateMachine.add('FINE', chain('X'), {'next': 'next'})
    tree.add_root('/R', machine)
    assert sorted(tree.by_path) == ['/R', '/R/BROKEN', '/R/FINE']
    machine['FINE'].execute()
    assert [info for _, info, _ in seen] == ['START', 'TERMINATION next']
    tree.clear()
    assert not is_watched(machine)
