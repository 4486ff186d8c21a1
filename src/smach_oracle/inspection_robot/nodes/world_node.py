"""The hall and the robot's hardware as a ROS node: base, laser scanner, camera, battery, clock."""

import re
import threading
import time
from typing import Optional

import rospy
from geometry_msgs.msg import Twist
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from smach_oracle.msg import TrialCause
from smach_oracle.srv import (
    ChargeTime,
    ChargeTimeRequest,
    ChargeTimeResponse,
    PassTime,
    PassTimeRequest,
    PassTimeResponse,
)

from ..world.causes import CHANCE, draw
from ..world.inspection_world import InspectionWorld
from .hardware_topics import HardwareTopics
from .parameters import ParameterError, flag_in, number_in, parameters_of, words_in
from .tour_record import TimeUse, TourRecord, append_record

STEP_S = 0.05
SCAN_STEPS = 2  # a scan and odometry every so many steps
IMAGE_STEPS = 4
SETTLES_S = 0.5  # after the robot was set down at its start
REPORTS_COME_S = 0.5  # wall time: what was reported last may come after the trial's end
LAST_WORDS_S = 5.0  # for the last trial's line
LONGEST_PASS_S = 3600.0  # of the world's time, that a call may wait
DRAWN = 'drawn'  # the causes of a trial, where none are named
REPORT = re.compile(r'panel (\d+): (\d+(?:\.\d+)?) bar')


