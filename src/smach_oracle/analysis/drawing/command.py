"""Draw the figures of an experiment, and write its tables, from the rows that it has kept.

FOLDER is that of `run_trials --protocol`, or one with its results.csv files below it. No bag is
needed. The folder of --output gets main.svg, same_seeds.svg, persistence.svg, memory.svg,
continuous.svg, extra.svg, each with a PNG, and tables.md, as far as there are rows of them.
"""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence

from smach_oracle.oracle.settings.paths import path_of

from ..bag_events import BagError
from ..compare_command.inputs import ROWS_FILE, folder_of_rows, no_rows_in
from ..reading import report_error
from ..trial_rows import TrialRow, read_rows
from .sweep_tables import format_sweeps
from .tables import format_tables

KINDS = ('main', 'persistence', 'memory', 'continuous', 'extra')


def find_rows(folder: Path) -> Dict[str, List[TrialRow]]:
    """Return the rows below a folder, by the figure that they belong to, one of KINDS.

    :raises BagError: where there are none, or a file cannot be used.
    :raises OSError: where one cannot be read.
    """
    found: Dict[str, List[TrialRow]] = {}
    for path in sorted(folder.rglob(ROWS_FILE)):
        kind = next((each for each in KINDS[1:] if each in path.parent.name), KINDS[0])
        found.setdefault(kind, []).extend(read_rows(path))
    found = {kind: found[kind] for kind in KINDS if found.get(kind)}
    if not found:
        raise no_rows_in(str(folder))
    return found


def tables_page(found: Mapping[str, Sequence[TrialRow]]) -> str:
    """Return a page of Markdown with the tables of all figures."""
    parts = [
        '# Tables of the experiment\n\nThe command `compare figures` has made this page from the '
        'rows of {:,} trials.\n'.format(sum(map(len, found.values())))
    ]
    for kind, rows in found.items():
        parts.append(
            '## {}\n\n{}'.format(
                kind.capitalize(),
                '\n'.join(filter(None, [format_sweeps(kind, rows), format_tables(rows, kind)])),
            )
        )
    return '\n'.join(parts)


def draw_all(found: Mapping[str, Sequence[TrialRow]], output: Path) -> List[Path]:
    """Draw what there is, and write the tables. Return the paths.

    :raises OSError: where a file cannot be written.
    """
    from .hours_figure import draw_hours  # matplotlib takes a second: only where it is wanted
    from .looks import save
    from .main_figure import draw_main, draw_same_seeds, same_seeds
    from .sweep_figures import draw_memory, draw_persistence

    draws: Dict[str, Callable[[Sequence[TrialRow]], Any]] = dict(
        zip(KINDS, (draw_main, draw_persistence, draw_memory, draw_hours, draw_main))
    )
    output.mkdir(parents=True, exist_ok=True)
    paths = [output / 'tables.md']
    paths[0].write_text(tables_page(found), encoding='utf-8')
    for kind, rows in found.items():
        if kind == 'continuous' and all(row.hour is None for row in rows):
            continue
        paths += save(partial(draws[kind], rows), output / kind)
    compared = found.get('main', ())
    if same_seeds(compared):
        paths += save(partial(draw_same_seeds, compared), output / 'same_seeds')
    return paths


def main(argv: Optional[Sequence[str]] = None, command: str = 'compare figures') -> int:
    """Run the command, and return its exit code.

    :param command: its name in messages.
    """
    parser = argparse.ArgumentParser(
        prog=command,
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('folder', metavar='FOLDER', type=path_of, help='with rows below it')
    parser.add_argument('former', metavar='OUT', nargs='?', type=path_of, help=argparse.SUPPRESS)
    parser.add_argument(
        '--output', metavar='FOLDER', type=path_of, help='folder of the figures and tables'
    )
    args = parser.parse_args(argv)
    if (args.output is None) == (args.former is None):
        parser.error('name the folder of the figures once: --output OUT')
    try:
        found = find_rows(folder_of_rows(args.folder))
        for path in draw_all(found, Path(args.output or args.former)):
            sys.stdout.write('{}\n'.format(path))
    except (BagError, OSError, ImportError) as err:
        return report_error(command, err)
    return 0
