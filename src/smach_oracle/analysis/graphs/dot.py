"""Runs dot."""

import shutil
import subprocess

from .container_graph import GraphLayout, read_layout

DOT_LIMIT_S = 20.0


class LayoutError(Exception):
    """A graph was not laid out. The text says why."""


def lay_out(text: str, command: str = 'dot', limit_s: float = DOT_LIMIT_S) -> GraphLayout:
    """Return the layout of a graph in dot's language.

    :param command: found in PATH.
    :raises LayoutError: where dot is missing, fails, or takes longer than `limit_s`.
    """
    path = shutil.which(command)
    if path is None:
        raise LayoutError('no {} in PATH'.format(command))
    try:
        result = subprocess.run(
            [path, '-Tjson0'],
            input=text.encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            timeout=limit_s,
            check=True,
        )
        return read_layout(result.stdout.decode('utf-8', 'replace'))
    except (OSError, ValueError, subprocess.SubprocessError) as err:
        raise LayoutError(str(err)) from err
