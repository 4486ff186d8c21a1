"""Values of userdata as text and bytes, and back. No pickle: what is read runs no code.

Plain data become JSON. What JSON has no word for becomes an object with one key that begins with
`$`, such as {"$tuple": [1, 2]}. Long bytes and long texts are handed over apart, by content.
"""

import base64
import dataclasses
import enum
import functools
import hashlib
import json
import math
from collections import OrderedDict
from typing import (
    Any,
    Callable,
    Dict,
    Iterable,
    List,
    Mapping,
    NamedTuple,
    NoReturn,
    Optional,
    Tuple,
    Type,
)

from smach_common.foreign import ends_program, error_text

from .object_parts import (
    attributes,
    class_attribute,
    found_by_name,
    has,
    is_only_attributes,
    is_set,
    name_of,
)

Encode = Callable[[Any], Any]
Decode = Callable[[Any], Any]
FetchBytes = Callable[[bytes], bytes]

_as_json = json.JSONEncoder(separators=(',', ':')).encode
SHORT = 256  # bytes: what is no longer stays within the text
MOST = 1 << 28  # bytes of one value
MOST_DEPTH = 300  # of lists in lists and the like
MOST_CONTAINERS = 1 << 20  # lists, mappings and objects of one value: it is written again and again
DIGEST = 16  # bytes
_PLAIN = (str, bool, type(None))


class NotStorable(ValueError):
    """A value, or something in it, that no codec knows."""


class NotReadable(ValueError):
    """A stored value that cannot be made again here."""


class Encoded(NamedTuple):
    """A value as it is stored: `text`, or where that is long, its digest in `whole`.

    `parts`: the bytes by their digests.
    """

    text: Optional[str]
    whole: Optional[bytes]
    parts: Dict[bytes, bytes]


class _Registered(NamedTuple):
    name: str
    encode: Encode
    decode: Decode


class Codecs:
    """Codecs by type. `register` adds one. Those that came later win.

    Of a value, `encode` of the codec makes plain data, bytes, or anything else that is storable.
    `decode` is handed the same again.
    """

    def __init__(self, parent: Optional['Codecs'] = None) -> None:
        self._parent = parent
        self._by_type: Dict[type, _Registered] = {}
        self._by_name: Dict[str, _Registered] = {}

    def register(self, of: Type[Any], encode: Encode, decode: Decode, name: str = '') -> None:
        """Store values of type `of`, and of its subclasses, by these two functions.

        `name` stands in the store: that of the type unless given. Who reads must have registered
        the same name.

        :raises TypeError: where `of` is no type, or one of the functions cannot be called.
        """
        if not isinstance(of, type) or not callable(encode) or not callable(decode):
            raise TypeError(
                'a codec is a type and two functions, not {!r}, {!r}, {!r}'.format(
                    of, encode, decode
                )
            )
        codec = _Registered(name or name_of(of), encode, decode)
        self._by_type[of] = codec
        self._by_name[codec.name] = codec

    def encode(self, value: object, drops: Optional[Callable[[str], None]] = None) -> Encoded:
        """Return a value as it is stored.

        `drops`: takes the name of each attribute that is not stored with its object.

        :raises NotStorable: saying what in it cannot be stored. Whatever the value itself raises
            becomes this.
        """
        writer = _Writer(self, drops)
        try:
            text = _as_json(writer.plain(value))
        except NotStorable:
            raise
        except RecursionError:
            _refuse_depth()
        except BaseException as err:  # whatever an object does as it is looked at
            if ends_program(err):
                raise
            raise NotStorable('looking at it raised {}'.format(error_text(err))) from err
        if len(text) <= SHORT:
            return Encoded(text, None, writer.parts)
        return Encoded(None, writer.part(text.encode('ascii')), writer.parts)

    def decode(self, text: Optional[str], whole: Optional[bytes], fetch: FetchBytes) -> Any:
        """Return the value that `encode` was given.

        `fetch`: returns the bytes of a digest.

        :raises NotReadable: saying what cannot be made again here.
        """
        try:
            if text is None:
                if whole is None:
                    raise NotReadable('there is no value')
                text = fetch(whole).decode('ascii')
            return self._value(json.loads(text), fetch)
        except NotReadable:
            raise
        except Exception as err:  # damaged, or refused by a codec of the user's
            raise NotReadable(error_text(err)) from err

    def codec_of(self, kind: type) -> Optional[_Registered]:
        """Return the codec of a type: its own, or that of the nearest class above it."""
        for each in kind.__mro__:
            scope: Optional[Codecs] = self
            while scope is not None:
                if each in scope._by_type:
                    return scope._by_type[each]
                scope = scope._parent
        return None

    def _named(self, name: str) -> _Registered:
        scope: Optional[Codecs] = self
        while scope is not None:
            if name in scope._by_name:
                return scope._by_name[name]
            scope = scope._parent
        raise NotReadable('no codec {!r} is registered'.format(name))

    def _value(self, plain: Any, fetch: FetchBytes) -> Any:
        if type(plain) is list:
            return [self._value(each, fetch) for each in plain]
        if type(plain) is not dict:
            return plain
        tag = next(iter(plain)) if len(plain) == 1 else ''
        if not tag.startswith('$'):
            return {key: self._value(each, fetch) for key, each in plain.items()}
        if tag == '$part':
            return fetch(bytes.fromhex(plain[tag]))
        if tag in _CLASSES:
            name, inner = plain[tag]
            return _CLASSES[tag](name, self._value(inner, fetch))
        if tag == '$by':
            name, inner = plain[tag]
            return self._named(name).decode(self._value(inner, fetch))
        if tag not in _TAGS:
            raise NotReadable('{!r} is not known here'.format(tag))
        return _TAGS[tag](self._value(plain[tag], fetch))


