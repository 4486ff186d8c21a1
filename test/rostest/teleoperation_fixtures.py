"""An arm that goes at once where it is told, and a person's front end, to test the manipulation
interface.
"""

import contextlib
import os
import subprocess
import sys
import threading
import time

import actionlib
import numpy as np
import rospy
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory
from waiting import wait_for

from control_msgs.msg import GripperCommandAction, GripperCommandResult
from smach_oracle.msg import SharedAutonomyAction, SharedAutonomyGoal, TeleopCommand, TeleopState
from smach_oracle.ros.goal_link import GoalLink
from smach_oracle.ros.userdata_codec import encode_all
from smach_oracle.srv import FinishInterface, GiveUpInterface

READY = (-0.4, 0.3, -1.2, -1.4, 0.3, -0.8, 0.2)
NAMES = ['j{}'.format(number) for number in range(7)]


class FakeArm:
    """Takes every target at once, tells its joints 100 times a second; its gripper meets something
    at 5 cm.

    Unless it is `blocked` (it stays where it is), `silent` (it tells nothing), or `odd` (it tells
    what is no number).
    """

    def __init__(self, below=''):
        self._lock = threading.Lock()
        self._positions = np.array(READY)
        self.moved_s = 0.0  # monotonic, of the last change
        self.blocked = self.silent = self.odd = False
        self.leads = []  # rad, of each target before where the arm is
        self.grip_s = 0.05  # that a motion of the gripper takes
        self.grips = []  # of the gripper's motions: where to, and whether it came to its end
        self._states = rospy.Publisher(
            below + 'joint_states', JointState, queue_size=10, tcp_nodelay=True
        )
        self._gripper = actionlib.SimpleActionServer(
            below + 'gripper', GripperCommandAction, self._grip, auto_start=False
        )
        self._gripper.start()
        self._commands = rospy.Subscriber(
            below + 'arm/command', JointTrajectory, self._move, queue_size=10, tcp_nodelay=True
        )
        threading.Thread(target=self._tell_on, daemon=True).start()

    def reset(self):
        self.blocked = self.silent = self.odd = False
        self.grip_s = 0.05
        self.leads, self.grips = [], []
        with self._lock:
            self._positions = np.array(READY)
        self.tell()

    def stands_after(self, let_go, rest_s=0.4):
        """s after `let_go` has returned at which it moved last; waits until it has rested so
        long.
        """
        let_go()
        begun_s = time.monotonic()
        assert wait_for(lambda: time.monotonic() - max(self.moved_s, begun_s) > rest_s), (
            'it does not stand'
        )
        return self.moved_s - begun_s

    def tell(self):
        with self._lock:
            positions = [float('nan')] * 7 if self.odd else self._positions.tolist()
        if self.silent:
            return
        self._states.publish(JointState(Header(stamp=rospy.Time.now()), NAMES, positions, [], []))

    def _tell_on(self):
        try:
            while not rospy.is_shutdown():
                self.tell()
                time.sleep(0.01)  # 100 times a second
        except rospy.ROSException:
            return  # the node goes down

    def _move(self, message):
        now_s = time.monotonic() + message.points[-1].time_from_start.to_sec()
        with self._lock:
            self.leads.append(
                np.abs(np.array(message.points[-1].positions) - self._positions).max()
            )
            if not self.blocked:
                self._positions = np.array(message.points[-1].positions)
        self.moved_s = now_s
        self.tell()

    def _grip(self, goal):
        preempted = wait_for(self._gripper.is_preempt_requested, self.grip_s)
        self.grips.append((goal.command.position, not preempted))
        met = goal.command.position < 0.05
        if not self.grips[-1][1]:
            self._gripper.set_preempted(GripperCommandResult(0.07, 0.0, False, False))
            return
        self._gripper.set_succeeded(
            GripperCommandResult(max(0.05, goal.command.position), 10.0, met, not met)
        )


