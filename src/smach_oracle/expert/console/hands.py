"""The manipulation interfaces that run for questions, as the pages drive them: commands out, states in."""
import math
import threading
import time
from typing import Any, Dict, List, Optional

import rosgraph
import rosgraph.names
import rospy
from geometry_msgs.msg import Twist, Vector3
from std_msgs.msg import Header

from smach_oracle.msg import CollisionBoxes, SharedAutonomyActionResult, TeleopCommand, TeleopState

from ..followed_server import Listed
from ..front_end import FrontEnd
from ..teleoperation import GRIPPER_OPEN
from .audit import Audit, Person
from .checks import shown
from .commands import Command
from .desk import Reply
from .interface_outputs import InterfaceOutputs
from .perception_desk import action_of
from .sections import Sections
from .wheel import Drive, Wheel, along

LOOK_PERIOD_S = 0.5
DRAW_PERIOD_S = 0.1
NOT_RUNNING = 'No manipulation interface runs for this question.'
TAKE_FIRST = 'Take the wheel first.'
ANSWER_S = 2.0  # after which a command in lock-step counts as lost
STILL = {'frame': 'base', 'linear': (0, 0, 0), 'angular': (0, 0, 0), 'gripper': '', 'arm': ''}


class Hand:
    """One manipulation interface: its topics, and what its parameters tell a front end."""

    def __init__(self, action: str) -> None:
        self.wheel = Wheel()
        self.state: Optional[TeleopState] = None
        self._seq, self._sent_s = 0, -math.inf
        self._in_steps = bool(rospy.get_param(action + '/lock_step', False))
        self._base = str(rospy.get_param(action + '/base_frame', 'base_footprint'))
        self._camera = str(rospy.get_param(action + '/camera_frame', ''))
        arms = rospy.get_param(action + '/arms', {})
        self._tools = {name: str(arm.get('tool', '')) for name, arm in arms.items()}
        self._linear = float(rospy.get_param(action + '/limits/linear', 0.25))
        self._angular = float(rospy.get_param(action + '/limits/angular', 1.0))
        self._open = float(rospy.get_param(action + '/gripper_open', GRIPPER_OPEN))
        self._publisher = rospy.Publisher(action + '/command', TeleopCommand, queue_size=2, tcp_nodelay=True)
        self.boxes: Optional[int] = None  # that the robot's collision map has; None: there is no map
        self._subscribers = [
            rospy.Subscriber(action + '/state', TeleopState, self._take, queue_size=2, tcp_nodelay=True),
            rospy.Subscriber(rosgraph.names.namespace(action) + 'collision_map', CollisionBoxes, self._map)]

    def _take(self, state: TeleopState) -> None:
        self.state = state

    def _map(self, message: CollisionBoxes) -> None:
        self.boxes = len(message.names)

    def busy(self, operator: str) -> bool:
        """Whether a world in lock-step has not carried out the last command yet: more would wait, and move the hand
        after it was let go."""
        answered = self.state is not None and (self.state.sender, self.state.seq) == (operator, self._seq)
        return self._in_steps and not answered and time.monotonic() - self._sent_s < ANSWER_S

    @property
    def arms(self) -> List[str]:
        """Their names."""
        return sorted(self._tools)

    @property
    def arm(self) -> str:
        """The one that the interface has chosen for the state, or moved last; '' before it has said so."""
        return self.state.arm if self.state is not None else ''

    def frames(self, arm: str) -> Dict[str, str]:
        """The links by which a page may name a frame; those that are not known are left out."""
        frames = {'tool': self._tools.get(arm, ''), 'base': self._base, 'camera': self._camera}
        return {name: frame for name, frame in frames.items() if frame}

    def send(self, operator: str, said: Dict[str, Any], held: bool) -> None:
        """One command, along the axes of the frame named."""
        arm = said['arm'] or self.arm
        frame = self.frames(arm).get(said['frame'], self._base)
        self._seq, self._sent_s = self._seq + 1, time.monotonic()
        self._publisher.publish(TeleopCommand(
            header=Header(frame_id=frame, stamp=rospy.Time.now()), operator=operator, seq=self._seq,
            arm=arm, dead_man=held,
            twist=Twist(Vector3(*along(said['frame'], said['linear'], self._linear)),
                        Vector3(*along(said['frame'], said['angular'], self._angular))),
            move_gripper=held and bool(said['gripper']), gripper=self._open if said['gripper'] == 'open' else 0.0))

    def release(self, operator: str) -> None:
        """Stop now."""
        self.send(operator, STILL, False)

    def stop(self) -> None:
        """Take the topics down."""
        self._publisher.unregister()
        for subscriber in self._subscribers:
            subscriber.unregister()


