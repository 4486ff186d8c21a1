"""Finds bags, and reads the executive's events and the worlds' causes, without ROS."""

import contextlib
import math
import os
import stat
from importlib.util import find_spec
from operator import attrgetter, itemgetter
from typing import (
    Any,
    Callable,
    Dict,
    Iterable,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
    Union,
)

from smach_oracle.bag_format import MAGIC
from smach_oracle.oracle.errors import OracleError
from smach_oracle.oracle.records.events import Event

from .plain_bags.decoding import STAMP_NS, STAMP_S, MessageDecoder
from .plain_bags.definition_sum import sum_of
from .plain_bags.event_decoder import EventDecoder, StampedEvent, event_of
from .plain_bags.indexed_bag import IndexedBag, KnownHeaders, NotPlain, PlainConnection

EVENT_TYPE = 'smach_oracle/msg/OracleEvent'  # as rosbags writes smach_oracle/OracleEvent
CAUSE_TYPE = 'smach_oracle/msg/TrialCause'
UNFINISHED = (  # why a bag is not used
    'still being recorded, or its recorder died: start the recorder again in this folder, or run '
    '`rosbag reindex` on it and take the .active off its name'
)
MENDING = (
    '`rosbag reindex` on it keeps what lies before the damage; named .bag.active, the next '
    'recorder in this folder saves what can be read behind it, too'
)
NO_EVENTS = 'no events of the executive in it'
_BACKUP = '.orig.bag'
_EVENTS = '/oracle/events'
_WRAP = 2**32
_MOST_DECODERS = 100
# fields that are taken of a message, in this order
_TAKEN = {
    EVENT_TYPE: (STAMP_S, STAMP_NS, 'kind', 'trial_id', 'seq', 'wall_time', *Event._fields[4:]),
    CAUSE_TYPE: ('seed', 'task', 'kinds', 'details'),
}
_PICKS = {msgtype: attrgetter(*names) for msgtype, names in _TAKEN.items()}


class BagError(OracleError):
    """A bag cannot be used. The text says why."""


class SkippedBag(NamedTuple):
    """A bag, or a folder of bags, that was not used."""

    path: str
    reason: str


class RecordedCause(NamedTuple):
    """The cause of failure that a simulated world was given for a trial (TrialCause)."""

    seed: int
    task: str
    kinds: Tuple[str, ...]  # none: a benign world
    details: Tuple[str, ...]


# a message of one of the two types: topic, time of recording in ns, and what it tells
_Message = Tuple[str, int, Union[StampedEvent, RecordedCause]]
# decodes a message that stands in some bytes, from one place to another
_Decoder = Callable[[bytes, int, int], Union[StampedEvent, RecordedCause]]


class _Taker:
    """Takes what is wanted of the messages of a definition, whatever their fields' order."""

    def __init__(self, msgtype: str, definition: str) -> None:
        """:raises NotPlain: where rosbags is to read them."""
        self._decode = MessageDecoder(definition)
        names = self._decode.names
        missing = [name for name in _TAKEN[msgtype] if name not in names]
        if missing:
            raise NotPlain('no field {}'.format(missing[0]))
        self._pick = itemgetter(*map(names.index, _TAKEN[msgtype]))
        self._told: Callable[..., Union[StampedEvent, RecordedCause]] = _TOLD[msgtype]

    def __call__(self, data: bytes, start: int, end: int) -> Union[StampedEvent, RecordedCause]:
        """Return it.

        :raises NotPlain: where the message is not as its definition says.
        """
        return self._told(*self._pick(self._decode(data[start:end])))


def _decoder_of(connection: PlainConnection) -> _Decoder:
    """:raises NotPlain: where rosbags is to read the messages of a connection."""
    if connection.msgtype == EVENT_TYPE:
        with contextlib.suppress(NotPlain):
            return EventDecoder(connection.msgdef)
    return _Taker(connection.msgtype, connection.msgdef)


def _cause(seed: int, task: str, kinds: Sequence[str], details: Sequence[str]) -> RecordedCause:
    return RecordedCause(int(seed), task, tuple(kinds), tuple(details))


# what a message tells, by what is taken of it
_TOLD: Mapping[str, Callable[..., Union[StampedEvent, RecordedCause]]] = {
    EVENT_TYPE: event_of,
    CAUSE_TYPE: _cause,
}


class BagContent(NamedTuple):
    """The part of a bag that the analysis takes."""

    events: List[Event]  # in the order of their stamps. `seq` is that of their happening
    causes: Dict[str, RecordedCause]  # by trial id
    nodes: Dict[str, str]  # by trial id: the node, from the topic of the events
    stamps: List[float]  # of each of the events: ROS time, s. 0 where there was none


