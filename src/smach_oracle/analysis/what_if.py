"""Replay recorded failures under other settings, and compare the decisions.

Settings are the memory, thresholds and the policy. Each recorded failure is put once more to an
oracle of other settings, which has seen the same results before it. Would it have asked where the
recorded one recovered, or the other way round? A record can tell no more than that. It does not
forecast how often such an oracle asks: after the first other decision the trial, and so the rates,
would have gone another way. To measure that, run the trials with the other settings (run_trials
--memory ... --policy ...).

Of a policy that goes by ways (--policy escalating) it says in how many streaks it agrees with the
recorded decisions, and between what a mean streak lies: cured, questions, cost. Where ways were
drawn (any_way, or a parameter `explore`), it weights the streaks, with 95% intervals.

The record is first replayed under its own settings. If that does not reproduce the recorded rates
and decisions, the folder is skipped and the reason is printed. Exit code: 0; 1, some bags or
folders were skipped; 2, nothing could be replayed.
"""

import argparse
import itertools
import sys
import textwrap
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence

from smach_oracle.oracle.decision.failure_rate import ESTIMATORS
from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.decision.policy import Action
from smach_oracle.oracle.errors import OracleError
from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.oracle.settings.settings import Settings

from .bag_events import BagError, SkippedBag
from .compare_command.inputs import instead_of_bags
from .counting.trial_summary import summarise
from .reading import plain, report_error, report_skipped, write_json
from .replaying.checks import beginnings, that_count
from .replaying.replay import NOT_KNOWN, STAYS, Replay, ReplayedDecision, conditioned, policy_of
from .replaying.streak_words import findings_as_data, findings_in_words
from .replaying.streaks import StreakReader
from .replaying.weighting import Findings, findings_of
from .trials import load_replicates

SAME = 'same'
OUTCOMES = (SAME, 'would ask', 'would recover', 'recovers otherwise', NOT_KNOWN)
GIVES_UP = 'would give up'  # a column of its own, where some would
_HEAD, _ANOTHER = 'settings', 'trials with another'  # of the table
_WIDTH = 100
NEEDED = ('estimator', 'memory', 'prior', 'policy', 'moderate_from', 'high_from')  # settings


class TriedSettings(NamedTuple):
    """The counts of the recorded decisions under other settings."""

    settings: Mapping[str, Any]
    counts: Mapping[str, int]  # by OUTCOMES
    trials: int
    other_trials: int  # in which at least one decision is known to be another
    programs: int = 1  # found that began with nothing learned
    without_menu: int = 0  # decisions of a policy that goes by ways, where no menu is recorded
    streaks: Optional[Findings] = None  # None: it does not go by ways


def _changed(recorded: Mapping[str, Any], settings: Mapping[str, Any]) -> Dict[str, Any]:
    """Return the recorded settings with others. Another policy has the parameters it comes with."""
    kept = {
        key: value
        for key, value in recorded.items()
        if 'policy' not in settings or not key.startswith('policy.')
    }
    return {**kept, **settings}


class Recorded:
    """One replicate, and what is needed to replay it."""

    def __init__(self, trials: Sequence[Sequence[Event]], nodes: Sequence[str] = ()) -> None:
        """`trials`: the events of each trial, in order. `nodes`: whose they are.

        :raises BagError: where it cannot be replayed under its own settings.
        """
        self.trials = trials
        self.settings = dict(summarise(trials[0]).settings)
        if not set(NEEDED) <= set(self.settings):
            raise BagError('its trials do not tell the settings of their oracle')
        self._conditioned = conditioned(
            (event for trial in trials for event in trial), policy_of(self.settings)
        )
        try:
            self.beginnings = beginnings(trials, lambda: self.replay({}))
        except BagError as err:
            raise BagError('{}. {}'.format(err, _why_not(trials, nodes))) from err

    def replay(self, settings: Mapping[str, Any]) -> Replay:
        """Return an oracle that has learned nothing, with these settings in place of its own."""
        return Replay(self.settings_with(settings), self._conditioned)

    def settings_with(self, settings: Mapping[str, Any]) -> Dict[str, Any]:
        """Return the recorded settings, with others in their place.

        :raises SettingsError: where no oracle may have these.
        """
        found = _changed(self.settings, settings)
        Settings.from_dict({name: found[name] for name in NEEDED if name != 'policy'})
        return found


