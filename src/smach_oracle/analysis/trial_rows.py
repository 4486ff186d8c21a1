"""One row a trial, whatever variant it was run under: what comparisons are made from.

Rows are kept in a CSV file that is appended to as trials end, so that figures can be made without
the bags. An empty cell is what is not known. Definitions: doc/statistics.md.
"""

import csv
import io
import json
import os
from pathlib import Path
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from .bag_events import BagError
from .counting.trial_summary import TrialSummary
from .judging.account import (
    Entry,
    HarmedThing,
    account_in,
    account_text,
    harm_in,
    harm_text,
)
from .lasting.causes_log import LoggedCause, causes_in, causes_of, causes_text
from .lasting.tries import StateTry, WorldClock, in_world_time, tries_in, tries_text
from .trial_counter import TrialEnding
from .truth import DAMAGE, SHARED

OLDEST = 23  # columns of the oldest rows that can be read
LOST = 'lost'  # an ending: the trial hung, or its processes died


class TrialRow(NamedTuple):
    """One trial of one variant. None means it is not known."""

    task: str
    variant: str
    replicate: int
    seed: int
    ending: str  # a value of TrialEnding, or LOST
    true_success: Optional[bool] = None  # by the judge of the world
    wrong_object: Optional[str] = None  # what was brought to the goal in place of the target
    damage: Optional[int] = None  # things that came to harm
    failures: int = 0  # of states
    attempts: int = 0  # recoveries of the oracle by itself, whether they helped or not
    questions: int = 0
    answered: int = 0
    expert_s: Optional[float] = None  # world's time that the expert took
    sim_s: Optional[float] = None  # world's time that the trial took
    causes: str = ''  # kinds, one word each
    lasting: Optional[int] = None  # causes that last
    why: str = ''  # by the judge, or why it was lost
    version: str = ''  # of the code that ran it
    learned: str = ''  # rates at its end, as JSON
    lasting_share: Optional[float] = None  # of the causes. None: as the world has it
    wall_s: Optional[float] = None  # of the machine, that the trial took
    hour: Optional[float] = None  # of a world that goes on, at which it began
    left: str = ''  # how it left a world that goes on, as JSON
    # those below are not in rows of older versions. doc/comparing_experiments.md describes them
    cause_log: str = ''  # the world's log of the causes, as JSON
    tries: str = ''  # of the states that failed, in the world's time, as JSON
    memory: Optional[int] = None  # of the oracle, results of a state
    prior: Optional[float] = None  # failure rate that a state begins with
    harmed: str = ''  # how, which thing and when, as JSON
    account: str = ''  # each failure, decision, jump and answer, as JSON
    shared: Optional[bool] = None  # whether it was run by the bare script, for all variants
    extra_causes: Optional[bool] = None  # whether it had one of the extra kinds of causes
    asked_s: Optional[float] = None  # of the world's time, at which a person was first asked

    @property
    def succeeded(self) -> bool:
        """Whether it truly ended in success: by machine and judge, by the machine if none judged.

        Another object than the one that was meant is no success. Where the machine's outcome says
        neither success nor failure, the judge alone says it.
        """
        if self.wrong_object:
            return False
        if self.ending == TrialEnding.OTHER.value:
            return self.true_success is True
        return self.ending == TrialEnding.SUCCESS.value and self.true_success is not False

    @property
    def intervened(self) -> bool:
        """Whether a person had to act: asked, or to set right how the trial ended."""
        return self.questions > 0 or not self.succeeded

    @property
    def recovered(self) -> bool:
        """Whether a state failed, nobody was asked, and it truly ended in success."""
        return self.failures > 0 and not self.intervened

    @property
    def pair(self) -> 'Pair':
        """Return what the same trial has in common under every variant."""
        return Pair(self.task, self.seed)


class Pair(NamedTuple):
    """The same trial under several variants."""

    task: str
    seed: int


class TruthDetails(NamedTuple):
    """The details that the truth on a trial gives beyond its end.

    Lines of older worlds lack some of them, and those are None.
    """

    wrong_object: Optional[str] = None  # brought to the goal in place of the target. '' means none
    damage: Optional[int] = None  # things knocked over, dropped, pushed off
    passed_s: Optional[Mapping[str, float]] = None  # s of the world's time, by what took them
    lasting: Optional[int] = None  # causes that last
    wall_s: Optional[float] = None
    hour: Optional[float] = None  # of a world that goes on, at which it began
    left: Optional[Mapping[str, Any]] = None  # how it left a world that goes on
    causes: Optional[List[LoggedCause]] = None
    clock: Optional[WorldClock] = None
    shared: bool = False  # it is of the bare script's trial
    harmed: Optional[Tuple[HarmedThing, ...]] = None


NO_DETAILS = TruthDetails()


