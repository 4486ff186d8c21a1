"""The folder of one job: complete trials, lost ones, and where to go on.

A job is one replicate of one variant.

The bag of a trial holds the rates learned at its end, so that a bag with its end in it is all that
is needed to go on after it, whatever happened at whichever moment. Bags are in the order of
their names, which is that of the trials.
"""

import json
import os
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.analysis.bag_events import BagContent, BagError, EventReader, find_bags
from smach_oracle.analysis.counting.trial_summary import TrialSummary, summarise
from smach_oracle.analysis.judging.account import Entry, account_of
from smach_oracle.analysis.lasting.tries import StateTry, tries_of
from smach_oracle.analysis.trial_counter import TrialEnding
from smach_oracle.analysis.truth import TRUTH_FILE, read_truth
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import is_counted
from smach_oracle.oracle.records.rates_format import write_learned
from smach_oracle.oracle.settings.failure_rule import FailureRule

from .plan import ExperimentError, write_json

LOST_FILE = 'lost.json'
RATES_FILE = 'rates.json'
DROPPED = '.dropped'  # behind the name of a bag that does not count


class RecordedTrial(NamedTuple):
    """One trial, from its bag."""

    summary: TrialSummary
    learned: Optional[Mapping[str, Any]]  # at its end, or None where the bag lacks it
    tries: Tuple[StateTry, ...] = ()  # of the states that failed, in ROS time
    account: Tuple[Entry, ...] = ()
    first_asked: Optional[float] = None  # ROS time (s) of the first question
    # whether its program was to stop: the state that ended then taught nothing, whatever came of it
    was_stopped: bool = False


class JobProgress(NamedTuple):
    """The progress of a job."""

    done: List[RecordedTrial]
    lost: Dict[int, str]  # number of the trial, from 0: why
    dropped: Tuple[str, ...]  # names of the bags that were put aside
    next_trial: int  # number of the first trial that is neither done nor lost
    kept: int = 0  # trials that are done and have no bag here


class KeptTrials(NamedTuple):
    """Trials from the first one on that a job keeps rows of. They may have no bags here."""

    numbers: List[int]
    lost: Dict[int, str]  # number of the trial, from 0: why
    learned: List[Optional[Mapping[str, Any]]]  # at the end of each of `numbers`

    def before(self, number: int) -> 'KeptTrials':
        """Return those before a trial."""
        count = sum(1 for each in self.numbers if each < number)
        return KeptTrials(
            self.numbers[:count],
            {each: why for each, why in self.lost.items() if each < number},
            self.learned[:count],
        )


NONE_KEPT = KeptTrials([], {}, [])


