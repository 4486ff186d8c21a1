"""Trials that are run once and counted for every variant: those in which nothing fails.

An oracle acts only after a failure. So a trial without one is the same under every variant, and the
bare script runs it. All others replay it, so that their rates learn what they would have learned.
Every variant runs a tenth anyway, which the seed draws. One difference in anything but the
machine's time ends the sharing: what was shared is then run by every variant.
"""

import json
import random
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.analysis.bag_events import RecordedCause
from smach_oracle.analysis.trial_rows import details_of
from smach_oracle.analysis.trial_steps import steps_of
from smach_oracle.analysis.truth import SHARED
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.oracle.settings.failing_outcomes import FailingNames, is_preempted
from smach_oracle.oracle.settings.failure_rule import EndMeaning, FailureRule

from .plan import ExperimentError, write_json, write_text
from .records import ReplicateRecords

ENDED_FILE = 'sharing_ended.json'
SHARED_FILE = 'shared.json'  # in a job's folder: the trials that it replays
CLEAN_FILE = 'clean_trials.jsonl'  # in a bare job's folder: those that others replay, without bags
RUN_AGAIN = 0.1  # of the trials that could be shared
# all that happens where nothing fails
PLAIN = frozenset(
    (
        EventKind.TRIAL_START,
        EventKind.TRIAL_END,
        EventKind.CONTAINER_START,
        EventKind.CONTAINER_END,
        EventKind.STATE_START,
        EventKind.TRANSITION,
    )
)
# of a line of truth: the machine's time, and the clock of the whole run
TIMES = frozenset(('wall_s', 'share', 'cpu_s', 'clock_s', 'pauses', SHARED))


class CleanTrial(NamedTuple):
    """A trial of the bare script in which nothing failed."""

    cause: RecordedCause
    outcomes: Tuple[Tuple[str, str], ...]  # of its states, in the order of their visits
    ended: str  # outcome of the machine
    steps: Tuple[object, ...]  # all that happened, without times
    truth: Mapping[str, Any]  # the world's line on it
    took_s: float  # of the world's time

    def as_data(self) -> Dict[str, Any]:
        """Return it as plain data, for who replays it."""
        seed, task, kinds, details = self.cause
        return {
            'seed': seed,
            'task': task,
            'kinds': list(kinds),
            'details': list(details),
            'outcomes': [list(each) for each in self.outcomes],
            'ended': self.ended,
            'took_s': self.took_s,
            'truth': {**self.truth, SHARED: True},
        }

    @classmethod
    def of_data(cls, data: Mapping[str, Any]) -> 'CleanTrial':
        """Return the trial of as_data(), with its steps beside.

        :raises KeyError, TypeError, ValueError: where something is missing or of another type.
        """
        kinds, details = map(str, data['kinds']), map(str, data['details'])
        return cls(
            RecordedCause(int(data['seed']), str(data['task']), tuple(kinds), tuple(details)),
            tuple((str(state), str(outcome)) for state, outcome in data['outcomes']),
            str(data['ended']),
            tuple(map(tuple, data['steps'])),
            {key: value for key, value in data['truth'].items() if key != SHARED},
            float(data['took_s']),
        )


def is_run_again(seed: int) -> bool:
    """Whether a trial is run by every variant although it could be shared."""
    return random.Random('run again {}'.format(seed)).random() < RUN_AGAIN


def outcomes_of(events: Sequence[Event]) -> Optional[Tuple[Tuple[str, str], ...]]:
    """Return the states of a trial and their outcomes. None means that something failed in it.

    It takes the widest rule: an outcome that sounds like a failure is one, also where the author
    handles it, and so is any event beyond the way of a machine from state to state. A machine with
    machines in it cannot be replayed, and counts as one in which something failed.
    """
    failing, running = FailingNames(), ''
    found: List[Tuple[str, str]] = []
    tops = {event.path for event in events}
    in_order = sorted(events, key=lambda event: event.seq)
    if len(tops) != 1 or any(event.kind not in PLAIN for event in in_order):
        return None
    if [event.seq for event in in_order] != list(range(len(in_order))):  # some were lost
        return None
    if in_order[-1].kind != EventKind.TRIAL_END:
        return None
    for event in in_order:
        name = event.outcome
        if name and (name in failing or is_preempted(name)):
            return None
        if event.failure_kind != FailureKind.NOT_A_FAILURE:
            return None
        if event.kind == EventKind.STATE_START:
            running = event.state
        elif event.kind == EventKind.TRANSITION:
            if event.state != running or event.text:
                return None
            found.append((event.state, name))
    went_well = FailureRule().meaning(in_order[-1].outcome) is EndMeaning.SUCCESS
    return tuple(found) if went_well and found else None


