"""The rows of one job in `results.csv`: written as its trials end, read where it goes on.

They hold all that is needed to go on on another machine, without the bags.
"""

import json
import subprocess
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence

from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.trial_rows import (
    LOST,
    NO_DETAILS,
    TrialRow,
    append_rows,
    cut_torn_line,
    read_details,
    read_rows,
    row_of,
)

from .plan import ExperimentError
from .records import KeptTrials, RecordedTrial

RESULTS_FILE = 'results.csv'


def code_version() -> str:
    """Return the commit of the code that runs, '-dirty' behind it, or '' where there is none."""
    try:
        return subprocess.run(
            ['git', 'describe', '--always', '--dirty', '--abbrev=12'],
            check=True,
            cwd=str(Path(__file__).parent),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            universal_newlines=True,
        ).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ''


class JobResults:
    """The rows of one job."""

    def __init__(
        self,
        output: Path,
        task: str,
        variant: str,
        replicate: int,
        first_seed: int,
        lasting_share: Optional[float] = None,
        slot_h: Optional[float] = None,
        extra_causes: bool = False,
    ) -> None:
        """Read them.

        :param slot_h: h from the begin of one trial to that of the next, in a world that goes on.
        :param extra_causes: whether the world has the extra kinds of causes.
        :raises ExperimentError: where the file cannot be used.
        :raises OSError: where it cannot be read.
        """
        self._path = output / RESULTS_FILE
        self._task = task
        self._variant = variant
        self._replicate = replicate
        self._first_seed = first_seed
        self._lasting_share = lasting_share
        self._slot_h = slot_h
        self._extra_causes = extra_causes
        self._version = code_version()
        self._rows: Dict[int, TrialRow] = {}  # by seed
        if self._path.exists():
            cut_torn_line(self._path)
            try:
                self._rows = {
                    row.seed: row
                    for row in read_rows(self._path)
                    if (row.task, row.variant, row.replicate) == (task, variant, replicate)
                }
            except BagError as err:
                raise ExperimentError(str(err)) from err

    def kept(self, takes_shared: bool = True) -> KeptTrials:
        """Return the trials from the first one on that have rows, without a gap.

        :param takes_shared: whether the rows of shared trials count. They are a gap otherwise.
        :raises ExperimentError: where a row does not tell what was learned.
        """
        kept = KeptTrials([], {}, [])
        seed = self._first_seed
        while seed in self._rows and (takes_shared or not self._rows[seed].shared):
            row, number = self._rows[seed], seed - self._first_seed
            if row.ending == LOST:
                kept.lost[number] = row.why
            else:
                kept.learned.append(_data_in(row, row.learned, 'what was learned'))
                kept.numbers.append(number)
            seed += 1
        return kept

    def rows(self) -> List[TrialRow]:
        """Return all rows of the job, in the order of the trials."""
        return [self._rows[seed] for seed in sorted(self._rows)]

    def last_left(self) -> Optional[Mapping[str, Any]]:
        """Return how the last trial left a world that goes on. None means none has ended.

        :raises ExperimentError: where a row does not tell.
        """
        told = [row for row in self.rows() if row.left]
        return _data_in(told[-1], told[-1].left, 'how the world was left') if told else None

    def forget_from(self, number: int) -> None:
        """Drop the rows of this trial and of those behind it, which are run again."""
        self._rows = {
            seed: row for seed, row in self._rows.items() if seed < self._first_seed + number
        }

    def add(self, trials: Sequence[RecordedTrial], lost: Mapping[int, str], truth: Path) -> None:
        """Append the rows of trials that have none. `lost`: why, by number of the trial.

        A trial that tells no seed has no row.

        :raises OSError: where they cannot be written.
        """
        new: List[TrialRow] = []
        details = None
        for trial in trials:
            cause = trial.summary.cause
            if cause is None or cause.seed in self._rows:
                continue
            if details is None:
                details = read_details(str(truth)) if truth.exists() else {}
            new.append(
                row_of(
                    trial.summary,
                    self._task,
                    self._variant,
                    self._replicate,
                    cause.seed,
                    details.get(cause.seed, NO_DETAILS),
                    self._version,
                    trial.learned,
                    self._lasting_share,
                    trial.tries,
                    trial.account,
                    self._extra_causes,
                    trial.first_asked,
                )
            )
        for number, why in lost.items():
            if self._first_seed + number not in self._rows:
                new.append(
                    TrialRow(
                        self._task,
                        self._variant,
                        self._replicate,
                        self._first_seed + number,
                        LOST,
                        why=why,
                        version=self._version,
                        lasting_share=self._lasting_share,
                        hour=self._hour_of(number),
                        extra_causes=self._extra_causes,
                    )
                )
        if new:
            append_rows(self._path, new)
            self._rows.update((row.seed, row) for row in new)

    def _hour_of(self, number: int) -> Optional[float]:
        """Return the hour at which a lost trial was to begin, of a world that goes on.

        Where the trial before it took long, it is the end of that one.
        """
        if self._slot_h is None:
            return None
        before = [row for row in self.rows() if row.seed < self._first_seed + number and row.left]
        left = _data_in(before[-1], before[-1].left, 'how the world was left') if before else None
        ended = left.get('ended') if left else None
        return max(number * self._slot_h, float(ended) if isinstance(ended, (int, float)) else 0.0)


def _data_in(row: TrialRow, text: str, what: str) -> Optional[Mapping[str, Any]]:
    try:
        data = json.loads(text)
    except ValueError as err:
        raise ExperimentError(
            'results of {}, seed {}: the row lacks {}'.format(row.variant, row.seed, what)
        ) from err
    return data if isinstance(data, dict) else None
