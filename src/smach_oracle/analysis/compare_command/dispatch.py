"""The command compare: it finds the subcommand, and loads nothing else."""

import argparse
import sys
from importlib import import_module
from typing import Mapping, NamedTuple, Optional, Sequence

OWN, EXPERIMENT = 'own', 'experiment'
_PACKAGE = 'smach_oracle.analysis.'
_NAME = 'compare'


class Subcommand(NamedTuple):
    """A word behind `compare`."""

    module: str  # below smach_oracle.analysis. Its main() takes arguments, and a name for messages
    group: str  # OWN or EXPERIMENT
    takes: str  # as the help shows it
    about: str


SUBCOMMANDS: Mapping[str, Subcommand] = {
    'oracles': Subcommand(
        'sweep', OWN, 'FOLDER ...', 'bags: how often was the expert asked, by memory and policy?'
    ),
    'what_if': Subcommand(
        'what_if',
        OWN,
        'FOLDER ...',
        'bags: what would other settings have decided at each failure?',
    ),
    'variants': Subcommand(
        'comparison',
        OWN,
        'FILE ...',
        'CSV of bag_statistics, or rows of run_trials: is one better?',
    ),
    'figures': Subcommand(
        'drawing.command',
        EXPERIMENT,
        'FOLDER --output OUT',
        'rows of run_trials: figures and tables',
    ),
    'same_trials': Subcommand(
        'trial_steps', EXPERIMENT, 'FOLDER FOLDER', 'bags: did the same seeds do the same?'
    ),
}
_ABOUT = """Compare recorded trials.

of your own trials:
{own}

of experiments of this package (run_trials):
{experiment}

`compare WHAT --help` has the options of each. `bag_statistics FOLDER --by WHAT` compares bags by
folder, node, host, version, settings or day.
"""


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the subcommand that is named first, and return its exit code."""
    given = list(sys.argv[1:] if argv is None else argv)
    if given and given[0] in SUBCOMMANDS:
        module = import_module(_PACKAGE + SUBCOMMANDS[given[0]].module)
        code: int = module.main(given[1:], '{} {}'.format(_NAME, given[0]))
        return code
    parser = _parser()
    parser.parse_args(given)
    parser.error('name one of: {}'.format(', '.join(SUBCOMMANDS)))


def _parser() -> argparse.ArgumentParser:
    """Return the parser of a line that names no subcommand: of --help, and of mistakes."""
    parser = argparse.ArgumentParser(
        prog=_NAME,
        usage='{} WHAT ...'.format(_NAME),
        description=_ABOUT.format(own=_listed(OWN), experiment=_listed(EXPERIMENT)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    works = parser.add_subparsers(metavar='WHAT', help=argparse.SUPPRESS)
    for name in SUBCOMMANDS:
        works.add_parser(name, add_help=False)
    return parser


def _listed(group: str) -> str:
    return '\n'.join(
        '  {:<12}{:<21}{}'.format(name, each.takes, each.about)
        for name, each in SUBCOMMANDS.items()
        if each.group == group
    )
