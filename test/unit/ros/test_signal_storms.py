"""A handler of ours may meet the main thread anywhere, also within what the handler does itself.

Real processes, and as many signals as the machine sends.
"""

import os
import signal
import subprocess
import sys
import textwrap
import time

import pytest

PRELUDE = """
import signal, sys, threading, time
def for_a_while(work):
    print('READY', flush=True)
    until = time.monotonic() + 3.0
    while time.monotonic() < until:
        work()
    print('DONE', heard, flush=True)
heard = 0
def hear(*_):
    global heard
    heard += 1
"""
GUARD = """
from smach_oracle.ros.shutdown import ShutdownGuard
hear.__module__ = 'rospy.core'  # which ends nothing by itself
guard = ShutdownGuard(lambda: None, lambda limit_s: None, end=lambda code: None)
guard.install()
signal.signal(signal.SIGINT, hear)
"""
LATCH = """
from smach_oracle.ros.signals.latch import Latch, start_thread

latches = [Latch()]
def hear_and_set(*_):
    hear()
    latches[-1].set()
    start_thread(int)
signal.signal(signal.SIGINT, hear_and_set)
"""
PREEMPT = """
import rospy, smach, smach_ros
rospy.core._in_mainthread, rospy.core.is_initialized = True, lambda: True
class Container:
    def request_preempt(self):
        pass
smach_ros.set_preempt_handler(Container())
ours = signal.getsignal(signal.SIGINT)
assert ours is not signal.default_int_handler
signal.signal(signal.SIGINT, lambda *given: (hear(), ours(*given)))
"""
BESIDE = {
    'trials end': GUARD + 'for_a_while(guard.trials_ended)',
    'a handler is waited for': GUARD
    + textwrap.dedent("""
        def wait():
            guard._hold_s = 1.0
            guard._handled.set()
            guard.wait_for_handler()
        guard._no_hold.set()
        for_a_while(wait)
        """),
    'a latch is set': LATCH + 'for_a_while(lambda: latches[0].set())',
    'a latch is waited for': LATCH
    + textwrap.dedent("""
        def wait():
            latches.append(Latch())
            latches[-1].wait(0.001)
            del latches[0]
        for_a_while(wait)
        """),
    'a thread starts': LATCH + 'for_a_while(threading.enumerate)',
    'a machine is preempted': PREEMPT + 'for_a_while(threading.enumerate)',
}


@pytest.mark.parametrize('beside', list(BESIDE))
def test_the_main_thread_goes_on_whatever_a_signal_meets(beside):
    if 'smach_ros' in BESIDE[beside] and os.environ.get('SMACH_UPSTREAM'):
        pytest.skip('the handler is that of our smach_ros')
    program = subprocess.Popen(
        [sys.executable, '-c', PRELUDE + BESIDE[beside]],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
    )
    try:
        assert program.stdout.readline() == 'READY\n'
        until = time.monotonic() + 3.5
        while program.poll() is None and time.monotonic() < until:
            program.send_signal(signal.SIGINT)
            time.sleep(0.001)  # for a handler to end before the next one
        output, errors = program.communicate(timeout=20)  # it hangs where a lock is taken twice
    finally:
        program.kill()
        program.communicate()
    assert errors == ''
    done, heard = output.split()
    assert done == 'DONE' and int(heard) > 100
