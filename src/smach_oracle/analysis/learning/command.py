"""Learn from recorded trials which ways on from a failure help.

The trials are of one machine, under a policy that goes by ways: escalating, any_way or learned. The
rates of its states and what their ways have led to go to a file, with which a machine begins:

    learn bags --rates-file model.json

The setting `rates_file: model.json` has it go on from there.

It prints, as YAML, the preconditions that the record suggests and those that never helped. Exit
code: 0; 1, some bags were skipped; 2, nothing was learned.
"""

import argparse
import os
import sys
from typing import List, Optional, Sequence

from smach_oracle.oracle.records.rates_format import write_learned
from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.renamed_option import RenamedOption

from ..bag_events import BagError, SkippedBag
from ..compare_command.inputs import instead_of_bags
from ..reading import report_error, report_skipped
from ..trials import load_replicates
from .record import MachineRecord, read_record, states_named
from .suggestions import as_yaml
from .words import explained

NAME = 'learn'


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command, and return its exit code."""
    parser = argparse.ArgumentParser(
        prog=NAME, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        'folders',
        nargs='+',
        metavar='FOLDER',
        type=path_of,
        help='with bags in it or below it; or a bag',
    )
    parser.add_argument(
        '--rates-file',
        metavar='FILE',
        type=path_of,
        help='write what was learned to this file, which must not be there yet',
    )
    parser.add_argument(
        '--output',
        dest='rates_file',
        type=path_of,
        default=argparse.SUPPRESS,
        action=RenamedOption,
        help=argparse.SUPPRESS,
    )
    parser.add_argument(
        '--explain',
        action='append',
        metavar='STATE',
        default=[],
        help='say in words what has helped a state: its label, or its path below the top machine',
    )
    args = parser.parse_args(argv)
    skipped: List[SkippedBag] = []
    try:
        if args.rates_file and os.path.exists(args.rates_file):
            raise BagError(
                '{}: is there already. Name another file, or remove it'.format(args.rates_file)
            )
        record = _read(args.folders, skipped)
        lines = _told(record, args.explain)
        if args.rates_file:
            write_learned(args.rates_file, record.learned, record.rule)
    except (BagError, ImportError, OSError) as err:
        report_skipped(skipped)
        return report_error(NAME, instead_of_bags(err, args.folders))
    sys.stdout.write('\n'.join(lines) + '\n')
    return report_skipped(skipped)


def _read(folders: Sequence[str], skipped: List[SkippedBag]) -> MachineRecord:
    """Read the trials in folders.

    :raises BagError: where there is nothing to learn from.
    """
    replicates = load_replicates(folders, skipped)
    trials = [trial.events for _, found in sorted(replicates.items()) for trial in found]
    where = ', '.join(folders)
    if not trials:
        raise BagError('{}: no trials with an oracle whose events are all there'.format(where))
    try:
        return read_record(trials)
    except BagError as err:
        raise BagError('{}: {}'.format(where, err)) from err


def _told(record: MachineRecord, explain: Sequence[str]) -> List[str]:
    """Return what is printed.

    :raises BagError: where there is no such state.
    """
    results = sum(map(len, record.results.values()))
    lines = [
        '# {}: {} trials, {} results of ways from failures of {} states'.format(
            record.machine, record.trials, results, len(record.results)
        )
    ]
    for name in explain:
        states = states_named(record, name)
        if not states:
            raise BagError('{!r}: no trial has visited such a state'.format(name))
        for state in states:
            told = explained(state, record.results.get(state, ()))
            lines += told or ['{}: no way was gone from a failure of it'.format(state)]
    return lines + as_yaml(record)
