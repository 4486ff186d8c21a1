"""What the web server answers of the past: a trial of a bag, and what a camera saw."""
import asyncio
from concurrent.futures import ThreadPoolExecutor

import tornado.web

from .access import Buckets
from .bags import NotRead
from .handlers import ForPages
from .recorded import RecordedTrials
from .stills import StillFiles


class HistoryRoom:
    """What all requests for the past share."""

    def __init__(self, recorded: RecordedTrials, files: StillFiles) -> None:
        self.recorded = recorded
        self.files = files
        self.limits = Buckets(rate=10.0, burst=60.0, for_all=5.0)
        self.workers = ThreadPoolExecutor(1, 'bags')


class _HistoryHandler(ForPages):
    """Has no arguments but the number."""

    _room: HistoryRoom

    def prepare(self) -> None:
        """The gate, who it is, and nothing besides."""
        super().prepare()
        if self.request.query_arguments:
            raise tornado.web.HTTPError(400)


class RecordedHandler(_HistoryHandler):
    """GET /recorded/NUMBER: a trial of a bag, as RecordedTrials tells it; 422 with a text where it cannot be read."""

    async def get(self, number: str) -> None:
        """Answer when it has been read."""
        try:
            text = await asyncio.get_running_loop().run_in_executor(
                self._room.workers, self._room.recorded.text, int(number))
        except NotRead as err:
            self.tell_why(err)
            return
        self.set_header('Content-Type', 'application/json')
        self.finish(text)


class StillHandler(_HistoryHandler):
    """GET /still/NUMBER: what a camera saw when a question was put; 404 where it is not kept any more."""

    def get(self, number: str) -> None:
        """Answer."""
        found = self._room.files.find(int(number))
        if found is None:
            raise tornado.web.HTTPError(404)
        self.set_header('Content-Type', found.content_type)
        self.finish(found.body)
