"""What `--check` leaves out of what may run again, beside what machines do that are drawn."""

import random

import pytest
from machines import Scripted, Watched
from test_ways import at_once

import smach
from smach_oracle.oracle.prospects import prospects_of
from smach_oracle.oracle.records.events import EventKind

ENDS = ['done', 'aborted', 'preempted']
FORWARD = ('ok', 'other', 'third')


def drawn(rng, depth):
    """A machine of one to five states, whose outcomes lead to later ones. Some are machines."""
    labels = ['S{}'.format(number) for number in range(rng.randint(1, 5))]
    machine = smach.StateMachine(ENDS)
    with machine:
        for number, label in enumerate(labels):
            later = labels[number + 1 :] + ['done']
            if depth and rng.random() < 0.3:
                ends = {'done': later[0]}
                smach.StateMachine.add(label, drawn(rng, depth - 1), ends)
                continue
            results = ['aborted' if rng.random() < 0.3 else rng.choice(FORWARD) for _ in range(20)]
            state = Scripted(*results, outcomes=[*FORWARD, 'aborted', 'preempted'])
            leads = {outcome: rng.choice(later) for outcome in FORWARD[1:]}
            smach.StateMachine.add(label, state, {'ok': later[0], **leads})
    return machine


def guards(rng, machine, path=''):
    """The settings of some of its states, at any depth."""
    found = {}
    for label, state in machine.get_children().items():
        if rng.random() < 0.15:
            found[path + label] = {'on_retry': 'confirm'}
        if isinstance(state, smach.StateMachine):
            found.update(guards(rng, state, path + label + '/'))
    return found


@pytest.mark.parametrize('seed', range(150))
def test_where_a_way_is_open_it_was_told_that_the_state_may_run_again(seed):
    rng = random.Random(seed)
    machine = drawn(rng, 2)
    states = guards(rng, machine)
    watched = at_once(Watched(machine, settings={'policy': 'escalating', 'states': states}))
    told = {
        (each.path, state.label): state for each in prospects_of(machine) for state in each.states
    }
    watched.run()
    for event in watched.of(EventKind.DECISION):
        prospect = told[event.path, event.state]
        for way in event.data.get('menu', ()):
            if way['back'] and not way['blocked']:
                assert way['target'] in prospect.before, (seed, event.state, way, states)
                assert way['kind'] in {kind.value for kind in prospect.kinds}
            elif way['back']:
                assert way['target'] in prospect.before + prospect.not_before
