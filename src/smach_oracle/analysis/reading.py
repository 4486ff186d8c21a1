"""Reads folders of bags for all commands of the analysis.

A bag that cannot be used is skipped and named, and the exit code is 1.
"""

import json
import os
import sys
from typing import Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

from smach_oracle.oracle.settings.failure_rule import FailureRule
from smach_oracle.packages import lacking

from .bag_events import BagContent, BagError, EventReader, SkippedBag, find_bags

ALL_READ, SOME_SKIPPED, NOTHING_COUNTED = 0, 1, 2  # exit codes


def bags_in(places: Sequence[str], skipped: List[SkippedBag]) -> List[str]:
    """Return the paths of all bags in folders and below. Adds unreadable folders to `skipped`.

    :raises BagError: where a place does not exist, or there are no bags.
    """
    paths = find_bags(places, skipped)
    if not paths:
        raise BagError('{}: no bags{}'.format(', '.join(places), reasons_of(skipped)))
    return paths


def reasons_of(skipped: Sequence[SkippedBag]) -> str:
    """Return lines that name what was skipped, with the reasons, to follow another line."""
    return ''.join('\n  {}: {}'.format(item.path, item.reason) for item in skipped)


def read_bags(places: Sequence[str], skipped: List[SkippedBag]) -> Iterator[Tuple[str, BagContent]]:
    """Yield path and content of all bags in folders and below. Adds what is unusable to `skipped`.

    :raises BagError: where a place does not exist, or there are no bags.
    """
    paths = bags_in(places, skipped)
    reader = EventReader()
    for path in paths:
        try:
            content = reader.read(path)
        except BagError as err:
            skipped.append(SkippedBag(path, str(err)))
        else:
            yield path, content


def report_skipped(skipped: Sequence[SkippedBag]) -> int:
    """Name on standard error what was skipped, with the reasons, and return the exit code."""
    sys.stdout.flush()
    for item in skipped:
        sys.stderr.write('Skipped {}: {}\n'.format(item.path, item.reason))
    return SOME_SKIPPED if skipped else ALL_READ


def rule_of(command: str, names: Optional[Sequence[str]]) -> Optional[FailureRule]:
    """Return the rule that --failing-outcomes gives, None where it is not given.

    A folder behind the option is one of its names. A line on standard error says so.
    """
    for name in names or ():
        if os.path.exists(name):
            text = "{}: --failing-outcomes: '{}' is taken as an outcome; give folders before it\n"
            sys.stderr.write(text.format(command, name))
    return FailureRule(tuple(names)) if names else None


def plain(skipped: Sequence[SkippedBag]) -> List[Dict[str, str]]:
    """Return what was skipped, for JSON."""
    return [item._asdict() for item in skipped]


def write_json(path: str, data: Mapping[str, object]) -> None:
    """Write the result of a command to a file.

    :raises OSError: where the file cannot be written.
    """
    with open(path, 'w', encoding='utf-8') as target:
        json.dump(data, target, indent=2)
        target.write('\n')


def report_error(command: str, why: Union[str, Exception]) -> int:
    """Print on standard error why a command has no result, and return the exit code."""
    if isinstance(why, OSError):
        text = '{}: {}'.format(why.filename or 'output', why.strerror or why)
    else:
        text = isinstance(why, ImportError) and lacking(why) or str(why)
    sys.stdout.flush()
    sys.stderr.write('{}: {}\n'.format(command, text))
    return NOTHING_COUNTED
