"""What is remembered after visits, ways and streaks that are drawn at random.

    python3 test/unit/support/pinned_records.py FOLDER [--pin]

writes that to FOLDER, and with --pin the digests to test/data/pinned/records.txt. What users see of
a change is the difference of two folders, of before and after it.
"""

import random
import sys
from pathlib import Path
from typing import Any, Dict, Iterator, List

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from pinned import drawn, write_told

from smach_oracle.oracle.decision.ways import PLACES, WayKind, WayResult
from smach_oracle.oracle.records.events import NO_OUTCOME, Event, EventKind
from smach_oracle.oracle.records.facts import (
    BRANCHES,
    DECIDED_BY,
    ENDED_BY,
    JUMPED_TO,
    LAST_SEQ,
    NOT_COUNTED,
    branches_of,
    decided_by,
    ended_by,
    is_counted,
    last_stored,
    told_in_words,
)
from smach_oracle.oracle.records.history import History
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.oracle.records.streaks import OpenStreak, Streaks
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.oracle.records.way_results import (
    WayLog,
    counts_of_kinds,
    failure_text_key,
    merged_ways,
)

LABELS = 'ABCD'
VALUES = (None, True, 0, 3, -1, -2, 1.0, 'policy', 'budget', 'outcome', 'kept', 'A', ['A', 'B'], {})


def tell() -> Dict[str, List[str]]:
    """Return a line for each thing that is told, by the draws that it comes from."""
    groups = (
        ('visits', 6, _of_visits),
        ('ways', 4, _of_ways),
        ('streaks', 2, _of_streaks),
        ('facts', 6, _of_facts),
        ('texts', 4, _of_texts),
    )
    return drawn(groups, draws=20)


# -- visits


def _of_visits(rng: random.Random) -> Iterator[str]:
    """The visits of a container, in some executions, and what they say of a failure next."""
    history, successes = History(rng.choice((3, 50))), dict.fromkeys(LABELS, 0)
    if rng.random() < 0.5:
        history.count_visits()
    conditioned = rng.choice(LABELS)
    for _ in range(40):
        label, chance = rng.choice(LABELS), rng.random()
        if chance < 0.45:
            successes[label] += 1
            history.visited(Visit(label, 'ok', VisitResult.SUCCESS), label == conditioned)
        elif chance < 0.8:
            history.failed(label, successes[label])
            history.visited(Visit(label, 'aborted', VisitResult.FAILURE), label == conditioned)
            yield 'failed {}'.format(history.context_since(label, 'A', successes[label]))
        elif chance < 0.88:
            rng.choice((history.supersede, history.count_superseded))(
                label, 'ok', label == conditioned
            )
        elif chance < 0.92:
            history.visited(Visit(label, '', VisitResult.PREEMPTED), label == conditioned)
        elif chance < 0.95:
            history.begin_execution()
        elif chance < 0.96:
            history.begin_trial()
        elif chance < 0.98:
            history.resize(rng.choice((2, 5)))
        else:
            told, number = history.told(), history.visits_of_execution
            visits = history.latest()
            history = History(rng.choice((2, 50)))
            history.take_over(visits, number, told, lambda label: label != 'D')
        yield '{} {} {}'.format(
            history.told(), history.visits_of_execution, history.latest() and history.latest()[-1]
        )
        each = rng.choice((label, rng.choice(LABELS)))
        yield '{} {}'.format(
            history.failure_context(each, 'A', successes[each]), history.keeps_failing(each)
        )


# -- ways


