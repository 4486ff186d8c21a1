"""The world node: physics, controllers, camera, and the record of each trial's truth."""

import sys
import threading
import time
import traceback
from pathlib import Path
from typing import Optional

import rosgraph
import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from smach_oracle.msg import TrialCause
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.pr2.model.pr2_model import ModelError
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.shutdown import ShutdownGuard
from smach_oracle.srv import (
    ChargeTime,
    ChargeTimeRequest,
    ChargeTimeResponse,
    Judge,
    JudgeRequest,
    JudgeResponse,
    PassTime,
    PassTimeRequest,
    PassTimeResponse,
    Recognise,
    RecogniseRequest,
    RecogniseResponse,
    ResetWorld,
    ResetWorldRequest,
    ResetWorldResponse,
    Reveal,
    RevealRequest,
    RevealResponse,
    Snapshot,
    SnapshotRequest,
    SnapshotResponse,
)

from ..physics.camera import IMAGE_PERIODS, take_image
from ..physics.judge import TrialVerdict, judge
from ..physics.world import World
from ..scenes.scene import Scene
from ..scenes.tasks import draw
from .camera_publisher import CameraPublisher
from .controllers import Controllers
from .lab import read_lab
from .loop import PERIOD_S, WorldLoop, WorldStopped
from .motion_table import MotionTable
from .recognition import Recognition
from .reveal import reveal
from .settings import NONE, WorldSettings, read_settings
from .sim_clock import SimClock
from .state_publisher import StatePublisher, publish_description, ros_time
from .trial_film import TrialFilm
from .truth import TrialTruth
from .truth_file import append_line

# simulated s from one time on /clock to the next, by whether time is that of the commands. Each one
# wakes every action server of every node.
CLOCK_S = {False: 0.05, True: 0.5}
LONGEST_PASS_S = 36000.0  # of the world's time, that may pass at once
REST_S = 1.0  # after a trial, before it is judged
# for the last trial's line, at the end, on a busy machine: less than the 15 s after which roslaunch
# sends a second signal. It takes a tenth of a second where nothing else is done
LAST_WORDS_S = 12.0
UNREGISTERING_S = 0.7  # for taking back some sixty topics from a master that may be busy, or gone
SWITCH_S = 0.001  # between threads: a step of physics must not keep a message waiting


