"""The newest sample of a sensor, for a page that asks for it.

The page asks again when it has shown the last one, so that a slow link or a slow machine gets fewer
samples, never older ones.
"""

import asyncio
import itertools
import json
import re
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Counter, Dict, Optional, Tuple

import tornado.web

from ..web.access import ClientRateLimits
from ..web.handlers import SignedInHandler
from .images import USUAL_WIDTH, WIDTHS
from .robot_clocks import ImageAges
from .robot_stream import RobotStream
from .sensor_streams import SensorSample, SensorStream, SensorStreams

WAIT_S = 5.0
POLL_S = 0.02
MOST_WAITING = 64
MOST_WAITING_EACH = 16  # of one address
_NUMBER = re.compile('[0-9]{1,15}')
RATE, BURST = 100.0, 200.0  # samples a second of one address


class SensorRequests:
    """The objects that all requests for samples share."""

    def __init__(self, sensors: SensorStreams, ages: Optional[ImageAges] = None) -> None:
        self.sensors = sensors
        self.ages = ages
        self.limits = ClientRateLimits(rate=RATE, burst=BURST, for_all=3.0)
        self.waiting: Counter[str] = Counter()
        self.workers = ThreadPoolExecutor(3, 'encode')


class SensorHandler(SignedInHandler):
    """The base of handlers that are asked about sensors."""

    _shared: SensorRequests
    _gone = False

    def on_connection_close(self) -> None:
        """The page asks for it no longer."""
        self._gone = True

    def sensor(self, number: str) -> SensorStream:
        """Return a sensor by its number.

        :raises tornado.web.HTTPError: 404 where there is none.
        """
        found = self._shared.sensors.find(int(number))
        if found is None:
            raise tornado.web.HTTPError(404)
        return found

    def robot(self, number: str) -> RobotStream:
        """Return a sensor that is a robot, by its number.

        :raises tornado.web.HTTPError: 404 where there is none.
        """
        found = self.sensor(number)
        if not isinstance(found, RobotStream):
            raise tornado.web.HTTPError(404)
        return found


class RobotAppearanceHandler(SensorHandler):
    """GET /model/NUMBER: a robot as of RobotAppearance.encoded. 422 with a text if that fails."""

    async def get(self, number: str) -> None:
        """Answer when it has been read."""
        robot = self.robot(number)
        try:
            encoded = await asyncio.get_running_loop().run_in_executor(
                self._shared.workers, lambda: robot.appearance().encoded()
            )
        except ValueError as err:
            self.refuse(err)
            return
        self.set_header('Content-Type', encoded.content_type)
        self.finish(encoded.body)


class SampleHandler(SensorHandler):
    """GET /sample/NUMBER?after=SEQUENCE&width=PIXELS: a sample other than SEQUENCE (0: any).

    Its facts have its `age`, s by the robot's clock, where that is known.
    With `robot=NUMBER` its facts have `place`, the pose of its tf frame at that robot, 12 numbers
    of (3, 4), or `astray`, why that is not known. 204 where none came within 5 s, 404 for no such
    sensor, 422 with a text for a message that cannot be shown.
    """

    async def get(self, number: str) -> None:
        """Answer as soon as there is another sample."""
        after, width, robot = self._arguments()
        sensor = self.sensor(number)
        beside = self.robot(robot) if robot else None
        sample = await self._wait(sensor, after)
        if sample is None:
            self.set_status(204)
            return
        try:
            encoded, facts = await asyncio.get_running_loop().run_in_executor(
                self._shared.workers, sensor.file_of, sample, width
            )
        except ValueError as err:
            self.set_header('X-Sequence', str(sample.sequence))
            self.refuse(err)
            return
        if beside is not None and facts:
            facts = _with_place(facts, beside, sample)
        if facts and self._shared.ages is not None:
            facts = _with_age(facts, self._shared.ages, sensor.topic, sample)
        self.set_header('Content-Type', encoded.content_type)
        if facts:
            self.set_header('X-Facts', facts)
        self.finish(encoded.body)

    async def _wait(self, sensor: SensorStream, after: int) -> Optional[SensorSample]:
        client, waiting = self.request.remote_ip or '', self._shared.waiting
        if waiting[client] >= MOST_WAITING_EACH or sum(waiting.values()) >= MOST_WAITING:
            raise tornado.web.HTTPError(503)
        waiting[client] += 1
        try:
            for _ in itertools.repeat(None, int(WAIT_S / POLL_S)):
                sample = sensor.newer(after)
                if sample is not None or self._gone:
                    return sample
                await asyncio.sleep(POLL_S)
            return None
        finally:
            waiting[client] -= 1
            if not waiting[client]:
                del waiting[client]

    def _arguments(self) -> Tuple[int, int, str]:
        given = {name: self.get_query_arguments(name) for name in self.request.query_arguments}
        after, width = given.pop('after', ['0']), given.pop('width', [str(USUAL_WIDTH)])
        robot = given.pop('robot', [''])
        if (
            given
            or not len(after) == len(width) == len(robot) == 1
            or width[0] not in map(str, WIDTHS)
            or not _NUMBER.fullmatch(after[0])
            or not _NUMBER.fullmatch(robot[0] or '0')
        ):
            raise tornado.web.HTTPError(400)
        return int(after[0]), int(width[0]), robot[0]


def _with_age(facts: str, ages: ImageAges, topic: str, sample: SensorSample) -> str:
    age_s = ages.age_s(topic, sample.message.header.stamp.to_sec())
    return json.dumps(dict(json.loads(facts), age=age_s), allow_nan=False)


def _with_place(facts: str, robot: RobotStream, sample: SensorSample) -> str:
    """The facts of a sample, with the pose of its tf frame at a robot."""
    header = sample.message.header
    robot.newer(0)
    place, astray = robot.place_of(header.frame_id, header.stamp)
    placed: Dict[str, Any] = dict(json.loads(facts))
    if place is None:
        placed['astray'] = astray
    else:
        placed['place'] = [round(float(each), 6) for each in place.ravel()]
    return json.dumps(placed, allow_nan=False)
