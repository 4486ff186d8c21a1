"""One trial of a bag as the page replays it: events, graphs of its machines, camera images."""

import json
import threading
import time
from collections import OrderedDict
from typing import Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

from sensor_msgs.msg import CompressedImage

from smach_oracle.analysis.bag_machines import FailureImage
from smach_oracle.analysis.graphs.container_graph import ContainerGraph, drawing
from smach_oracle.analysis.graphs.drawn_graph import GraphView
from smach_oracle.analysis.graphs.recorded import graph_from_events, recorded_graphs
from smach_oracle.ros.log.said_once import warn_once

from ..feeds.views import event_view
from ..graphs.layout_worker import LayoutWorker
from ..sensors.question_images import ImageStore, image_view, stored_images
from ..sensors.question_replays import KeptReplay, next_number
from ..sensors.recorded_replays import recorded_replays
from ..shapes.basics import ByPath
from ..shapes.questions import KeptImageView
from ..shapes.trials import RecordedTrialView
from .bag_catalogue import BagCatalogue, BagTrial, RecordedTrialError

MOST_EVENTS = 20000  # of a trial: the first ones
LAYOUT_WAIT_S = 8.0
REMEMBERED = 4
MOST_BYTES = 20000000  # of what is sent
ImagesByQuestion = Dict[str, List[KeptImageView]]


class _Remembered(NamedTuple):
    """A trial that was opened."""

    text: str
    replays: Dict[int, KeptReplay]  # by number


class RecordedTrials:
    """Reads trials of bags. The last few are remembered. Any thread may use it."""

    def __init__(self, catalogue: BagCatalogue, layouts: LayoutWorker, files: ImageStore) -> None:
        self._catalogue = catalogue
        self._layouts = layouts
        self._files = files
        self._lock = threading.Lock()
        self._known: 'OrderedDict[Tuple[int, Tuple[str, ...]], _Remembered]' = OrderedDict()
        self._replays: Dict[int, KeptReplay] = {}  # of all that are remembered

    def text(self, number: int) -> str:
        """The trial of that number as JSON: RecordedTrialView.

        :raises RecordedTrialError: where it cannot be had.
        """
        with self._lock:  # one at a time: reading takes memory
            trial = self._catalogue.find(number)
            key = (number, trial.summary.bags)
            if key not in self._known:
                content, replays = self._content(trial)
                text = json.dumps(content, allow_nan=False)
                if len(text) > MOST_BYTES:
                    raise RecordedTrialError(
                        'The trial is too large to be shown: {:.0f} MB.'.format(len(text) / 1e6)
                    )
                self._known[key] = _Remembered(text, replays)
                while len(self._known) > REMEMBERED:
                    self._known.popitem(last=False)
                self._replays = {
                    replay: kept
                    for each in self._known.values()
                    for replay, kept in each.replays.items()
                }
            return self._known[key].text

    def find_replay(self, replay: int) -> Optional[KeptReplay]:
        """Return a replay of a trial that is remembered. It waits for nothing that is read."""
        return self._replays.get(replay)

    def _content(self, trial: BagTrial) -> Tuple[RecordedTrialView, Dict[int, KeptReplay]]:
        read = self._catalogue.replayed(trial, MOST_EVENTS)
        if read.problem:
            warn_once('Machines in {} cannot be read: {}'.format(trial.summary.bags, read.problem))
        containers, events = recorded_graphs(read.machines), read.events
        structures = {
            path: containers.get(path) or graph_from_events(path, events)
            for path in sorted({event.path for event in events if event.path})[:200]
        }
        by_failure = recorded_replays(read.machines.replays)
        numbers = {seq: next_number() for seq in by_failure}
        view: RecordedTrialView = {
            'events': [event_view(event) for event in events],
            'graphs': self._graphs(structures),
            'images': self._images(
                read.machines.frames, {event.query_id for event in events if event.query_id}
            ),
            'replays': {str(seq): replay for seq, replay in numbers.items()},
        }
        return view, {numbers[seq]: kept for seq, kept in by_failure.items()}

    def _images(self, frames: Sequence[FailureImage], questions: Set[str]) -> ImagesByQuestion:
        """Images by query id."""
        images: ImagesByQuestion = {}
        for frame in frames:
            if frame.query_id in questions:
                image = CompressedImage(format=frame.format, data=frame.data)
                images.setdefault(frame.query_id, []).extend(
                    image_view(each) for each in stored_images(self._files, [frame.topic], [image])
                )
        return images

    def _graphs(self, structures: Dict[str, ContainerGraph]) -> ByPath[GraphView]:
        """Drawings of the containers, after waiting a little for dot."""
        found = {}
        until_s = time.monotonic() + LAYOUT_WAIT_S
        for path, structure in structures.items():
            layout = self._layouts.wait(structure, max(0.0, until_s - time.monotonic()))
            nested = [
                label for label in structure.states if '{}/{}'.format(path, label) in structures
            ]
            found[path] = drawing(structure, layout, nested)
        return found
