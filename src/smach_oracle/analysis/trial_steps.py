"""Compare what happened in trials that ought to be the same: states, outcomes and decisions, but no times and no names.

Trials are compared that are of the same experiment, the same arm and the same seed. Exit code: 0, the same; 1, not the
same, or some bags were skipped; 2, nothing to compare.
"""
import argparse
import sys
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

from ..oracle.events import Event, EventKind
from ..oracle.paths import path_of
from .bag_events import BagError, Skipped
from .reading import complain, read_bags, tell_skipped
from .trials import summarise

SAME, NOT_THE_SAME = 0, 1  # exit codes
# Who takes a question, and when, is the expert's affair; a warning may be of the network.
LEFT_OUT = (EventKind.QUERY_CLAIMED, EventKind.QUERY_RELEASED, EventKind.WARNING)

Step = Tuple[Any, ...]
Key = Tuple[Any, ...]


class Trial(NamedTuple):
    """One trial, and where it was recorded."""

    bag: str
    course: Tuple[Step, ...]


def course_of(events: Iterable[Event]) -> Tuple[Step, ...]:
    """The steps of one trial: kind, container, state, outcome, target, and how a failure was judged."""
    return tuple((str(getattr(event.kind, 'name', event.kind)), event.path, event.state, event.outcome, event.target,
                  event.failure_kind, event.failure_class, repr(event.rate), event.continuous,
                  event.text if event.kind in (EventKind.FAILURE, EventKind.DECISION) else '')
                 for event in sorted(events, key=lambda event: event.seq) if event.kind not in LEFT_OUT)


def load_courses(place: str, skipped: List[Skipped]) -> Dict[Key, Trial]:
    """The trials in a folder by experiment, arm and seed; bags that cannot be used go to `skipped`. Raises BagError."""
    found: Dict[Key, Trial] = {}
    for path, content in read_bags([place], skipped):
        for trial_id, cause in content.causes.items():
            events = [event for event in content.events if event.trial_id == trial_id]
            summary = summarise(events, (path,))
            key = (summary.experiment, 'without' if summary.recovers is False else 'with', summary.settings, cause.seed)
            found[key] = Trial(path, course_of(events))
    return found


def differences(first: Dict[Key, Trial], second: Dict[Key, Trial]) -> List[str]:
    """In words, the first difference of each two trials that are not the same; of those that are in both."""
    texts = []
    for key in sorted(set(first) & set(second), key=repr):
        ours, theirs = first[key], second[key]
        if ours.course != theirs.course:
            texts.append('seed {}, {} oracle: {}\n  {}\n  {}'.format(
                key[3], key[1], _first_difference(ours.course, theirs.course), ours.bag, theirs.bag))
    return texts


def _first_difference(ours: Sequence[Step], theirs: Sequence[Step]) -> str:
    for number, (one, other) in enumerate(zip(ours, theirs), 1):
        if one != other:
            return 'step {}: {} and {}'.format(number, one, other)
    return '{} and {} steps'.format(len(ours), len(theirs))


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog='same_trials', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folders', nargs=2, metavar='FOLDER', type=path_of, help='with bags in it or below it')
    args = parser.parse_args(argv)
    skipped: List[Skipped] = []
    try:
        first, second = (load_courses(folder, skipped) for folder in args.folders)
    except (BagError, ImportError) as err:
        return complain('same_trials', err)
    code = tell_skipped(skipped)
    common = set(first) & set(second)
    if not common:
        return complain('same_trials', 'no trial of the same experiment, arm and seed in both')
    found = differences(first, second)
    for text in found:
        sys.stdout.write(text + '\n')
    sys.stdout.write('{} trials in both, {} of them the same in all states, outcomes and decisions\n'.format(
        len(common), len(common) - len(found)))
    return NOT_THE_SAME if found else code
