"""Compare trials that should be the same, except for times and names.

The trials have the same experiment, variant and seed. Their states, outcomes and decisions are
compared. Exit code: 0, they are the same; 1, they are not, or some bags were skipped; 2, there is
nothing to compare.
"""

import argparse
import sys
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.settings.paths import path_of

from .bag_events import BagError, SkippedBag
from .compare_command.inputs import instead_of_bags
from .counting.trials_of_bags import trials_of
from .reading import read_bags, report_error, report_skipped

SAME, NOT_THE_SAME = 0, 1  # exit codes
# Who takes a question, and when, is the expert's affair. A warning may be of the network.
LEFT_OUT = (EventKind.QUERY_CLAIMED, EventKind.QUERY_RELEASED, EventKind.WARNING)

TrialStep = Tuple[object, ...]  # a kind of event, and its fields without times and names
TrialKey = Tuple[str, str, Tuple[Tuple[str, Any], ...], int]  # experiment, variant, settings, seed


class TrialSteps(NamedTuple):
    """The steps of one trial, and where it was recorded."""

    bag: str  # the first of its bags
    steps: Tuple[TrialStep, ...]


def steps_of(events: Iterable[Event]) -> Tuple[TrialStep, ...]:
    """Return the trial's steps: kind, container, state, outcome, target, judgement of a failure."""
    return tuple(
        (
            str(getattr(event.kind, 'name', event.kind)),
            event.path,
            event.state,
            event.outcome,
            event.target,
            event.failure_kind,
            event.failure_class,
            repr(event.rate),
            event.continuous,
            event.text if event.kind in (EventKind.FAILURE, EventKind.DECISION) else '',
        )
        for event in sorted(events, key=lambda event: event.seq)
        if event.kind not in LEFT_OUT
    )


def load_trial_steps(place: str, skipped: List[SkippedBag]) -> Dict[TrialKey, TrialSteps]:
    """Read the trials in a folder, by experiment, variant and seed.

    Bags that cannot be used go to `skipped`.

    :raises BagError: where there are none, or no folder.
    """
    found: Dict[TrialKey, TrialSteps] = {}
    for trial in trials_of(dict(read_bags([place], skipped))):
        if trial.cause is not None:
            summary = trial.summary(None)
            key = (
                summary.experiment,
                'without' if summary.recovers is False else 'with',
                summary.settings,
                trial.cause.seed,
            )
            found[key] = TrialSteps(trial.bags[0], steps_of(trial.events))
    return found


def differences(first: Dict[TrialKey, TrialSteps], second: Dict[TrialKey, TrialSteps]) -> List[str]:
    """Describe the first difference of each two trials that are in both and not the same."""
    texts = []
    for key in sorted(set(first) & set(second), key=repr):
        ours, theirs = first[key], second[key]
        if ours.steps != theirs.steps:
            texts.append(
                'seed {}, {} oracle: {}\n  {}\n  {}'.format(
                    key[3],
                    key[1],
                    _first_difference(ours.steps, theirs.steps),
                    ours.bag,
                    theirs.bag,
                )
            )
    return texts


def _first_difference(ours: Sequence[TrialStep], theirs: Sequence[TrialStep]) -> str:
    for number, (one, other) in enumerate(zip(ours, theirs), 1):
        if one != other:
            return 'step {}: {} and {}'.format(number, one, other)
    return '{} and {} steps'.format(len(ours), len(theirs))


def main(argv: Optional[Sequence[str]] = None, command: str = 'compare same_trials') -> int:
    """Run the command, and return its exit code.

    :param command: its name in messages.
    """
    parser = argparse.ArgumentParser(
        prog=command,
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        'folders',
        nargs=2,
        metavar='FOLDER',
        type=path_of,
        help='with bags in it or below it; or a bag',
    )
    args = parser.parse_args(argv)
    skipped: List[SkippedBag] = []
    try:
        first, second = (load_trial_steps(folder, skipped) for folder in args.folders)
    except (BagError, ImportError) as err:
        return report_error(command, instead_of_bags(err, args.folders))
    code = report_skipped(skipped)
    common = set(first) & set(second)
    if not common:
        none = BagError('no trial of the same experiment, variant and seed in both')
        return report_error(command, instead_of_bags(none, args.folders))
    found = differences(first, second)
    for text in found:
        sys.stdout.write(text + '\n')
    sys.stdout.write(
        '{} trials in both, {} of them the same in all states, outcomes and decisions\n'.format(
            len(common), len(common) - len(found)
        )
    )
    return NOT_THE_SAME if found else code