def row_of(
    summary: TrialSummary,
    task: str,
    variant: str,
    replicate: int,
    seed: int,
    details: TruthDetails = NO_DETAILS,
    version: str = '',
    learned: Optional[Mapping[str, Any]] = None,
    lasting_share: Optional[float] = None,
    tries: Sequence[StateTry] = (),
    account: Sequence[Entry] = (),
    extra_causes: bool = False,
    first_asked: Optional[float] = None,
) -> TrialRow:
    """Return the row of a trial that has come to its end.

    :param tries: of the states that failed, in ROS time.
    :param account: as account_of() returns it.
    :param extra_causes: whether it had one of the extra kinds of causes.
    :param first_asked: ROS time (s) of the first question. None means that there was none.
    """
    truth, cause, settings = summary.truth, summary.cause, dict(summary.settings)
    expert_s = None
    if details.passed_s is not None:  # a world that was not told of the expert's time has no entry
        expert_s = details.passed_s.get('expert', None if summary.questions else 0.0)
    return TrialRow(
        task,
        variant,
        replicate,
        seed,
        summary.ending.value,
        None if truth is None else truth.success,
        details.wrong_object,
        details.damage,
        summary.failures,
        summary.recoveries,
        summary.questions,
        summary.answered,
        expert_s,
        None if truth is None else truth.sim_s,
        ' '.join(cause.kinds) if cause is not None else '',
        details.lasting,
        '' if truth is None else truth.why,
        version,
        _as_json(learned),
        lasting_share,
        details.wall_s,
        details.hour,
        _as_json(details.left),
        '' if details.causes is None else causes_text(details.causes),
        '' if details.clock is None else tries_text(in_world_time(tries, details.clock)),
        settings.get('memory'),
        settings.get('prior'),
        '' if details.harmed is None else harm_text(details.harmed),
        account_text(account),
        details.shared,
        extra_causes,
        None
        if first_asked is None or details.clock is None
        else round(details.clock.world_s(first_asked), 2),
    )


def _as_json(data: Optional[Mapping[str, Any]]) -> str:
    return json.dumps(data, sort_keys=True) if data is not None else ''


def append_rows(path: Path, rows: Sequence[TrialRow]) -> None:
    """Append rows. They are on the disk when this returns.

    :raises OSError: where they cannot be written.
    """
    known = path.exists() and path.stat().st_size > 0
    if known and _columns(path) != TrialRow._fields:
        _rewrite(path)
    with path.open('a', encoding='utf-8', newline='') as target:
        target.write(_text_of(rows, not known))
        target.flush()
        os.fsync(target.fileno())


def _text_of(rows: Sequence[TrialRow], with_columns: bool) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    if with_columns:
        writer.writerow(TrialRow._fields)
    for row in rows:
        writer.writerow([_written(value) for value in row])
    return text.getvalue()


def _columns(path: Path) -> Tuple[str, ...]:
    with path.open(encoding='utf-8', newline='') as source:
        return tuple(next(csv.reader(source), []))


def _rewrite(path: Path) -> None:
    """Give the rows of an older version the columns of this one. A crash leaves the old file.

    :raises BagError: where a row is wrong.
    """
    temporary = path.with_name(path.name + '.tmp')
    with temporary.open('w', encoding='utf-8', newline='') as target:
        target.write(_text_of(read_rows(path), True))
        target.flush()
        os.fsync(target.fileno())
    os.replace(str(temporary), str(path))


def _written(value: object) -> object:
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    return '' if value is None else value


def read_rows(path: Path) -> List[TrialRow]:
    """Return the rows of a file. If a variant has a trial twice, the later row is used.

    A last line that was cut off in its writing is skipped. In rows of older versions the columns
    that came later are not known.

    :raises BagError: where another line is wrong.
    :raises OSError: where the file cannot be read.
    """
    text = path.read_text(encoding='utf-8')
    whole = text[: text.rfind('\n') + 1]
    lines = list(csv.reader(io.StringIO(whole)))
    if not lines:
        return []
    columns = len(lines[0])
    if columns < OLDEST or tuple(lines[0]) != TrialRow._fields[:columns]:
        raise BagError('{}: its columns are not those of this version'.format(path))
    found: Dict[Any, TrialRow] = {}
    for number, line in enumerate(lines[1:], 2):
        row = _parsed(line, columns, '{} row {}'.format(path, number))
        found[row.variant, row.replicate, row.pair] = row
    return list(found.values())


def cut_torn_line(path: Path) -> None:
    """Take away a last line that was cut off in its writing, so that rows can be appended.

    :raises OSError: where the file cannot be changed.
    """
    content = path.read_bytes()
    whole = content[: content.rfind(b'\n') + 1]
    if whole != content:
        with path.open('r+b') as target:
            target.truncate(len(whole))


def _flag(text: str) -> bool:
    return {'yes': True, 'no': False}[text]


