"""Programs killed at random instants go on as they should; more in benchmarks/killed.py."""

import pytest
from random_kills.drawing import TOP, Node, Tree, walk
from random_kills.judging import Judge
from random_kills.killing import kill_many

from smach_oracle.oracle.records.events import FailureKind

ITEMS = Node('machine', TOP, (Node('repeated', 'I', (Node('leaf', 'L'),), items=2),))


@pytest.mark.parametrize('seed', range(4))
def test_what_must_hold_holds_after_kills_at_random_instants(seed):
    courses = kill_many(seed, 10)
    assert sum(course.resumed for course in courses) > 0
    assert [(course.seed, course.wrong) for course in courses if course.wrong] == []


def journal(*lines):
    """The lines of processes 1, 2, ...: an event, or what the state L writes in an item."""
    written = []
    for run, (what, *more) in lines:
        line = {'run': run, 'thread': 1, 'path': 'TOP/I', 'state': '', 'target': '', 'failure': 0}
        if what in ('begins', 'ends'):
            line.update(what=what, path='TOP/I/L', items=more, seen={}, stamp='')
        else:
            line.update(
                what='event', kind=what, trial='t', seq=len(written), last_seq=99, **more[0]
            )
        written.append(line)
    return written


@pytest.mark.parametrize('told', [True, False])
def test_an_end_that_was_stored_is_told_from_one_in_doubt_though_the_kill_hid_its_event(told):
    """Each process is killed after the store is written, and before the journal is."""
    state = {'state': 'L'}
    judge = Judge(Tree('', ITEMS, dict(walk(TOP, ITEMS))))
    lines = [
        (1, ('TRIAL_START', {})),
        (1, ('STATE_START', state)),
        (1, ('begins', 0)),
        (1, ('ends', 0)),
        (2, ('RESUMED', {})),
        (2, ('CONTAINER_END', {})),
        (3, ('RESUMED', {})),  # the next item has begun
        (3, ('FAILURE', dict(state, failure=FailureKind.INTERRUPTED))),
    ]
    judge.read(journal(*(line for line in lines if told or line[1][0] != 'CONTAINER_END')))
    judge.end({'outcome': 'ok', 'threads': [], 'rates': [['TOP/I/L', int(told)]]})
    missing = [1] if told else [0, 1]
    assert judge.wrong == ['TOP/I/L ({},) never ended'.format(item) for item in missing]