def find_bags(places: Sequence[str], skipped: Optional[List[SkippedBag]] = None) -> List[str]:
    """Return the paths of all bags, also `.bag.active`, in folders and below, sorted.

    Each is there once. A path of a file is taken as it is. Left out: the backups `X.orig.bag` that
    `rosbag reindex` makes of `X.bag`.

    :param skipped: gets the folders that cannot be read.
    :raises BagError: where a place does not exist.
    """
    found: Dict[str, None] = {}
    closed: List[SkippedBag] = []
    for place in places:
        if os.path.isfile(place):
            found[os.path.realpath(place)] = None
        elif not os.path.isdir(place):
            raise BagError('{}: no such folder'.format(place))
        else:
            # below a real folder all folders are real: links to some are left out
            for entry in _bags_below(os.path.realpath(place), closed):
                found[os.path.realpath(entry.path) if entry.is_symlink() else entry.path] = None
    if skipped is not None:
        skipped.extend(sorted(set(closed)))
    return sorted(found)


def walk_bags(folder: str) -> Iterator[str]:
    """Yield the paths of bags, by their names, in a folder and below. Not by links to folders."""
    return (entry.path for entry in _bags_below(folder, []))


def _bags_below(folder: str, closed: List[SkippedBag]) -> Iterator['os.DirEntry[str]']:
    """Yield the bags. `closed` gets the folders that cannot be read."""
    left = [folder]
    while left:
        entries: List['os.DirEntry[str]'] = []
        place = left.pop()
        try:
            with os.scandir(place) as found:
                entries.extend(found)
        except FileNotFoundError:
            pass  # it is gone by now
        except OSError as err:
            closed.append(SkippedBag(place, 'this folder cannot be read: ' + str(err.strerror)))
        names = {entry.name for entry in entries}
        for entry in entries:
            name = entry.name
            if name.endswith(_BACKUP) and name[: -len(_BACKUP)] + '.bag' in names:
                continue
            if name.endswith(('.bag', '.bag.active')) and not _is_folder(entry):
                yield entry
            elif _is_folder(entry) and not entry.is_symlink():
                left.append(entry.path)


def _is_folder(entry: 'os.DirEntry[str]') -> bool:
    try:
        return entry.is_dir()
    except OSError:
        return False


class MessageStores:
    """Reads messages. It remembers the definitions it has met, so that many bags are quick."""

    def __init__(self) -> None:
        """:raises ImportError: where rosbags is missing."""
        from rosbags import (
            typesys,  # only where bags are read: a command shows its options without it
        )

        self._typesys = typesys
        # by message definition: another release's events may have other fields
        self._stores: Dict[str, Any] = {}

    def read(self, connection: Any, data: bytes) -> Any:
        """Read one message of a connection. A damaged one raises whatever rosbags raises."""
        definition = connection.msgdef
        text = getattr(definition, 'data', definition)  # a string before rosbags 0.10
        return self.store_of(text, connection.msgtype).deserialize_ros1(data, connection.msgtype)

    def store_of(self, definition: str, msgtype: str) -> Any:
        """Return what reads messages of a definition. A damaged one raises what rosbags raises."""
        if definition not in self._stores:
            store = self._typesys.get_typestore(self._typesys.Stores.EMPTY)
            store.register(self._typesys.get_types_from_msg(definition, msgtype))
            self._stores[definition] = store
        return self._stores[definition]