class _Writer:
    """Makes one value plain, and collects the bytes that are kept apart."""

    def __init__(self, codecs: Codecs, drops: Optional[Callable[[str], None]]) -> None:
        self._codecs, self._drops = codecs, drops
        self._depth = self._containers = 0
        self.parts: Dict[bytes, bytes] = {}

    def part(self, data: bytes) -> bytes:
        """Keep bytes apart, and return their digest."""
        if len(data) > MOST:
            raise NotStorable(
                'it has {} MB, and {} are allowed'.format(len(data) >> 20, MOST >> 20)
            )
        digest = hashlib.blake2b(data, digest_size=DIGEST).digest()
        self.parts[digest] = data
        return digest

    def plain(self, value: Any) -> Any:
        """Return a value as JSON has it."""
        kind = type(value)
        if kind in _PLAIN or kind is int:
            return value
        if kind is float:
            return value if math.isfinite(value) else {'$float': repr(value)}
        self._go_in()
        if kind is list:
            plain = self._list(value)
        elif kind is dict:
            plain = self._dict(value)
        elif kind is tuple:
            plain = {'$tuple': self._list(value)}
        else:
            plain = self._other(value, kind)
        self._depth -= 1
        return plain

    def _go_in(self) -> None:
        """Note one that holds others. Those that hold themselves, or are shared, have no end."""
        self._depth += 1
        self._containers += 1
        if self._depth > MOST_DEPTH:
            _refuse_depth()
        if self._containers > MOST_CONTAINERS:
            raise NotStorable(
                'it has more than {} lists, mappings and objects, and one that '
                'stands in several places counts in each'.format(MOST_CONTAINERS)
            )

    def _list(self, values: Iterable[object]) -> Any:
        plain = self.plain
        return [plain(each) for each in list(values)]

    def _dict(self, value: Mapping[Any, Any]) -> Any:
        items = dict(value).items()
        if all([type(key) is str and key[:1] != '$' for key, _ in items]):
            plain = self.plain
            return {key: plain(each) for key, each in items}
        return {'$map': [[self.plain(key), self.plain(each)] for key, each in items]}

    def _other(self, value: Any, kind: Any) -> Any:
        if kind in (bytes, bytearray):
            return self._bytes(bytes(value), kind)
        if kind in _SIMPLE:
            tag, simple = _SIMPLE[kind]
            return {tag: self.plain(simple(value))}
        codec = self._codecs.codec_of(kind)
        if codec is not None:
            return {'$by': [codec.name, self.plain(_encoded_by(codec, value))]}
        if issubclass(kind, enum.Flag) and not _is_member(value):
            return {'$flag': [_findable(kind), value._value_]}
        if issubclass(kind, enum.Enum):
            return {'$enum': [_findable(kind), value._name_]}
        if has(kind, '__dataclass_fields__'):
            return {'$data': [_findable(kind), self._dict(self._fields(value, kind))]}
        if issubclass(kind, tuple) and has(kind, '_fields'):
            self._tell_dropped(value, kind, frozenset(kind._fields))
            return {'$named': [_findable(kind), self._list(tuple.__iter__(value))]}
        raise NotStorable('no codec is registered for {}'.format(name_of(kind)))

    def _fields(self, value: Any, kind: type) -> Dict[str, object]:
        """Return the fields of a dataclass."""
        if not is_only_attributes(kind):
            raise NotStorable('{} is a dataclass and holds other data, too'.format(name_of(kind)))
        names = [each.name for each in dataclasses.fields(kind)]
        unset = [name for name in names if not is_set(value, name)]
        if unset:
            raise NotStorable(
                '{} is not set, a field of {}'.format(', '.join(unset), name_of(kind))
            )
        self._tell_dropped(value, kind, frozenset(names))
        return {name: getattr(value, name) for name in names}

    def _tell_dropped(self, value: object, kind: type, stored: Iterable[str]) -> None:
        """Name what an object has besides its fields. A property that was cached is no loss."""
        if self._drops is None:
            return
        for name in attributes(value, kind):
            if name not in stored and not isinstance(
                class_attribute(kind, name), functools.cached_property
            ):
                self._drops(name)

    def _bytes(self, value: bytes, kind: type) -> object:
        if len(value) > SHORT:
            plain: object = {'$part': self.part(value).hex()}
        else:
            plain = {'$bytes': base64.b64encode(value).decode('ascii')}
        return plain if kind is bytes else {'$bytearray': plain}


