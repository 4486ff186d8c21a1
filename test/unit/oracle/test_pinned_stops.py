"""What trees tell that are held, sent and stopped does not change, and is the same for each engine.

`python3 test/unit/support/pinned_stops.py FOLDER --pin` writes all again
(test/data/pinned/README.md).
"""

import pinned_stops
import pytest
from pinned import held
from pinned_trees import digests, name_of

pytestmark = pytest.mark.usefixtures('quiet_threads')

PINNED = dict(line.split(' ', 1) for line in held('stops'))


@pytest.mark.parametrize('part', range(4))
def test_trees_that_are_stopped_tell_the_same_as_ever(part):
    for number in pinned_stops.STOPPED[part::4]:
        name = name_of(number, 'stopped')
        assert digests(pinned_stops.tell(number)) == PINNED[name], name


@pytest.mark.parametrize('part', range(4))
def test_trees_that_nobody_observes_do_the_same_as_ever(part):
    for number in pinned_stops.UNOBSERVED[part::4]:
        name = name_of(number, 'unobserved')
        assert digests(pinned_stops.tell_unobserved(number)) == PINNED[name], name