def _why_not(trials: Sequence[Sequence[Event]], nodes: Sequence[str]) -> str:
    """Say why trials may not be those of one oracle."""
    told = [dict(summarise(trial).settings) for trial in trials]
    differing = []
    for key in sorted({key for settings in told for key in settings}):
        values = dict.fromkeys(str(settings.get(key, 'none')) for settings in told)
        if len(values) > 1 and (key in NEEDED or '.' in key):  # no other one changes a decision
            differing.append('{} {}'.format(key, ' and '.join(values)))
    if differing:
        return 'Its trials are under several settings: {}'.format(', '.join(differing))
    several = sorted({*nodes} - {''})
    of_nodes = 'Its trials are of several nodes: {}. '.format(', '.join(several))
    return (of_nodes if len(several) > 1 else '') + (
        'The state may have settings of its own, rates may be kept in a file, or trials may be '
        'missing'
    )


def compare(recorded: Recorded, settings: Mapping[str, Any]) -> TriedSettings:
    """Put the decisions of one replicate to an oracle of other settings."""
    counts = dict.fromkeys((*OUTCOMES, GIVES_UP), 0)
    other_trials = without_menu = 0
    in_force = recorded.settings_with(settings)
    policy = policy_of(in_force)
    streaks = StreakReader(policy) if policy.goes_by_ways else None
    for number, trial in enumerate(recorded.trials):
        if number in recorded.beginnings:
            other = recorded.replay(settings)
        another = False
        for event in that_count(trial):
            tried = other.take(event)
            if streaks is not None:
                streaks.take(event, tried, in_force)
            if tried is not None:
                outcome = _outcome(event, tried)
                counts[outcome] += 1
                without_menu += tried.lacks_menu
                another = another or outcome not in (SAME, NOT_KNOWN)
        other_trials += another
    return TriedSettings(
        dict(settings),
        counts,
        len(recorded.trials),
        other_trials,
        len(recorded.beginnings),
        without_menu,
        None if streaks is None else findings_of(streaks.found),
    )


def _outcome(recorded: Event, tried: ReplayedDecision) -> str:
    if tried.action == NOT_KNOWN:
        return NOT_KNOWN
    if tried.is_as(recorded):
        return SAME
    if tried.action in STAYS:
        return 'would ask' if tried.action == Action.ASK.value else GIVES_UP
    return 'would recover' if recorded.outcome in STAYS else 'recovers otherwise'


def format_tried_settings(rows: Sequence[TriedSettings], wide: bool = False) -> str:
    """Return a line for each oracle that was tried, of at most 100 columns unless it is wide."""
    names = [
        ', '.join('{} {}'.format(*item) for item in row.settings.items()) or 'as recorded'
        for row in rows
    ]
    columns = OUTCOMES + ((GIVES_UP,) if any(row.counts[GIVES_UP] for row in rows) else ())
    table = _wide_table(names, rows, columns) if wide else _narrow_table(names, rows, columns)
    notes = _notes(names, rows)
    if not wide:
        notes = [
            line for note in notes for line in textwrap.wrap(note, _WIDTH, subsequent_indent='    ')
        ]
    return '\n'.join(table + notes) + '\n'


def _wide_table(
    names: Sequence[str], rows: Sequence[TriedSettings], columns: Sequence[str]
) -> List[str]:
    width = max(map(len, [*names, _HEAD]))
    lines = [
        '{:<{}}  decisions'.format(_HEAD, width)
        + ''.join('{:>20}'.format(name) for name in columns)
        + '   '
        + _ANOTHER
    ]
    for name, row in zip(names, rows):
        numbers = ''.join('{:>20}'.format(row.counts[outcome]) for outcome in columns)
        lines.append(_line(name, width, row, numbers))
    return lines


def _narrow_table(
    names: Sequence[str], rows: Sequence[TriedSettings], columns: Sequence[str]
) -> List[str]:
    """Return a table with headings in two lines. A name that is too long has a line of its own."""
    words = [('', *name.split(' ', 1))[-2:] for name in columns]
    widths = [2 + max(map(len, each)) for each in words]
    above, below = (
        ''.join('{:>{}}'.format(each[line], size) for each, size in zip(words, widths))
        for line in (0, 1)
    )
    with_another = _ANOTHER.rsplit(' ', 1)
    rest = len('  decisions') + sum(widths) + 3 + max(map(len, with_another))
    width = min(max(map(len, [*names, _HEAD])), _WIDTH - rest)
    lines = [
        '{:<{}}  {:>9}{}   {}'.format('', width, '', above, with_another[0]),
        '{:<{}}  {:>9}{}   {}'.format(_HEAD, width, 'decisions', below, with_another[1]),
    ]
    for name, row in zip(names, rows):
        if len(name) > width:
            lines.append(name)
            name = ''
        numbers = ''.join(
            '{:>{}}'.format(row.counts[outcome], size) for outcome, size in zip(columns, widths)
        )
        lines.append(_line(name, width, row, numbers))
    return lines


