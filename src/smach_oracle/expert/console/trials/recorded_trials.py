"""One trial of a bag as the page replays it: events, drawings of its machines, what cameras saw. Read in a worker."""
import json
import threading
import time
from collections import Counter, OrderedDict
from typing import Any, Dict, List, Sequence, Tuple

import rospy
from sensor_msgs.msg import CompressedImage

from ...oracle.events import Event, EventKind
from .bags import BagShelf, NotRead
from .graph import Edge, Structure, dot_text, drawing, make_structure
from .layout import Layouter
from .robot import guess
from .stills import StillFiles, kept_frames, still_view
from .views import event_view

MOST_EVENTS = 20000  # of a trial: the first ones
LAYOUT_WAIT_S = 8.0
REMEMBERED = 4
MOST_BYTES = 20000000  # of what is sent
MOST_TEXT = 4000000  # of all events' texts, in characters


class RecordedTrials:
    """Reads trials of bags; the last few are remembered. Any thread."""

    def __init__(self, shelf: BagShelf, layouter: Layouter, files: StillFiles) -> None:
        self._shelf = shelf
        self._layouter = layouter
        self._files = files
        self._lock = threading.Lock()
        self._known: 'OrderedDict[Tuple[int, Tuple[str, ...]], str]' = OrderedDict()

    def text(self, number: int) -> str:
        """The trial of that number as JSON: `events`, `graphs` by path, `stills` by query id.

        :raises NotRead: where it cannot be had.
        """
        with self._lock:  # one at a time: reading takes memory
            trial, events = self._shelf.events(number)
            key = (number, trial.summary.bags)
            if key not in self._known:
                text = json.dumps(self._made(trial.summary.bags, _shortened(events[:MOST_EVENTS])), allow_nan=False)
                if len(text) > MOST_BYTES:
                    raise NotRead('The trial is too large to be shown: {:.0f} MB.'.format(len(text) / 1e6))
                self._known[key] = text
                while len(self._known) > REMEMBERED:
                    self._known.popitem(last=False)
            return self._known[key]

    def _made(self, bags: Sequence[str], events: List[Event]) -> Dict[str, Any]:
        containers, stills = self._machines(bags, {event.query_id for event in events if event.query_id})
        structures = {path: containers.get(path) or guess_of(path, events)
                      for path in sorted({event.path for event in events if event.path})[:200]}
        return {'events': [event_view(event) for event in events], 'graphs': self._drawn(structures), 'stills': stills}

    def _machines(self, bags: Sequence[str],
                  questions: Any) -> Tuple[Dict[str, Structure], Dict[str, List[Dict[str, Any]]]]:
        from ...analysis.bag_machines import read_machines  # it needs rosbags
        containers: Dict[str, Structure] = {}
        stills: Dict[str, List[Dict[str, Any]]] = {}
        for bag in bags:
            try:
                found = read_machines(bag)
            except Exception as err:  # a damaged file can make rosbags raise anything; the events are there
                rospy.logwarn('The machines in %s cannot be read: %r', bag, err)
                continue
            for path, told in found.containers.items():
                containers[path] = make_structure(path, told.children, [Edge(*edge) for edge in told.edges],
                                                  told.outcomes)
            for frame in found.frames:
                if frame.query_id in questions:
                    image = CompressedImage(format=frame.format, data=frame.data)
                    stills.setdefault(frame.query_id, []).extend(
                        still_view(still) for still in kept_frames(self._files, [frame.topic], [image]))
        return containers, stills

    def _drawn(self, structures: Dict[str, Structure]) -> Dict[str, Any]:
        """Drawings, waiting a little for dot."""
        found = {}
        until_s = time.monotonic() + LAYOUT_WAIT_S
        for path, structure in structures.items():
            layout = self._layouter.wait(dot_text(structure), max(0.0, until_s - time.monotonic()))
            nested = [label for label in structure.states if '{}/{}'.format(path, label) in structures]
            found[path] = drawing(structure, layout, nested)
        return found


def _shortened(events: Sequence[Event]) -> List[Event]:
    """With the ends of long texts, the longer the fewer events there are."""
    longest = max(200, MOST_TEXT // max(1, len(events)))
    return [event if len(event.text) <= longest else event._replace(text='…' + event.text[-longest:])
            for event in events]


def guess_of(path: str, events: Sequence[Event]) -> Structure:
    """A container as the transitions taken tell of it, where the bag has no structure."""
    taken: 'Counter[Tuple[str, str, str]]' = Counter()
    labels: Dict[str, None] = {}
    for event in events:
        if event.path == path and event.kind == EventKind.STATE_START:
            labels[event.state] = None
        elif event.path == path and event.kind == EventKind.TRANSITION:
            taken[(event.state, event.outcome, event.target)] += 1
    return guess(path, list(labels), [[*edge, times, 0.0] for edge, times in taken.items()])
