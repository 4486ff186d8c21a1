"""Answers to requests for the past: a trial of a bag, an image of a question."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

import tornado.web

from ..sensors.question_images import ImageStore
from ..web.access import ClientRateLimits
from ..web.handlers import PathOnlyHandler
from .bag_catalogue import RecordedTrialError
from .recorded_trials import RecordedTrials


class HistoryRequests:
    """The objects that all requests for the past share."""

    def __init__(self, recorded: RecordedTrials, files: ImageStore) -> None:
        self.recorded = recorded
        self.files = files
        self.limits = ClientRateLimits(rate=10.0, burst=60.0, for_all=5.0)
        self.workers = ThreadPoolExecutor(1, 'bags')


class _HistoryHandler(PathOnlyHandler):
    _shared: HistoryRequests


class RecordedHandler(_HistoryHandler):
    """GET /recorded/NUMBER: a trial of a bag as JSON. 422 with a text if unreadable."""

    async def get(self, number: str) -> None:
        """Answer when it has been read."""
        try:
            text = await asyncio.get_running_loop().run_in_executor(
                self._shared.workers, self._shared.recorded.text, int(number)
            )
        except RecordedTrialError as err:
            self.refuse(err)
            return
        self.set_header('Content-Type', 'application/json')
        self.finish(text)


class QuestionImageHandler(_HistoryHandler):
    """GET /image/NUMBER: a camera image of a question. 404 where it is not kept any more."""

    def get(self, number: str) -> None:
        """Answer."""
        found = self._shared.files.find(int(number))
        if found is None:
            raise tornado.web.HTTPError(404)
        self.set_header('Content-Type', found.content_type)
        self.finish(found.body)