class Hands:
    """All of them. Driving comes from the server's loop and waits for nothing; the rest from other threads."""

    def __init__(self, sections: Sections, front_end: FrontEnd, audit: Audit) -> None:
        self._sections = sections
        self._front_end = front_end
        self._audit = audit
        self._outputs = InterfaceOutputs()
        self._lock = threading.Lock()
        self._hands: Dict[str, Hand] = {}  # by question
        self._interfaces: List[str] = []

    def is_interface(self, action: str) -> bool:
        """Whether there is a SharedAutonomy action of that name."""
        return action in self._interfaces

    def start(self) -> None:
        """Begin; the threads end with the node."""
        for step, period_s in ((self.look, LOOK_PERIOD_S), (self.draw, DRAW_PERIOD_S)):
            threading.Thread(target=_again, args=(step, period_s), name='hands', daemon=True).start()

    def drives(self, browser: int) -> bool:
        """Whether a page has a wheel."""
        return any(hand.wheel.drive is not None and hand.wheel.drive.browser == browser
                   for hand in list(self._hands.values()))

    def drive(self, command: Command, browser: int) -> Reply:
        """Relay one command, where its page has the wheel and it is fresh; a late one stops the hand."""
        said = command.arguments
        hand = self._hands.get(said['question'])
        if hand is None:
            return Reply(False, NOT_RUNNING)
        with self._lock:
            drive = hand.wheel.drive
            if drive is None or drive.browser != browser:
                return Reply(False, TAKE_FIRST)
            if said['arm'] and said['arm'] not in hand.arms:
                hand.release(_operator(drive))
                return Reply(False, 'unknown arm {}; allowed: {}'.format(shown(said['arm']), ', '.join(hand.arms)))
            was_held = hand.wheel.held
            if hand.wheel.hear(said['sent'] / 1e3, said['held'], time.monotonic()):
                if not hand.busy(_operator(drive)):
                    hand.send(_operator(drive), said, True)
            elif was_held or said['held']:
                hand.release(_operator(drive))
        return Reply(True)

    def carry_out(self, command: Command, person: Person, browser: int) -> Reply:
        """Take the wheel or leave it, and tell the audit."""
        key = command.arguments['question']
        hand, listed = self._hands.get(key), self._front_end.find(key)
        if command.name == 'leave_wheel':
            self._leave(key, browser, 'left')
            return Reply(True)
        if hand is None or listed is None:
            reply = Reply(False, NOT_RUNNING)
        else:
            with self._lock:
                now_s = time.monotonic()
                why = hand.wheel.take(Drive(key, browser, person, listed, now_s), now_s)
            reply = Reply(not why, why, None if why else {'wheel': browser})
        self._audit.tell(person, command.name, reply.ok, reply.message, {}, listed)
        return reply

    def leave(self, browser: int) -> None:
        """A page is gone: what it drives stops."""
        for key in list(self._hands):
            self._leave(key, browser, 'the page is gone')

    def _leave(self, key: str, browser: Optional[int], why: str) -> None:
        hand = self._hands.get(key)
        if hand is None:
            return
        with self._lock:
            drive = hand.wheel.drive
            if drive is None or browser not in (None, drive.browser):
                return
            hand.release(_operator(drive))
            told = hand.wheel.leave(time.monotonic())
        self._audit.tell(drive.person, 'leave_wheel', True, why, told, drive.listed)

    def look(self) -> None:
        """Ask the master once: which interfaces are there, which of them move a hand."""
        types = dict(rosgraph.Master(rospy.get_name()).getTopicTypes())
        self._interfaces = [topic[:-len('/result')] for topic, kind in types.items()
                            if kind == SharedAutonomyActionResult._type and topic.endswith('/result')]
        running = {listed.key: action_of(listed) for listed in self._front_end.questions() if listed.goal.interface}
        moving = {key: action for key, action in running.items()
                  if types.get(action + '/state') == TeleopState._type
                  and types.get(action + '/command') == TeleopCommand._type}
        for key in set(self._hands) - set(moving):
            self._leave(key, None, 'the interface has ended')
            self._hands.pop(key).stop()
        self._outputs.follow([listed.goal.robot for listed in self._front_end.questions()])
        for key in set(moving) - set(self._hands):
            self._begin(key, moving[key])

    def _begin(self, key: str, action: str) -> None:
        try:
            self._hands[key] = Hand(action)
        except (AttributeError, TypeError, ValueError) as err:  # what one robot says must not take the others' hands
            rospy.logerr_throttle(10, 'The settings of {} are none of a manipulation interface: {!r}'.format(
                action, err))

    def draw(self) -> None:
        """Bring the sections up to date; let go what silent pages hold."""
        for key, hand in list(self._hands.items()):
            if hand.wheel.drive is not None and hand.wheel.silent(time.monotonic()):
                self._leave(key, None, 'the page has fallen silent')
        self._sections.put('hand', {key: _view(hand) for key, hand in list(self._hands.items())})
        self._sections.put('output', {listed.key: self._outputs.view(listed.goal.query_id)
                                      for listed in self._front_end.questions() if self._known(listed)})

    def _known(self, listed: Listed) -> bool:
        return bool(listed.goal.interface) and self._outputs.view(listed.goal.query_id) is not None


