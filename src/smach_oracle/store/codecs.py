"""Values of userdata as text and bytes, and back. No pickle: what is read runs no code.

Plain data become JSON. What JSON has no word for becomes an object with one key that begins with
`$`, such as {"$tuple": [1, 2]}. Long bytes and long texts are handed over apart, by content.
"""
import base64
import dataclasses
import enum
import hashlib
import json
import math
import sys
from collections import OrderedDict
from typing import (
    Any,
    Callable,
    Dict,
    Iterable,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Tuple,
    Type,
)

Encode = Callable[[Any], Any]
Decode = Callable[[Any], Any]
FetchBytes = Callable[[bytes], bytes]

_as_json = json.JSONEncoder(separators=(',', ':')).encode
SHORT = 256  # bytes: what is no longer stays within the text
MOST = 1 << 28  # bytes of one value
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
            raise TypeError('a codec is a type and two functions, not {!r}, {!r}, {!r}'.format(
                of, encode, decode))
        codec = _Registered(name or _name_of(of), encode, decode)
        self._by_type[of] = codec
        self._by_name[codec.name] = codec

    def encode(self, value: object) -> Encoded:
        """Return a value as it is stored.

        :raises NotStorable: saying what in it cannot be stored.
        """
        writer = _Writer(self)
        try:
            text = _as_json(writer.plain(value))
        except RecursionError:
            raise NotStorable('it is nested too deeply, or holds itself') from None
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
            raise NotReadable('{}: {}'.format(type(err).__name__, err)) from err

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

    def __init__(self, codecs: Codecs) -> None:
        self._codecs = codecs
        self.parts: Dict[bytes, bytes] = {}

    def part(self, data: bytes) -> bytes:
        """Keep bytes apart, and return their digest."""
        if len(data) > MOST:
            raise NotStorable('it has {} MB, and {} are allowed'.format(len(data) >> 20,
                                                                       MOST >> 20))
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
        if kind is list:
            return self._list(value)
        if kind is dict:
            return self._dict(value)
        if kind is tuple:
            return {'$tuple': self._list(value)}
        return self._other(value, kind)

    def _list(self, values: Iterable[object]) -> List[Any]:
        plain = self.plain
        return [plain(each) for each in list(values)]

    def _dict(self, value: Mapping[Any, Any]) -> Any:
        items = list(value.items())
        if all([type(key) is str and key[:1] != '$' for key, _ in items]):
            plain = self.plain
            return {key: plain(each) for key, each in items}
        return {'$map': [[self.plain(key), self.plain(each)] for key, each in items]}

    def _other(self, value: Any, kind: type) -> Any:
        if kind in (bytes, bytearray):
            return self._bytes(bytes(value), kind)
        if kind in _SIMPLE:
            tag, simple = _SIMPLE[kind]
            return {tag: self.plain(simple(value))}
        codec = self._codecs.codec_of(kind)
        if codec is not None:
            try:
                inner = codec.encode(value)
            except Exception as err:
                raise NotStorable('its codec {} failed: {!r}'.format(codec.name, err)) from err
            return {'$by': [codec.name, self.plain(inner)]}
        if isinstance(value, enum.Flag) and not _is_member(value):
            return {'$flag': [_findable(kind), value.value]}
        if isinstance(value, enum.Enum):
            return {'$enum': [_findable(kind), value.name]}
        if dataclasses.is_dataclass(value):
            fields = {each.name: getattr(value, each.name) for each in dataclasses.fields(value)}
            return {'$data': [_findable(kind), self._dict(fields)]}
        if isinstance(value, tuple) and isinstance(getattr(kind, '_fields', None), tuple):
            return {'$named': [_findable(kind), self._list(value)]}
        raise NotStorable('no codec is registered for {}'.format(_name_of(kind)))

    def _bytes(self, value: bytes, kind: type) -> object:
        if len(value) > SHORT:
            plain: object = {'$part': self.part(value).hex()}
        else:
            plain = {'$bytes': base64.b64encode(value).decode('ascii')}
        return plain if kind is bytes else {'$bytearray': plain}


def _name_of(kind: type) -> str:
    return '{}:{}'.format(kind.__module__, kind.__qualname__)


def _is_member(value: enum.Flag) -> bool:
    """Whether it is one member of its class, not several of its flags, or none."""
    return type(value).__members__.get(value.name or '') is value


def _findable(kind: type) -> str:
    """Return the name of a class.

    :raises NotStorable: where a later program would not find the class by it, such as one that a
        function has made.
    """
    name = _name_of(kind)
    if _found(name) is not kind:
        raise NotStorable('its class cannot be found by its name, {}'.format(name))
    return name


def _found(name: str) -> Any:
    """Return what stands at a place of the program that runs. Nothing is imported for it."""
    module, _, path = name.partition(':')
    found: Any = sys.modules.get(module)
    for part in path.split('.'):
        found = getattr(found, part, None)
    return found


def _class_named(name: str, wanted: Callable[[type], bool]) -> type:
    """Return a class of the program that runs."""
    found = _found(name)
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
        raise NotReadable('{} has other fields now: {}'.format(
            name, ', '.join(sorted(known.symmetric_difference(values)))))
    made: object = object.__new__(kind)  # without its __init__, which may do anything
    for key, value in values.items():
        object.__setattr__(made, key, value)
    return made


def _named(name: str, values: List[object]) -> object:
    kind: Any = _class_named(name, lambda found: issubclass(found, tuple)
                             and hasattr(found, '_fields'))
    if len(values) != len(kind._fields):
        raise NotReadable('{} has {} fields now, not {}'.format(
            name, len(kind._fields), len(values)))
    made: object = tuple.__new__(kind, values)
    return made


_CLASSES: Dict[str, Callable[[str, Any], object]] = {
    '$enum': _enum, '$flag': _flag, '$data': _data, '$named': _named}
_SIMPLE: Dict[type, Tuple[str, Callable[[Any], Any]]] = {
    set: ('$set', list),
    frozenset: ('$frozenset', list),
    complex: ('$complex', lambda value: [value.real, value.imag]),
    OrderedDict: ('$ordered', lambda value: [list(item) for item in value.items()]),
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

    :raises TypeError: where `of` is no type, or one of the functions cannot be called.
    """
    CODECS.register(of, encode, decode, name)
