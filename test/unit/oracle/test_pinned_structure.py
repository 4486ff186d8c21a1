"""What the containers of a wrapped tree are to whoever looks: states, edges, what is active.

Files in test/data/pinned hold it, the same for each engine.
"""

import pytest
from branch_machines import Item, iterator_over
from machines import Scripted, Watched
from pinned import held
from pinned_scenes import both, chain

import smach


def tree():
    """A machine in a machine, a Concurrence of a state and a machine, and an Iterator."""
    return chain(
        LOOK=Scripted(),
        ARM=chain(HAND=chain(CLOSE=Scripted('aborted'))),
        BOTH=both(Scripted('aborted'), chain(R=Scripted())),
        ALL=iterator_over(Item(item2=['aborted']), items=(1, 2)),
    )


def containers(path, state):
    """Each container, with its path."""
    if isinstance(state, smach.Container):
        yield path, state
        for label, child in state.get_children().items():
            yield from containers('{}/{}'.format(path, label), child)


def structure_of(machine):
    """The lines of a tree of containers."""
    lines = []
    for path, container in containers('TOP', machine):
        lines += [
            '{}: {}'.format(path, type(container).__name__),
            '  states ' + ', '.join(container.get_children()),
            '  begins with ' + ', '.join(map(str, container.get_initial_states())),
            '  ends with ' + ', '.join(sorted(container.get_registered_outcomes())),
        ]
        lines += sorted(
            '  {} --{}--> {}'.format(source, outcome, target)
            for outcome, source, target in container.get_internal_edges()
        )
    return lines


def test_the_structure_is_the_same_as_ever_at_rest_and_while_it_runs():
    machine = Watched(tree(), name='TOP')
    machine.machine.userdata.done = []
    seen = {}
    machine.machine.events.observers.append(
        lambda event: seen.setdefault(event.kind.name, structure_of(machine.machine))
    )
    expected = held('structure')
    assert structure_of(machine.machine) == expected
    assert machine.run() == 'done'
    assert {'STATE_START', 'FAILURE', 'DECISION', 'JUMP', 'TRIAL_END'} <= set(seen)
    assert [kind for kind, lines in seen.items() if lines != expected] == []


def test_the_active_states_are_the_same_as_ever_at_each_event():
    machine = Watched(tree(), name='TOP')
    machine.machine.userdata.done = []
    lines = []

    def look(event):
        active = [
            '{}={}'.format(path, '+'.join(map(str, container.get_active_states())))
            for path, container in containers('TOP', machine.machine)
            if container.get_active_states() not in ([], ['None'])
        ]
        place = '/'.join(filter(None, (event.path, event.state)))
        lines.append('{:15} {}: {}'.format(event.kind.name, place, ', '.join(active) or 'nothing'))

    machine.machine.events.observers.append(look)
    assert machine.run() == 'done'
    # in BOTH there are two threads: what is active there is another time something else
    assert [line for line in lines if 'BOTH' not in line] == held('active_states')


# from the least exact one to the most exact one
NAMES = ('**', '*/BOTH/**', 'KITCHEN/**', 'KITCHEN/**/EACH', 'EACH', 'KITCHEN/BOTH/RIGHT/ALL/EACH')


@pytest.mark.parametrize('last', range(len(NAMES)), ids=NAMES.__getitem__)
def test_a_name_or_a_pattern_reaches_a_branch_by_its_whole_path(last):
    settings = {
        'states': {
            name: {'prior': (number + 1) / 10} for number, name in enumerate(NAMES[: last + 1])
        }
    }
    iterator = iterator_over(Item(), items=(1, 2))
    machine = Watched(
        chain(KITCHEN=chain(BOTH=both(Scripted(), chain(ALL=iterator)))),
        name='TOP',
        settings=settings,
    )
    rates = {'{}/{}'.format(row.path, row.state): row.rate for row in machine.machine.rates()}
    assert rates['TOP/KITCHEN/BOTH/RIGHT/ALL/EACH'] == pytest.approx((last + 1) / 10)