def _line(name: str, width: int, row: TriedSettings, numbers: str) -> str:
    return '{:<{}}  {:>9}{}   {} of {}'.format(
        name, width, sum(row.counts.values()), numbers, row.other_trials, row.trials
    )


def _notes(names: Sequence[str], rows: Sequence[TriedSettings]) -> List[str]:
    """Return what stands below the table."""
    notes = [
        '{}: not known for {} decisions, which another policy made without a menu'.format(
            name, row.without_menu
        )
        for name, row in zip(names, rows)
        if row.without_menu
    ]
    for name, row in zip(names, rows):
        if row.streaks is not None:
            notes += ['{}: {}'.format(name, each) for each in findings_in_words(row.streaks)]
    if rows[0].programs > 1:
        notes.append(
            'at least {} programs, each of which began with nothing learned'.format(
                rows[0].programs
            )
        )
    return notes


def as_data(folder: str, rows: Sequence[TriedSettings]) -> Dict[str, Any]:
    """Return a folder's table as plain data, decisions counted by what became of them."""
    return {
        'folder': folder,
        'programs': rows[0].programs,
        'tried': [
            {
                'settings': row.settings,
                'decisions': sum(row.counts.values()),
                'outcomes': {name: row.counts[name] for name in OUTCOMES + (GIVES_UP,)},
                'trials': row.trials,
                'trials_with_another': row.other_trials,
                **({} if row.streaks is None else {'streaks': findings_as_data(row.streaks)}),
            }
            for row in rows
        ],
    }


def main(argv: Optional[Sequence[str]] = None, command: str = 'compare what_if') -> int:
    """Run the command, and return its exit code.

    :param command: its name in messages.
    """
    parser = argparse.ArgumentParser(
        prog=command, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        'folders',
        nargs='+',
        metavar='FOLDER',
        type=path_of,
        help='with bags in it or below it; or a bag',
    )
    parser.add_argument('--memory', nargs='+', type=int, metavar='N', help='values to try')
    parser.add_argument('--policy', nargs='+', choices=sorted(POLICIES), help='policies to try')
    parser.add_argument(
        '--estimator', nargs='+', choices=sorted(ESTIMATORS), help='of failure rates: those to try'
    )
    for name in ('moderate_from', 'high_from', 'prior'):
        parser.add_argument(
            '--' + name.replace('_', '-'), nargs='+', type=float, metavar='X', help='values to try'
        )
    parser.add_argument(
        '--wide', action='store_true', help='lines of 150 columns and more in place of 100'
    )
    parser.add_argument(
        '--json', metavar='FILE', type=path_of, help='write the tables and what was skipped as JSON'
    )
    args = parser.parse_args(argv)
    varied = {
        name: values
        for name, values in vars(args).items()
        if name not in ('folders', 'json', 'wide') and values
    }
    skipped: List[SkippedBag] = []
    try:
        replicates = load_replicates(args.folders, skipped)
    except (BagError, ImportError) as err:
        return report_error(command, instead_of_bags(err, args.folders))
    replayed = []
    for folder, trials in sorted(replicates.items()):
        try:
            recorded = Recorded(
                [trial.events for trial in trials], [trial.node for trial in trials]
            )
            rows = [
                compare(recorded, dict(zip(varied, values)))
                for values in itertools.product(*varied.values())
            ]
        except OracleError as err:
            skipped.append(SkippedBag(folder, str(err)))
        else:
            sys.stdout.write('{}\n{}'.format(folder, format_tried_settings(rows, args.wide)))
            replayed.append(as_data(folder, rows))
    code = report_skipped(skipped)
    if args.json:
        try:
            write_json(args.json, {'folders': replayed, 'skipped': plain(skipped)})
        except OSError as err:
            return report_error(command, err)
    if not replayed:
        places = ', '.join(args.folders)
        none = BagError('{}: no trials with an oracle that could be replayed'.format(places))
        return report_error(command, instead_of_bags(none, args.folders))
    return code
