"""What trees drawn at random tell does not change, and is the same for each engine.

A change of the inside leaves it alone. Where users are meant to see one,
`python3 test/unit/support/pinned_trees.py FOLDER --pin` writes all again
(test/data/pinned/README.md).
"""

import pinned_trees
import pytest
from pinned import held

pytestmark = pytest.mark.usefixtures('quiet_threads')

PINNED = dict(line.split(' ', 1) for line in held('trees'))


@pytest.mark.parametrize('first', range(0, pinned_trees.TREES, 20))
def test_trees_tell_the_same_as_ever(first):
    for number in range(first, min(first + 20, pinned_trees.TREES)):
        name = pinned_trees.name_of(number)
        assert pinned_trees.digests(pinned_trees.tell(number)) == PINNED[name], name


@pytest.mark.parametrize('first', range(0, pinned_trees.OPERATED, 20))
def test_trees_and_their_operators_tell_the_same_as_ever(first):
    for number in range(first, first + 20):
        name = pinned_trees.name_of(number, 'operated')
        assert pinned_trees.digests(pinned_trees.tell_operated(number)) == PINNED[name], name


@pytest.mark.parametrize('number', range(pinned_trees.KILLED))
def test_killed_trees_have_stored_and_tell_the_same_as_ever(number, tmp_path):
    name = pinned_trees.name_of(number, 'killed')
    assert pinned_trees.digests(pinned_trees.tell_killed(number, tmp_path)) == PINNED[name]


def test_each_digest_has_its_tree():
    assert len(PINNED) == pinned_trees.TREES + pinned_trees.OPERATED + pinned_trees.KILLED
