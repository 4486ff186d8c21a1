"""What is drawn: plain data, texts, damaged bytes and messages of any type."""

import io
import re
from typing import Any, Dict, NamedTuple, Optional, Sequence

import genpy
import roslib.message
from hypothesis import strategies as st

WORDS = (
    '',
    'A',
    'B',
    'task',
    'task/A',
    'succeeded',
    'aborted',
    'preempted',
    'q1',
    'eva',
    'stop',
    'goto',
    'goto:A',
    '*',
    '**',
    '/',
    '//',
    'T/../A',
    '~',
    '$',
    'default',
    'x' * 300,
    '\0',
    '\ud7ff',
    '\x1b[2J',
    'python:os:system',
    'a\nb',
    '-1',
    'nan',
    '1e999',
    'None',
    '[',
)
texts = st.one_of(st.sampled_from(WORDS), st.text(max_size=12))
numbers = st.one_of(
    st.integers(-3, 20), st.integers(), st.floats(), st.sampled_from((0.0, 0.5, 1e308, 2**63))
)
leaves = st.one_of(st.none(), st.booleans(), numbers, texts)
plain = st.recursive(
    leaves,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(texts, inner, max_size=4)),
    max_leaves=10,
)
"""What JSON, YAML and the parameter server hold."""


def mapping_of(fields: Dict[str, Any], always: Sequence[str] = ()) -> Any:
    """A mapping with some of `fields`, each as its strategy draws it.

    Now and then one is anything plain, or nobody knows it, or there is no mapping at all.
    """
    right = st.sets(st.sampled_from(sorted(fields)), max_size=4).flatmap(
        lambda names: st.fixed_dictionaries(
            {name: fields[name] for name in sorted(names.union(always))}
        )
    )
    wrong = st.tuples(right, st.sampled_from(sorted(fields)), plain).map(
        lambda drawn: dict(drawn[0], **{drawn[1]: drawn[2]})
    )
    odd = st.tuples(right, texts, plain).map(lambda drawn: dict(drawn[0], **{drawn[1]: drawn[2]}))
    return st.one_of(right, right, right, right, right, wrong, wrong, odd, plain)


class Damage(NamedTuple):
    """What has happened to a file."""

    kind: str
    place: float  # 0 to 1, of its length
    noise: bytes

    def of(self, whole: bytes) -> bytes:
        """The bytes that are left."""
        place = int(self.place * len(whole))
        if self.kind == 'cut':
            return whole[:place]
        if self.kind == 'overwritten':
            return whole[:place] + self.noise + whole[place + len(self.noise) :]
        if self.kind == 'put in':
            return whole[:place] + self.noise + whole[place:]
        if self.kind == 'flipped' and place < len(whole):
            return whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :]
        return self.noise if self.kind == 'another' else whole


damages = st.builds(
    Damage,
    st.sampled_from(('none', 'cut', 'overwritten', 'put in', 'flipped', 'another')),
    st.floats(0, 1),
    st.one_of(st.binary(max_size=40), st.integers(1, 9000).map(bytes)),
)


def damaged(whole: bytes) -> Any:
    """The bytes as they are, or damaged."""
    return damages.map(lambda damage: damage.of(whole))


_ARRAY = re.compile(r'(.+)\[(\d*)\]\Z')
_INTEGERS = {
    '{}int{}'.format(sign, bits): (
        (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    )
    for sign in ('', 'u')
    for bits in (8, 16, 32, 64)
}
_INTEGERS.update(byte=_INTEGERS['int8'], char=_INTEGERS['uint8'])


def message(kind: Any, given: Optional[Dict[str, Any]] = None) -> Any:
    """A message as it comes off the wire.

    :param given: strategies of some of its fields, in place of anything of their type.
    """
    fields = dict(zip(kind.__slots__, kind._slot_types))
    drawn = {name: _or(given, name, _field(of)) for name, of in sorted(fields.items())}
    return st.fixed_dictionaries(drawn).map(lambda values: sent(kind(**values)))


def _or(given: Optional[Dict[str, Any]], name: str, any_of_type: Any) -> Any:
    if given is None or name not in given:
        return any_of_type
    return st.one_of(given[name], given[name], given[name], any_of_type)


def sent(one: genpy.Message) -> genpy.Message:
    """The message behind the wire."""
    buffer = io.BytesIO()
    one.serialize(buffer)
    other = type(one)()
    other.deserialize(buffer.getvalue())
    return other


def _field(of: str) -> Any:
    array = _ARRAY.match(of)
    if array:
        return _array(array.group(1), array.group(2))
    if of in _INTEGERS:
        low, high = _INTEGERS[of]
        return st.one_of(st.integers(max(low, 0), min(high, 9)), st.integers(low, high))
    if of == 'bool':
        return st.booleans()
    if of in ('float32', 'float64'):
        width = int(of[5:])
        return st.one_of(st.sampled_from((0.0, 1.0, -1.0, 0.5)), st.floats(width=width))
    if of == 'string':
        return texts
    if of in ('time', 'duration'):
        seconds, nanoseconds = st.integers(0, 2**31 - 1), st.integers(0, 999999999)
        return st.tuples(seconds, nanoseconds).map(
            lambda parts: (genpy.Time if of == 'time' else genpy.Duration)(*parts)
        )
    kind = roslib.message.get_message_class('std_msgs/Header' if of == 'Header' else of)
    return message(kind)


def _array(of: str, size: str) -> Any:
    if of in ('uint8', 'char'):
        length = (int(size), int(size)) if size else (0, 40)
        return st.binary(min_size=length[0], max_size=length[1])
    least, most = (int(size), int(size)) if size else (0, 3)
    return st.lists(_field(of), min_size=least, max_size=most)


def words(*first: str) -> Any:
    """One of these words, or another text."""
    return st.one_of(st.sampled_from(first), st.sampled_from(first), texts)
