"""The newest frame of a sensor, to a page that asks for it: it asks again when it has shown the last, so that a slow
link or a slow machine gets fewer frames, never older ones."""
import asyncio
import itertools
import json
import re
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from typing import Optional, Tuple

import tornado.web

from .access import Buckets
from .handlers import ForPages
from .images import WIDTHS
from .robot_sensor import RobotSensor
from .sensors import Frame, Sensor, Sensors

WAIT_S = 5.0
POLL_S = 0.02
MOST_WAITING = 64
MOST_WAITING_EACH = 16  # of one address
_NUMBER = re.compile('[0-9]{1,15}')
RATE, BURST = 100.0, 200.0  # frames a second of one address


class FrameRoom:
    """What all requests for frames share."""

    def __init__(self, sensors: Sensors) -> None:
        self.sensors = sensors
        self.limits = Buckets(rate=RATE, burst=BURST, for_all=3.0)
        self.waiting: 'Counter[str]' = Counter()
        self.workers = ThreadPoolExecutor(3, 'encode')


class SensorHandler(ForPages):
    """What both have in common that are asked about sensors."""

    _room: FrameRoom
    _gone = False

    def on_connection_close(self) -> None:
        """The page asks for it no longer."""
        self._gone = True

    def sensor(self, number: str) -> Sensor:
        """By its number. Raises HTTPError 404 where there is none."""
        found = self._room.sensors.find(int(number))
        if found is None:
            raise tornado.web.HTTPError(404)
        return found

    def robot(self, number: str) -> RobotSensor:
        """A sensor that is a robot, by its number. Raises HTTPError 404 where there is none."""
        found = self.sensor(number)
        if not isinstance(found, RobotSensor):
            raise tornado.web.HTTPError(404)
        return found


class ModelHandler(SensorHandler):
    """GET /model/NUMBER: what a robot looks like, as RobotModel.encoded has it; 422 with a text where that fails."""

    async def get(self, number: str) -> None:
        """Answer when it has been read."""
        robot = self.robot(number)
        try:
            encoded = await asyncio.get_running_loop().run_in_executor(
                self._room.workers, lambda: robot.model().encoded())
        except ValueError as err:
            self.tell_why(err)
            return
        self.set_header('Content-Type', encoded.content_type)
        self.finish(encoded.body)


class FrameHandler(SensorHandler):
    """GET /frame/NUMBER?after=SEQUENCE&width=PIXELS: another frame than the one of that sequence number (0: any).

    With `robot=NUMBER` its facts tell the `place` of its coordinates at that robot, 12 numbers of (3, 4), or `astray`,
    why that is not known. 204 where none came within 5 s, 404 for no such sensor, 422 with a text for a message that
    cannot be shown.
    """

    async def get(self, number: str) -> None:
        """Answer as soon as there is another frame."""
        after, width, robot = self._arguments()
        sensor = self.sensor(number)
        beside = self.robot(robot) if robot else None
        frame = await self._wait(sensor, after)
        if frame is None:
            self.set_status(204)
            return
        try:
            encoded, facts = await asyncio.get_running_loop().run_in_executor(
                self._room.workers, sensor.file_of, frame, width)
        except ValueError as err:
            self.set_header('X-Sequence', str(frame.sequence))
            self.tell_why(err)
            return
        if beside is not None and facts:
            facts = _with_place(facts, beside, frame)
        self.set_header('Content-Type', encoded.content_type)
        if facts:
            self.set_header('X-Facts', facts)
        self.finish(encoded.body)

    async def _wait(self, sensor: Sensor, after: int) -> Optional[Frame]:
        client, waiting = self.request.remote_ip or '', self._room.waiting
        if waiting[client] >= MOST_WAITING_EACH or sum(waiting.values()) >= MOST_WAITING:
            raise tornado.web.HTTPError(503)
        waiting[client] += 1
        try:
            for _ in itertools.repeat(None, int(WAIT_S / POLL_S)):
                frame = sensor.newer(after)
                if frame is not None or self._gone:
                    return frame
                await asyncio.sleep(POLL_S)
            return None
        finally:
            waiting[client] -= 1
            if not waiting[client]:
                del waiting[client]

    def _arguments(self) -> Tuple[int, int, str]:
        given = {name: self.get_query_arguments(name) for name in self.request.query_arguments}
        after, width = given.pop('after', ['0']), given.pop('width', [str(WIDTHS[1])])
        robot = given.pop('robot', [''])
        if given or not len(after) == len(width) == len(robot) == 1 or width[0] not in map(str, WIDTHS) \
                or not _NUMBER.fullmatch(after[0]) or not _NUMBER.fullmatch(robot[0] or '0'):
            raise tornado.web.HTTPError(400)
        return int(after[0]), int(width[0]), robot[0]


def _with_place(facts: str, robot: RobotSensor, frame: Frame) -> str:
    """Facts, with where it lies at the robot."""
    header = frame.message.header
    robot.newer(0)
    place, astray = robot.place_of(header.frame_id, header.stamp)
    found = {'astray': astray} if place is None else {'place': [round(float(each), 6) for each in place.ravel()]}
    return json.dumps(dict(json.loads(facts), **found), allow_nan=False)
