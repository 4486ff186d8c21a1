"""The newest frame of a sensor, to a page that asks for it: it asks again when it has shown the last, so that a slow
link or a slow machine gets fewer frames, never older ones."""
import asyncio
import itertools
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Optional, Tuple

import tornado.web

from .access import Buckets
from .handlers import Gate, Guarded
from .images import WIDTHS
from .sensors import Frame, Sensor, Sensors

WAIT_S = 5.0
POLL_S = 0.02
MOST_WAITING = 48
MOST_WAITING_EACH = 8  # of one address
RATE, BURST = 60.0, 150.0  # frames a second of one address


class FrameRoom:
    """What all requests for frames share."""

    def __init__(self, sensors: Sensors) -> None:
        self.sensors = sensors
        self.limits = Buckets(rate=RATE, burst=BURST, for_all=3.0)
        self.waiting: 'Counter[str]' = Counter()
        self.workers = ThreadPoolExecutor(2, 'encode')


class FrameHandler(Guarded):
    """GET /frame/NUMBER?after=SEQUENCE&width=PIXELS: another frame than the one of that sequence number (0: any).

    204 where none came within 5 s, 404 for no such sensor, 422 with a text for a message that cannot be shown.
    """

    def initialize(self, gate: Gate, room: FrameRoom, **_: Any) -> None:  # type: ignore[override]
        """Called by Tornado."""
        super().initialize(gate)
        self._room = room
        self._gone = False

    def prepare(self) -> None:
        """The gate, with limits of its own; then who it is, and that a page of ours asks."""
        status = self.gate.refusal(self, self._room.limits)
        if status:
            raise tornado.web.HTTPError(status)
        session = self.gate.session(self)
        if self.gate.identity(session) is None:
            raise tornado.web.HTTPError(401)
        self.demand_xsrf(session)

    def on_connection_close(self) -> None:
        """The page asks for it no longer."""
        self._gone = True

    async def get(self, number: str) -> None:
        """Answer as soon as there is another frame."""
        after, width = self._arguments()
        sensor = self._room.sensors.find(int(number))
        if sensor is None:
            raise tornado.web.HTTPError(404)
        frame = await self._wait(sensor, after)
        self.set_header('Cache-Control', 'no-store')
        if frame is None:
            self.set_status(204)
            return
        try:
            encoded, facts = await asyncio.get_running_loop().run_in_executor(
                self._room.workers, sensor.file_of, frame, width)
        except ValueError as err:
            self.set_status(422)
            self.set_header('Content-Type', 'text/plain; charset=utf-8')
            self.set_header('X-Sequence', str(frame.sequence))
            self.finish(str(err)[:500])
            return
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

    def _arguments(self) -> Tuple[int, int]:
        given = {name: self.get_query_arguments(name) for name in self.request.query_arguments}
        after, width = given.pop('after', ['0']), given.pop('width', [str(WIDTHS[1])])
        if given or len(after) != 1 or len(width) != 1 or not (after[0].isascii() and after[0].isdigit()) \
                or len(after[0]) > 15 or width[0] not in map(str, WIDTHS):
            raise tornado.web.HTTPError(400)
        return int(after[0]), int(width[0])
