"""Machines in which POUR is not repeated by itself."""

from machines import FakeExpert, Scripted, Watched

import smach
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.facts import decided_by

HELD_BACK = 'POUR was done in this trial and is not repeated by itself'
OUTCOMES = ['done', 'aborted', 'preempted']
CONFIRM, NEVER = {'on_retry': 'confirm'}, {'on_retry': 'never'}
ASKED_ABOUT = {'max_recoveries': 0}
# it is tried again once; then its policy asks, and an oracle above may decide
UNSURE = {'prior': 0.5}


def chain(**states):
    """A machine of these states, in this order: 'ok' or 'done' leads to the next."""
    machine = smach.StateMachine(outcomes=OUTCOMES)
    labels = list(states)
    with machine:
        for label, following in zip(labels, labels[1:] + ['done']):
            good = 'ok' if 'ok' in states[label].get_registered_outcomes() else 'done'
            smach.StateMachine.add(label, states[label], {good: following})
    return machine


def both(**branches):
    """A Concurrence of these, which ends with 'done' where all of them do."""
    concurrence = smach.Concurrence(
        outcomes=OUTCOMES,
        default_outcome='aborted',
        outcome_map={'done': dict.fromkeys(branches, 'done')},
    )
    with concurrence:
        for label, branch in branches.items():
            smach.Concurrence.add(label, branch)
    return concurrence


def guarded(machine, *answers, on_retry='confirm', states=None, **settings):
    """The machine, watched, in which POUR is not repeated by itself; the expert.

    `states`: settings of single states in its place; `of_all`: on_retry of all others.
    """
    expert = FakeExpert(*answers)
    given = {'states': {'POUR': {'on_retry': on_retry}}}
    if states is not None:
        given = {'states': states, 'on_retry': settings.pop('of_all', 'allow')}
    return Watched(machine, expert=expert, settings=dict(given, memory=1000, **settings)), expert


def sentences(machine):
    return [event.text for event in machine.of(EventKind.DECISION)]


def deciders(machine):
    return [decided_by(event) for event in machine.of(EventKind.DECISION)]


def pouring(*place, pour=()):
    """DETECT, POUR, PLACE; PLACE and POUR end as told."""
    return chain(DETECT=Scripted(), POUR=Scripted(*pour), PLACE=Scripted(*place))
