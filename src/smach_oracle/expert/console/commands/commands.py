"""The closed set of what a browser may say, and the check of every bit of it. Pure.

A command is a JSON object {"id": number, "do": name, ...arguments}. No argument is ever the name of a topic, a service
or a type to call: questions are named by their keys, and must be open ones.
"""
import json
from typing import Any, Dict, NamedTuple

from ...oracle.errors import OracleError
from .checks import QUESTION, Spec, one_of, outputs, shown, text
from .eye_commands import EYE_COMMANDS
from .hand_commands import HAND_COMMANDS

MOST_BYTES = 65536
KINDS = ('goto', 'supersede', 'give_up', 'interface')


class BadCommand(OracleError):
    """Something that is no command; the text says what is allowed. `number` is its id, 0 where it has none."""

    def __init__(self, text: str, number: int = 0) -> None:
        super().__init__(text)
        self.number = number


class Command(NamedTuple):
    """A command that has the right form."""

    number: int
    name: str
    arguments: Dict[str, Any]


def parse(text: Any) -> Command:
    """Check one message of a browser.

    :raises BadCommand: saying what is wrong, and what is allowed.
    """
    data = _decode(text)
    number = data.pop('id', None)
    if not _is_count(number):
        raise BadCommand('"id" must be a whole number from 1')
    name = data.pop('do', None)
    if not isinstance(name, str) or name not in COMMANDS:
        raise BadCommand('there is no command {}; allowed: {}'.format(shown(name), ', '.join(sorted(COMMANDS))),
                         number)
    checks = COMMANDS[name].checks
    unknown = sorted(set(data) - set(checks))
    if unknown:
        raise BadCommand('{} takes no {}'.format(name, shown(unknown[0])), number)
    try:
        return Command(number, name, {field: check(data.get(field)) for field, check in checks.items()})
    except ValueError as err:
        raise BadCommand('{}: {}'.format(name, err), number) from err


def needed_role(name: str) -> str:
    """The least role that may give a command."""
    return COMMANDS[name].role


def _decode(text: Any) -> Dict[str, Any]:
    if not isinstance(text, str):
        raise BadCommand('commands are text')
    if len(text) > MOST_BYTES:
        raise BadCommand('a command has at most {} bytes'.format(MOST_BYTES))
    try:
        data = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as err:
        raise BadCommand('not JSON: {}'.format(err)) from err
    if not isinstance(data, dict):
        raise BadCommand('a command is a JSON object')
    return data


def _refuse(name: str) -> float:
    raise ValueError('{} is not a JSON number'.format(name))


def _person(value: Any) -> str:
    name = ' '.join(text(60)(value).split())
    if not name.isprintable():
        raise ValueError('a name is made of printable characters')
    return name


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 < value < 2 ** 53


COMMANDS: Dict[str, Spec] = {
    'hello': Spec('viewer', {'xsrf': text(200, 1), 'expert': _person}),
    'watch': Spec('viewer', {'trial': text(400)}),
    'claim': Spec('operator', QUESTION),
    'take_over': Spec('operator', QUESTION),
    'release': Spec('operator', QUESTION),
    'answer': Spec('operator', dict(QUESTION, kind=one_of(KINDS), name=text(400), outputs=outputs,
                                    why=text(2000))),
    **EYE_COMMANDS,
    **HAND_COMMANDS,
}
