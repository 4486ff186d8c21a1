"""Commands to change machines that are down, in their stores. Pure."""

from typing import Dict

from .checks import CommandSpec, text, whole

# which one, by the key of its row, and the moment that the row had: what has gone on since is not
# changed
DOWN = {
    'down': text(6000, 1),
    'moment': whole(0, 2**53 - 1, 'the number of a moment, as the row has it'),
}

STORED_COMMANDS: Dict[str, CommandSpec] = {
    'goto_stored': CommandSpec('operator', dict(DOWN, label=text(4000, 1))),
    'edit_stored': CommandSpec(
        'operator', dict(DOWN, container=text(4000, 1), key=text(1000, 1), json=text(40000, 1))
    ),
    'drop_stored': CommandSpec('operator', DOWN),
}