class EventReader:
    """Reads bags."""

    def __init__(self, most_events: float = math.inf) -> None:
        """
        :param most_events: a bag with more is refused.
        :raises ImportError: where rosbags is missing.
        """
        if find_spec('rosbags') is None:
            raise ModuleNotFoundError("No module named 'rosbags'", name='rosbags')
        self._made_stores: Optional[MessageStores] = None
        self._decoders: Dict[Tuple[str, str], _Decoder] = {}  # by topic and definition
        self._known = KnownHeaders()
        self._most_events = most_events

    def read(self, path: str) -> BagContent:
        """Read all events in a bag, and the cause of each trial. The topics' names do not matter.

        A cause is latched: a bag may begin with that of the trial before. The last one before a
        trial's end counts.

        :raises BagError: where it cannot be used.
        """
        if path.endswith('.active'):
            raise BagError(UNFINISHED)
        try:
            if not stat.S_ISREG(os.stat(path).st_mode):  # opening a pipe may wait forever
                raise BagError('no plain file')
            return self._read(path)
        except (BagError, ImportError):  # a package that only seldom bags need may be missing
            raise
        except Exception as err:
            # a damaged file can make rosbags raise anything, assertions among it
            raise BagError(why_unreadable(path, _words(err))) from err

    def _read(self, path: str) -> BagContent:
        try:
            return self._content_of(self._quickly(path))
        except NotPlain:  # rosbags reads it, or says what is wrong with it
            return self._content_of(self._by_rosbags(path))

    def _quickly(self, path: str) -> Iterator[_Message]:
        """Yield the messages of a bag that is sound and plain.

        :raises NotPlain: where rosbags is to read it.
        """
        with IndexedBag(path, self._known) as bag:
            _check_types(each.msgtype for each in bag.connections.values())
            decoders: Dict[int, _Decoder] = {}
            for stamp, order, _, connection, data, start, end in bag.messages(
                EVENT_TYPE, CAUSE_TYPE
            ):
                decode = decoders.get(order)
                if decode is None:
                    decode = decoders[order] = self._decoder(connection)
                yield connection.topic, stamp, decode(data, start, end)

    def _decoder(self, connection: PlainConnection) -> _Decoder:
        key = connection.topic, connection.msgdef
        decode = self._decoders.get(key)
        if decode is None:
            if sum_of(connection.msgdef) != connection.md5sum:
                self._stores.store_of(connection.msgdef, connection.msgtype)
            decode = _decoder_of(connection)
            if len(self._decoders) == _MOST_DECODERS:
                self._decoders.clear()
            self._decoders[key] = decode
        return decode

    @property
    def _stores(self) -> MessageStores:
        if self._made_stores is None:
            self._made_stores = MessageStores()
        return self._made_stores

    def _by_rosbags(self, path: str) -> Iterator[_Message]:
        from rosbags.rosbag1 import Reader  # it takes 30 ms, and most bags do without

        with Reader(path) as reader:
            _check_types(item.msgtype for item in reader.connections)
            connections = [
                item for item in reader.connections if item.msgtype in (EVENT_TYPE, CAUSE_TYPE)
            ]
            for item, stamp, data in reader.messages(connections):
                taken = _PICKS[item.msgtype](self._stores.read(item, data))
                if item.msgtype == CAUSE_TYPE:
                    yield item.topic, stamp, _cause(*taken)
                else:  # rosbags takes the numbers of a stamp for signed ones
                    second, rest, *fields = taken
                    yield item.topic, stamp, event_of(second % _WRAP, rest % _WRAP, *fields)

    def _content_of(self, messages: Iterable[_Message]) -> BagContent:
        events: List[Event] = []
        ends: Dict[str, int] = {}  # ns, of the last event of each trial
        causes: List[Tuple[int, RecordedCause]] = []
        topics: Dict[str, str] = {}
        stamps: List[float] = []
        for topic, stamp, told in messages:
            if isinstance(told, RecordedCause):
                causes.append((stamp, told))
            else:
                ros_time, event = told
                events.append(event)
                trial_id = event.trial_id
                ends[trial_id] = stamp
                topics[trial_id] = topic
                stamps.append(ros_time)
            if len(events) > self._most_events:
                raise BagError('it has more than {:g} events'.format(self._most_events))
        if ends:  # what is recorded while the last trial of a bag ends is its own
            ends[max(ends, key=lambda trial_id: ends[trial_id])] = max(
                [stamp for stamp, _ in causes], default=0
            )
        found = {trial_id: _latest(causes, end) for trial_id, end in ends.items()}
        return BagContent(
            events,
            {trial_id: cause for trial_id, cause in found.items() if cause is not None},
            {trial_id: _node_of(topic) for trial_id, topic in topics.items()},
            stamps,
        )


def _node_of(topic: str) -> str:
    return topic[: -len(_EVENTS)] if topic.endswith(_EVENTS) else ''


def _check_types(types: Iterable[str]) -> None:
    if EVENT_TYPE not in types:
        raise BagError(NO_EVENTS)


def why_unreadable(path: str, why: str) -> str:
    """Say why a bag cannot be read, and what may save it where it is one."""
    with contextlib.suppress(OSError), open(path, 'rb') as source:
        if source.read(len(MAGIC)) == MAGIC:
            return 'cut off, or damaged: {}; {}'.format(why, MENDING)
    return 'damaged, or no bag: {}'.format(why)


def _latest(causes: Sequence[Tuple[int, RecordedCause]], end: int) -> Optional[RecordedCause]:
    return next((cause for stamp, cause in reversed(causes) if stamp <= end), None)


def _words(err: Exception) -> str:
    return str(err).strip().rstrip('.') or type(err).__name__