def _of_ways(rng: random.Random) -> Iterator[str]:
    """Two programs note the results of ways from one state, and share them now and then."""
    logs, shared = [WayLog(), WayLog()], [{}, {}]  # type: ignore[var-annotated]
    texts = ['no object {}'.format(each) for each in 'abcdefghij'[: rng.choice((2, 10))]]
    file: Dict[str, Any] = {}
    for _ in range(rng.choice((12, 12, 12, 160))):
        number = rng.randrange(2)
        log = logs[number]
        key = log.failure_key(rng.choice((1, 3)), rng.choice(('', 'aborted')), rng.choice(texts))
        kind = rng.choice(list(WayKind))
        hoped = rng.choice((None, None, 0.5))
        took = rng.choice((0.0, 0.25, 1.23456))
        log.go(WayResult(kind.value, kind.value, rng.choice(PLACES), key, None, 0.0, hoped), float)
        if rng.random() < 0.8:
            log.go(log.gone, lambda took=took: took)  # type: ignore[arg-type,misc]
        if rng.random() < 0.9:
            log.settle(rng.choice((True, False, None)))
        chance = rng.random()
        if chance < 0.15:
            file = merged_ways(log.told(), shared[number], file)
            log.take_over(file)
            shared[number] = dict(file)
        elif chance < 0.2:
            logs[number] = log = log.twin()
        yield '{} {} {} {}'.format(key, log.total, log.of_kinds, log.gone)
    yield '{} {}'.format(file, counts_of_kinds(each.of_kinds for each in logs))
    yield '{} {}'.format(*(each.told() for each in logs))


# -- streaks


def _of_streaks(rng: random.Random) -> Iterator[str]:
    streaks = Streaks()
    for step in range(12):
        label = rng.choice(LABELS)
        streak = streaks.of(label, rng.randrange(2))
        if streak is None:
            streak = streaks[label] = OpenStreak(rng.randrange(2), 6.0 * step, tuple(LABELS))
        streak.note(rng.choice(('again', 'from A')), rng.random() < 0.3)
        streak.leaves = rng.random() < 0.3
        if rng.random() < 0.2:
            streaks.end_execution()
        if rng.random() < 0.2:
            again = Streaks()
            again.take_over(streaks.told())
            streaks = again
        yield '{} {}'.format(streaks.told(), [each.so_far(90.0) for each in streaks.values()])
    told: Any = dict(streaks.told())
    label, right = rng.choice(sorted(told) or ['A']), [1, 2.0, ['A'], ['again'], 3, '']
    wrong = (None, 3, [], ['x'] * 6, [0, 0.0, 3, [], 0], [0, 0.0, [], [], 'x'])
    given = rng.choice((right, rng.choice(wrong)))
    try:
        streaks.take_over(rng.choice(({**told, label: given}, {label: given}, given)))
    except ValueError as err:
        yield str(err).partition(':')[0]
    yield str(streaks.told())


# -- facts of events


def _of_facts(rng: random.Random) -> Iterator[str]:
    """What the data of an event say, and where they do not say it, the words of earlier bags."""
    keys = (DECIDED_BY, ENDED_BY, BRANCHES, LAST_SEQ, NOT_COUNTED, JUMPED_TO)
    for _ in range(12):
        data: Any = {key: rng.choice(VALUES) for key in keys if rng.random() < 0.6}
        text = rng.choice(('', '3 are spent on it', 'SystemExit: 1', NO_OUTCOME, 'else'))
        data = rng.choice((data, data, data, None, 3))
        event = Event(EventKind.DECISION, 'id', 0, 0.0, 'TOP', text=text, data=data)
        event = event._replace(outcome=rng.choice(('', 'done')))
        yield '{} {} {} {} {} {} {} {}'.format(
            decided_by(event).name,
            ended_by(event, True).name,
            ended_by(event, False).name,
            branches_of(event),
            last_stored(event),
            is_counted(event),
            told_in_words(data),
            told_in_words(text),
        )


# -- texts


def _of_texts(rng: random.Random) -> Iterator[str]:
    words = ('no', 'object', '3', '-0.5', '1e-05', '0x7f3a', 'a3', '3a', '(2/3)', ' ', '\n', '-:')
    for length in (0, 1, 5, 30, 60, rng.choice((60, 60, 60, 60, 900))):
        text = rng.choice(('', ' ')).join(rng.choice(words) for _ in range(length))
        yield repr(failure_text_key(rng.choice((1, 3, 8, 99)), rng.choice(('', 'aborted')), text))
        for longest in (0, 1, 3, 4, 5, len(text) - 1, len(text), len(text) + 1):
            yield repr(shortened(text[:80], longest))


if __name__ == '__main__':
    write_told('records', tell(), Path(sys.argv[1]), '--pin' in sys.argv)
