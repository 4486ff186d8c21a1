"""Reads YAML files. A value keeps how it is written, since a label may look like a value.

Keys are taken as they are written, and so are dates. `1e3` is a number. All else is as YAML 1.1
has it.
"""

import math
import re
from collections import deque
from pathlib import Path
from typing import Any, Deque, Dict, List, Optional, Tuple, cast

import yaml

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.written import WrittenFloat, WrittenInt, WrittenWord

NOT_YAML = '{}: not valid YAML: {}; allowed: a mapping in YAML'
_TAG = 'tag:yaml.org,2002:'
_MERGE = _TAG + 'merge'
# numbers that YAML 1.1 takes for texts: 1e3, 1.5e3, 5.e-1
_EXPONENT = re.compile(r'[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$')


def read_yaml(path: str, what: str = 'settings file') -> Tuple[Dict[str, Any], Dict[str, int]]:
    """Read a YAML file that holds a mapping.

    :param what: what to call the file in an error.
    :returns: the values, and dotted key -> line number.
    :raises SettingsError: where it cannot be read, is no YAML, names a key twice or holds something
        else.
    """
    text = _text_of(path, what)
    try:
        values, lines = _values_of(text, str(path))
    except SettingsError:
        raise
    except yaml.YAMLError as err:
        why = getattr(err, 'problem', None) or str(err)
        place = _marked(str(path), err)
        raise SettingsError(place, why, 'YAML', NOT_YAML.format(place, why)) from err
    except RecursionError as err:
        raise SettingsError(
            str(path), 'something that contains itself', 'a tree of settings'
        ) from err
    except Exception as err:  # a value that is not what its tag says can make PyYAML raise anything
        raise SettingsError(str(path), str(err), 'YAML', NOT_YAML.format(path, err)) from err
    if values is None:
        return {}, lines
    if not isinstance(values, dict):
        raise SettingsError(str(path), values, 'a mapping of settings')
    return values, lines


def _text_of(path: str, what: str) -> str:
    try:
        return Path(path).read_text(encoding='utf-8')
    except FileNotFoundError as err:
        raise SettingsError(
            what, str(path), 'a readable YAML file', '{}: no such file: {}'.format(what, path)
        ) from err
    except (OSError, UnicodeDecodeError) as err:
        raise SettingsError(what, str(path), 'a readable YAML file ({})'.format(err)) from err


def _values_of(text: str, path: str) -> Tuple[Any, Dict[str, int]]:
    loader = _Loader(text)
    try:
        root = loader.get_single_node()
        lines = _line_numbers(path, root)  # first, since merge keys are gone once it is constructed
        values = None if root is None else loader.construct_document(root)
        _check_is_tree(values)
        return values, lines
    finally:
        loader.dispose()


class _Loader(yaml.SafeLoader):
    """Makes values that keep their texts, and keys that are texts."""

    yaml_implicit_resolvers = {
        first: [each for each in resolvers if each[0] not in (_TAG + 'timestamp', _TAG + 'value')]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def construct_mapping(self, node: yaml.Node, deep: bool = False) -> Dict[Any, Any]:
        """Return a mapping, with merge keys resolved."""
        if isinstance(node, yaml.MappingNode):
            self.flatten_mapping(node)
            for key, _ in node.value:
                if isinstance(key, yaml.ScalarNode):
                    key.tag = _TAG + 'str'
        # the base class refuses any other node, with an error of its own
        mapping: Dict[Any, Any] = yaml.constructor.BaseConstructor.construct_mapping(
            self, cast('yaml.MappingNode', node), deep=deep
        )
        return mapping

    def word(self, node: yaml.ScalarNode) -> Optional[WrittenWord]:
        """Return true, false or nothing."""
        if not node.value:
            return None
        is_bool = node.tag == _TAG + 'bool'
        return WrittenWord(node.value, self.construct_yaml_bool(node) if is_bool else None)

    def whole(self, node: yaml.ScalarNode) -> WrittenInt:
        """Return a whole number."""
        number = WrittenInt(self.construct_yaml_int(node))
        number.text = node.value
        return number

    def number(self, node: yaml.ScalarNode) -> Any:
        """Return a number. One without a fraction is whole: 1e3."""
        value = (
            float(node.value) if _EXPONENT.match(node.value) else self.construct_yaml_float(node)
        )
        is_whole = math.isfinite(value) and value.is_integer() and '.' not in node.value
        number: Any = WrittenInt(value) if is_whole else WrittenFloat(value)
        number.text = node.value
        return number


_Loader.add_implicit_resolver(_TAG + 'float', _EXPONENT, list('-+.0123456789'))
for _name, _construct in (
    ('bool', _Loader.word),
    ('null', _Loader.word),
    ('int', _Loader.whole),
    ('float', _Loader.number),
):
    _Loader.add_constructor(_TAG + _name, _construct)


def _check_is_tree(value: Any) -> None:
    """Go through all values.

    :raises RecursionError: where one contains itself.
    """
    for each in (
        value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    ):
        _check_is_tree(each)


def _line_numbers(path: str, root: Optional[yaml.Node]) -> Dict[str, int]:
    """Dotted key -> line, from 1, of every key in the file, and of each item of a list.

    :raises SettingsError: where a key is given twice in one mapping, which YAML readers otherwise
        pass over.
    """
    lines: Dict[str, int] = {}
    waiting: Deque[Tuple[str, Optional[yaml.Node]]] = deque([('', root)])
    seen = set()  # an alias may lead back to where it stands
    while waiting:
        prefix, node = waiting.popleft()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            for index, item in enumerate(node.value):
                place = '{}[{}]'.format(prefix[:-1], index)
                lines[place] = item.start_mark.line + 1
                waiting.append((place + '.', item))
        elif isinstance(node, yaml.MappingNode):
            waiting += _entries(path, prefix, node, lines)
    return lines


def _entries(
    path: str, prefix: str, node: yaml.MappingNode, lines: Dict[str, int]
) -> List[Tuple[str, yaml.Node]]:
    entries = []
    first_lines: Dict[str, int] = {}
    for key, value in node.value:
        dotted = prefix + str(key.value)
        line = key.start_mark.line + 1
        if dotted in first_lines and key.tag != _MERGE:
            place, first = '{} line {}: {}'.format(path, line, dotted), first_lines[dotted]
            raise SettingsError(
                place,
                value.value,
                'each key once',
                '{}: given a second time (first in line {}); allowed: each key once'.format(
                    place, first
                ),
            )
        first_lines[dotted] = line
        entries.append((dotted + '.', value))
    lines.update(first_lines)
    return entries


def _marked(path: str, err: yaml.YAMLError) -> str:
    mark = getattr(err, 'problem_mark', None)
    return '{} line {}'.format(path, mark.line + 1) if mark else path
