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
