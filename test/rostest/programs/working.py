"""What the programs share: a state whose first visit ends as the command line says.

The ending is `well`, `fails`, `raises` or `preempted`; `always fails` and `always raises` mean
every visit. Nothing here knows of an oracle.
"""

import sys
import threading

import smach

OUTCOMES = ['succeeded', 'aborted', 'preempted']
LONGEST_WAIT_S = 30.0


def ending():
    """How this program is to end."""
    return sys.argv[1]


def say(*words):
    """One line, whole also where two threads speak.

    It begins a line of its own: the log of upstream's SMACH prints a text and its end of line
    apart, and another thread may speak in between, also where there is no oracle.
    """
    sys.stdout.write('\n' + ' '.join(str(word) for word in words) + '\n')
    sys.stdout.flush()


def telling(name, container):
    """Say each transition of a container, and its end."""
    container.register_transition_cb(lambda ud, active: say(name, 'is in', *active))
    container.register_termination_cb(lambda ud, last, outcome: say(name, 'ends in', outcome))
    return container


class Work(smach.State):
    """Counts in `count`; its visit number `at` ends as the program is told.

    `stop` asks the machine around it to stop: a program that is to be preempted does that itself.
    """

    def __init__(self, name='WORK', stop=None, at=1, how=None):
        smach.State.__init__(self, OUTCOMES, io_keys=['count'])
        self.name, self.stop, self.at, self.how = name, stop, at, how
        self.visits = 0

    def execute(self, ud):
        self.visits += 1
        ud.count = ud.count + 1
        say(self.name, ud.count)
        return self.end(self.how or ending())

    def end(self, how):
        is_due = self.visits == self.at or how.startswith('always') and self.visits > self.at
        if not is_due or how == 'well':
            return 'succeeded'
        if how == 'preempted':
            return self.wait_for_preempt()
        say(self.name, 'does not succeed')
        if how.endswith('raises'):
            raise ValueError('the gripper is not calibrated')
        return 'aborted'

    def wait_for_preempt(self):
        if self.stop is not None:
            self.stop()
        pause = threading.Event()
        for _ in range(int(LONGEST_WAIT_S * 100)):
            if self.preempt_requested():
                self.service_preempt()
                return 'preempted'
            pause.wait(0.01)
        return 'aborted'


class Step(Work):
    """A state that always succeeds."""

    def __init__(self, name):
        Work.__init__(self, name, how='well')


def line(*states, **keys):
    """A machine that goes from each (label, state) to the next one."""
    machine = smach.StateMachine(OUTCOMES, **keys)
    with machine:
        for (label, state), after in zip(states, states[1:] + (None,)):
            leads = {} if after is None else {'succeeded': after[0]}
            smach.StateMachine.add(label, state, leads)
    return machine
