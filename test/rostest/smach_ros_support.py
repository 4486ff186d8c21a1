"""What the smach_ros tests share: server processes, userdata, machines that run beside the test."""

import os
import signal
import subprocess
import sys
import threading
import time
import unittest

from waiting import wait_for, waits

import smach
import smach_ros
from smach_ros import SimpleActionState

HERE = os.path.dirname(os.path.abspath(__file__))
OURS = os.path.exists(os.path.join(os.path.dirname(smach_ros.__file__), 'action_link.py'))
# what doc/inside/smach_ros.md says ours does better; upstream's does otherwise
improvement = unittest.skipUnless(OURS, 'upstream does otherwise')


class ActionNodeProcess(object):
    """smach_ros_action_node.py as a process of its own, so that it can be killed."""

    def __init__(self, action_name):
        self.action_name = action_name
        self.process = None

    def start(self):
        command = [
            sys.executable,
            '-X',
            'faulthandler',
            os.path.join(HERE, 'smach_ros_action_node.py'),
            self.action_name,
            '__name:=serves_' + self.action_name,
        ]
        self.process = subprocess.Popen(command)
        return self

    def stop(self):
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
        if self.process is not None:
            self.process.wait(10)


class TellingState(SimpleActionState):
    """Says when its server has begun with the goal; until then nothing is to be seen of how it
    treats a cancel.
    """

    def __init__(self, *arguments, **keywords):
        SimpleActionState.__init__(self, *arguments, **keywords)
        self.active = threading.Event()

    def _goal_active_cb(self):
        self.active.set()


def userdata(**items):
    """A UserData with these items."""
    made = smach.UserData()
    for key, value in items.items():
        made[key] = value
    return made


class InBackground(object):
    """Executes a state in a thread; ``outcome()`` waits for its end."""

    def __init__(self, state, *args):
        self._outcome = []
        self._thread = threading.Thread(
            target=lambda: self._outcome.append(state.execute(*args)), daemon=True
        )
        self.started_at = time.monotonic()
        self._thread.start()

    def outcome(self, timeout_s=40.0):
        self._thread.join(timeout_s)
        return self._outcome[0] if self._outcome else 'still running'

    def waits(self):
        """Until the state waits for something; whether it does."""
        return wait_for(lambda: waits(self._thread))

    def took_s(self):
        return time.monotonic() - self.started_at


class LogWatch(object):
    """Collects what SMACH logs as warnings and errors while it is open."""

    def __enter__(self):
        self.lines = []
        self._loggers = (smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr)
        info, warn, debug, error = self._loggers
        smach.set_loggers(
            info,
            lambda text: (self.lines.append(str(text)), warn(text)),
            debug,
            lambda text: (self.lines.append(str(text)), error(text)),
        )
        return self

    def __exit__(self, *exc_info):
        smach.set_loggers(*self._loggers)

    def text(self):
        return '\n'.join(self.lines)