class WorldNode:
    """The node's topics, services and actions around one world. `run` serves until `close`."""

    def __init__(self, settings: WorldSettings) -> None:
        """Build the first scene and offer everything.

        :raises ModelError: where the PR2's model cannot be had.
        :raises ValueError: where a scene cannot be built.
        """
        self._settings = settings
        self.exit_code = 0  # of the process. 1 where the world failed
        self._lab = read_lab(settings) if settings.lab != NONE else None
        self._world = World(self._drawn(settings.seed), settings.camera_binning)
        self._truth: Optional[TrialTruth] = None
        self._film: Optional[TrialFilm] = None
        if settings.film != NONE:
            self._film = TrialFilm(Path(settings.film), settings.film_events)
        clock = rospy.Publisher('/clock', Clock, queue_size=1, tcp_nodelay=True)
        world_time = rospy.Publisher(
            'world/time', Clock, queue_size=1, latch=True, tcp_nodelay=True
        )

        def publish_clock(now_ns: int, worlds_ns: int) -> None:
            world_time.publish(Clock(ros_time(worlds_ns)))  # first: it is there with the other
            clock.publish(Clock(ros_time(now_ns)))

        self._clock = SimClock(publish_clock, CLOCK_S[settings.lock_step])
        self._motions = MotionTable(self._world)
        self._loop = WorldLoop(self._motions, self._clock, settings, self._after_tick)
        self._state = StatePublisher(
            publish_description(), list(self._world.joints()), settings.lock_step
        )
        self._camera = CameraPublisher()
        self._recognition = Recognition(self._world)
        self._cause = rospy.Publisher('world/cause', TrialCause, queue_size=10, latch=True)
        self._state_due = self._image_due = 0.0
        self._published = -1  # the world's periods at the last state that was published
        self._controllers = Controllers(
            self._world,
            self._loop,
            self._motions,
            lambda: self._clock.now_ns / 1e9,
            self._publish_state,
        )
        self._services = [
            rospy.Service('world/reset', ResetWorld, self._answer_reset),
            # before snapshots: who has these finds it, and charges it from the start
            rospy.Service('world/pass_time', PassTime, self._answer_pass_time),
            rospy.Service('world/charge_time', ChargeTime, self._answer_charge),
            rospy.Service('world/snapshot', Snapshot, self._answer_snapshot),
            rospy.Service('world/recognise', Recognise, self._answer_recognise),
        ]
        if settings.reveal:  # where experiments run nobody can ask for the truth
            self._services += [
                rospy.Service('world/reveal', Reveal, self._answer_reveal),
                rospy.Service('world/judge', Judge, self._answer_judge),
            ]

    def run(self) -> None:
        """Serve until close(), in the thread that owns the physics."""
        rospy.loginfo('pr2_world: ready for %s', self._settings.task)
        self._publish_state()
        self._loop.run(self._end)

    def close(self) -> None:
        """Stop serving, and end the process within UNREGISTERING_S of the last trial's line."""
        self._loop.stop(LAST_WORDS_S)
        ShutdownGuard(lambda: None, lambda limit_s: None, limit_s=UNREGISTERING_S).arm(
            self.exit_code
        )

    # in the world's thread

    def _after_tick(self) -> None:
        if self._film:
            self._film.look(self._world)
        now = self._clock.now_ns / 1e9
        came_to_rest = not self._motions and self._published != self._world.periods
        if came_to_rest or (now >= self._state_due and not self._between_targets()):
            self._publish_state()
            self._controllers.publish_feedback()
        if self._settings.camera_rate and now >= self._image_due and self._camera.wanted:
            self._image_due = now + 1.0 / self._settings.camera_rate
            self._publish_image(self._publish_state(), counted=False)

    def _between_targets(self) -> bool:
        """Whether a target of a stream is on its way in lock-step.

        Then only the state at the target is published, as the answer to it.
        """
        return self._settings.lock_step and self._controllers.streaming()

    def _publish_state(self) -> rospy.Time:
        stamp = ros_time(self._clock.stamp())
        self._state.publish(self._world, stamp)
        self._published = self._world.periods
        self._state_due = stamp.to_sec() + 1.0 / self._settings.state_rate - PERIOD_S / 2
        return stamp

    def _publish_image(self, stamp: rospy.Time, counted: bool) -> None:
        self._loop.watch.add_time('publish')
        image = take_image(self._world, counted)
        self._recognition.keep(stamp, image.colour)
        self._loop.watch.add_time('camera')
        self._camera.publish(image.colour, image.depth, image.intrinsics, stamp)
        self._loop.watch.add_time('publish')

    def _snapshot(self, camera: bool) -> rospy.Time:
        if camera:
            self._loop.pass_time(IMAGE_PERIODS * PERIOD_S)
        stamp = self._publish_state()
        if camera:
            self._publish_image(stamp, counted=True)
        return stamp

    def _pass_time(self, seconds: float, what: str) -> rospy.Time:
        self._loop.pass_by(self._world, seconds)
        if self._truth is not None and self._settings.lock_step:
            self._truth.passed(seconds, what)
        return self._publish_state()

    def _charge(self, what: str, on: bool) -> None:
        if self._truth is not None:
            self._truth.charge(what, on, self._world.time)

    def _drawn(self, seed: int) -> Scene:
        settings = self._settings
        return draw(settings.task, seed, settings.benign, settings.lasting, settings.extra_causes)

    def _reset(self, seed: int) -> None:
        self._motions.stop_all('the world was reset')
        self._finish_trial()
        self._loop.watch.restart()
        began_s = time.monotonic()
        self._world.reset(self._lab.scene(seed) if self._lab else self._drawn(seed))
        self._recognition.forget()
        if self._film:
            self._film.begin(seed)
        self._loop.watch.add_time('reset')
        self._truth = TrialTruth(self._world.scene, self._world.time, began_s)
        self._clock.begin_trial()
        causes = self._world.scene.causes
        self._cause.publish(
            TrialCause(
                Header(stamp=ros_time(self._clock.now_ns)),
                seed,
                self._settings.task,
                [cause.kind for cause in causes],
                [cause.text for cause in causes],
            )
        )
        self._publish_state()

    def _judge(self) -> TrialVerdict:
        return judge(self._world, self._world.scene.goal)

    def _finish_trial(self) -> None:
        """Write down how the trial ended, once."""
        truth, self._truth = self._truth, None
        if self._film:
            self._film.end()
        if truth is None or not (self._lab or self._settings.truth_file != NONE):
            return
        sim_s = self._world.time
        truth.happened(self._world.cause_spans())
        self._world.step(round(REST_S / PERIOD_S))
        verdict = self._judge()
        record = truth.record(
            verdict,
            self._world.harm.found(self._world),
            sim_s,
            self._loop.watch.spent,
            self._loop.watch.used,
        )
        record.update(self._clock.trial_record())
        if self._lab:
            record.update(self._lab.leave(self._world, verdict, record['sim_s']))
        if self._settings.truth_file == NONE:
            return
        try:
            append_line(self._settings.truth_file, record)
        except OSError as err:
            rospy.logerr('pr2_world: the truth on trial %d is lost: %s', record['seed'], err)

    def _end(self) -> None:
        self._finish_trial()
        self._world.close()

    # in the threads of ROS

    def _answer_reset(self, request: ResetWorldRequest) -> ResetWorldResponse:
        try:
            self._loop.call(lambda: self._reset(request.seed))
        except (ValueError, WorldStopped) as err:
            return ResetWorldResponse(False, str(err))
        return ResetWorldResponse(True, '')

    def _answer_snapshot(self, request: SnapshotRequest) -> SnapshotResponse:
        try:
            return SnapshotResponse(
                True, '', self._loop.call(lambda: self._snapshot(request.camera))
            )
        except WorldStopped as err:
            return SnapshotResponse(False, str(err), rospy.Time())

    def _answer_pass_time(self, request: PassTimeRequest) -> PassTimeResponse:
        if not 0 <= request.seconds <= LONGEST_PASS_S:
            raise rospy.ServiceException(
                'seconds is {}; allowed: 0 to {:g}'.format(request.seconds, LONGEST_PASS_S)
            )
        try:
            return PassTimeResponse(
                self._loop.call(lambda: self._pass_time(request.seconds, request.what))
            )
        except WorldStopped as err:
            raise rospy.ServiceException(str(err)) from err

    def _answer_charge(self, request: ChargeTimeRequest) -> ChargeTimeResponse:
        try:
            self._loop.call(lambda: self._charge(request.what, request.on))
        except WorldStopped as err:
            raise rospy.ServiceException(str(err)) from err
        return ChargeTimeResponse()

    def _answer_recognise(self, request: RecogniseRequest) -> RecogniseResponse:
        try:
            return self._loop.call(lambda: self._recognition.answer(request))
        except WorldStopped as err:
            return RecogniseResponse(ok=False, message=str(err))

    def _answer_reveal(self, request: RevealRequest) -> RevealResponse:
        try:
            bodies = self._loop.call(
                lambda: reveal(self._world, request.names, ros_time(self._clock.now_ns))
            )
        except (ValueError, WorldStopped) as err:
            return RevealResponse(ok=False, message=str(err))
        scene = self._world.scene
        return RevealResponse(True, '', scene.seed, scene.goal.body, bodies)

    def _answer_judge(self, _request: JudgeRequest) -> JudgeResponse:
        try:
            verdict = self._loop.call(self._judge)
        except WorldStopped as err:
            return JudgeResponse(ok=False, message=str(err))
        return JudgeResponse(True, '', verdict.success, verdict.why)


