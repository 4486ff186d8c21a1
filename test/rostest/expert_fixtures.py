"""Questions, and ways to put and watch them, for the tests of the expert's side."""

import os
import signal
import subprocess
import sys
import threading
import time

import roslib.packages
import rospy
from own_master import wait_for_master

from smach_oracle.expert.front_end import FrontEnd, wait_for_question
from smach_oracle.oracle.asking.question import OutcomeChoice, Question, StateChoice
from smach_oracle.oracle.records.events import FailureKind
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.oracle.settings.interfaces import InterfaceOffer
from smach_oracle.ros.expert.client import ExpertQueryClient


def make_question(query_id='q1', **changes):
    """A question of a pick-and-place machine whose PICK has failed; fields can be changed by
    name.
    """
    question = Question(
        question_id=query_id,
        trial_id='trial',
        container_path='PICK_AND_PLACE',
        failed_state='PICK',
        failure_kind=FailureKind.FELL_THROUGH,
        outcome='aborted',
        text='no grasp found',
        failure_class=3,
        rate=0.8,
        continuous=True,
        recoveries=2,
        reason='the failure rate of PICK is HIGH',
        tried=('revisit PICK',),
        history=(
            Visit('DETECT', 'succeeded', VisitResult.SUCCESS),
            Visit('PICK', 'aborted', VisitResult.FAILURE),
        ),
        choices=(
            StateChoice('DETECT', 0.9, 1, 2, (), ()),
            StateChoice('PICK', 0.2, 3, 1, ('grasp',), ('MOVE_ARMS_ASIDE', 'view_is_clear')),
            StateChoice('PLACE', 0.5, 2, 0, (), (), 'still running after an overrun'),
        ),
        supersede_outcomes=(
            OutcomeChoice('succeeded', 'PLACE'),
            OutcomeChoice('aborted', 'aborted'),
        ),
        output_keys=('grasped',),
        give_up_outcomes=('succeeded', 'aborted'),
        interfaces=(InterfaceOffer('assist', '/assist', 'do it by hand'),),
        userdata={'object': 'mug'},
        input_userdata={'target': 'mug'},
        deadline_s=0.0,
        fallback='PICK_AND_PLACE ends with aborted',
    )
    return question._replace(**changes)


class Asked(threading.Thread):
    """A question put in a thread of its own; what comes of it is kept."""

    def __init__(self, expert, question):
        super().__init__(daemon=True)
        self.cancelled = threading.Event()
        self.progress = []
        self.answer = None
        self.error = None
        self.returned_s = None
        self._expert = expert
        self._question = question
        self.start()

    def run(self):
        try:
            self.answer = self._expert.ask(self._question, self.cancelled, self._note)
        except ValueError as err:
            self.error = err
        self.returned_s = time.monotonic()

    def _note(self, *what):
        assert threading.current_thread() is self, 'progress is told in the asking thread'
        self.progress.append(what)

    def wait(self, timeout_s=40.0):
        """Whether ask() has returned within the time."""
        self.join(timeout_s)
        return not self.is_alive()


def start_master(port, **options):
    """A ROS master on a port, once it answers."""
    master = Process('rosmaster', '--core', '-p', str(port), stdout=subprocess.DEVNULL, **options)
    wait_for_master('http://localhost:{}'.format(port))
    return master


class Process:
    """Another ROS node: this file under a role, or an installed command of the package."""

    def __init__(self, *command, **options):
        self._process = subprocess.Popen(command, **options)

    @classmethod
    def installed(cls, command, *arguments, **options):
        """A command of the package, found as roslaunch finds it."""
        return cls(roslib.packages.find_node('smach_oracle', command)[0], *arguments, **options)

    @classmethod
    def role(cls, role, *arguments, **options):
        """One of the roles of `main` below."""
        return cls(sys.executable, os.path.abspath(__file__), role, *arguments, **options)

    def output(self, timeout_s):
        """What it has written when it ends (needs stdout=PIPE); raises where it does not end in
        time.
        """
        return self._process.communicate(timeout=timeout_s)[0].decode()

    def kill(self):
        """SIGKILL: no farewell to anybody."""
        self._process.kill()
        self._process.wait(10)

    def freeze(self):
        """SIGSTOP: its connections stay, and nothing answers."""
        self._process.send_signal(signal.SIGSTOP)

    def thaw(self):
        """SIGCONT."""
        self._process.send_signal(signal.SIGCONT)

    def interrupt(self):
        """SIGINT; how long it took to end, in seconds."""
        begun_s = time.monotonic()
        self._process.send_signal(signal.SIGINT)
        self._process.wait(10)
        return time.monotonic() - begun_s


def main(role, server, query_id='q1'):
    """Roles: `ask` puts a question and waits; `hold` claims one and keeps the claim."""
    rospy.init_node('{}_{}'.format(role, os.getpid()))
    if role == 'ask':
        answer = ExpertQueryClient(server).ask(
            make_question(query_id), threading.Event(), lambda *_: None
        )
        sys.stdout.write('answer {}'.format(answer.state if answer else None))
    elif role == 'hold':
        front_end = FrontEnd('holder', [server], lease_s=1.5)
        front_end.claim(wait_for_question(front_end, 10.0))
        rospy.spin()


if __name__ == '__main__':
    main(*sys.argv[1:])
