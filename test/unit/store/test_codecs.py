"""Values as a store keeps them, and back."""

import collections
import dataclasses
import enum
import math
import sys

import pytest

from smach_oracle.store.codecs import SHORT, Codecs, NotReadable, NotStorable


class Colour(enum.Enum):
    RED = 1


class Level(enum.IntEnum):
    LOW = 2


class Doors(enum.Flag):
    LEFT = 1
    RIGHT = 2


class Pair(collections.namedtuple('Pair', 'one two')):
    pass


@dataclasses.dataclass
class Thing:
    name: str
    parts: list


MADE = []


@dataclasses.dataclass(frozen=True)
class Fixed:
    pair: Pair

    def __post_init__(self):
        MADE.append(self)


class Opaque:
    pass


Unfindable = collections.namedtuple('Point', 'x y')  # its name is another one
Inside = dataclasses.make_dataclass('Inside', ['x'])
Inside.__qualname__ = 'f.<locals>.Inside'


def there_and_back(value, codecs=None, other=None):
    codecs = codecs or Codecs()
    text, whole, parts = codecs.encode(value)
    return (other or codecs).decode(text, whole, parts.__getitem__)


VALUES = [
    None,
    True,
    3,
    -1 << 80,
    0.1,
    'Größe \ud800',
    '',
    [1, [2, {'a': None}]],
    {'$tuple': [1]},
    {1: 'one', (2, 3): 'pair', None: 0},
    (1, (2,)),
    {1, 2},
    frozenset('ab'),
    b'\x00\xff',
    b'x' * (SHORT + 1),
    bytearray(b'abc'),
    1 + 2j,
    collections.OrderedDict([('b', 1), ('a', 2)]),
    Colour.RED,
    Level.LOW,
    Doors.LEFT,
    Doors.LEFT | Doors.RIGHT,
    Doors(0),
    Pair(1, (2,)),
    Thing('cup', [Pair(1, 2)]),
    'x' * 10 * SHORT,
    {'deep': {'bytes': [b'y' * 1000, b'y' * 1000]}},
    float('inf'),
    [float('-inf')],
]


@pytest.mark.parametrize('value', VALUES, ids=lambda value: repr(value)[:30])
def test_a_value_is_the_same_after_it_was_stored(value):
    found = there_and_back(value)
    assert found == value
    assert type(found) is type(value)


def test_nan_is_stored():
    assert math.isnan(there_and_back(float('nan')))


def test_a_dataclass_is_made_without_its_init():
    fixed = Fixed(Pair(1, 2))
    made = len(MADE)
    assert there_and_back(fixed) == fixed
    assert len(MADE) == made


def test_equal_bytes_are_kept_once():
    assert len(Codecs().encode([b'z' * 5000, b'z' * 5000]).parts) == 1


@pytest.mark.parametrize(
    'value, why',
    [
        (Opaque(), 'no codec is registered for .*Opaque'),
        ({'inside': [Opaque()]}, 'no codec'),
        (open, 'no codec'),
        (sys, 'no codec'),
        (Unfindable(1, 2), 'its class cannot be found by its name, test_codecs:Point'),
        ([Inside(1)], 'its class cannot be found by its name, .*:f.<locals>.Inside'),
    ],
)
def test_what_no_codec_knows_is_named(value, why):
    with pytest.raises(NotStorable, match=why):
        Codecs().encode(value)


def test_what_holds_itself_is_refused():
    value = []
    value.append(value)
    with pytest.raises(NotStorable, match='holds itself'):
        Codecs().encode(value)


def test_a_registered_type_is_stored_and_its_subclasses():
    class Special(Opaque):
        pass

    codecs = Codecs()
    codecs.register(Opaque, lambda value: {'raw': b'1' * 1000}, lambda plain: plain['raw'])
    assert there_and_back(Special(), codecs) == b'1' * 1000


def test_who_has_not_registered_the_name_is_told_so():
    codecs = Codecs()
    codecs.register(Opaque, lambda value: 1, lambda plain: plain, name='opaque')
    with pytest.raises(NotReadable, match="no codec 'opaque'"):
        there_and_back(Opaque(), codecs, Codecs())


def test_a_codec_that_fails_is_named():
    codecs = Codecs()
    codecs.register(Opaque, lambda value: 1 // 0, lambda plain: 1 // 0, name='opaque')
    with pytest.raises(NotStorable, match='its codec opaque failed: ZeroDivisionError'):
        codecs.encode(Opaque())


def test_codecs_of_a_parent_are_used():
    above = Codecs()
    above.register(Opaque, lambda value: 1, lambda plain: 'made')
    assert there_and_back(Opaque(), Codecs(above)) == 'made'


@pytest.mark.parametrize('given', [(1, str, str), (Opaque, None, str), (Opaque, str, 'no')])
def test_a_codec_that_is_none_is_refused(given):
    with pytest.raises(TypeError, match='a codec is'):
        Codecs().register(*given)


@pytest.mark.parametrize(
    'text',
    [
        '{"$enum": ["no.such.module:Colour", "RED"]}',
        '{"$data": ["os:system", {}]}',
        '{"$named": ["subprocess:Popen", [1]]}',
        '{"$unheard": 1}',
        '{"$part": "zz"}',
        '[',
        'nothing',
        '{"$float": "one"}',
        '{"$map": [1]}',
        '{"$by": ["a"]}',
    ],
)
def test_a_damaged_or_foreign_value_is_refused(text):
    with pytest.raises(NotReadable):
        Codecs().decode(text, None, {}.__getitem__)


def test_nothing_is_imported_for_a_stored_value():
    assert 'antigravity' not in sys.modules
    with pytest.raises(NotReadable, match='no class antigravity:geohash'):
        Codecs().decode('{"$data": ["antigravity:geohash", {}]}', None, {}.__getitem__)
    assert 'antigravity' not in sys.modules


def test_a_class_that_has_changed_is_told():
    text = Codecs().encode(Thing('cup', [])).text.replace('parts', 'pieces')
    with pytest.raises(NotReadable, match='has other fields now: parts, pieces'):
        Codecs().decode(text, None, {}.__getitem__)
