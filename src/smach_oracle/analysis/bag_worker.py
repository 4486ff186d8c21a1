"""Reads bags for another process, in one of its own: within limits on memory and time.

A bag may come from anywhere: a small one can unpack to gigabytes, or keep its reader busy for good.
The request comes on standard input, the reply goes to standard output, both as JSON.
"""

import base64
import json
import math
import os
import resource
import sys
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import NOT_COUNTED, told_in_words
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.oracle.settings.failure_rule import FORMER_RULE, RULE, rule_in

from .bag_events import BagError, EventReader
from .bag_machines import (
    FailureImage,
    RecordedContainer,
    RecordedMachines,
    RecordedReplay,
    ReplayImage,
    ReplayJoints,
    read_machines,
)
from .counting.trial_summary import TrialSummary, summarise
from .trial_counter import TrialEnding

MOST_TEXT = 4000000  # of all events' texts, in characters
MOST_IMAGES = 24000000  # bytes, of all failure images of a trial
MOST_REPLAYED = 20000000  # bytes, of all images of its replays
MOST_TRIALS = 1000  # of a bag
NICENESS = 10
_KINDS = {int(kind): kind for kind in EventKind}


class BagRequest(NamedTuple):
    """A request to read bags, within limits."""

    paths: List[str]  # they are read as one
    trials: List[str]  # ids. Empty means every trial
    shown_events: int = 0  # of the one trial that is to be replayed. 0 means summaries alone
    most_events: int = 200000  # of a bag
    memory_bytes: int = 2**29  # beyond what the process has when it begins
    cpu_s: int = 60
    reply_bytes: int = 10**6


class ReadTrial(NamedTuple):
    """One trial as a bag tells it."""

    node: str  # whose it is
    summary: TrialSummary  # without bags


class BagReply(NamedTuple):
    """The content that was read."""

    trials: List[ReadTrial]
    events: List[Event]  # of the trial that is to be replayed, without what the page does not show
    machines: RecordedMachines
    problem: str  # why there are no machines


class BagReadError(BagError):
    """A bag cannot be used.

    `position` is that of its path in the request, -1 where it is not known.
    """

    def __init__(self, text: str, position: int = -1) -> None:
        super().__init__(text)
        self.position = position


def reply_of(text: bytes) -> BagReply:
    """Return the reply of a worker.

    :raises BagReadError: where the worker says that it could not read a bag.
    :raises ValueError: for what is no reply.
    """
    data = json.loads(text)
    if 'error' in data:
        raise BagReadError(data['error'], data['position'])
    containers = {
        path: RecordedContainer(
            tuple(children), tuple((a, b, c) for a, b, c in edges), tuple(outcomes)
        )
        for path, (children, edges, outcomes) in data['containers'].items()
    }
    frames = [
        FailureImage(query_id, topic, image_format, base64.b64decode(image))
        for query_id, topic, image_format, image in data['frames']
    ]
    return BagReply(
        [ReadTrial(node, _summary(fields)) for node, fields in data['trials']],
        [Event(_KINDS.get(kind, kind), *others) for kind, *others in data['events']],
        RecordedMachines(containers, frames, [_replay(*fields) for fields in data['replays']]),
        data['problem'],
    )


def _replay(
    trial_id: str, seq: int, at_s: float, seconds: float, images: List[Any], joints: List[Any]
) -> RecordedReplay:
    return RecordedReplay(
        trial_id,
        seq,
        at_s,
        seconds,
        [
            ReplayImage(topic, came_s, image_format, base64.b64decode(data))
            for topic, came_s, image_format, data in images
        ],
        [ReplayJoints(*fields) for fields in joints],
    )


def _summary(fields: Dict[str, Any]) -> TrialSummary:
    return TrialSummary(
        **dict(
            fields,
            ending=TrialEnding(fields['ending']),
            bags=(),
            failures_by_state=tuple((name, count) for name, count in fields['failures_by_state']),
            settings=tuple((name, value) for name, value in fields['settings']),
            origin=tuple((name, value) for name, value in fields['origin']),
            inputs=tuple((name, value) for name, value in fields['inputs']),
            rule=rule_in({RULE: fields['rule']}) or FORMER_RULE,
        )
    )


def read(request: BagRequest) -> Dict[str, Any]:
    """Return the reply to a request, as plain data.

    :raises BagReadError: where a bag cannot be used.
    """
    by_trial: Dict[str, Dict[int, Event]] = {}
    nodes: Dict[str, str] = {}
    reader = EventReader(request.most_events)
    for position, path in enumerate(request.paths):
        try:
            content = reader.read(path)
        except BagError as err:
            if isinstance(err.__cause__, MemoryError):
                raise err.__cause__ from None
            raise BagReadError(str(err), position) from err
        for event in content.events:
            if not request.trials or event.trial_id in request.trials:
                by_trial.setdefault(event.trial_id, {})[event.seq] = event
        nodes.update(content.nodes)
    if len(by_trial) > MOST_TRIALS:
        raise BagReadError('it has more than {} trials'.format(MOST_TRIALS))
    reply = {
        'trials': [
            [nodes.get(trial_id, ''), _fields(list(events.values()))]
            for trial_id, events in by_trial.items()
        ],
        'events': [],
        'containers': {},
        'frames': [],
        'replays': [],
        'problem': '',
    }
    if request.shown_events:
        reply.update(_replayed(request, by_trial))
    return reply


