"""What trees tell does not change, and is the same for each engine, whatever is around them.

`python3 test/unit/support/pinned_circumstances.py FOLDER --pin` writes all again
(test/data/pinned/README.md).
"""

import pinned_circumstances
import pytest
from pinned import held
from pinned_trees import digests, name_of

pytestmark = pytest.mark.usefixtures('quiet_threads')

PINNED = dict(line.split(' ', 1) for line in held('circumstances'))


@pytest.mark.parametrize('number', range(pinned_circumstances.TREES))
def test_trees_tell_the_same_as_ever_under_drawn_circumstances(number, tmp_path):
    assert digests(pinned_circumstances.tell(number, tmp_path)) == PINNED[name_of(number)]


@pytest.mark.parametrize('number', range(pinned_circumstances.KILLED))
def test_trees_that_are_killed_then_go_on_as_ever(number, tmp_path):
    told = pinned_circumstances.tell_killed(number, tmp_path)
    assert digests(told) == PINNED[name_of(number, 'killed')]
