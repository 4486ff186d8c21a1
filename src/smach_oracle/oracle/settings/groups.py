"""Groups of settings: where files and parameters have what the executive has in one row. Pure.

The fields of `Settings` are flat, while a file has `deadline_s` in the mapping `expert`. Each field
says so itself, by its `key`: `expert.deadline_s`. The name of the field is the older key, and is
still read. If it is that of the group, it is the short form: `checkpoint: FILE` means
`checkpoint: {file: FILE}`.
"""

from difflib import get_close_matches
from typing import Any, Dict, Iterable, Iterator, List, Mapping, NamedTuple, Tuple

from ..errors import SettingsError
from ..identity import is_same
from . import checks
from .written import as_text, as_value, plain


class GivenSetting(NamedTuple):
    """A setting that is given."""

    name: str  # of its field, or the key where no field is meant
    written: str  # the dotted key under which it is given
    value: object


class Member(NamedTuple):
    """A setting that belongs to a group."""

    name: str  # of its field
    key: str  # in the group
    short: str  # what may stand for the whole group, in words; '' for nothing
    marks: Tuple[str, ...]  # a mapping with one of these keys is this setting, and not the group
    kinds: Tuple[type, ...]  # of what stands for the whole group


_NO_MEMBER = Member('', '', '', (), ())


class Groups:
    """The groups of a dataclass of settings.

    :param fields: what `setting` was told of each field.
    :param others: keys at the top that are none of its fields.
    :param texts: what each group is about, a line of Markdown, in the order of a page.
    """

    def __init__(
        self,
        fields: Mapping[str, Mapping[str, Any]],
        others: Iterable[str],
        texts: Mapping[str, str],
    ) -> None:
        self.texts = texts
        self._others = list(others)
        self._keys = {name: facts['key'] or name for name, facts in fields.items()}
        self._members: Dict[str, Dict[str, Member]] = {group: {} for group in texts}
        self._short = dict.fromkeys(texts, _NO_MEMBER)
        for name, facts in fields.items():
            group, _, key = self._keys[name].partition('.')
            if key:
                short = facts['short']
                kinds = (str,) if isinstance(facts['default'], str) else (list, tuple)
                member = Member(name, key, short, facts['marks'], kinds)
                self._members[group][key] = member
                if name == group:
                    self._short[group] = member

    def key_of(self, name: str) -> str:
        """Return the dotted key of a field."""
        return self._keys.get(name, name)

    def members(self, group: str) -> List[str]:
        """Return the names of the fields of a group."""
        return [member.name for member in self._members[group].values()]

    def older_keys(self) -> Dict[str, str]:
        """Return the keys of now by the older ones, which are still read."""
        return {
            name: key
            for name, key in self._keys.items()
            if name != key and name not in self._members
        }

    def top_keys(self) -> List[str]:
        """Return the keys at the top: groups, and settings that are in none."""
        return sorted({*self._others, *(key.partition('.')[0] for key in self._keys.values())})

    def given_in(self, given: Mapping[str, object]) -> List[GivenSetting]:
        """Return the settings in a mapping, flat. Keys that mean no field are among them.

        :raises SettingsError: for a group that is no mapping, a key that its group does not have,
            and a setting that is given under two keys with two values.
        """
        found: Dict[str, GivenSetting] = {}
        for each in self._each(checks.mapping('settings', given)):
            other = found.setdefault(each.name, each)
            if other is not each and not is_same(plain(other.value), plain(each.value)):
                raise _given_twice(self.key_of(each.name), each, other)
        return list(found.values())

    def in_groups(self, given: List[GivenSetting]) -> Dict[str, Any]:
        """Return settings as a file of now has them."""
        found: Dict[str, Any] = {}
        for each in given:
            group, _, key = self.key_of(each.name).partition('.')
            if key:
                found.setdefault(group, {})[key] = each.value
            else:
                found[group] = each.value
        return found

    def hint(self, key: str, group: str = '') -> str:
        """Return ' (did you mean KEY?)' for a key that nobody has, '' if no other is close.

        `group`: where it stands, '' for the top.
        """
        meant = {each.key: self._keys[each.name] for each in self._members.get(group, {}).values()}
        marks = self._short.get(group, _NO_MEMBER).marks
        meant.update({mark: '{}.{}'.format(group, mark) for mark in marks})
        here = list(meant)
        for members in self._members.values():
            for each in members.values():
                meant.setdefault(each.key, self._keys[each.name])
        meant.update(self._keys)
        meant.update({name: name for name in self.top_keys()})
        close = [key] if key in meant else get_close_matches(key, here, 1)
        close = close or get_close_matches(key, sorted(meant), 1)
        if not close:
            return ''
        place = ' at the top' if group and '.' not in meant[close[0]] else ''
        return ' (did you mean {}{}?)'.format(meant[close[0]], place)

    def _each(self, given: Mapping[str, object]) -> Iterator[GivenSetting]:
        for key, value in given.items():
            if key not in self._members:
                yield GivenSetting(key, key, value)
            elif as_value(value) is not None:  # nothing is set in an empty section of a file
                yield from self._of_group(key, value)

    def _of_group(self, group: str, value: object) -> Iterator[GivenSetting]:
        members, short = self._members[group], self._short[group]
        if not isinstance(value, Mapping):
            if not isinstance(as_text(value), short.kinds):
                raise SettingsError(group, value, self._allowed(group))
            yield GivenSetting(short.name, group, value)
            return
        alone: Dict[str, object] = {}
        is_one = any(mark in value for mark in short.marks)
        for key, each in checks.mapping(group, value).items():
            if key in members:
                yield GivenSetting(members[key].name, '{}.{}'.format(group, key), each)
            elif is_one:
                alone[key] = each
            else:
                allowed = [*members, *short.marks]
                raise no_such('{}.{}'.format(group, key), each, allowed, self.hint(key, group))
        if alone:
            yield GivenSetting(short.name, group, alone)

    def _allowed(self, group: str) -> str:
        keys = 'a mapping with some of the keys ' + ', '.join(self._members[group])
        short = self._short[group].short
        return '{}, or {}'.format(short, keys) if short else keys


def no_such(key: str, value: object, allowed: Any, hint: str) -> SettingsError:
    """Return the error for a key that is none of those that are allowed in its place."""
    keys = 'one of the keys ' + ', '.join(allowed)
    text = '{}: no such setting{}; allowed: {}'.format(key, hint, keys)
    return SettingsError(key, value, keys, text)


def _given_twice(key: str, one: GivenSetting, other: GivenSetting) -> SettingsError:
    text = '{}: {!r} and {}: {!r} are one setting with two values; allowed: one value, under {}'
    return SettingsError(
        one.written,
        one.value,
        'one value',
        text.format(one.written, one.value, other.written, other.value, key),
    )