def differing(first: Mapping[str, Any], second: Mapping[str, Any]) -> List[str]:
    """Return the keys in which two lines of truth differ, without those of times."""
    keys = (set(first) | set(second)) - TIMES
    return sorted(key for key in keys if first.get(key) != second.get(key))


def world_seconds(stamps: Sequence[float], truth: Mapping[str, Any]) -> float:
    """Return how much of the world's time passes between the first and the last of some stamps."""
    first, last, clock = min(stamps), max(stamps), details_of(truth).clock
    return last - first if clock is None else clock.world_s(last) - clock.world_s(first)


def clean_trials(records: ReplicateRecords) -> Dict[int, CleanTrial]:
    """Return and keep the trials of a bare job in which nothing failed, by seed.

    Those without a bag are as they were kept. Those without the world's line on them are not known.

    :raises ExperimentError: where what was kept cannot be read.
    :raises OSError: where it cannot be written.
    """
    found = _kept(records.folder / CLEAN_FILE)
    kept = dict(found)
    truths = records.truth_lines()
    for path in records.closed_bags():
        content = records.events_of(path)
        outcomes = None if content is None else outcomes_of(content.events)
        if content is not None and outcomes is not None:
            last = max(content.events, key=lambda event: event.seq)
            for cause in content.causes.values():
                if cause.seed in truths:
                    steps = steps_of(content.events)
                    truth = truths[cause.seed]
                    took_s = world_seconds(content.stamps, truth)
                    found[cause.seed] = CleanTrial(
                        cause, outcomes, last.outcome, steps, truth, took_s
                    )
    if found != kept:
        lines = [{**found[seed].as_data(), 'steps': found[seed].steps} for seed in sorted(found)]
        write_text(records.folder / CLEAN_FILE, ''.join(json.dumps(each) + '\n' for each in lines))
    return found


def _kept(path: Path) -> Dict[int, CleanTrial]:
    if not path.exists():
        return {}
    try:
        lines = path.read_text(encoding='utf-8').splitlines()
        trials = [CleanTrial.of_data(json.loads(line)) for line in lines]
    except (ValueError, KeyError, TypeError, AttributeError) as err:
        raise ExperimentError('{}: no trials to share: {!r}'.format(path, err)) from err
    return {trial.cause.seed: trial for trial in trials}


class Sharing:
    """The sharing of all jobs of an experiment, and whether it has ended."""

    def __init__(self, output: Path) -> None:
        """Look whether it had ended before.

        :raises ExperimentError: where the file cannot be used.
        """
        self._path = output / ENDED_FILE
        self.ended = ''  # why
        if self._path.exists():
            try:
                self.ended = str(json.loads(self._path.read_text(encoding='utf-8'))['why'])
            except (ValueError, KeyError, TypeError) as err:
                raise ExperimentError('{}: {!r}'.format(self._path, err)) from err

    def end(self, why: str) -> None:
        """End it, for good.

        :raises OSError: where that cannot be written.
        """
        write_json(self._path, {'why': why})
        self.ended = why


def difference(clean: CleanTrial, events: Sequence[Event], truth: Mapping[str, Any]) -> str:
    """Return how a trial differs from the same one of the bare script, '' where it does not."""
    keys = differing(clean.truth, truth)
    if keys:
        return ', '.join(
            '{} {!r} and {!r}'.format(key, clean.truth.get(key), truth.get(key)) for key in keys
        )
    for number, pair in enumerate(zip(clean.steps, steps_of(events)), 1):
        if pair[0] != pair[1]:
            return 'step {}: {} and {}'.format(number, *pair)
    count = len(steps_of(events))
    return '' if count == len(clean.steps) else '{} and {} steps'.format(len(clean.steps), count)


def write_shared(folder: Path, trials: Sequence[CleanTrial]) -> Path:
    """Write the trials that a job replays, and return the file.

    :raises OSError: where it cannot be written.
    """
    write_json(folder / SHARED_FILE, [trial.as_data() for trial in trials])
    return folder / SHARED_FILE
