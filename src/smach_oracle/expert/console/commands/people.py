"""Commands for the notes between shifts. Pure."""

from typing import Dict

from .checks import CommandSpec, text

PEOPLE_COMMANDS: Dict[str, CommandSpec] = {
    'write_note': CommandSpec('operator', {'text': text(2000, 1)}),
    'drop_note': CommandSpec('operator', {'note': text(80, 1)}),
}