_PARSERS: Mapping[str, Callable[[str], Any]] = {
    'replicate': int,
    'seed': int,
    'true_success': _flag,
    'damage': int,
    'failures': int,
    'attempts': int,
    'questions': int,
    'answered': int,
    'expert_s': float,
    'sim_s': float,
    'lasting': int,
    'lasting_share': float,
    'wall_s': float,
    'hour': float,
    'memory': int,
    'prior': float,
    'shared': _flag,
    'extra_causes': _flag,
    'asked_s': float,
}
_MAY_BE_EMPTY = (
    'true_success',
    'damage',
    'expert_s',
    'sim_s',
    'lasting',
    'lasting_share',
    'wall_s',
    'hour',
    'memory',
    'prior',
    'shared',
    'extra_causes',
    'asked_s',
)
# columns that are JSON, where they are not empty
_TEXTS: Mapping[str, Callable[[str], object]] = {
    'cause_log': causes_in,
    'tries': tries_in,
    'harmed': harm_in,
    'account': account_in,
}
_ENDINGS = {ending.value for ending in TrialEnding} | {LOST}


def _parsed(line: Sequence[str], columns: int, where: str) -> TrialRow:
    if len(line) != columns:
        raise BagError('{}: {} cells, not {}'.format(where, len(line), columns))
    cells: Dict[str, Any] = dict(zip(TrialRow._fields, line))
    # '' is no object. A row that has the damage has this, too
    cells['wrong_object'] = (
        None if cells['damage'] == '' and not cells['wrong_object'] else cells['wrong_object']
    )
    for name in cells:
        try:
            if name in _PARSERS:
                cells[name] = (
                    None
                    if not cells[name] and name in _MAY_BE_EMPTY
                    else _PARSERS[name](cells[name])
                )
            elif name in _TEXTS and cells[name]:
                _TEXTS[name](cells[name])
        except (ValueError, KeyError, TypeError) as err:
            raise BagError('{}: {}: {!r} is not allowed'.format(where, name, cells[name])) from err
    if cells['ending'] not in _ENDINGS:
        raise BagError(
            '{}: ending: {!r} is not allowed; allowed: {}'.format(
                where, cells['ending'], ', '.join(sorted(_ENDINGS))
            )
        )
    return TrialRow(**cells)


# -- truth beyond the end


def read_details(path: str) -> Dict[int, TruthDetails]:
    """Return the details by seed. If a seed appears twice, the later line is used.

    Lines that are not truth are skipped: `truth.read_truth` reports them.

    :raises OSError: where the file cannot be read.
    """
    found: Dict[int, TruthDetails] = {}
    with open(path, encoding='utf-8') as source:
        for line in source:
            data = _data_of(line)
            seed = data.get('seed')
            if isinstance(seed, int):
                found[seed] = details_of(data)
    return found


def _data_of(line: str) -> Mapping[str, Any]:
    try:
        data = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}


def details_of(data: Mapping[str, Any]) -> TruthDetails:
    """Return the details of a line."""
    wrong, passed, left = (data.get(key) for key in ('wrong_object', 'passed_s', 'left'))
    return TruthDetails(
        wrong if isinstance(wrong, str) else None,
        _damage(data.get('damage')),
        passed if isinstance(passed, dict) else None,
        _lasting(data.get('causes')),
        _number(data.get('wall_s')),
        _number(data.get('hour')),
        left if isinstance(left, dict) else None,
        causes_of(data.get('causes')),
        _clock(data),
        data.get(SHARED) is True,
        _harmed(data.get('damage')),
    )


def _clock(data: Mapping[str, Any]) -> Optional[WorldClock]:
    trial_s, pauses = _number(data.get('clock_s')), data.get('pauses')
    if trial_s is None or not isinstance(pauses, list):
        return None
    return WorldClock(trial_s, tuple((float(begin), float(length)) for begin, length in pauses))


def _number(value: object) -> Optional[float]:
    return float(value) if isinstance(value, (int, float)) and value is not True else None


def _damage(by_kind: object) -> Optional[int]:
    """Count the things. Each kind lists them, or tells their number. The line has a sum, too."""
    if not isinstance(by_kind, dict):
        return None
    told = [by_kind.get(kind, 0) for kind in DAMAGE]
    return sum(len(each) if isinstance(each, list) else int(each) for each in told)


def _lasting(causes: object) -> Optional[int]:
    """Count the causes that last. Return None where they do not tell."""
    if not isinstance(causes, list):
        return None
    told = [cause.get('lasting') for cause in causes if isinstance(cause, dict)]
    return sum(map(bool, told)) if all(isinstance(each, bool) for each in told) else None


def _harmed(by_kind: object) -> Optional[Tuple[HarmedThing, ...]]:
    """Return what came to harm. A line of an older world does not tell when."""
    if not isinstance(by_kind, dict):
        return None
    if 'seen_s' in by_kind:
        return tuple(harm_in(json.dumps(by_kind['seen_s'])))
    lists = [(kind, by_kind.get(kind)) for kind in DAMAGE]
    named = [(kind, things) for kind, things in lists if isinstance(things, list)]
    return tuple(HarmedThing(kind, str(thing)) for kind, things in named for thing in things)
