"""Values that do what no value should, as they are looked at."""

import collections
import dataclasses
import enum
import functools
from typing import Any, List

from hypothesis import strategies as st


class Rude(BaseException):
    """No Exception, as a cancelled task of asyncio."""

    def __str__(self) -> str:
        raise Rude


ERRORS = (
    ValueError,
    KeyError,
    AttributeError,
    RecursionError,
    MemoryError,
    RuntimeError,
    StopIteration,
    GeneratorExit,
    Rude,
)


def raising(error: type) -> Any:
    """A method, or a property, that raises."""

    def method(*_: Any, **__: Any) -> Any:
        raise error()

    return method


SPECIAL = (
    '__reduce__',
    '__reduce_ex__',
    '__deepcopy__',
    '__copy__',
    '__eq__',
    '__hash__',
    '__iter__',
    '__len__',
    '__bool__',
    '__str__',
    '__repr__',
    '__getattr__',
    '__dir__',
    '__getstate__',
    '__getitem__',
    '__format__',
    '__contains__',
)
BASES = (object, list, dict, tuple, str, int, float, set, bytes, Exception, collections.OrderedDict)


def hostile(base: type, names: Any, error: type, lies: object) -> Any:
    """An object of a class of which some methods raise."""
    members = {name: raising(error) for name in names}
    if lies == 'raises':
        members['__class__'] = property(raising(error))
    elif lies is not None:
        members['__class__'] = lies
    return type('Hostile', (base,), members)()


@dataclasses.dataclass
class HalfSet:
    name: str
    grasp: list = dataclasses.field(init=False)


@dataclasses.dataclass
class More:
    name: str = 'cup'

    @functools.cached_property
    def length(self) -> int:
        return len(self.name)


@dataclasses.dataclass
class Slotted:
    __slots__ = ('name',)
    name: str


class SlottedMore(Slotted):
    __slots__ = ('note',)


@dataclasses.dataclass
class OfList(list):
    name: str = 'cup'


@dataclasses.dataclass
class RaisingField:
    name: str = 'cup'

    def __getattribute__(self, name: str) -> Any:
        if name == 'name':
            raise Rude
        return object.__getattribute__(self, name)


class Pair(collections.namedtuple('Pair', 'one two')):
    pass


class Mode(enum.Enum):
    ON = 1

    @property
    def name(self) -> str:  # type: ignore[override]
        raise ValueError('none')


class Named(type):
    def __getattribute__(cls, name: str) -> Any:
        if name in ('__module__', '__qualname__', '__name__'):
            raise Rude
        return type.__getattribute__(cls, name)

    def __eq__(cls, other: object) -> bool:
        raise Rude

    def __hash__(cls) -> int:
        raise Rude


def holding_itself() -> List[object]:
    """Two ways round, so that who goes every way has no end."""
    value: List[object] = []
    value += [value, [value], {'again': value}]
    return value


def shared() -> List[object]:
    """64 lists, that are more than there are atoms where each is written out."""
    value: List[object] = []
    for _ in range(64):
        value = [value, value]
    return value


def deep() -> List[object]:
    value: List[object] = []
    for _ in range(100000):
        value = [value]
    return value


def with_more() -> More:
    value = More()
    value.extra = 1  # type: ignore[attr-defined]
    return value


MAKERS = (
    lambda: HalfSet('cup'),
    lambda: HalfSet,
    with_more,
    lambda: SlottedMore('cup'),
    OfList,
    RaisingField,
    lambda: Pair(1, HalfSet('cup')),
    lambda: Mode.ON,
    lambda: Mode,
    lambda: Named('Odd', (), {})(),
    lambda: Named('Odd', (), {}),
    holding_itself,
    deep,
    lambda: '\ud800',
    lambda: {'\udcff': '\ud800'},
    lambda: 10**5000,
    lambda: float('nan'),
    lambda: {1: 2, '1': 3},
    lambda: {(1, 2): None},
    lambda: memoryview(b'abc')[::2],
    lambda: iter([1]),
    lambda: open,
    lambda: More.length,
    object,
    lambda: Rude,
    lambda: type('Gone', (), {'__module__': 5})(),
)

oddities = st.one_of(
    st.sampled_from(MAKERS).map(lambda make: make()),
    st.builds(
        hostile,
        st.sampled_from(BASES),
        st.sets(st.sampled_from(SPECIAL), max_size=4),
        st.sampled_from(ERRORS),
        st.sampled_from((None, None, 'raises', str, int, dict, list, HalfSet, Mode)),
    ),
)
values = st.recursive(
    st.one_of(oddities, st.integers(), st.text(max_size=3)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.text(max_size=3), inner, max_size=3),
        st.tuples(inner, inner),
    ),
    max_leaves=6,
)


def boxed(strategy: st.SearchStrategy) -> st.SearchStrategy:
    """Each value in a list of its own. Hypothesis (6.130 does) looks at the class of what it has
    drawn for a test, and some of these raise there.
    """
    return st.lists(strategy, min_size=1, max_size=1)
