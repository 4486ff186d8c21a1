"""Machines to be killed: a flat one, and one of everything."""

import shutil

from killed_machines import Noted, each_of

import smach

ENDS = {'succeeded': 'succeeded', 'aborted': 'aborted'}
ALL = ['A', 'X', 'Y', 'LEFT', 'M1', 'M2', 'I0', 'I1', 'I2', 'J1', 'K1', 'J2', 'K2', 'B']


def flat(diary, points):
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('A', Noted('A', diary, points), {'succeeded': 'B'})
        smach.StateMachine.add('B', Noted('B', diary, points, failures=1), {'succeeded': 'C'})
        smach.StateMachine.add('C', Noted('C', diary, points), ENDS)
    return machine


def tree(diary, points):
    """A machine in a machine, a Concurrence of a state and a machine, Iterators of both."""

    def noted(name, *keys):
        return Noted(name, diary, points, keys=('done', *keys))

    def two(first, second, *keys):
        inner = smach.StateMachine(['succeeded', 'aborted'], ['done', *keys], ['done'])
        with inner:
            smach.StateMachine.add(first, noted(first, *keys), {'succeeded': second})
            smach.StateMachine.add(second, noted(second, *keys), ENDS)
        return inner

    both = smach.Concurrence(
        ['succeeded', 'aborted'],
        'aborted',
        ['done'],
        ['done'],
        outcome_map={'succeeded': {'LEFT': 'succeeded', 'RIGHT': 'succeeded'}},
    )
    with both:
        smach.Concurrence.add('LEFT', noted('LEFT'))
        smach.Concurrence.add('RIGHT', two('M1', 'M2'))
    plain = each_of(range(3), 'I', noted('I', 'item'))
    nested = each_of([1, 2], 'JK', two('J', 'K', 'item'))
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('A', noted('A'), {'succeeded': 'XY'})
        smach.StateMachine.add('XY', two('X', 'Y'), {'succeeded': 'BOTH'})
        smach.StateMachine.add('BOTH', both, {'succeeded': 'PLAIN'})
        smach.StateMachine.add('PLAIN', plain, {'succeeded': 'NESTED'})
        smach.StateMachine.add('NESTED', nested, {'succeeded': 'B'})
        smach.StateMachine.add('B', noted('B'), ENDS)
    return machine


def make(folder):
    if folder.exists():
        shutil.rmtree(str(folder))
    folder.mkdir()
    return folder
