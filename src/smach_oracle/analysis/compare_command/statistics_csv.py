"""Trials from the CSV of `bag_statistics --csv`, compared without their bags."""

import csv
import json
import os
from typing import (
    Any,
    Callable,
    Collection,
    Dict,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
)

from ..bag_events import BagError, RecordedCause
from ..comparing.groups import BY, NOT_RECORDED, VALUES, TrialGroup
from ..comparing.report import format_groups
from ..counting.trial_summary import TrialSummary
from ..trial_counter import TrialEnding
from ..truth import Truth

FILE, FOLDER, SETTINGS = 'file', 'folder', 'settings'
BY_OF_CSV = (FILE, *BY)
_VARIANT = 'variant'  # column, and the name of the setting that stands for all
_ORACLE = {True: 'with oracle', False: 'without oracle', None: 'oracle unknown'}


class CsvTrial(NamedTuple):
    """A line of such a file."""

    file: str
    variant: str  # as the file names it: by what differs in it
    folder: str
    trial: TrialSummary


def _flag(text: str) -> Optional[bool]:
    return {'True': True, 'False': False, '': None}[text]


# columns of all versions, by what reads them. Those of later versions may be missing
_COLUMNS: Mapping[str, Callable[[str], Any]] = {
    'trial_id': str,
    'experiment': str,
    'recovers': _flag,
    'start_time': float,
    'duration_s': float,
    'ending': TrialEnding,
    'outcome': str,
    'failures': int,
    'recoveries': int,
    'questions': int,
    'answered': int,
    'lost_events': int,
}
_OF_WORLD: Mapping[str, Callable[[str], Any]] = {'seed': int, 'true_success': _flag}

_ALLOWED: Mapping[Callable[[str], Any], str] = {
    _flag: 'True, False, or nothing',
    float: 'a number',
    int: 'a whole number',
    TrialEnding: ', '.join(ending.value for ending in TrialEnding),
}


def read_statistics(path: str) -> List[CsvTrial]:
    """Return the trials of a CSV of bag_statistics.

    :raises BagError: where it is no such file, or a line is wrong.
    :raises OSError: where it cannot be read.
    """
    try:
        with open(path, encoding='utf-8', newline='') as source:
            reader = csv.DictReader(source)
            columns = reader.fieldnames or ()
            missing = [name for name in (*_COLUMNS, *_OF_WORLD) if name not in columns]
            if missing:
                raise BagError('{}: no column {}'.format(path, missing[0]))
            return [_parsed(path, number, cells) for number, cells in enumerate(reader, 2)]
    except (UnicodeDecodeError, csv.Error) as err:
        raise BagError('{}: no CSV of bag_statistics: {}'.format(path, err)) from err


def _parsed(path: str, number: int, cells: Mapping[str, Optional[str]]) -> CsvTrial:
    found: Dict[str, Any] = {}
    for name, kind in {**_COLUMNS, **_OF_WORLD}.items():
        text = cells[name] or ''
        try:
            found[name] = None if name in _OF_WORLD and not text else kind(text)
        except (ValueError, KeyError) as err:
            raise BagError(
                '{} row {}: {}: {!r} is not allowed; allowed: {}'.format(
                    path, number, name, text, _ALLOWED[kind]
                )
            ) from err
    told = {name: text or '' for name, text in cells.items() if isinstance(text, str)}
    seed, success = (found.pop(name) for name in _OF_WORLD)
    variant = told.get(_VARIANT) or _ORACLE[found['recovers']]
    folder = told.get('folder', '')
    trial = TrialSummary(
        **found,
        failures_by_state=(),
        bags=(os.path.join(folder, ''),),  # its replicate
        settings=((_VARIANT, variant),),
        cause=None if seed is None else RecordedCause(seed, '', (), ()),
        truth=None if success is None else _truth(seed or 0, success, told),
        node=told.get('node', ''),
        origin=tuple(
            (name, told[name]) for name in ('host', 'version', 'script') if told.get(name)
        ),
        inputs=_inputs(told.get('inputs', '')),
    )
    return CsvTrial(path, variant, folder, trial)


def _inputs(text: str) -> Tuple[Tuple[str, Any], ...]:
    try:
        found = json.loads(text) if text else {}
    except ValueError:
        return ()
    return tuple(sorted(found.items())) if isinstance(found, dict) else ()


def _truth(seed: int, success: bool, told: Mapping[str, str]) -> Truth:
    wrong = told.get('wrong_object', '')
    return Truth(seed, '', success, told.get('why', ''), (), 0.0, 0.0, {}, wrong)


def compared_files(paths: Sequence[str], by: Optional[str]) -> str:
    """Return the table of the groups of trials in such files, and the tests of each two.

    If a trial is there twice, the later line is used. A file names its variants by what differs in
    it. So variants of several files are told apart by their files, too.

    :param by: one of BY_OF_CSV. None means by file, or by settings where there is one file.

    :raises BagError: where a file cannot be used, or there are no trials.
    :raises OSError: where one cannot be read.
    """
    files = list(dict.fromkeys(paths))
    found = {each.trial.trial_id: each for path in files for each in read_statistics(path)}
    if not found:
        raise BagError('{}: no trials in it'.format(', '.join(files)))
    by = by or (FILE if len(files) > 1 else SETTINGS)
    groups = _groups(_value(by, list(found.values()), len(files) > 1), list(found.values()))
    return format_groups(by, groups).lstrip('\n')


def _groups(value: Callable[[CsvTrial], str], trials: Sequence[CsvTrial]) -> List[TrialGroup]:
    parts: Dict[Tuple[str, str], List[TrialSummary]] = {}
    for each in trials:
        parts.setdefault((each.trial.experiment, value(each)), []).append(each.trial)
    return [TrialGroup(*key, tuple(parts[key])) for key in sorted(parts)]


def _value(by: str, trials: Sequence[CsvTrial], several: bool) -> Callable[[CsvTrial], str]:
    """Return what names the group of a trial. `several`: whether there are several files."""
    if by == FILE:
        return lambda each: each.file
    if by == SETTINGS:
        return lambda each: '{}: {}'.format(each.file, each.variant) if several else each.variant
    if by == FOLDER:
        around = _around({each.folder for each in trials} - {''})
        return lambda each: os.path.relpath(each.folder, around) if each.folder else NOT_RECORDED
    return lambda each: VALUES[by](each.trial)


def _around(folders: Collection[str]) -> str:
    """Return the folder around all of them. They may be of another machine."""
    absolute = [folder for folder in folders if os.path.isabs(folder)]
    if len(absolute) != len(folders) or not absolute:
        return os.curdir
    return os.path.commonpath([os.path.dirname(folder) for folder in absolute])
