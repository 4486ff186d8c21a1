"""Preconditions of a state as its designer wrote them (paper, section IV-B). Pure.

There are four kinds. The first is the label of another state of the same container, or the path of
a state of another one below the top machine. The others are a `smach.State`, a callable
`f(userdata) -> bool`, and a pair (check, achieve) whose second half runs only if the first does not
hold. In YAML: a label, a path (KITCHEN/LOOK, or /LOOK for a state of the top machine),
'python:module:attribute', or {check: ..., achieve: ...}.
"""

from enum import Enum
from typing import Any, Iterator, List, Mapping, NamedTuple, Optional, Tuple

from ..errors import SettingsError
from ..identity import name_of
from .checks import PYTHON, Resolver, is_state, named_object, no_name
from .written import as_text


class PreconditionKind(Enum):
    """Kinds of precondition."""

    LABEL = 'label'
    STATE = 'state'
    CALLABLE = 'callable'
    PAIR = 'pair'


class PreconditionSpec(NamedTuple):
    """One precondition: what it is and what people call it."""

    kind: PreconditionKind
    name: str
    # the label or path, the state, the callable, or the pair of specs (check, achieve)
    target: Any

    def labels(self) -> Tuple[str, ...]:
        """Return the labels and paths of other states that it names."""
        return tuple(each.target for each in self.of_kind(PreconditionKind.LABEL))

    def of_kind(self, kind: PreconditionKind) -> Iterator['PreconditionSpec']:
        """Yield itself if it is of this kind. Of a pair, yield the halves that are."""
        if self.kind is PreconditionKind.PAIR:
            for half in self.target:
                yield from half.of_kind(kind)
        elif self.kind is kind:
            yield self


_ALLOWED = (
    'the label of a state, PATH/LABEL of one elsewhere, a smach.State, '
    'a callable f(userdata) -> bool, a pair (check, achieve) of these, '
    "'python:module:attribute' or {check: ..., achieve: ...}"
)


def parse_preconditions(
    key: str, given: object, resolver: Optional[Resolver] = None
) -> Tuple[PreconditionSpec, ...]:
    """Check a list of preconditions of one state.

    :raises SettingsError: naming `key` and the position.
    """
    if not isinstance(given, list):
        if isinstance(given, tuple) and all(isinstance(spec, PreconditionSpec) for spec in given):
            return given
        raise SettingsError(key, given, 'a list of preconditions')
    return tuple(
        parse_precondition('{}[{}]'.format(key, index), spec, resolver)
        for index, spec in enumerate(given)
    )


def parse_precondition(
    key: str, given: object, resolver: Optional[Resolver] = None
) -> PreconditionSpec:
    """Check one precondition.

    :raises SettingsError: naming `key`.
    """
    if isinstance(given, PreconditionSpec):
        return given
    given = as_text(given)
    if isinstance(given, str):
        return _parse_text(key, given, resolver)
    if is_state(given) and not isinstance(given, type):
        return PreconditionSpec(PreconditionKind.STATE, type(given).__name__, given)
    if isinstance(given, Mapping):
        if set(given) != {'check', 'achieve'}:
            raise SettingsError(key, dict(given), 'exactly the keys check and achieve')
        return _parse_pair(key, [given['check'], given['achieve']], resolver)
    if isinstance(given, (tuple, list)) and len(given) == 2:
        return _parse_pair(key, list(given), resolver)
    if callable(given) and not is_state(given):
        return PreconditionSpec(PreconditionKind.CALLABLE, name_of(given), given)
    raise no_name(key, given, _ALLOWED)


def _parse_text(key: str, given: str, resolver: Optional[Resolver]) -> PreconditionSpec:
    if not given:
        raise SettingsError(key, given, _ALLOWED)
    if not given.startswith(PYTHON):
        return PreconditionSpec(PreconditionKind.LABEL, given, given)
    if resolver is None:
        raise SettingsError(key, given, 'an object, since names cannot be imported here')
    found = named_object(key, given, 'function or state', resolver)
    if not callable(found) and not is_state(found):
        raise SettingsError(
            key,
            given,
            'the name of a callable or a smach.State',
            problem='names a value of type {}'.format(type(found).__name__),
        )
    return parse_precondition(key, found)._replace(name=given[len(PYTHON) :].rpartition(':')[2])


def _parse_pair(key: str, halves: List[object], resolver: Optional[Resolver]) -> PreconditionSpec:
    check = parse_precondition(key + '.check', halves[0], resolver)
    achieve = parse_precondition(key + '.achieve', halves[1], resolver)
    if PreconditionKind.PAIR in (check.kind, achieve.kind):
        raise SettingsError(key, halves, 'a pair of a check and an achieve, neither of them a pair')
    return PreconditionSpec(
        PreconditionKind.PAIR, '{} or {}'.format(check.name, achieve.name), (check, achieve)
    )
