"""The command oracle_disk: what bags and stores take of the disk, and what of it may go."""

import argparse
import math
import os
import sqlite3
import sys
import time
from typing import List, Optional

from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.store.errors import StoreError
from smach_oracle.store.retention import Dropped, Retention, check
from smach_oracle.store.store_file import StoreFile

from .bag_folder import BagFolder, remove, told
from .limits import GB, Limits, planned, sizes

SKIPPED, WRONG = 1, 2  # exit codes


def main(arguments: Optional[List[str]] = None) -> int:
    """Run the command, and return its exit code."""
    given = _parser().parse_args(arguments)
    limits = Limits(given.keep_days, given.keep_gb)
    if not limits.are_set:
        _complain('nothing goes without a limit: give --keep-days or --keep-gb')
        return WRONG
    codes = [_look_at(path_of(path), limits, given.delete) for path in given.paths]
    if not given.delete:
        _say('nothing was removed: --delete removes it')
    return max(codes)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='oracle_disk',
        description='Name the bags of folders, and the trials of stores, that '
        'are over a limit, and remove them with --delete. What is open, being written or held by a '
        'program stays, and so does a trial that has not ended or whose question is open.',
    )
    parser.add_argument('paths', nargs='+', metavar='PATH', help='a folder of bags, or a store')
    parser.add_argument(
        '--keep-days',
        type=_amount,
        default=0.0,
        metavar='DAYS',
        help='remove trials that ended more than DAYS days ago',
    )
    parser.add_argument(
        '--keep-gb',
        type=_amount,
        default=0.0,
        metavar='GB',
        help='remove the oldest until each folder and store has at most GB * 10^9 bytes',
    )
    parser.add_argument(
        '--delete', action='store_true', help='remove them; without this option they are only named'
    )
    return parser


def _amount(text: str) -> float:
    try:
        amount = float(text)
    except ValueError:
        amount = math.nan
    if not 0 < amount < math.inf:
        raise argparse.ArgumentTypeError(
            '{} is not allowed; allowed: a number above 0'.format(text)
        )
    return amount


def _look_at(path: str, limits: Limits, delete: bool) -> int:
    try:
        if os.path.isdir(path):
            return _folder(path, limits, delete)
        if not os.path.exists(path):
            raise StoreError('{}: no such folder or store'.format(path))
        return _store(path, limits, delete)
    except (OSError, StoreError, sqlite3.Error) as err:
        _complain(str(err))
        return WRONG


def _folder(path: str, limits: Limits, delete: bool) -> int:
    plan = planned(BagFolder(path).bags(), limits, time.time())
    for removal in plan.kept:
        _say('stays    {}'.format(told(removal)))
    if not delete:
        for removal in plan.removals:
            _say('would go {}'.format(told(removal)))
        number = len(plan.removals)
        _say(
            '{}: {} bag{} would go, {:.1f} MB; {} over the limits stay'.format(
                path, number, '' if number == 1 else 's', sizes(plan.removals) / 1e6, len(plan.kept)
            )
        )
        return 0
    gone = remove(plan, _say, _complain)
    _say('{}: {} bags are gone; {} over the limits stay'.format(path, gone, len(plan.kept)))
    return 0 if gone == len(plan.removals) else SKIPPED


def _store(path: str, limits: Limits, delete: bool) -> int:
    StoreFile(path, read_only=True).close()  # a store is not made by looking for it
    store = StoreFile(path)
    try:
        check(store)
        retention = Retention(store, limits.days, limits.gb * GB)
        retention.plan(time.time())
        for dropped in retention.kept:
            _say('stays    {}'.format(_trial(path, dropped)))
        for dropped in retention.going:
            _say('{} {}'.format('removes' if delete else 'would go', _trial(path, dropped)))
        if not delete or not retention.going:
            _say(
                '{}: {} trials would go; {} over the limits stay'.format(
                    path, len(retention.going), len(retention.kept)
                )
            )
        if delete and retention.going:
            before = _size_on_disk(path)
            retention.drop()
            _say('{}: {:.1f} MB less'.format(path, (before - _size_on_disk(path)) / 1e6))
    finally:
        store.close()
    return 0


def _size_on_disk(path: str) -> int:
    return sum(os.path.getsize(path + end) for end in ('', '-wal') if os.path.exists(path + end))


def _trial(path: str, dropped: Dropped) -> str:
    trial = dropped.trial
    return '{}: trial {} of {}, {} moments: {}'.format(
        path, trial.number, trial.machine, trial.moments, dropped.why
    )


def _say(text: str) -> None:
    sys.stdout.write(text + '\n')
    sys.stdout.flush()  # it is read before anything goes


def _complain(text: str) -> None:
    sys.stderr.write('oracle_disk: {}\n'.format(text))
