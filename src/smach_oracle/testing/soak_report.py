"""The result of a soak, as a text that people read and an object that tests assert on."""

from typing import Callable, Dict, List, NamedTuple, Sequence, Tuple

from .faults import Fault
from .observed_trial import ObservedTrial

_MOST_NUMBERS = 5


class SoakTrial(NamedTuple):
    """The course of one trial of a soak."""

    number: int
    state: str  # PATH/LABEL
    kind: str  # of the fault, such as "outcome 'aborted'"
    fault: Fault
    happened: bool  # the fault. False means the trial did not come to it
    recovered: bool  # the trial ended well
    asked: bool  # the expert
    ending: str  # in words


class SoakRow(NamedTuple):
    """All trials of a soak in which one state failed in one way."""

    state: str  # PATH/LABEL
    kind: str
    trials: int
    recovered: int
    asked: int  # trials in which the expert was asked
    not_recovered: Tuple[int, ...]  # numbers of trials
    ending: str  # of the first of these

    def __str__(self) -> str:
        numbers = ', '.join(map(str, self.not_recovered[:_MOST_NUMBERS]))
        more = ', ...' if len(self.not_recovered) > _MOST_NUMBERS else ''
        text = '{}: {}: {} of {} recovered'.format(
            self.state, self.kind, self.recovered, self.trials
        )
        if self.asked:
            text += ', the expert asked in {}'.format(self.asked)
        if self.not_recovered:
            text += '; not in trial {}{}, which {}'.format(numbers, more, self.ending)
        return text


class SoakReport:
    """The result of a soak. `str` gives it as text."""

    def __init__(
        self,
        seed: int,
        trials: Sequence[SoakTrial],
        not_visited: Sequence[str],
        again: Callable[[int], ObservedTrial],
    ) -> None:
        self.seed = seed
        self.trials = tuple(trials)
        self.not_visited = tuple(not_visited)  # states that no trial enters without a fault
        self.rows = _rows(trials)
        self._again = again

    @property
    def never_recovered(self) -> List[SoakRow]:
        """Return the failures that no trial recovered from."""
        return [row for row in self.rows if not row.recovered]

    @property
    def sometimes_recovered(self) -> List[SoakRow]:
        """Return the failures that some trials recovered from, and some did not."""
        return [row for row in self.rows if 0 < row.recovered < row.trials]

    @property
    def always_recovered(self) -> List[SoakRow]:
        """Return the failures that all trials recovered from."""
        return [row for row in self.rows if row.recovered == row.trials]

    def again(self, number: int) -> ObservedTrial:
        """Run one trial again, alone. It raises what `soak_trial` raises.

        :raises ValueError: for a number that the soak has not.
        """
        if not any(trial.number == number for trial in self.trials):
            raise ValueError(
                'there is no trial {!r}; the soak has 1 to {}'.format(number, len(self.trials))
            )
        return self._again(number)

    def assert_every_failure_can_recover(self) -> 'SoakReport':
        """Fail where a state failed in a way from which no trial recovered.

        :raises AssertionError: with the report.
        """
        __tracebackhide__ = True
        return self._require(not self.never_recovered, 'some failures never recover')

    def assert_all_recovered(self) -> 'SoakReport':
        """Fail where a trial did not recover.

        :raises AssertionError: with the report.
        """
        __tracebackhide__ = True
        return self._require(
            len(self.always_recovered) == len(self.rows), 'some trials did not recover'
        )

    def _require(self, holds: bool, sentence: str) -> 'SoakReport':
        __tracebackhide__ = True
        if not holds:
            raise AssertionError('{}\n{}'.format(sentence, self))
        return self

    def __str__(self) -> str:
        lines = [
            '{} trials with one fault each, seed {}: {} recovered, {} did not.'.format(
                sum(row.trials for row in self.rows),
                self.seed,
                sum(row.recovered for row in self.rows),
                sum(len(row.not_recovered) for row in self.rows),
            )
        ]
        for title, rows in (
            ('Never recovered', self.never_recovered),
            ('Sometimes recovered', self.sometimes_recovered),
            ('Always recovered', self.always_recovered),
        ):
            lines += ['{}:'.format(title)] * bool(rows) + ['  {}'.format(row) for row in rows]
        idle = sum(1 for trial in self.trials if not trial.happened)
        if idle:
            lines.append('In {} trials the fault did not happen.'.format(idle))
        if self.not_visited:
            lines.append('Not visited without a fault: {}.'.format(', '.join(self.not_visited)))
        bad = next((row.not_recovered[0] for row in self.rows if row.not_recovered), None)
        if bad is not None:
            lines.append(
                'Run one again: report.again({0}), or soak_trial(..., {0}, seed={1}) with '
                'the arguments of the soak.'.format(bad, self.seed)
            )
        return '\n'.join(lines)


def _rows(trials: Sequence[SoakTrial]) -> Tuple[SoakRow, ...]:
    found: Dict[Tuple[str, str], List[SoakTrial]] = {}
    for trial in trials:
        if trial.happened:
            found.setdefault((trial.state, trial.kind), []).append(trial)
    return tuple(_row(state, kind, found[state, kind]) for state, kind in sorted(found))


def _row(state: str, kind: str, trials: Sequence[SoakTrial]) -> SoakRow:
    bad = [trial for trial in trials if not trial.recovered]
    return SoakRow(
        state,
        kind,
        len(trials),
        len(trials) - len(bad),
        sum(1 for trial in trials if trial.asked),
        tuple(each.number for each in bad),
        bad[0].ending if bad else '',
    )