class InspectionWorldNode:
    """Serves one world after the other. `run` lets their time pass."""

    def __init__(self) -> None:
        """:raises ParameterError: for a parameter that cannot be used."""
        self._speed = number_in('speed', 1.0, 0.1, 20.0)
        self._seed = int(number_in('seed', 1, 0, 2**31))
        causes = words_in('causes', DRAWN)
        self._only = None if causes == [DRAWN] else [each for each in causes if each != 'none']
        if not set(self._only or ()) <= set(CHANCE):
            raise ParameterError(
                '{}: allowed are {}, none, or some of {}'.format(
                    rospy.resolve_name('~causes'), DRAWN, ', '.join(CHANCE)
                )
            )
        self._extra = flag_in('extra_causes', False)
        if self._extra and self._only is not None:
            raise ParameterError(
                '{} is true: leave {} out'.format(
                    rospy.resolve_name('~extra_causes'), rospy.resolve_name('~causes')
                )
            )
        self._truth_file = str(rospy.get_param('~truth_file', 'none'))
        self._lock = threading.Lock()
        self._world = InspectionWorld(draw(self._seed, self._only, self._extra))
        self._in_trial = False  # the first has begun
        self._record: Optional[TourRecord] = None  # of the trial that is under way
        self._steps = 0
        self._use = TimeUse()
        self._clock = rospy.Publisher('/clock', Clock, queue_size=1, tcp_nodelay=True)
        self._topics = HardwareTopics()
        rospy.Subscriber('cmd_vel', Twist, self._drive, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber('inspection/report', String, self._hear, queue_size=10)
        self._cause = rospy.Publisher('world/cause', TrialCause, queue_size=10, latch=True)
        self._services = [
            rospy.Service('new_trial', Trigger, self._new_trial),
            rospy.Service('end_trial', Trigger, self._end_trial),
            rospy.Service('world/pass_time', PassTime, self._pass_time),
            rospy.Service('world/charge_time', ChargeTime, self._charge_time),
        ]

    def run(self) -> None:
        """Let time pass until the node ends, which is the end of the last trial, too.

        Not for the main thread: a signal is handled there, and takes locks that publishing takes.
        """
        try:
            self._pass()
        except rospy.ROSException:
            if not rospy.is_shutdown():  # else a topic was closed while it published
                raise
        finally:
            with self._lock:
                self._write_truth()

    def _pass(self) -> None:
        due_s, self._use = time.monotonic(), TimeUse()
        while not rospy.is_shutdown():
            self._step()
            due_s = max(due_s + STEP_S / self._speed, time.monotonic() - STEP_S)
            time.sleep(max(0.0, due_s - time.monotonic()))
            self._use.add('idle')

    def _step(self) -> None:
        with self._lock:
            self._world.step(STEP_S)
            self._steps += 1
            world, steps = self._world, self._steps
            now = rospy.Time.from_sec(steps * STEP_S)
            scan = world.scan() if steps % SCAN_STEPS == 0 else None
        self._use.add('hall')
        self._clock.publish(Clock(now))
        if scan is not None:
            self._topics.publish_state(world, scan, now)
        self._use.add('publish')
        if steps % IMAGE_STEPS == 0:
            self._topics.publish_image(world, now)
            self._use.add('camera')

    def _drive(self, message: Twist) -> None:
        with self._lock:
            self._world.base.command(message.linear.x, message.angular.z)

    def _hear(self, message: String) -> None:
        told = REPORT.fullmatch(message.data)
        if told is not None:
            with self._lock:
                self._world.reported[int(told.group(1))] = float(told.group(2))

    def _new_trial(self, _: TriggerRequest) -> TriggerResponse:
        """Set the robot down at its start, in the world of the next seed."""
        self._finish_trial()
        with self._lock:
            self._seed += self._in_trial
            self._world = world = InspectionWorld(draw(self._seed, self._only, self._extra))
            self._in_trial = True
            self._use.restart()
            now_s = self._steps * STEP_S
            self._record = TourRecord(world, now_s)
        causes = world.log.record()
        self._cause.publish(
            TrialCause(
                Header(stamp=rospy.Time.from_sec(now_s)),
                world.scene.seed,
                'inspection',
                [cause['kind'] for cause in causes],
                [cause['text'] for cause in causes],
            )
        )
        self._topics.publish_start()
        while world.time_s < SETTLES_S and not rospy.is_shutdown():
            time.sleep(STEP_S / self._speed)
        return TriggerResponse(True, 'seed {}'.format(world.scene.seed))

    def _end_trial(self, _: TriggerRequest) -> TriggerResponse:
        """Judge the trial. The hall goes on until the next one begins."""
        begun = self._finish_trial()
        return TriggerResponse(begun, '' if begun else 'no trial has begun')

    def _finish_trial(self) -> bool:
        """Wait for the last reports and write down how the trial went, if one is under way."""
        with self._lock:
            if self._record is None:
                return False
            self._record.end()
        time.sleep(REPORTS_COME_S)
        with self._lock:
            self._write_truth()
        return True

    def _write_truth(self) -> None:
        """Append a line on how the trial truly went, once."""
        record, self._record = self._record, None
        if record is None or self._truth_file in ('', 'none'):
            return
        line = record.line(self._use)
        try:
            append_record(self._truth_file, line)
        except OSError as err:
            rospy.logerr('inspection_world: trial %d is not judged: %s', line['seed'], err)

    def _pass_time(self, request: PassTimeRequest) -> PassTimeResponse:
        """Answer once so much of the hall's time has passed: it has a pace of its own."""
        if not 0 <= request.seconds <= LONGEST_PASS_S:
            raise rospy.ServiceException(
                'seconds is {}; allowed: 0 to {:g}'.format(request.seconds, LONGEST_PASS_S)
            )
        until = self._steps + request.seconds / STEP_S
        while self._steps < until and not rospy.is_shutdown():
            time.sleep(STEP_S / self._speed)
        with self._lock:
            if self._record is not None:
                self._record.passed(request.seconds, request.what)
            return PassTimeResponse(rospy.Time.from_sec(self._steps * STEP_S))

    def _charge_time(self, request: ChargeTimeRequest) -> ChargeTimeResponse:
        """Somebody's work begins or ends: the hall's time between is charged to it."""
        with self._lock:
            if self._record is not None:
                self._record.charge(request.what, request.on)
        return ChargeTimeResponse()


def main() -> Optional[int]:
    """Entry point of the node."""
    parameters_of(
        'Node: the hall of the inspection robot, its base, its sensors, and the clock. '
        'Parameters: ~speed, ~seed, ~causes, ~extra_causes, ~truth_file; '
        'see doc/second_robot.md.'
    )
    rospy.init_node('inspection_world')
    try:
        node = InspectionWorldNode()
    except ParameterError as err:
        rospy.logfatal('inspection_world: %s', err)
        return 2
    passing = threading.Thread(target=node.run, name='time', daemon=True)
    passing.start()
    rospy.spin()
    passing.join(LAST_WORDS_S)
    return 0