class ReplicateRecords:
    """The folder of a job."""

    def __init__(self, folder: Path, first_seed: int, trials: int) -> None:
        """Make the folder.

        :raises OSError: where it cannot be made.
        """
        self.folder = folder
        self.rates = folder / RATES_FILE
        self.truth = folder / TRUTH_FILE
        self._first_seed = first_seed
        self._trials = trials
        self._reader = EventReader()
        self.takes_shared = True  # trials that the bare script ran count, as if they were run here
        folder.mkdir(parents=True, exist_ok=True)

    def tidy_up(self, kept: KeptTrials = NONE_KEPT) -> JobProgress:
        """Put aside what is not complete, and prepare to go on. Only while nothing runs.

        Afterwards there are the bags and the truth of complete trials, and the rates as the last
        one left them. Trials of `kept` count without a bag where all bags come behind them.

        :raises ExperimentError: where a bag is of another seed than its place says.
        :raises OSError: where a file cannot be moved or written.
        """
        truths = self._truths()
        bags = self._bags()
        torn, first_number = self._torn_before(bags) if kept.numbers or kept.lost else (0, 0)
        paths, kept = bags[torn:], kept.before(first_number)
        lost = {**kept.lost, **self._lost()}
        passed = {*lost, *kept.numbers}
        numbers = [number for number in range(self._trials) if number not in passed]
        done: List[RecordedTrial] = []
        while len(done) < min(len(paths), len(numbers)):
            recorded = self.read(paths[len(done)])
            seed = self._first_seed + numbers[len(done)]
            if recorded is None or not self._is_complete(recorded, seed, truths):
                break
            if recorded.learned is None:
                raise ExperimentError(
                    '{}: the bag does not contain the learned rates'.format(paths[len(done)])
                )
            done.append(recorded)
        dropped = bags[:torn] + paths[len(done) :]
        for path in dropped:
            os.replace(path, path + DROPPED)
        next_trial = (numbers + [self._trials])[len(done)]
        self._keep_lost({number: why for number, why in lost.items() if number < next_trial})
        self._keep_truths({self._first_seed + number for number in numbers[: len(done)]})
        learned = [each.learned for each in done] or kept.learned
        rule = done[-1].summary.rule if done else None
        self._restore_rates(learned[-1] if learned else None, rule)
        return JobProgress(
            done,
            self._lost(),
            tuple(os.path.basename(path) for path in dropped),
            next_trial,
            len(kept.numbers),
        )

    def _torn_before(self, bags: Sequence[str]) -> Tuple[int, int]:
        """Return how many torn bags come first, and the trial of the first one behind them.

        A bag is torn where it tells no seed. If all are, the trial is the one behind the last, so
        that they cost no row.
        """
        for count, path in enumerate(bags):
            recorded = self.read(path)
            if recorded is not None and recorded.summary.cause is not None:
                return count, recorded.summary.cause.seed - self._first_seed
        return len(bags), self._trials

    def events_of(self, path: str) -> Optional[BagContent]:
        """Return the content of a bag, None where it cannot be read, or is not of one trial."""
        try:
            content = self._reader.read(path)
        except BagError:
            return None
        return content if len({event.trial_id for event in content.events}) == 1 else None

    def read(self, path: str) -> Optional[RecordedTrial]:
        """The trial of a bag, or None where the bag cannot be read, or is not of one trial."""
        content = self.events_of(path)
        if content is None:
            return None
        summary = summarise(content.events, (path,))
        end = next((event for event in content.events if event.kind == EventKind.TRIAL_END), None)
        learned = (
            end.data.get('learned') if end is not None and isinstance(end.data, Mapping) else None
        )
        return RecordedTrial(
            summary._replace(cause=content.causes.get(summary.trial_id)),
            learned,
            tuple(tries_of(content.events, content.stamps)),
            tuple(account_of(content.events)),
            min(
                (
                    second
                    for event, second in zip(content.events, content.stamps)
                    if event.kind == EventKind.QUERY_OPENED
                ),
                default=None,
            ),
            _was_stopped(content.events),
        )

    def is_complete(self, recorded: RecordedTrial) -> bool:
        """Whether a trial has come to its end, and the world has told how."""
        cause = recorded.summary.cause
        return cause is not None and self._is_complete(recorded, cause.seed, self._truths())

    def with_truth(self, recorded: RecordedTrial) -> RecordedTrial:
        """Return a trial with what the world has told of its end."""
        cause = recorded.summary.cause
        truth = self._truths().get(cause.seed) if cause is not None else None
        return recorded._replace(summary=recorded.summary._replace(truth=truth))

    def _is_complete(self, recorded: RecordedTrial, seed: int, truths: Mapping[int, Any]) -> bool:
        summary = recorded.summary
        if summary.ending in (TrialEnding.UNFINISHED, TrialEnding.PREEMPTED) or seed not in truths:
            return False
        if recorded.was_stopped:
            return False
        if summary.cause is None and not summary.outcome:  # it was ended as it began
            return False
        if truths[seed].shared and not self.takes_shared:
            return False
        if summary.cause is not None and summary.cause.seed != seed:
            raise ExperimentError(
                '{}: a trial of seed {} where seed {} is expected'.format(
                    summary.bags[0], summary.cause.seed, seed
                )
            )
        return True

    def mark_lost(self, number: int, why: str) -> None:
        """Note that a trial could not be run.

        :raises OSError: where it cannot be written.
        """
        self._keep_lost({**self._lost(), number: why})

    def closed_bags(self) -> List[str]:
        """Paths of the bags whose trials are over, in the order of the trials."""
        return sorted(str(path) for path in self.folder.glob('*.bag'))

    def _bags(self) -> List[str]:
        return sorted(find_bags([str(self.folder)]))

    def _keep_lost(self, lost: Mapping[int, str]) -> None:
        if lost != self._lost():
            write_json(self.folder / LOST_FILE, {str(number): why for number, why in lost.items()})

    def _lost(self) -> Dict[int, str]:
        path = self.folder / LOST_FILE
        if not path.exists():
            return {}
        try:
            return {
                int(key): str(why)
                for key, why in json.loads(path.read_text(encoding='utf-8')).items()
            }
        except (ValueError, AttributeError) as err:
            raise ExperimentError('{}: {}'.format(path, err)) from err

    def truth_lines(self) -> Dict[int, Mapping[str, Any]]:
        """Return the world's lines by seed, as they are, without those that cannot be read."""
        if not self.truth.exists():
            return {}
        lines = map(_data_of, self.truth.read_text(encoding='utf-8').split('\n'))
        return {line['seed']: line for line in lines if isinstance(line.get('seed'), int)}

    def _truths(self) -> Mapping[int, Any]:
        try:
            return read_truth(str(self.truth))
        except FileNotFoundError:
            return {}
        except BagError as err:
            raise ExperimentError(str(err)) from err

    def _keep_truths(self, seeds: Any) -> None:
        """Keep the lines of these seeds only: an interrupted trial has a line of its own later."""
        if not self.truth.exists():
            return
        lines = self.truth.read_text(encoding='utf-8').split('\n')
        kept = [line for line in lines if line.strip() and _seed_of(line) in seeds]
        temporary = self.truth.with_name(TRUTH_FILE + '.tmp')
        with temporary.open('w', encoding='utf-8') as stream:
            stream.writelines(line + '\n' for line in kept)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(str(temporary), str(self.truth))

    def _restore_rates(
        self, learned: Optional[Mapping[str, Any]], rule: Optional[FailureRule]
    ) -> None:
        if learned is not None:
            write_learned(str(self.rates), learned, rule)
        elif self.rates.exists():
            self.rates.unlink()


def _data_of(line: str) -> Mapping[str, Any]:
    try:
        data = json.loads(line)
    except ValueError:
        return {}
    return data if isinstance(data, dict) else {}


def _seed_of(line: str) -> Optional[int]:
    seed = _data_of(line).get('seed')
    return seed if isinstance(seed, int) else None


def _was_stopped(events: Sequence[Event]) -> bool:
    """Whether the top machine was preempted, or a state of it ended at a shutdown."""
    return any(
        event.kind == EventKind.PREEMPT
        # the others that are not counted say why in their text
        or (event.kind == EventKind.TRANSITION and not event.text and not is_counted(event))
        for event in events
        if event.path == events[0].path
    )