def _fields(events: Sequence[Event]) -> Dict[str, Any]:
    if not all(math.isfinite(event.wall_time) for event in events):
        raise BagReadError('damaged, or no bag: an event has no time')
    summary = summarise(events)
    fields = dict(summary._asdict(), ending=summary.ending.value, rule=summary.rule.as_data())
    for of_bags in ('bags', 'cause', 'truth'):
        del fields[of_bags]
    return fields


def _replayed(request: BagRequest, by_trial: Dict[str, Dict[int, Event]]) -> Dict[str, Any]:
    by_number = by_trial.get(request.trials[0], {})
    events = [by_number[seq] for seq in sorted(by_number)][: request.shown_events]
    machines, problem = _machines(request.paths)
    return {
        'events': [_event(event) for event in _shortened(events)],
        'problem': problem,
        'containers': machines.containers,
        'frames': [
            [*image[:3], base64.b64encode(image.data).decode()]
            for image in _bounded(machines.frames)
        ],
        'replays': list(_replays(machines.replays, request.trials[0])),
    }


def _replays(replays: Sequence[RecordedReplay], trial_id: str) -> Iterator[List[Any]]:
    """The replays of a trial, of all images the first ones."""
    size = 0
    for replay in replays:
        if replay.trial_id != trial_id:
            continue
        images = []
        for image in replay.images:
            size += len(image.data)
            if size <= MOST_REPLAYED:
                images.append([*image[:-1], base64.b64encode(image.data).decode()])
        yield [*replay[:4], images, replay.joints]


def _event(event: Event) -> List[Any]:
    counted = not (event.data and event.data.get(NOT_COUNTED))
    kept = dict(told_in_words(event.data), **({} if counted else {NOT_COUNTED: True}))
    return [int(event.kind), *event[1:-1], kept or None]


def _shortened(events: Sequence[Event]) -> List[Event]:
    """Return the events, with long texts cut in the middle. Fewer events keep longer texts."""
    longest = max(200, MOST_TEXT // max(1, len(events)))
    return [
        event if len(event.text) <= longest else event._replace(text=shortened(event.text, longest))
        for event in events
    ]


def _machines(paths: Sequence[str]) -> Tuple[RecordedMachines, str]:
    """The machines of some bags, and why those of one cannot be read."""
    found = RecordedMachines({}, [], [])
    problem = ''
    for path in paths:
        try:
            machines = read_machines(path)
        except Exception as err:
            # a damaged file can make rosbags raise anything. The events are there
            problem = shortened('{!r}'.format(err), 300)
            continue
        found.containers.update(machines.containers)
        found.frames.extend(machines.frames)
        found.replays.extend(machines.replays)
    return found, problem


def _bounded(frames: Sequence[FailureImage]) -> List[FailureImage]:
    kept, size = [], 0
    for frame in frames:
        size += len(frame.data)
        if size <= MOST_IMAGES:
            kept.append(frame)
    return kept


def _limit(request: BagRequest) -> None:
    """Hold this process to the limits. A call that needs more memory raises MemoryError."""
    with open('/proc/self/statm', encoding='ascii') as status:
        present = int(status.read().split()[0]) * resource.getpagesize()
    memory = present + request.memory_bytes
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    # SIGXCPU ends it at the first of the two, SIGKILL at the second
    resource.setrlimit(resource.RLIMIT_CPU, (request.cpu_s, request.cpu_s + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    os.nice(NICENESS)


def _reply(request: BagRequest) -> str:
    """The text of the reply, also where a bag cannot be read."""
    try:
        text = json.dumps(read(request))
        if len(text) > request.reply_bytes:
            raise BagReadError(
                'its trials have more than {:.0f} MB'.format(request.reply_bytes / 1e6)
            )
        return text
    except BagReadError as err:
        return _refusal(str(err), err.position)
    except MemoryError:
        return _refusal(
            'damaged, or too large: it takes more than {:.0f} MiB of memory'.format(
                request.memory_bytes / 2**20
            )
        )
    except Exception as err:  # a damaged file can make rosbags raise anything
        return _refusal('damaged, or no bag: {!r}'.format(err))


def _refusal(text: str, position: Optional[int] = -1) -> str:
    return json.dumps({'error': shortened(text, 1000), 'position': position})


def main() -> None:
    """Answer the one request on standard input."""
    request = BagRequest(*json.load(sys.stdin))
    _limit(request)
    sys.stdout.write(_reply(request))


if __name__ == '__main__':
    main()
