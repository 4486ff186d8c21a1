"""The manipulation interface: a person drives the robot's arms in place of a failed state.

A SharedAutonomy action beside `~command` (TeleopCommand), `~state` (TeleopState), `~finish` and
`~give_up`, for any robot with a robot_description, joint_states, arms that take joint trajectories
and grippers of control_msgs.
"""

import threading
import time
from typing import Any, Collection, Dict, Mapping, Optional, Tuple

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import Header

from smach_common.connections import sender_of
from smach_oracle.msg import CollisionBoxes, SharedAutonomyGoal, TeleopCommand, TeleopState
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.master_watch import start_master_watch
from smach_oracle.ros.senders.own_messages import listens
from smach_oracle.ros.userdata_codec import UserdataCodecError, decode_all
from smach_oracle.srv import Snapshot

from ..interface_goal import NO_GOAL, FinishServices, InterfaceGoal
from ..priority import take_priority
from .cartesian_drive import no_motion
from .command_inbox import ArrivedCommand, CommandInbox
from .dead_man_switch import DeadManSwitch
from .settings import GRASP_POSE, NO_SNAPSHOT, TeleoperationSettings
from .surroundings import Surroundings
from .teleoperated_arm import TeleoperatedArm

_IDLE_S = 0.2  # how often the state is published while a goal is active and nothing moves
_APPLIED_S = 2.0  # wall time that a world in lock-step has for one period
_GRIPPER_S = 60.0  # the same, for a motion of the gripper


