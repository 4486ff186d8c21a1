"""The account of a trial in its row: each failure, decision, jump and answer, without its bag."""

import json
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import decided_by

# what an entry begins with
FAILED, DECIDED, WENT, ASKED, ANSWERED, UNANSWERED = (
    'failed',
    'decided',
    'went',
    'asked',
    'answered',
    'unanswered',
)
_KINDS = {
    EventKind.FAILURE: FAILED,
    EventKind.DECISION: DECIDED,
    EventKind.JUMP: WENT,
    EventKind.QUERY_OPENED: ASKED,
    EventKind.QUERY_ANSWERED: ANSWERED,
    EventKind.QUERY_EXPIRED: UNANSWERED,
    EventKind.QUERY_CANCELLED: UNANSWERED,
}
LONGEST_TEXT = 160  # letters. A failure's text may be a page
Entry = Tuple[Any, ...]


def account_of(events: Sequence[Event]) -> List[Entry]:
    """Return the entries of a trial, in order.

    ('failed', state, outcome, text), ('decided', state, action, target, by, rate, order, chance),
    ('went', state, target, way), ('asked', state, reason), ('answered', state, answer, target, by),
    ('unanswered', state). `order` has the ways that were open, the first of which is taken, and
    `chance` is that of the choice. Either is None where the decision does not tell it.
    """
    in_order = sorted(events, key=lambda event: event.seq)
    top = in_order[0].path if in_order else ''
    return [_entry(event, top) for event in in_order if event.kind in _KINDS]


def _entry(event: Event, top: str) -> Entry:
    data: Mapping[str, Any] = event.data if isinstance(event.data, Mapping) else {}
    kind, state = _KINDS[EventKind(event.kind)], _below(top, event)
    more: Dict[str, Tuple[Any, ...]] = {
        FAILED: (event.outcome, event.text[:LONGEST_TEXT]),
        DECIDED: (
            event.outcome,
            event.target,
            decided_by(event).value,
            round(event.rate, 4) if event.rate == event.rate else None,  # NaN: there is none
            data.get('order'),
            data.get('chance'),
        ),
        WENT: (event.target, data.get('way')),
        ASKED: (event.text[:LONGEST_TEXT],),
        ANSWERED: (event.outcome, event.target, event.by),
        UNANSWERED: (),
    }
    return (kind, state, *more[kind])


def _below(top: str, event: Event) -> str:
    path = '/'.join(filter(None, (event.path, event.state)))
    return path[len(top) + 1 :] if path.startswith(top + '/') else path


def account_text(entries: Sequence[Entry]) -> str:
    """Return the entries as they stand in a row."""
    return json.dumps([list(entry) for entry in entries], separators=(',', ':'))


def account_in(text: str) -> List[Entry]:
    """Return the entries of a row.

    :raises ValueError or TypeError: where the text is none of account_text().
    """
    entries = [tuple(entry) for entry in json.loads(text)]
    if any(len(entry) < 2 or entry[0] not in _KINDS.values() for entry in entries):
        raise ValueError('an entry is a list of its kind, its state and more')
    return entries


class HarmedThing(NamedTuple):
    """A thing that came to harm."""

    how: str
    thing: str
    seen_s: Optional[float] = None  # of the world's time since the trial began. None: not told


def harm_text(harmed: Sequence[HarmedThing]) -> str:
    """Return what came to harm, how and when, as it stands in a row."""
    told = [each[: 2 if each.seen_s is None else 3] for each in harmed]
    return json.dumps(told, separators=(',', ':'))


def harm_in(text: str) -> List[HarmedThing]:
    """Return what came to harm, once for each time.

    :raises ValueError or TypeError: where the text is none of harm_text().
    """
    return [
        HarmedThing(str(how), str(thing), *map(float, seen_s))
        for how, thing, *seen_s in json.loads(text)
    ]
