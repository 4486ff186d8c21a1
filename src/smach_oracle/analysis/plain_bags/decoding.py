"""Decodes flat ROS messages by `struct`: plain types, strings, lists of strings, a Header.

It is for speed, and knows what the messages of this package need. Another type raises NotPlain, and
so does a message that is not as its definition says. rosbags decodes every message. Source of the
format: http://wiki.ros.org/ROS/Technical%20Overview (little-endian, a string has its length before
it, a list its number).
"""

import re
import struct
from typing import Any, Callable, List, NamedTuple, Sequence, Tuple

from .indexed_bag import NotPlain

STAMP_S, STAMP_NS = 'header.stamp.sec', 'header.stamp.nanosec'  # names of a Header's parts
PLAIN_CODES = {
    'bool': '?',
    'uint8': 'B',
    'int8': 'b',
    'uint16': 'H',
    'int16': 'h',
    'uint32': 'I',
    'int32': 'i',
    'uint64': 'Q',
    'int64': 'q',
    'float32': 'f',
    'float64': 'd',
}
STRING, _STRINGS = 'string', 'string[]'
_HEADER = (
    ('uint32', 'header.seq'),
    ('uint32', STAMP_S),
    ('uint32', STAMP_NS),
    (STRING, 'header.frame_id'),
)
_HEADERS = ('Header', 'std_msgs/Header')
_LINE = re.compile(r'(?P<type>[\w/]+(?:\[\])?)\s+(?P<name>\w+)\s*(?P<constant>=)?')
_LENGTH = struct.Struct('<I')

Field = Tuple[str, str]  # type and name


class _Stretch(NamedTuple):
    """Some fields of plain types, and the string or list behind them."""

    unpack: Callable[[bytes, int], Tuple[Any, ...]]  # their values, and the length
    size: int  # bytes
    is_list: bool


class FieldsDecoder:
    """Decodes fields that follow each other. `names` are those of the fields, in their order."""

    def __init__(self, fields: Sequence[Field]) -> None:
        """:raises NotPlain: where a field is of another type."""
        self.names: Sequence[str] = [name for _, name in fields]
        self._stretches: List[_Stretch] = []
        codes = '<'
        for kind, _ in fields:
            if kind in PLAIN_CODES:
                codes += PLAIN_CODES[kind]
            elif kind in (STRING, _STRINGS):
                layout = struct.Struct(codes + 'I')
                stretch = _Stretch(layout.unpack_from, layout.size, kind == _STRINGS)
                self._stretches.append(stretch)
                codes = '<'
            else:
                raise NotPlain('a field of type {}'.format(kind))
        self._last = struct.Struct(codes)

    def __call__(self, data: bytes) -> List[Any]:
        """Return the values of the fields. They are all of the data.

        :raises NotPlain: where they are not as their definition says.
        """
        values, end = self.begin(data, 0)
        if end != len(data):
            raise NotPlain('a message of another length')
        return values

    def begin(self, data: bytes, at: int) -> Tuple[List[Any], int]:
        """Return the values of the fields that begin at a place, and where they end.

        :raises NotPlain: where they are not as their definition says.
        """
        values: List[Any] = []
        try:
            for unpack, size, is_list in self._stretches:
                values += unpack(data, at)
                at += size
                length = values.pop()
                if is_list:
                    texts, at = _texts(data, at, length)
                    values.append(texts)
                elif length:
                    values.append(data[at : at + length].decode())
                    at += length
                else:  # as most are
                    values.append('')
            values += self._last.unpack_from(data, at)
        except (struct.error, UnicodeDecodeError) as err:
            raise NotPlain(str(err)) from err
        return values, at + self._last.size


class MessageDecoder(FieldsDecoder):
    """Decodes the messages of a definition."""

    def __init__(self, definition: str) -> None:
        """:raises NotPlain: where a field is of another type."""
        super().__init__(fields_of(definition))


def _texts(data: bytes, at: int, count: int) -> Tuple[List[str], int]:
    texts: List[str] = []
    for _ in range(count):
        (length,) = _LENGTH.unpack_from(data, at)
        at += _LENGTH.size + length
        texts.append(data[at - length : at].decode())
    return texts, at


def fields_of(definition: str) -> List[Field]:
    """Return type and name of each field. Behind a line of `=` come other messages.

    :raises NotPlain: for a line that is no field.
    """
    found: List[Field] = []
    for text in definition.split('\n====')[0].split('\n'):
        line = text.split('#')[0].strip()
        match = _LINE.match(line)
        if line and match is None:
            raise NotPlain('a line {!r}'.format(line))
        if match is not None and not match.group('constant'):
            kind, name = match.group('type'), match.group('name')
            found += _HEADER if kind in _HEADERS and name == 'header' else ((kind, name),)
    return found