def _refuse_depth() -> NoReturn:
    raise NotStorable('it is nested too deeply, or holds itself') from None


def _encoded_by(codec: _Registered, value: object) -> object:
    try:
        return codec.encode(value)
    except BaseException as err:  # the user's, as the value
        if ends_program(err):
            raise
        raise NotStorable('its codec {} failed: {}'.format(codec.name, error_text(err))) from err


def _is_member(value: enum.Flag) -> bool:
    """Whether it is one member of its class, not several of its flags, or none."""
    return type(value).__members__.get(value._name_ or '') is value


def _findable(kind: type) -> str:
    """Return the name of a class.

    :raises NotStorable: where a later program would not find the class by it, such as one that a
        function has made.
    """
    name = name_of(kind)
    if found_by_name(name) is not kind:
        raise NotStorable('its class cannot be found by its name, {}'.format(name))
    return name


def _class_named(name: str, wanted: Callable[[type], bool]) -> type:
    """Return a class of the program that runs."""
    found = found_by_name(name)
    if not isinstance(found, type) or not wanted(found):
        raise NotReadable('there is no class {} in this program'.format(name))
    return found


def _enum(name: str, member: object) -> object:
    kind: Any = _class_named(name, lambda found: issubclass(found, enum.Enum))
    if member not in kind.__members__:
        raise NotReadable('{} has no {!r} any more'.format(name, member))
    found: object = kind[member]
    return found


def _flag(name: str, value: object) -> object:
    kind: Any = _class_named(name, lambda found: issubclass(found, enum.Flag))
    made: object = kind(value)
    return made


def _data(name: str, values: Mapping[str, object]) -> object:
    kind: Any = _class_named(name, dataclasses.is_dataclass)
    known = {each.name for each in dataclasses.fields(kind)}
    if known != set(values):
        raise NotReadable(
            '{} has other fields now: {}'.format(
                name, ', '.join(sorted(known.symmetric_difference(values)))
            )
        )
    made: object = object.__new__(kind)  # without its __init__, which may do anything
    for key, value in values.items():
        object.__setattr__(made, key, value)
    return made


def _named(name: str, values: List[object]) -> object:
    kind: Any = _class_named(
        name, lambda found: issubclass(found, tuple) and hasattr(found, '_fields')
    )
    if len(values) != len(kind._fields):
        raise NotReadable(
            '{} has {} fields now, not {}'.format(name, len(kind._fields), len(values))
        )
    made: object = tuple.__new__(kind, values)
    return made


_CLASSES: Dict[str, Callable[[str, Any], object]] = {
    '$enum': _enum,
    '$flag': _flag,
    '$data': _data,
    '$named': _named,
}
_SIMPLE: Dict[type, Tuple[str, Callable[[Any], Any]]] = {
    set: ('$set', list),
    frozenset: ('$frozenset', list),
    complex: ('$complex', lambda value: [value.real, value.imag]),
    OrderedDict: ('$ordered', lambda value: [list(item) for item in dict(value).items()]),
}
_TAGS: Dict[str, Callable[[Any], Any]] = {
    '$tuple': tuple,
    '$float': float,
    '$map': lambda items: {key: value for key, value in items},
    '$bytes': base64.b64decode,
    '$bytearray': bytearray,
    '$set': set,
    '$frozenset': frozenset,
    '$complex': lambda parts: complex(*parts),
    '$ordered': lambda items: OrderedDict((key, value) for key, value in items),
}
OFFERED = Codecs()  # by other rooms. What the user registers goes before
CODECS = Codecs(OFFERED)


def register_codec(of: Type[Any], encode: Encode, decode: Decode, name: str = '') -> None:
    """Store values of a type in every store of this program. See `Codecs.register`.

    >>> from smach_oracle.oracle import register_codec
    >>> class Cup:
    ...     def __init__(self, size):
    ...         self.size = size
    >>> register_codec(Cup, encode=lambda cup: {'size': cup.size}, decode=lambda data: Cup(**data))

    :raises TypeError: where `of` is no type, or one of the functions cannot be called.
    """
    CODECS.register(of, encode, decode, name)
