"""The times at which master, query servers and robots were heard last, and the limit for an answer.

The page gets it once a second, with a beat: a page that gets none knows that the console is silent.
"""

import time
from typing import Any, Callable, Dict, List, Mapping, Optional

from ...followed_server import ListedQuestion, ListNews
from ...front_end import FrontEnd
from ..commands.commands import PageCommand
from ..feeds.node_pulse import NodePulse
from ..sensors.robot_clocks import RobotClocks
from ..shapes.robots import HeardView
from ..web.sections import PageSections

BEAT_S = 1.0
SILENT_AFTER_S = 6.0  # the page has the same limit (liveness.js)
OLDEST_SEEN_S = 15.0  # what a page may have seen last when it sends an answer
# commands that end the robot's waiting. Stopping and letting go are never refused
ANSWERING = ('answer', 'hand_over')
GetHeard = Callable[[], Optional[float]]


class LastHeard:
    """One thread calls `write_sections`. Any thread calls the rest."""

    def __init__(
        self,
        front_end: FrontEnd,
        pulse: NodePulse,
        nodes: Callable[[], Mapping[str, Any]],
        master_heard_s: GetHeard,
        clocks: Optional[RobotClocks] = None,
    ) -> None:
        """
        :param nodes: of each robot that is there the nodes that publish it.
        :param master_heard_s: when the master answered last, by the monotonic clock.
        """
        self._front_end = front_end
        self._clocks = clocks
        self._pulse = pulse
        self._nodes = nodes
        self._master_heard_s = master_heard_s
        self._beat_s = -BEAT_S
        self._told: Dict[str, Optional[float]] = {}  # when each server was heard, in the last beat
        self._followed: Dict[str, List[str]] = {}  # nodes by robot

    def write_sections(self, sections: PageSections) -> None:
        """Write the next beat when it is due, or a server that was silent is heard."""
        now_s = time.monotonic()
        if now_s - self._beat_s < BEAT_S and not self._is_heard_again():
            return
        self._beat_s = now_s
        self._follow()
        self._told = {name: _came_s(self._front_end.news(name)) for name in self._front_end.servers}
        heard: HeardView = {
            'beat': round(now_s, 1),
            'master': _age(self._master_heard_s(), now_s),
            'servers': {name: _age(came_s, now_s) for name, came_s in self._told.items()},
            'robots': {
                robot: _age(self._robot_heard_s(robot), now_s) for robot in sorted(self._followed)
            },
        }
        sections.put('heard', heard)

    def _is_heard_again(self) -> bool:
        """A server without questions is silent. With the next one it must not read as silent."""
        for name in self._front_end.servers:
            came_s = _came_s(self._front_end.news(name))
            before_s = self._told.get(name)
            if (
                came_s is not None
                and before_s is not None
                and (self._beat_s - before_s > SILENT_AFTER_S and came_s > before_s)
            ):
                return True
        return False

    def refusal(self, command: PageCommand, listed: ListedQuestion) -> str:
        """Return why a command is not carried out for what is too old, or '' where it may be."""
        if command.name not in ANSWERING:
            return ''
        now_s = time.monotonic()
        return self.robot_refusal(listed.goal.robot, command.arguments.get('seen')) or _silence(
            listed.server, _came_s(self._front_end.news(listed.server)), now_s
        )

    def robot_refusal(self, robot: str, seen: Optional[float]) -> str:
        """Return why nothing is sent to a robot that would have it go on, or '' where it may be.

        :param seen: the newest beat that the page had seen, s. None means it does not say.
        """
        now_s = time.monotonic()
        if seen is not None and now_s - seen > OLDEST_SEEN_S:
            return (
                'This was said of what the page knew {:.0f} s ago: it is not carried out. '
                'Look again, and answer again.'.format(now_s - seen)
            )
        return _silence('The ROS master', self._master_heard_s(), now_s) or _silence(
            robot, self._robot_heard_s(robot), now_s
        )

    def _follow(self) -> None:
        nodes = {robot: sorted(found) for robot, found in self._nodes().items()}
        for listed in self._front_end.questions():
            robot = listed.goal.robot
            if robot.startswith('/'):  # a question may come under any name
                nodes.setdefault(robot, [robot])
            self._take_clock(listed)
        self._followed = nodes
        self._pulse.follow({node for found in nodes.values() for node in found})

    def _take_clock(self, listed: ListedQuestion) -> None:
        """Take the clock of a server that is in the robot's own node."""
        news = self._front_end.news(listed.server)
        robot = listed.goal.robot
        if self._clocks is not None and news is not None and listed.server.startswith(robot + '/'):
            self._clocks.take(robot, news.stamp_s, news.came_s)

    def _robot_heard_s(self, robot: str) -> Optional[float]:
        heard = [self._pulse.heard_s(node) for node in self._followed.get(robot, ())]
        return max((each for each in heard if each is not None), default=None)


def _came_s(news: Optional[ListNews]) -> Optional[float]:
    return news.came_s if news is not None else None


def _age(heard_s: Optional[float], now_s: float) -> Optional[float]:
    return None if heard_s is None else round(max(0.0, now_s - heard_s), 1)


def _silence(name: str, heard_s: Optional[float], now_s: float) -> str:
    if heard_s is None or now_s - heard_s <= SILENT_AFTER_S:
        return ''  # who was never heard is new, or cannot be asked
    return '{} has been silent for {:.0f} s: it was not sent.'.format(name, now_s - heard_s)
