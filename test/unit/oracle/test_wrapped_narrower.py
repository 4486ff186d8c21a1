"""Which machines keep their oracles where one is wrapped again, or the one around it unwrapped."""

import pytest
from branch_machines import Item, both, inside, iterator_over
from guarded_machines import chain
from held_machines import Gate, Held, eventually
from machines import Scripted, Watched

import smach
from smach_oracle.oracle import OracleContainer, oracle_of, unwrap

LISTS = [True, False, ['N'], ['N', 'N/M'], ['BOTH/LEFT', 'WORK'], ['WORK', 'WORK/EACH/EACH']]


def tree(n=None):
    """A machine N of another one M, a Concurrence, and an Iterator in a machine."""
    m = chain(A=Scripted(*['ok'] * 3))
    return chain(
        N=n or chain(M=m, B=Scripted(*['ok'] * 3)),
        BOTH=both(Scripted(*['ok'] * 3), Scripted(*['ok'] * 3)),
        WORK=inside(iterator_over(Item(), items=(1, 2)), 'EACH'),
    )


def told(machine):
    """The events of one trial of a machine, sorted: a Concurrence has no order."""
    events = []
    oracle_of(machine).events.observers.append(events.append)
    assert machine.execute() == 'done'
    oracle_of(machine).events.observers.remove(events.append)
    return sorted((event.kind.name, event.path, event.state, event.outcome) for event in events)


@pytest.mark.parametrize('nested', LISTS)
@pytest.mark.parametrize('before', LISTS)
@pytest.mark.parametrize('has_run', [False, True])
def test_wrapped_again_it_has_the_oracles_that_it_has_where_it_is_wrapped_once(
    before, nested, has_run
):
    once, again = tree(), tree()
    OracleContainer.wrap(again, nested=before)
    if has_run:
        assert again.execute() == 'done'
    OracleContainer.wrap(again, nested=nested)
    assert told(again) == told(OracleContainer.wrap(once, nested=nested))
    types = [[type(machine['N']), type(machine['BOTH'])] for machine in (once, again)]
    assert types[0] == types[1]
    unwrap(again)
    assert (type(again['N']), type(again['BOTH'])) == (smach.StateMachine, smach.Concurrence)


@pytest.mark.parametrize('outer', [True, False, ['N', 'N/M']])
@pytest.mark.parametrize('own', [True, False, ['M']])
def test_what_was_wrapped_on_its_own_is_as_before_once_the_machine_around_it_is_unwrapped(
    own, outer
):
    alone, n = (chain(M=chain(A=Scripted('ok', 'ok')), B=Scripted('ok', 'ok')) for _ in range(2))
    OracleContainer.wrap(n, nested=own, name='N')
    around = OracleContainer.wrap(tree(n), nested=outer)
    assert around.execute() == 'done'
    unwrap(around)
    assert told(n) == told(OracleContainer.wrap(alone, nested=own, name='N'))


def test_what_another_wrap_names_keeps_its_oracle_and_its_rates():
    n = chain(M=chain(A=Scripted('aborted', 'ok', 'ok')), B=Scripted('ok', 'ok'))
    OracleContainer.wrap(n, name='N')
    around = OracleContainer.wrap(tree(n))
    assert around.execute() == 'done'
    OracleContainer.wrap(n, nested=False)  # the machine around it names what is in it
    OracleContainer.wrap(around, nested=True)
    assert [row.failures for row in around.rates() if row.path.endswith('N/M')] == [1]
    OracleContainer.wrap(n, nested=True)
    OracleContainer.wrap(around, nested=False)  # and now it does so itself
    assert [row.failures for row in around.rates() if row.path.endswith('N/M')] == [1]


def test_a_machine_that_runs_keeps_its_oracles():
    gate = Gate()
    with Held(chain(N=chain(A=Scripted(gate), B=Scripted()))).begin() as machine:
        eventually(gate.entered.is_set)
        OracleContainer.wrap(machine.machine, nested=False)
        gate.opened.set()
        assert machine.end() == 'done'
        assert machine.visits() == ['N', 'A', 'B']


def test_one_that_is_refused_keeps_them_too():
    machine = Watched(chain(N=chain(A=Scripted('aborted', 'ok'))))
    assert machine.run() == 'done'
    with pytest.raises(Exception, match='GHOST'):
        OracleContainer.wrap(
            machine.machine, settings={'states': {'GHOST': {'memory': 3}}}, nested=False
        )
    assert machine.rate('A').failures == 1
