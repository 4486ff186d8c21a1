"""Machines in which a later state reports the failure of an earlier one."""

from machines import Scripted, Watched

import smach

BAD = ('ok', 'failed')


def made(states, outcomes=('done', 'failed')):
    """A machine of (label, state, transitions)."""
    machine = smach.StateMachine(outcomes=list(outcomes))
    with machine:
        for label, state, transitions in states:
            smach.StateMachine.add(label, state, transitions)
    return machine


def reporting(work, report=None, between=(), **wrap):
    """WORK fails, its author leads to REPORT, and that ends in `failed`."""
    report = report or Scripted(outcomes=('said',))
    says = report.otherwise
    first = between[0][0] if between else 'REPORT'
    return Watched(
        made(
            [
                ('LOOK', Scripted(outcomes=('seen',)), {'seen': 'WORK'}),
                ('WORK', work, {'ok': 'done', 'failed': first}),
                *between,
                ('REPORT', report, {says: 'failed'}),
            ]
        ),
        **wrap,
    )
