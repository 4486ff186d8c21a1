"""States and small machines that the tests of the engine are made of."""

import re
import threading
import time

import smach


def naming(*names):
    """A pattern for messages with all these names in quotes, in whatever words and order."""
    return '(?s)^' + ''.join(r"""(?=.*['"]%s['"])""" % re.escape(str(name)) for name in names)


def that_name(names, texts):
    """Those of the texts in which all the names are."""
    return [text for text in texts if re.search(naming(*names), text)]


class Scripted(smach.State):
    """Runs ``work(state, userdata)`` for its outcome, or returns ``work`` itself if that is a
    string.
    """

    def __init__(self, work, outcomes=('done', 'failed', 'preempted'), **keys):
        smach.State.__init__(self, outcomes=list(outcomes), **keys)
        self.work = work

    def execute(self, ud):
        return self.work(self, ud) if callable(self.work) else self.work


class Fixed(smach.State):
    """Always ends the same way; can be pickled."""

    def __init__(self, outcome='done'):
        smach.State.__init__(self, outcomes=[outcome])
        self.outcome = outcome

    def execute(self, ud):
        return self.outcome


class Counting(smach.State):
    """Adds one to the key ``count`` until it has reached ``limit``."""

    def __init__(self, limit=3):
        smach.State.__init__(self, outcomes=['again', 'done'], io_keys=['count'])
        self.limit = limit

    def execute(self, ud):
        ud.count = ud.count + 1
        return 'done' if ud.count >= self.limit else 'again'


class UntilPreempted(smach.State):
    """Ends 'preempted' once asked to, or 'done' after ``time_s``."""

    def __init__(self, time_s=30.0):
        smach.State.__init__(self, outcomes=['done', 'preempted'])
        self.time_s = time_s
        self.started = threading.Event()

    def execute(self, ud):
        deadline = time.monotonic() + self.time_s
        self.started.set()
        while time.monotonic() < deadline:
            if self.preempt_requested():
                self.service_preempt()
                return 'preempted'
            time.sleep(0.002)
        return 'done'


def machine(*states, **options):
    """A StateMachine of (label, state, transitions) triples."""
    outcomes = options.pop('outcomes', ['done', 'failed', 'preempted'])
    made = smach.StateMachine(outcomes, **options)
    with made:
        for label, state, transitions in states:
            smach.StateMachine.add(label, state, transitions)
    return made


def concurrence(children, default='done', outcomes=('done', 'failed', 'preempted'), **options):
    """A Concurrence of states by label."""
    made = smach.Concurrence(outcomes=list(outcomes), default_outcome=default, **options)
    with made:
        for label, state in children.items():
            smach.Concurrence.add(label, state)
    return made
