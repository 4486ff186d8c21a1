"""What was given in place of what a command reads, and which command takes it."""

import csv
import os
from enum import Enum
from pathlib import Path
from typing import Dict, List, Sequence

from ..bag_events import BagError, walk_bags

ROWS_FILE = 'results.csv'
STATISTICS_COLUMNS = ('trial_id', 'experiment')  # the first ones of `bag_statistics --csv`
ROWS_COLUMNS = ('task', 'variant', 'replicate', 'seed', 'ending')  # the first ones of such a file
_HEAD = 10000  # characters in which the columns stand
_SHOWN = 3  # files in a message
_BAG = '#ROSBAG'


class InputKind(Enum):
    """The kind of a place on a command line."""

    MISSING = 'missing'
    FOLDER = 'folder'
    ROWS = 'rows'  # of run_trials
    STATISTICS = 'statistics'  # a CSV of bag_statistics
    BAG = 'bag'
    OTHER = 'other'


def kind_of(place: str) -> InputKind:
    """Return what lies there, by the beginning of a file.

    :raises OSError: where a file cannot be read.
    """
    if not os.path.exists(place):
        return InputKind.MISSING
    if os.path.isdir(place):
        return InputKind.FOLDER
    if not os.path.isfile(place):  # opening a pipe may wait forever
        return InputKind.OTHER
    with open(place, encoding='utf-8', errors='replace', newline='') as source:
        head = source.readline(_HEAD)
    if head.startswith(_BAG):
        return InputKind.BAG
    columns = tuple(next(csv.reader([head]), []))
    if columns[: len(ROWS_COLUMNS)] == ROWS_COLUMNS:
        return InputKind.ROWS
    if columns[: len(STATISTICS_COLUMNS)] == STATISTICS_COLUMNS:
        return InputKind.STATISTICS
    return InputKind.OTHER


def instead_of_bags(err: Exception, places: Sequence[str]) -> Exception:
    """Return an error of reading bags, in better words where each place has no bags, but rows."""
    if not isinstance(err, BagError):
        return err
    hints = [_hint_for_bags(place) for place in places]
    return BagError('\n'.join(hints)) if all(hints) else err


def _hint_for_bags(place: str) -> str:
    """Say which command takes what lies there, '' where it is nothing known, or has bags."""
    try:
        kind = kind_of(place)
    except OSError:
        return ''
    if kind is InputKind.ROWS:
        return '{0}: no bag, but rows of run_trials: use `compare variants {0}`'.format(place)
    if kind is InputKind.STATISTICS:
        return '{0}: no bag, but a CSV of bag_statistics: use `compare variants {0}`'.format(place)
    if kind is not InputKind.FOLDER or next(walk_bags(place), None) is not None:
        return ''
    files = row_files(place)
    if not files:
        return ''
    return (
        '{0}: no bags, but rows of run_trials: use `compare variants {1}`, or `compare figures {0} '
        '--output OUT`'.format(place, _some(files))
    )


def csv_kind(paths: Sequence[str]) -> InputKind:
    """Return the kind of the files that are to be compared: ROWS or STATISTICS.

    An empty file has no rows.

    :raises BagError: where one is something else, or they are of both kinds.
    :raises OSError: where one cannot be read.
    """
    kinds: Dict[InputKind, str] = {}
    for path in paths:
        kind = kind_of(path)
        if kind is InputKind.FOLDER and row_files(path):
            raise BagError(
                '{}: a folder: give files in it: {}'.format(path, _some(row_files(path)))
            )
        if kind not in (InputKind.ROWS, InputKind.STATISTICS) and not _is_empty(path):
            raise no_rows_in(path)
        kinds.setdefault(kind if kind is InputKind.STATISTICS else InputKind.ROWS, path)
    if len(kinds) > 1:
        raise BagError(
            '{}: rows of run_trials, but {} is a CSV of bag_statistics: give files of one '
            'kind'.format(kinds[InputKind.ROWS], kinds[InputKind.STATISTICS])
        )
    return next(iter(kinds))


def _is_empty(path: str) -> bool:
    return os.path.isfile(path) and not os.path.getsize(path)


def no_rows_in(place: str) -> BagError:
    """Return an error that says what lies at a place in which there are no rows of run_trials.

    :raises OSError: where it cannot be read.
    """
    kind = kind_of(place)
    if kind is InputKind.MISSING:
        return BagError('{}: no such file'.format(place))
    if kind is InputKind.FOLDER:
        bags = sum(1 for _ in walk_bags(place))
        if bags:
            return BagError(
                '{0}: no rows of run_trials, but {1} bag(s): use `bag_statistics {0} --by '
                'settings`'.format(place, bags)
            )
        return BagError('{}: no {} with trials in it, and no bags'.format(place, ROWS_FILE))
    if kind is InputKind.BAG:
        return BagError(
            '{0}: no rows of run_trials, but a bag: use `bag_statistics {0}`'.format(place)
        )
    return BagError(
        '{}: neither rows of run_trials nor a CSV of bag_statistics, by its columns'.format(place)
    )


def folder_of_rows(place: str) -> Path:
    """Return a folder in which rows are looked for.

    :raises BagError: where there is no such folder.
    :raises OSError: where a file in its place cannot be read.
    """
    kind = kind_of(place)
    if kind is InputKind.FOLDER:
        return Path(place)
    if kind is InputKind.MISSING:
        raise BagError('{}: no such folder'.format(place))
    if kind is InputKind.ROWS:
        folder = os.path.dirname(place) or '.'
        raise BagError('{}: a file: give the folder in which it lies, {}'.format(place, folder))
    if kind is InputKind.STATISTICS:
        raise BagError(
            '{0}: a CSV of bag_statistics, no folder with rows of run_trials: `compare variants '
            '{0}` compares it, `bag_statistics FOLDER --figure OUT` draws bags'.format(place)
        )
    raise no_rows_in(place)


def row_files(folder: str) -> List[str]:
    """Return the files with rows of run_trials in a folder and below, sorted."""
    return sorted(str(path) for path in Path(folder).rglob(ROWS_FILE) if path.is_file())


def _some(files: Sequence[str]) -> str:
    more = ' ...' if len(files) > _SHOWN else ''
    return ' '.join(files[:_SHOWN]) + more
