"""Answers to requests for the last seconds before a failure."""

import asyncio
import json
from concurrent.futures import ThreadPoolExecutor
from typing import Callable, Optional

import tornado.web

from ..web.access import ClientRateLimits
from ..web.handlers import PathOnlyHandler
from .images import USUAL_WIDTH, encode_image
from .question_replays import KeptReplay

RATE, BURST = 60.0, 300.0  # images a second of one address


class ReplayRequests:
    """The objects that all requests for replays share."""

    def __init__(self, *finders: Callable[[int], Optional[KeptReplay]]) -> None:
        """`finders`: each gives what one keeps under a number. They must not wait."""
        self.finders = finders
        self.limits = ClientRateLimits(rate=RATE, burst=BURST, for_all=3.0)
        self.workers = ThreadPoolExecutor(1, 'replays')


class _ReplayBase(PathOnlyHandler):
    _shared: ReplayRequests

    def found(self, number: str) -> KeptReplay:
        """Return a replay.

        :raises tornado.web.HTTPError: 404 where it is not kept any more.
        """
        for find in self._shared.finders:
            replay = find(int(number))
            if replay is not None:
                return replay
        raise tornado.web.HTTPError(404)


class ReplayHandler(_ReplayBase):
    """GET /replay/NUMBER: all of a replay but its images, as JSON."""

    def get(self, number: str) -> None:
        """Answer."""
        self.set_header('Content-Type', 'application/json')
        self.finish(json.dumps(self.found(number).view, allow_nan=False))


class ReplayFrameHandler(_ReplayBase):
    """GET /replay/NUMBER/FRAME: an image of a replay. 422 with a text if it cannot be shown."""

    async def get(self, number: str, frame: str) -> None:
        """Answer when it has been encoded again: none of a robot's bytes reaches a browser."""
        images = self.found(number).images
        if int(frame) >= len(images):
            raise tornado.web.HTTPError(404)
        try:
            encoded = await asyncio.get_running_loop().run_in_executor(
                self._shared.workers, encode_image, images[int(frame)], USUAL_WIDTH
            )
        except ValueError as err:
            self.refuse(err)
            return
        self.set_header('Content-Type', encoded.content_type)
        self.finish(encoded.body)
