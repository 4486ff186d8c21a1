"""Names that users hold: interface fields, launch arguments, options, members of classes."""

import ast
import inspect
import re
import xml.etree.ElementTree as ElementTree
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any, Dict, List, Sequence

from held import ROOT, SCRIPTS

UNKNOWN = '--no-such-option'
# what a command line needs beside the options
WORDS = {
    'bag_statistics': ['1'],
    'compare_oracles': ['1'],
    'learn': ['1'],
    'pr2_film': ['1'],
    'same_trials': ['1', '1'],
    'what_if': ['1'],
}
# classes whose instances have members of their own: arguments to make one
INSTANCES = {
    'smach_oracle.oracle:FailureRate': (5, 0.1),
    'smach_oracle.oracle:ExponentialFailureRate': (5, 0.1),
    'smach_oracle.oracle:Settings': (),
}
_TEXT_CONSTANT = re.compile(r'string\s+\w+\s*=')


def interface_files() -> Dict[str, Any]:
    """The parts (request, response and so on) of every msg, srv and action file."""
    paths = [
        path
        for kind in ('msg', 'srv', 'action')
        for path in sorted((ROOT / kind).glob('*.' + kind))
    ]
    return {'{}/{}'.format(path.parent.name, path.name): parts_of(_text(path)) for path in paths}


def parts_of(text: str) -> List[Dict[str, Any]]:
    """Fields [type, name] in their order, and constants {name: [type, value]}, of each part."""
    parts: List[Dict[str, Any]] = [{'fields': [], 'constants': {}}]
    for line in text.splitlines():
        # the text of a constant may have a # in it
        declaration = line if _TEXT_CONSTANT.match(line) else line.partition('#')[0]
        declaration = declaration.strip()
        if declaration == '---':
            parts.append({'fields': [], 'constants': {}})
        elif '=' in declaration:
            kind, name, value = re.split(r'\s+|\s*=\s*', declaration, maxsplit=2)
            parts[-1]['constants'][name] = [kind, value]
        elif declaration:
            parts[-1]['fields'].append(declaration.split())
    return parts


def launch_arguments() -> Dict[str, List[str]]:
    """The arguments that can be given to each launch file."""
    return {
        path.name: sorted(_settable(ElementTree.parse(str(path)).getroot()))
        for path in sorted((ROOT / 'launch').glob('*.launch'))
    }


def _settable(launch: ElementTree.Element) -> List[str]:
    return [
        argument.get('name', '')
        for argument in launch.findall('arg')
        if argument.get('value') is None
    ]


def commands() -> List[str]:
    """The commands that are Python."""
    return sorted(
        path.name
        for path in SCRIPTS.iterdir()
        if path.read_bytes().startswith(b'#!/usr/bin/env python3')
    )


def options_of(help_text: str) -> Dict[str, List[str]]:
    """The options in a help text, each with values for it.

    These are all its choices, or '1', which is a number and a name. A flag has none.
    """
    found = {}
    for names, value in re.findall(r'^  (-[\w-]+(?:, -[\w-]+)*)(?: (\S+))?', help_text, re.M):
        choices = re.fullmatch(r'\{(.*)\}', value)
        values = choices.group(1).split(',') if choices else ['1']
        found[names.split(', ')[-1]] = values if value else []
    found.pop('--help', None)
    return found


def with_every_option(command: str, options: Dict[str, List[str]]) -> List[str]:
    """A command line with every option, each of its values, and an option that does not exist."""
    line = [command]
    for option, values in options.items():
        line += [word for value in values for word in (option, value)] or [option]
    line.append(UNKNOWN)
    return line + ['--'] + WORDS[command] if command in WORDS else line


def documented_private_names() -> List[str]:
    """The private names (`~name`: parameters, topics, services) in the documentation."""
    pages = [ROOT / 'README.md', *sorted((ROOT / 'doc').rglob('*.md'))]
    return sorted(
        {name for page in pages for name in re.findall(r'`(~[a-z_][a-z0-9_/]*)`', _text(page))}
    )


def is_put_together(name: str, texts: Sequence[str]) -> bool:
    """Whether the code has the end of a private name, without its ~ or behind another name."""
    last = name[1:].rpartition('/')[2]
    return any(text == name[1:] or text.endswith('/' + last) for text in texts)


def texts_of_the_code() -> List[str]:
    """Every string in the product's code, and every field, after which a parameter may be named."""
    nodes = [
        node
        for path in sorted((ROOT / 'src/smach_oracle').rglob('*.py'))
        for node in ast.walk(ast.parse(_text(path)))
    ]
    strings = {node.value for node in nodes if isinstance(node, ast.Constant)}
    fields = {
        node.target.id
        for node in nodes
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
    return sorted({each for each in strings if isinstance(each, str)} | fields)


def public(place: str) -> Dict[str, Any]:
    """Describe MODULE:NAME.

    An enumeration by its values, another class by its members and their parameters, without those
    that smach gives it; a function by its parameters.
    """
    module, _, name = place.partition(':')
    found = getattr(import_module(module), name)
    if not inspect.isclass(found):
        return {'parameters': parameters(found)}
    if issubclass(found, Enum):
        return {'values': {member.name: member.value for member in found}}
    members = [
        member
        for member in dir(found)
        if not member.startswith('_') and not _is_of_smach(found, member)
    ]
    methods = [name for name in members + ['__init__'] if callable(getattr(found, name))]
    return {
        'members': sorted(set(members + _kept_by_instances(found, place))),
        'parameters': {name: parameters(getattr(found, name)) for name in methods},
    }


def _is_of_smach(found: type, member: str) -> bool:
    owner = next(each for each in found.__mro__ if member in vars(each))
    return owner.__module__.split('.')[0] == 'smach'


def _kept_by_instances(found: type, place: str) -> List[str]:
    if place not in INSTANCES:
        return []
    return [name for name in vars(found(*INSTANCES[place])) if not name.startswith('_')]


def parameters(function: Any) -> List[List[Any]]:
    """Name and kind of each parameter, and whether a call may leave it out."""
    try:
        signature = inspect.signature(function)
    except ValueError:  # written in C, without one
        return []
    return [
        [each.name, each.kind.name, each.default is not each.empty]
        for each in signature.parameters.values()
    ]


def _text(path: Path) -> str:
    return path.read_text(encoding='utf-8')
