"""Decodes events where they stand in a chunk, each part of them once.

An event differs from those of other trials in its first fields: number, times, trial. What follows,
from its path on, is the same bytes in each trial of a machine. It is decoded once, and remembered
by its bytes. It is for speed: a struct for each string of each event took a third of the time in
which bags were counted.
"""

import json
import struct
from operator import itemgetter
from typing import Any, Dict, Iterator, Mapping, Optional, Sequence, Tuple

from smach_oracle.oracle.records.events import Event, EventKind

from .decoding import PLAIN_CODES, STAMP_NS, STAMP_S, STRING, Field, FieldsDecoder, fields_of
from .indexed_bag import NotPlain

_NUMBERS = (STAMP_S, STAMP_NS, 'kind', 'seq', 'wall_time')  # of each event its own
_TRIAL = 'trial_id'
_REST = Event._fields[4:]
_MOST_REMEMBERED = 1000  # ends of events
_LONGEST_REMEMBERED = 4000  # bytes
_KINDS: Mapping[int, EventKind] = {int(kind): kind for kind in EventKind}
_NS = 1e9
_new_tuple = tuple.__new__

StampedEvent = Tuple[float, Event]  # ROS time in s, 0 where there was none


def event_of(
    second: int, rest: int, kind: int, trial_id: str, seq: int, wall_time: float, *more: Any
) -> StampedEvent:
    """Return an event with its stamp. `more`: its further fields, the last one as JSON.

    :raises ValueError: where that is no JSON.
    """
    event = _new_tuple(Event, (_KINDS.get(kind, kind), trial_id, seq, wall_time, *_read(more)))
    return second + rest / _NS, event


class EventDecoder:
    """Decodes the events of a definition. Those of one trial behind another are the fastest."""

    def __init__(self, definition: str) -> None:
        """:raises NotPlain: where a field is missing, or of another type."""
        fields = fields_of(definition)
        names = [name for _, name in fields]
        missing = [name for name in (*_NUMBERS, _TRIAL, *_REST) if name not in names]
        if missing:
            raise NotPlain('no field {}'.format(missing[0]))
        begin = 1 + max(map(names.index, (*_NUMBERS, _TRIAL)))
        is_plain = all(kind == STRING or kind in PLAIN_CODES for kind, _ in fields[:begin])
        if not is_plain or any(names.index(name) < begin for name in _REST):
            raise NotPlain('fields in another order')
        self._fields = fields[:begin]
        self._decode_head = FieldsDecoder(self._fields)
        self._decode_rest = FieldsDecoder(fields[begin:])
        self._pick = itemgetter(*map(self._decode_rest.names.index, _REST))
        self._rests: Dict[bytes, Tuple[Any, ...]] = {}
        places = dict(_places(self._fields))
        self._numbers = itemgetter(*(places[name] for name in _NUMBERS))
        # length and bytes of each text. A Header has one, and the trial's id is another
        texts = [name for kind, name in self._fields if kind == STRING]
        self._texts = itemgetter(*(places[name] - back for name in texts for back in (1, 0)))
        # of the event before: the texts are mostly the same
        self._layout = struct.Struct('')
        self._known: Sequence[Any] = ()
        self._trial_id = ''

    def __call__(self, data: bytes, start: int, end: int) -> StampedEvent:
        """Return the event that stands from `start` to `end`, with its stamp.

        :raises NotPlain: where it is not as its definition says.
        :raises ValueError: where its data are no JSON.
        """
        at = start + self._layout.size
        values = self._layout.unpack_from(data, start) if at <= end else ()
        if not values or self._texts(values) != self._known:
            at = self._learn_layout(data, start)
            if at > end:
                raise NotPlain('a message of another length')
            values = self._layout.unpack_from(data, start)
        second, rest, kind, seq, wall_time = self._numbers(values)
        told = data[at:end]
        more = self._rests.get(told) or self._decoded(told)
        fields = (_KINDS.get(kind, kind), self._trial_id, seq, wall_time) + more
        return second + rest / _NS, _new_tuple(Event, fields)

    def _learn_layout(self, data: bytes, start: int) -> int:
        """Take the layout of the first fields of this event. Return where they end."""
        decoded, end = self._decode_head.begin(data, start)
        codes = ''.join(_codes(self._fields, decoded))
        self._layout = struct.Struct('<' + codes)
        self._known = self._texts(self._layout.unpack_from(data, start))
        self._trial_id = decoded[self._decode_head.names.index(_TRIAL)]
        return end

    def _decoded(self, told: bytes) -> Tuple[Any, ...]:
        more = _read(self._pick(self._decode_rest(told)))
        if len(told) <= _LONGEST_REMEMBERED:
            if len(self._rests) == _MOST_REMEMBERED:
                self._rests.clear()
            self._rests[told] = more
        return more


def _places(fields: Sequence[Field]) -> Iterator[Tuple[str, int]]:
    """Yield where each field stands in what a layout unpacks: a text behind its length."""
    at = 0
    for kind, name in fields:
        at += kind == STRING
        yield name, at
        at += 1


def _codes(fields: Sequence[Field], values: Sequence[Any]) -> Iterator[str]:
    for (kind, _), value in zip(fields, values):
        yield 'I{}s'.format(len(value.encode())) if kind == STRING else PLAIN_CODES[kind]


def _read(more: Sequence[Any]) -> Tuple[Any, ...]:
    data = more[-1]
    parsed: Optional[Mapping[str, Any]] = json.loads(data) if data else None
    return (*more[:-1], parsed)
