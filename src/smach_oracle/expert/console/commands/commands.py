"""The closed set of commands that a page may give, with a check of each argument. Pure.

A command is a JSON object {"id": number, "do": name, ...arguments}. No argument is ever the name of
a topic, a service or a type to call: questions are named by their keys, and must be open ones.
"""

from typing import Any, Dict, Mapping, NamedTuple, Optional

from smach_oracle.oracle.errors import OracleError
from smach_oracle.ros.strict_json import load_json

from .checks import QUESTION, CommandSpec, one_of, outputs, seen, shown, text, whole
from .driving import DRIVING_COMMANDS
from .driving import stops as stops_hand
from .holding import HOLDING_COMMANDS, MACHINE_STOPS
from .marking import MARKING_COMMANDS
from .people import PEOPLE_COMMANDS
from .stored import STORED_COMMANDS

MOST_BYTES = 65536
KINDS = ('goto', 'supersede', 'give_up', 'interface')
_id = whole(1, 2**53 - 1, 'a whole number from 1')


class CommandError(OracleError):
    """A message that is not a command. The text gives what is allowed.

    `number` is its id, 0 where it has none.
    """

    def __init__(self, text: str, number: int = 0) -> None:
        super().__init__(text)
        self.number = number


class PageCommand(NamedTuple):
    """A command that has the right form."""

    number: int
    name: str
    arguments: Dict[str, Any]


class CommandReply(NamedTuple):
    """The result of a command, for the page."""

    ok: bool
    message: str = ''
    data: Optional[Mapping[str, object]] = None  # plain, or None where there is no more to it


def parse(text: object) -> PageCommand:
    """Check one message of a browser.

    :raises CommandError: saying what is wrong, and what is allowed.
    """
    data = _decode(text)
    try:
        number = _id(data.pop('id', None))
    except ValueError as err:
        raise CommandError('"id" must be a whole number from 1') from err
    name = data.pop('do', None)
    if not isinstance(name, str) or name not in COMMANDS:
        raise CommandError(
            'there is no command {}; allowed: {}'.format(shown(name), ', '.join(sorted(COMMANDS))),
            number,
        )
    checks = COMMANDS[name].checks
    unknown = sorted(set(data) - set(checks))
    if unknown:
        raise CommandError('{} takes no {}'.format(name, shown(unknown[0])), number)
    try:
        return PageCommand(
            number, name, {field: check(data.get(field)) for field, check in checks.items()}
        )
    except ValueError as err:
        raise CommandError('{}: {}'.format(name, err), number) from err


def needed_role(name: str) -> str:
    """Return the least role that may give a command."""
    return COMMANDS[name].role


def stops(command: PageCommand) -> bool:
    """Whether it can only stop something: it is never refused, and waits for nothing."""
    return command.name in MACHINE_STOPS or stops_hand(command.name, command.arguments)


def _decode(text: object) -> Dict[str, Any]:
    if not isinstance(text, str):
        raise CommandError('commands are text')
    if len(text) > MOST_BYTES:
        raise CommandError('a command has at most {} bytes'.format(MOST_BYTES))
    try:
        data = load_json(text)
    except (ValueError, RecursionError) as err:
        raise CommandError('not JSON: {}'.format(err)) from err
    if not isinstance(data, dict):
        raise CommandError('a command is a JSON object')
    return data


def _person(value: object) -> str:
    name = ' '.join(text(60)(value).split())
    if not name.isprintable():
        raise ValueError('a name is made of printable characters')
    return name


COMMANDS: Dict[str, CommandSpec] = {
    'hello': CommandSpec('viewer', {'xsrf': text(200, 1), 'expert': _person}),
    'watch': CommandSpec('viewer', {'trial': text(400)}),
    'look': CommandSpec('viewer', {'at': one_of(('', 'trials', 'people'))}),
    'view': CommandSpec('viewer', {'question': text(1000)}),
    'claim': CommandSpec('operator', QUESTION),
    'take_over': CommandSpec('operator', QUESTION),
    'release': CommandSpec('operator', QUESTION),
    'pressed': CommandSpec('operator', QUESTION),
    'answer': CommandSpec(
        'operator',
        dict(
            QUESTION,
            kind=one_of(KINDS),
            name=text(400),
            container=text(4000),
            outputs=outputs,
            why=text(2000),
            seen=seen,
        ),
    ),
    **MARKING_COMMANDS,
    **DRIVING_COMMANDS,
    **HOLDING_COMMANDS,
    **STORED_COMMANDS,
    **PEOPLE_COMMANDS,
}