def _operator(drive: Drive) -> str:
    """A name for each page: two pages of one person are two drivers."""
    return '{} ({} {})'.format(drive.person.expert, rospy.get_name(), drive.browser)


def _view(hand: Hand) -> Dict[str, Any]:
    state, drive = hand.state, hand.wheel.drive
    view: Dict[str, Any] = {'frames': sorted(hand.frames(hand.arm)), 'arms': hand.arms, 'boxes': hand.boxes,
                            'wheel': drive.browser if drive else None, 'driver': drive.person.expert if drive else ''}
    if state is not None:
        at, way = state.tool_pose.position, state.achieved.linear
        view['state'] = {
            'arm': state.arm, 'moving': state.moving, 'limit': state.limit[:300], 'refused': state.refused[:300],
            'share': _finite(state.speed), 'speed': _finite(math.sqrt(way.x ** 2 + way.y ** 2 + way.z ** 2)),
            'clearance': _finite(state.clearance), 'gripper': _finite(state.gripper),
            'stalled': state.gripper_stalled, 'at': [_finite(at.x), _finite(at.y), _finite(at.z)]}
    return view


def _finite(value: float) -> Optional[float]:
    return round(value, 3) if math.isfinite(value) else None


def _again(step: Any, period_s: float) -> None:
    while not rospy.is_shutdown():
        try:
            step()
        except (OSError, rosgraph.MasterException, rospy.ROSException) as err:
            rospy.logdebug('The interfaces could not be looked for: %s', err)
        except Exception as err:  # what one robot says must not take the others' hands away
            rospy.logerr_throttle(10, 'A manipulation interface could not be followed: {!r}'.format(err))
        time.sleep(period_s)
