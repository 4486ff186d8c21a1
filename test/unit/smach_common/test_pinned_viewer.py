"""What a viewer is shown of a wrapped tree in which states fail: each status, in order.

The file test/data/pinned/viewer.txt holds it, the same for each engine.
"""

import pytest
from pinned import held

import smach
from smach_oracle.oracle import OracleContainer, oracle_of

pytest.importorskip('rospy')
from smach_common.introspection.container_watch import ContainerTree
from smach_common.introspection.introspection_server import structure_fields

OUTCOMES = ['succeeded', 'aborted']


class Fails(smach.State):
    """Fails at its first visits."""

    def __init__(self, times=1):
        smach.State.__init__(self, outcomes=OUTCOMES)
        self._left = times

    def execute(self, ud):
        self._left -= 1
        return 'aborted' if self._left >= 0 else 'succeeded'


def chain(**states):
    machine = smach.StateMachine(outcomes=OUTCOMES)
    labels = list(states)
    with machine:
        for label, following in zip(labels, labels[1:] + ['succeeded']):
            smach.StateMachine.add(label, states[label], {'succeeded': following})
    return machine


def tree():
    both = smach.Concurrence(
        OUTCOMES,
        default_outcome='aborted',
        outcome_map={'succeeded': {'LEFT': 'succeeded', 'RIGHT': 'succeeded'}},
    )
    with both:
        smach.Concurrence.add('LEFT', Fails())
        smach.Concurrence.add('RIGHT', chain(R=Fails(0)))
    iterator = smach.Iterator(
        outcomes=OUTCOMES,
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='item',
        exhausted_outcome='succeeded',
    )
    with iterator:
        smach.Iterator.set_contained_state('EACH', Fails(), loop_outcomes=['succeeded'])
    return chain(LOOK=Fails(), ARM=chain(GRASP=Fails(), LIFT=Fails(0)), BOTH=both, ALL=iterator)


def shown(wrapped):
    """The statuses of an execution. Those below BOTH, which has threads, come in order of path."""
    statuses = []

    def note(watch, info, states, ud):
        # which of two threads has ended first is another time another one
        active = '' if watch.paths[0] == '/TOP/BOTH' else ' ' + '+'.join(states)
        statuses.append('{} {}{}'.format(watch.paths[0], info, active))

    containers = ContainerTree(note)  # it reports as long as it is held
    containers.add_root('/TOP', wrapped)
    assert wrapped.execute() == 'succeeded'
    inside = iter(
        sorted(
            (line for line in statuses if line.startswith('/TOP/BOTH')),
            key=lambda line: line.split()[0],
        )
    )
    return [next(inside) if line.startswith('/TOP/BOTH') else line for line in statuses]


def test_a_viewer_is_shown_the_same_as_ever():
    assert shown(OracleContainer.wrap(tree(), name='TOP')) == held('viewer')


def test_a_viewer_receives_the_same_structure_as_ever_at_rest_and_while_it_runs():
    """The fields of each container's SmachContainerStructure behind its path."""
    wrapped = OracleContainer.wrap(tree(), name='TOP')

    def lines(path, container):
        children, outcomes, starts, ends, results = map(list, structure_fields(container))
        yield '{}: {} | {}'.format(path, ', '.join(children), ', '.join(sorted(results)))
        yield from sorted('  {} --{}--> {}'.format(*edge) for edge in zip(starts, outcomes, ends))
        for label, child in container.get_children().items():
            if isinstance(child, smach.Container):
                yield from lines('{}/{}'.format(path, label), child)

    seen = {}
    oracle_of(wrapped).events.observers.append(
        lambda event: seen.setdefault(event.kind.name, list(lines('/TOP', wrapped)))
    )
    expected = held('structure_messages')
    assert list(lines('/TOP', wrapped)) == expected
    assert wrapped.execute() == 'succeeded'
    assert len(seen) > 6 and [kind for kind, told in seen.items() if told != expected] == []
