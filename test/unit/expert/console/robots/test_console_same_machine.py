"""A machine that is published twice, by its oracle and its script, is listed once."""

import pytest

from smach_oracle.expert.console.robots.same_machine import Source, copies

NODE = frozenset(['/script'])
LEARNED = {'TASK': frozenset(['A', 'FETCH']), 'TASK/FETCH': frozenset(['PICK', 'PLACE'])}
ORACLE = Source('/script', NODE, True, LEARNED)


def own(states, nodes=NODE, learns=False):
    """The server of the script itself."""
    return Source(
        '/server', nodes, learns, {path: frozenset(labels) for path, labels in states.items()}
    )


@pytest.mark.parametrize(
    'states',
    [
        {'SM_ROOT': ['A', 'FETCH'], 'SM_ROOT/FETCH': ['PICK', 'PLACE']},
        {'': ['A', 'FETCH'], '/FETCH': ['PICK', 'PLACE']},
        {'INNER': ['PICK', 'PLACE']},
        {'SM_ROOT': ['A', 'FETCH']},
    ],
)
def test_what_shows_nothing_new_is_a_copy(states):
    assert copies([ORACLE, own(states)]) == {'/server'}


@pytest.mark.parametrize(
    'other',
    [
        own({'SM_ROOT': ['A', 'FETCH', 'MORE']}),
        own({'SM_ROOT': ['A', 'FETCH'], 'SM_ROOT/OTHER': ['PICK', 'PLACE']}),
        own({'SM_ROOT': ['A', 'FETCH']}, frozenset(['/another_robot'])),
        own({'SM_ROOT': ['A', 'FETCH']}, frozenset()),
        own({}),
        own({'SM_ROOT': ['A', 'FETCH']}, learns=True),
    ],
)
def test_another_machine_is_none(other):
    assert copies([ORACLE, other]) == set()


def test_without_an_oracle_nothing_is_left_out():
    assert copies([ORACLE._replace(learns=False), own({'SM_ROOT': ['A', 'FETCH']})]) == set()