class TeleoperationServer:
    """Hosts the interface. One thread carries out the commands, one after the other.

    :raises SettingsError: for a setting or a robot description that cannot be used.
    """

    def __init__(
        self,
        settings: TeleoperationSettings,
        arms: Dict[str, TeleoperatedArm],
        surroundings: Optional[Surroundings] = None,
    ) -> None:
        """`arms` by name."""
        self._settings = settings
        self._arms = arms
        self._surroundings = surroundings
        self._last_arm = next(iter(arms))  # the one moved last
        # in lock-step nothing moves between commands. A slow sender must not change what its
        # commands do, but one that is dead does not keep the others out
        self._dead_man = (
            DeadManSwitch(float('inf'), settings.lease_s)
            if settings.lock_step
            else DeadManSwitch(settings.watchdog_s)
        )
        self._held: Optional[TeleopCommand] = None
        # m and N, sent to the gripper since it is held
        self._gripped: Optional[Tuple[float, float]] = None
        self._commands = CommandInbox()
        self._published_s, self._published_question = 0.0, ''
        self._unsure = True  # whether others may have moved the robot since our last command
        self._snapshot = (
            rospy.ServiceProxy(settings.snapshot, Snapshot)
            if settings.lock_step and settings.snapshot != NO_SNAPSHOT
            else None
        )
        self._seq, self._sender, self._refused, self._step = 0, '', '', no_motion()
        self._state = rospy.Publisher(
            '~state', TeleopState, queue_size=10, latch=True, tcp_nodelay=True
        )
        self._goal = InterfaceGoal(rospy.get_name(), self._begun, self._ended)
        self._services = FinishServices(self._goal, self.outputs)
        self._boxes = rospy.Subscriber(
            'collision_map', CollisionBoxes, self._on_boxes, queue_size=1
        )
        self._subscriber = rospy.Subscriber(
            '~command', TeleopCommand, self._put, queue_size=10, tcp_nodelay=True
        )
        self._thread = threading.Thread(target=self._run, name='teleoperation', daemon=True)
        self._thread.start()

    def outputs(self, outcome: str, _given: Collection[str] = ()) -> Mapping[str, Any]:
        """The outputs of the active state that the settings for this state list."""
        goal = self._goal.goal
        known: Dict[str, Any] = {}
        if goal is None or outcome not in self._settings.success:
            return known
        arm = self._arms[self._last_arm]
        for key, pose in self._settings.outputs_of(goal.state).items():
            grasped = pose == GRASP_POSE and arm.grasp is not None
            known[key] = arm.grasp if grasped else arm.tool_pose()
        return known

    def _put(self, command: TeleopCommand) -> None:
        """Take a command. Anybody may stop the arm, but only a node that sees its state moves it.

        The player of a bag does not.
        """
        node = sender_of(command)
        if command.dead_man and node and not listens(self._state, node):
            rospy.logwarn_throttle(
                10.0,
                '{}: ignored commands of {}, which does not listen to the '
                'state. A bag that is played does that'.format(rospy.get_name(), node),
            )
        else:
            self._commands.put(command)

    def _begun(self, goal: SharedAutonomyGoal) -> None:
        self._seq, self._sender, self._refused, self._step = 0, '', '', no_motion()
        self._last_arm = self._settings.arm_of(goal.state, self._named(goal), self._last_arm)
        self._unsure = True
        for arm in self._arms.values():
            arm.forget()

    def _named(self, goal: SharedAutonomyGoal) -> Dict[str, Any]:
        """The input userdata that may name an arm."""
        items = [item for item in goal.userdata if item.key in self._settings.arm_keys]
        try:
            return decode_all(items, skip_unsent=True)
        except UserdataCodecError as err:
            rospy.logwarn('%s: which arm is meant cannot be read: %s', rospy.get_name(), err)
            return {}

    def _ended(self) -> None:
        self._dead_man.drop(time.monotonic())
        for arm in self._arms.values():
            arm.gripper.stop()

    def _on_boxes(self, message: CollisionBoxes) -> None:
        if self._surroundings is not None:
            self._surroundings.replace(message)

    def _run(self) -> None:
        due_s = time.monotonic()
        while not rospy.is_shutdown():
            try:
                due_s = self._work(due_s)
            except rospy.ROSException as err:
                rospy.logdebug('%s: the node goes down: %s', rospy.get_name(), err)
            except Exception as err:
                rospy.logerr_throttle(1.0, '{}: {!r}'.format(rospy.get_name(), err))
                self._fail(err)

    def _fail(self, err: Exception) -> None:
        """After any error: arm and gripper stop, and the next command is taken."""
        self._dead_man.refuse(self._dead_man.holder(time.monotonic()))
        self._held, self._gripped, self._step, self._refused = (
            None,
            None,
            no_motion(),
            'error: {}'.format(err),
        )
        for arm in self._arms.values():
            arm.gripper.stop()

    def _work(self, due_s: float) -> float:
        """Take the commands that have come, and move on by a period where it is time.

        :returns: when the next period is due, monotonic s.
        """
        wait_s = max(0.0, due_s - time.monotonic()) if self._held is not None else _IDLE_S
        for arrived in self._commands.take_all(wait_s):
            self._take(arrived)
        self._goal.drop_if_asker_is_gone()
        now_s = time.monotonic()
        if self._held is None:
            self._idle(now_s)
            return now_s
        if now_s < due_s:
            return due_s
        self._move_on()
        return max(due_s + self._settings.period_s, now_s)

    def _driver(self) -> str:
        """Return who moves the arm, '' for nobody: the dead-man holds no longer than the goal."""
        return self._dead_man.holder(time.monotonic()) if self._goal.goal is not None else ''

    def _take(self, arrived: ArrivedCommand) -> None:
        """Carry out a command, or refuse it. A bad one of the driver stops the arm."""
        command = arrived.command
        self._seq, self._sender = command.seq, command.operator
        self._refused = self._why_not(arrived)
        if self._refused or not command.dead_man:
            self._let_go(arrived)
            self._publish_state()
        else:
            self._hold(command)

    def _why_not(self, arrived: ArrivedCommand) -> str:
        command = arrived.command
        if self._goal.goal is None:
            return NO_GOAL
        if command.arm not in self._arms:
            return 'unknown arm {!r}; allowed: {}'.format(
                command.arm, ', '.join(sorted(self._arms))
            )
        if not command.operator and command.dead_man:
            return 'a command needs the name of its operator'
        if not command.dead_man:
            return ''
        arm = self._arms[command.arm]
        goes_on = (
            self._dead_man.holder(arrived.at_s) == command.operator
            and command.arm == self._last_arm
        )
        why = arm.why_not(command, self._settings.lock_step) or self._dead_man.press(
            command.operator, arrived.at_s
        )
        if why:
            return why
        if self._driver() != command.operator:
            return 'it came too late to be carried out'
        if not goes_on:
            self._stop_moving()
            arm.begin()
        return ''

    def _let_go(self, arrived: ArrivedCommand) -> None:
        """The operator lets go, or is refused."""
        operator = arrived.command.operator
        if not operator and not arrived.command.dead_man:  # somebody stops the driver
            self._dead_man.drop(arrived.at_s)
            self._stop_moving()
            return
        if operator in (self._driver(), self._held.operator if self._held is not None else ''):
            self._stop_moving()
        if not arrived.command.dead_man:
            self._dead_man.release(operator)
        elif self._goal.goal is None:
            self._dead_man.press_for_nothing(operator, arrived.at_s)
        else:
            self._dead_man.refuse(operator)

    def _stop_moving(self) -> None:
        """Nobody moves the arms any more."""
        self._held, self._gripped, self._step = None, None, no_motion()
        for arm in self._arms.values():
            arm.gripper.stop()
        # after it, the arm is others' to move
        if self._goal.goal is not None and not self._settings.lock_step:
            self._arms[self._last_arm].rest(self._settings.period_s)

    def _hold(self, command: TeleopCommand) -> None:
        self._last_arm = command.arm
        arm = self._arms[command.arm]
        motion = (command.gripper, command.gripper_effort or self._settings.gripper_effort)
        # a front end may repeat it for as long as it is held, so that none is lost. What is done is
        # not done again
        if command.move_gripper and (self._settings.lock_step or motion != self._gripped):
            arm.gripper.move(*motion)
        self._gripped = motion if command.move_gripper else None
        if self._settings.lock_step:
            self._in_lock_step(command, arm)
        else:
            self._held = command

    def _in_lock_step(self, command: TeleopCommand, arm: TeleoperatedArm) -> None:
        """Carry the command out for one period, and publish when the world has done it."""
        until_s = time.monotonic() + _GRIPPER_S
        while (
            arm.gripper.moving
            and time.monotonic() < until_s
            and self._driver()
            and not rospy.is_shutdown()
        ):
            self._poll_gripper(arm, 0.02)
        if not self._driver():
            self._refused = NO_GOAL
            self._publish_state()
            return
        if self._unsure or command.move_gripper:
            self._catch_up(arm)
        if self._surroundings is not None:
            self._surroundings.update()
        self._step, done = arm.move_and_wait(command, self._settings.period_s, _APPLIED_S)
        if not done:
            self._refused = 'the world has not carried it out within {:g} s'.format(_APPLIED_S)
        self._publish_state()

    def _catch_up(self, arm: TeleoperatedArm) -> None:
        """Get the joints as they are now: others may have moved the world, or the gripper has."""
        self._unsure = False
        if self._snapshot is None:
            return
        try:
            stamp = self._snapshot(False).stamp
        except (rospy.ServiceException, rospy.ROSException, OSError) as err:
            rospy.logwarn('%s: %s', self._settings.snapshot, err)
            return
        if not arm.catch_up(stamp, _APPLIED_S):
            rospy.logwarn('joint_states of %s did not come', stamp)

    def _move_on(self) -> None:
        """One period of a command that is held."""
        command = self._held
        if command is None or self._driver() != command.operator:
            self._stop_moving()
        else:
            operator = command.operator
            arm = self._arms[command.arm]
            if self._surroundings is not None:
                self._surroundings.update()
            self._step = arm.move(
                command, self._settings.period_s, lambda: self._driver() == operator
            )
        for each in self._arms.values():
            self._poll_gripper(each, 0.0)
        self._publish_state()

    def _poll_gripper(self, arm: TeleoperatedArm, timeout_s: float) -> None:
        if arm.gripper.poll(timeout_s):
            arm.note_gripper()

    def _idle(self, now_s: float) -> None:
        for arm in self._arms.values():
            self._poll_gripper(arm, 0.0)
        question_id = self._question_id()
        if question_id != self._published_question or (
            question_id and now_s - self._published_s >= _IDLE_S
        ):
            self._publish_state()

    def _question_id(self) -> str:
        goal = self._goal.goal
        return goal.query_id if goal is not None else ''

    def _publish_state(self) -> None:
        arm = self._arms[self._last_arm]
        self._published_s, self._published_question = time.monotonic(), self._question_id()
        state = TeleopState(
            query_id=self._published_question,
            arm=self._last_arm,
            seq=self._seq,
            sender=self._sender,
            operator='' if self._dead_man.lapsed(self._published_s) else self._driver(),
            refused=self._refused,
            moving=bool(self._step.velocities.any()),
            speed=self._step.speed,
            limit=self._step.limit or arm.gripper.report.problem,
            clearance=self._step.clearance,
            gripper=arm.gripper.report.position,
            gripper_stalled=arm.gripper.report.stalled,
            gripper_moving=arm.gripper.moving,
        )
        pose = arm.tool_pose()
        state.header = Header(frame_id=pose.header.frame_id, stamp=pose.header.stamp)
        state.tool_pose = pose.pose
        state.achieved = arm.in_base(self._step.twist) if state.moving else Twist()
        if not rospy.is_shutdown():
            self._state.publish(state)


def main() -> None:
    """Entry point of the node `manipulation_interface`."""
    parameters_only(
        "Node: a person drives the robot's arms in place of a failed state. "
        'Parameters: ~arms, ~states, ~limits, ~nice and more; see '
        'doc/shared_autonomy.md.'
    )
    rospy.init_node('manipulation_interface')
    start_master_watch()
    try:
        take_priority()
        settings = TeleoperationSettings.from_parameters()
        arms, surroundings = settings.build()
    except (SettingsError, ValueError) as err:
        rospy.logfatal('manipulation_interface: %s', err)
        raise SystemExit(2) from err
    TeleoperationServer(settings, arms, surroundings)
    rospy.loginfo('manipulation_interface: arms %s', ', '.join(sorted(arms)))
    rospy.spin()
