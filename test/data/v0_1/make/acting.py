"""States that end as the plan of the trial has it, for the scripts beside this file."""

import threading
import time

import smach

PLAN = {}  # label: how its next visits end. Then they succeed.
_timers = []
_STUCK_S = 0.9  # longer than time limit and grace, so that the state is abandoned
_SLOW_S = 20.0


def begin(word, machine):
    """Make the plan of one trial, of a word such as PICK:aborted,raise+hand:full or PICK:slow@1.0.

    At the time (s) after @ the machine is asked to preempt. The word `nothing` lets all succeed.
    """
    events, _, preempt_s = word.partition('@')
    PLAN.clear()
    while _timers:
        _timers.pop().cancel()
    for part in events.split('+'):
        label, _, endings = part.partition(':')
        PLAN[label] = endings.split(',') if endings else []
    if preempt_s:
        _timers.append(threading.Timer(float(preempt_s), machine.request_preempt))
        _timers[0].start()


def take(label):
    """Return how the next visit of a state ends, or '' where the plan has no entry for it."""
    return PLAN[label].pop(0) if PLAN.get(label) else ''


class Act(smach.State):
    """Ends as planned. Where it succeeds it writes its output keys."""

    def __init__(self, label, more_outcomes=(), input_keys=(), outputs=None):
        super().__init__(
            ['succeeded', 'aborted', 'preempted', *more_outcomes],
            list(input_keys),
            sorted(outputs or {}),
        )
        self.label = label
        self.outputs = outputs or {}

    def execute(self, userdata):
        """Do as planned."""
        how = take(self.label)
        if how == 'raise':
            raise RuntimeError('the gripper does not answer')
        if how in ('slow', 'stuck'):
            print('WAITING', flush=True)  # record.py may stop the script now
        if how == 'stuck':  # deaf to preempts
            time.sleep(_STUCK_S)
        if how == 'slow' and self._wait_for_preempt():
            return 'preempted'
        if how in ('aborted', 'dropped', 'purple', 'none'):
            return None if how == 'none' else how
        for key, value in self.outputs.items():
            userdata[key] = value
        return 'succeeded'

    def _wait_for_preempt(self):
        until_s = time.monotonic() + _SLOW_S
        while time.monotonic() < until_s:
            if self.preempt_requested():
                self.service_preempt()
                return True
            time.sleep(0.02)
        return False
