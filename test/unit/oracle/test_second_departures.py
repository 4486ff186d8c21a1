"""A branch fails and is sent elsewhere where another branch has left the containers around it."""

import os

import pytest
from guarded_machines import both, chain
from machines import FakeExpert, Gate, Scripted, Watched, goto

from smach_oracle.oracle.records.events import EventKind

UPSTREAM = bool(os.environ.get('SMACH_UPSTREAM'))


class Obeys:
    """A state that obeys the preempt of the first departure. Its author goes on, though."""

    def __init__(self):
        self.gate = Gate()

    def __call__(self, state, ud):
        assert self.gate(state, ud) == 'preempted'
        return 'ok'


def leave(right, *obeying):
    """L goes to C once all that obey have begun. Whatever fails in RIGHT is sent to A, too late."""

    def fails(state, ud):
        assert all(each.gate.entered.wait(20) for each in obeying)
        return 'aborted'

    class Expert(FakeExpert):
        def ask(self, question, cancelled, progress):
            return goto('C' if question.failed_state == 'L' else 'A', container='TOP')

    machine = chain(
        A=Scripted(), BOTH=both(LEFT=chain(L=Scripted(fails)), RIGHT=right), C=Scripted()
    )
    watched = Watched(machine, name='TOP', expert=Expert(), settings={'max_recoveries': 0})
    assert watched.run() == 'done'
    assert [event.target for event in watched.of(EventKind.JUMP)] == ['C']
    return watched


def preempts(watched):
    return sorted((event.path, event.state) for event in watched.of(EventKind.PREEMPT))


@pytest.mark.skipif(UPSTREAM, reason='its Concurrence hands on one preempt in an execution')
def test_what_has_gone_on_in_the_branch_is_preempted_again():
    """RIGHT was preempted already, and what runs in it has obeyed."""
    one, other, beside = Obeys(), Obeys(), Gate()

    def fails(state, ud):
        assert beside.entered.wait(20)
        return 'aborted'

    watched = leave(
        both(
            ONE=chain(OBEYS=Scripted(one), R=Scripted(fails)),
            OTHER=chain(OBEYS=Scripted(other), S=Scripted(beside)),
        ),
        one,
        other,
    )
    ends = {event.path: event.outcome for event in watched.of(EventKind.CONTAINER_END)}
    assert ends['TOP/BOTH/RIGHT/OTHER'] == 'preempted'
    assert ('TOP/BOTH/RIGHT/OTHER', 'S') in preempts(watched)


def test_a_machine_that_fails_itself_gets_no_further_preempt():
    one = Obeys()
    watched = leave(chain(OBEYS=Scripted(one), R=Scripted('aborted')), one)
    assert preempts(watched) == [('TOP/BOTH/RIGHT', 'OBEYS')]


def test_a_machine_around_what_fails_is_preempted():
    """It has gone on behind a preempt, and would go on behind this end as well."""
    one = Obeys()
    watched = leave(
        chain(OBEYS=Scripted(one), IN=chain(R=Scripted('aborted')), LAST=Scripted()), one
    )
    assert 'LAST' not in watched.visits()
    ends = {event.path: event.outcome for event in watched.of(EventKind.CONTAINER_END)}
    assert ends['TOP/BOTH/RIGHT'] == 'preempted'
