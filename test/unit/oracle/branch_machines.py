"""Machines whose Iterators and Concurrences hold plain states, for tests of branches."""

from machines import OUTCOMES

import smach


class Item(smach.State):
    """Notes each item that it does; ends as told for an item, one entry a try, then with 'ok'."""

    def __init__(self, outcomes=OUTCOMES, **scripts):
        """`scripts`: by 'item3' for the item 3."""
        smach.State.__init__(self, outcomes=list(outcomes), io_keys=['item', 'done'])
        self.scripts = {key: list(script) for key, script in scripts.items()}
        self.tried = []

    def execute(self, ud):
        self.tried.append(ud.item)
        script = self.scripts.get('item{}'.format(ud.item))
        step = script.pop(0) if script else 'ok'
        if isinstance(step, Exception):
            raise step
        if callable(step):
            step = step(self, ud)
        if step == 'ok':
            ud.done = ud.done + [ud.item]
        return step


def iterator_over(
    state, items=(1, 2, 3, 4), outcomes=('done', 'aborted', 'preempted'), **contained
):
    """An Iterator whose state is EACH; 'ok' leads to the next item."""
    contained = contained or {'loop_outcomes': ['ok']}
    iterator = smach.Iterator(
        outcomes=list(outcomes),
        input_keys=['done'],
        output_keys=['done'],
        it=items,
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state('EACH', state, **contained)
    return iterator


def inside(container, label='ALL', transitions=None, outcomes=('done', 'aborted', 'preempted')):
    """A machine of one state; its key `done` is an empty list."""
    machine = smach.StateMachine(outcomes=list(outcomes))
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add(label, container, transitions or {'done': 'done'})
    return machine


def both(left, right, **options):
    """A Concurrence of the states LEFT and RIGHT, 'done' where both end with 'ok'."""
    given = {
        'outcomes': ['done', 'aborted', 'preempted'],
        'default_outcome': 'aborted',
        'outcome_map': {'done': {'LEFT': 'ok', 'RIGHT': 'ok'}},
        **options,
    }
    concurrence = smach.Concurrence(**given)
    with concurrence:
        smach.Concurrence.add('LEFT', left)
        smach.Concurrence.add('RIGHT', right)
    return concurrence