class Person:
    """A front end of one operator for one interface."""

    def __init__(self, server, operator='ann'):
        self.server = server
        self.operator = operator
        self.states = []
        self._seq = 0
        self._publisher = rospy.Publisher(
            server + '/command', TeleopCommand, queue_size=10, tcp_nodelay=True
        )
        rospy.Subscriber(
            server + '/state', TeleopState, self.states.append, queue_size=100, tcp_nodelay=True
        )
        self._link = GoalLink(rospy.resolve_name(server), SharedAutonomyAction)
        self.finish = rospy.ServiceProxy(server + '/finish', FinishInterface)
        self.give_up = rospy.ServiceProxy(server + '/give_up', GiveUpInterface)
        assert wait_for(lambda: self._link.ready() and self._publisher.get_num_connections())

    def start(self, state='PICK', query_id='q1', userdata=None):
        """Send a goal; the sent goal."""
        return self._link.send(
            SharedAutonomyGoal(
                query_id=query_id,
                container_path='SM',
                state=state,
                interface='manipulation',
                userdata=encode_all(userdata or {}),
                outcomes=['succeeded', 'aborted'],
                output_keys=['grasp', 'note'],
            ),
        )

    def active(self, query_id='q1'):
        return wait_for(lambda: self.states and self.states[-1].query_id == query_id)

    def send(
        self,
        linear=(0, 0, 0),
        angular=(0, 0, 0),
        frame='base_footprint',
        arm='right',
        held=True,
        **more,
    ):
        """Send one command; its seq."""
        self._seq += 1
        self._publisher.publish(
            TeleopCommand(
                header=Header(frame_id=frame),
                operator=self.operator,
                seq=self._seq,
                arm=arm,
                dead_man=held,
                twist=Twist(Vector3(*linear), Vector3(*angular)),
                **more,
            )
        )
        return self._seq

    def answer(self, seq):
        """The first state that shows a command."""
        return wait_for(
            lambda: next(
                (
                    state
                    for state in list(self.states)
                    if (state.sender, state.seq) == (self.operator, seq)
                ),
                None,
            )
        )

    def hold(self, seconds, rate_hz=30.0, **command):
        """Send a command again and again; monotonic times of the first and the last."""
        begun_s = time.monotonic()
        while time.monotonic() < begun_s + seconds:
            sent_s = time.monotonic()
            self.send(**command)
            time.sleep(1.0 / rate_hz)  # a hand that holds
        return begun_s, sent_s

    @contextlib.contextmanager
    def pressing(self, **command):
        """Send a command 30 times a second meanwhile."""
        over = threading.Event()

        def press():
            while not over.wait(1.0 / 30.0):
                self.send(**command)

        thread = threading.Thread(target=press, daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def tool(self):
        """(3,) m, where the tool was last said to be."""
        at = self.states[-1].tool_pose.position
        return np.array([at.x, at.y, at.z])


def asker_of_its_own(server, query_id):
    """Another process that sends a goal and waits for its end; killed at the latest in the end."""
    return _process('ask', server, query_id)


def driver_of_its_own(server, operator):
    """Another process that drives without end; killed at the latest in the end."""
    return _process('drive', server, operator)


@contextlib.contextmanager
def _process(*arguments):
    process = subprocess.Popen([sys.executable, os.path.abspath(__file__), *arguments])
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def result_of(sent, limit_s=10.0):
    """The end of a goal: (status, result)."""
    event = wait_for(lambda: _ended(sent), limit_s)
    return (event.status, event.result) if event else (None, None)


def _ended(sent):
    event = sent.poll()
    return event if event is not None and event.status else None


def _main(task, server, name):
    rospy.init_node(task, anonymous=True)
    person = Person(server, name)
    if task == 'ask':
        person.start(query_id=name)
        rospy.spin()
    while not rospy.is_shutdown():
        person.send()
        time.sleep(0.1)  # ten times a second, until it is killed


if __name__ == '__main__':
    _main(*sys.argv[1:])
