"""The machine of `imported_machine.py`: a module that scripts import, and no script."""

from working import OUTCOMES, Step, Work, telling

import smach

fetch = smach.StateMachine(OUTCOMES)
fetch.userdata.count = 0
with fetch:
    smach.StateMachine.add('FIRST', Step('FIRST'), {'succeeded': 'WORK'})
    smach.StateMachine.add('WORK', Work(stop=fetch.request_preempt), {'succeeded': 'LAST'})
    smach.StateMachine.add('LAST', Step('LAST'))
telling('FETCH', fetch)


def run():
    """Execute it, from within the module."""
    return fetch.execute()