def main() -> None:
    """Entry point of the node."""
    parameters_only(
        'Node: a simulated PR2 and the world around it. Parameters: ~task, ~seed, ~benign, '
        '~lasting, ~lab, ~real_time_factor, ~idle_speed, ~idle_grace, ~truth_file, ~state_rate, '
        '~camera_rate, ~camera_binning, ~film, ~film_events, ~reveal, ~extra_causes; '
        'see doc/simulation.md.'
    )
    sys.setswitchinterval(SWITCH_S)
    try:
        # before the node is made: rospy looks at it only then
        rospy.set_param('/use_sim_time', True)
    except OSError as err:
        raise SystemExit(
            'pr2_world: no ROS master at {}: {}'.format(rosgraph.get_master_uri(), err)
        ) from err
    rospy.init_node('pr2_world')
    try:
        node = WorldNode(read_settings(rospy.get_param))
    except (SettingsError, ModelError, ValueError) as err:
        rospy.logfatal('pr2_world: %s', err)
        raise SystemExit(2) from err
    thread = threading.Thread(target=_run, args=(node,), name='world')
    rospy.on_shutdown(node.close)
    thread.start()
    rospy.spin()
    thread.join()
    raise SystemExit(node.exit_code)


def _run(node: WorldNode) -> None:
    """Run the world. Where it fails, its node ends too."""
    try:
        node.run()
    except Exception:  # whatever it is, the node cannot go on
        node.exit_code = 1
        rospy.logfatal('pr2_world: %s', traceback.format_exc())
        rospy.signal_shutdown('the world failed')
