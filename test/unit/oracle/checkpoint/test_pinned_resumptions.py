"""What killed trees tell that go on otherwise does not change, and is the same for each engine.

Another script, names, a state or a moment to go on from, a second kill. The digests are written
again by `python3 test/unit/support/pinned_resumptions.py FOLDER --pin`.
"""

import pinned_resumptions
import pytest
from pinned import digests_of, held

PINNED = dict(line.split(': ', 1) for line in held('resumed'))


@pytest.mark.parametrize('number', range(pinned_resumptions.TREES), ids=pinned_resumptions.name_of)
def test_a_killed_tree_goes_on_otherwise_as_ever(number, tmp_path):
    name = pinned_resumptions.name_of(number)
    told = {name: pinned_resumptions.tell(number, tmp_path)}
    assert digests_of(told) == ['{}: {}'.format(name, PINNED[name])]


def test_each_digest_has_its_tree():
    assert len(PINNED) == pinned_resumptions.TREES
