"""Replay recorded failures under other settings, and compare the decisions.

Settings are the memory, thresholds and the policy. Each recorded failure is put once more to an
oracle of other settings, which has seen the same results before it. Would it have asked where the
recorded one recovered, or the other way round? A record can tell no more than that. It does not
forecast how often such an oracle asks: after the first other decision the trial, and so the rates,
would have gone another way. To measure that, run the trials with the other settings (run_trials
--memory ... --policy ...).

The record is first replayed under its own settings. If that does not reproduce the recorded rates
and decisions, the folder is skipped and the reason is printed. Exit code: 0; 1, some bags or
folders were skipped; 2, nothing could be replayed.
"""
import argparse
import itertools
import sys
from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

from smach_oracle.oracle.decision.failure_rate import FailureClass, classify, make_estimator
from smach_oracle.oracle.decision.policy import (
    POLICIES,
    Action,
    FailureContext,
    Past,
    Policy,
    Preconditions,
    Situation,
    policy_named,
)
from smach_oracle.oracle.errors import OracleError
from smach_oracle.oracle.records import facts
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.oracle.records.facts import Decider, branches_of, decided_by, is_counted
from smach_oracle.oracle.records.history import History
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.oracle.settings.failing_outcomes import is_preempted
from smach_oracle.oracle.settings.paths import path_of

from .bag_events import BagError, SkippedBag
from .reading import plain, report_error, report_skipped, write_json
from .trials import load_replicates, summarise

ENOUGH_VISITS = 50
SAME, NOT_KNOWN = 'same', 'not known'
OUTCOMES = (SAME, 'would ask', 'would recover', 'recovers otherwise', NOT_KNOWN)
GIVES_UP = 'would give up'  # a column of its own, where some would
NEEDED = ('estimator', 'memory', 'prior', 'policy', 'moderate_from', 'high_from')  # settings
_ROUNDING = 1e-9
_OUTSIDE_POLICIES = (Decider.MAX_RECOVERIES, Decider.BUDGET, Decider.ON_RETRY, Decider.AUTHOR)
_STAYS = (Action.ASK.value, Action.GIVE_UP.value)

Key = Tuple[str, str]  # path and state


class TriedSettings(NamedTuple):
    """The counts of the recorded decisions under other settings."""

    settings: Mapping[str, Any]
    counts: Mapping[str, int]  # by OUTCOMES
    trials: int
    other_trials: int  # in which at least one decision is known to be another


class _LearnedState:
    """An oracle's knowledge of a state: what it learns, and what it knows of this failure."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self.estimator = make_estimator(settings['estimator'], settings['memory'],
                                        settings['prior'])
        self.context: Optional[FailureContext] = None
        self.held_back = False  # the present question is about no failure
        self.recoveries = 0  # of this trial, as recorded
        self.interrupted = False  # the program was stopped while it ran: nothing is learned of it
        # whether each was met, of those run for the present failure
        self.preconditions: List[bool] = []


class Replay:
    """An oracle that follows the recorded trials of one replicate, in their order."""

    def __init__(self, settings: Mapping[str, Any], conditioned: Mapping[Key, bool]) -> None:
        """`conditioned`: whether a state has preconditions, where that is known."""
        self._settings = settings
        self._policy = _policy_of(settings)
        self._restarts = 0  # of this trial, as recorded
        self._conditioned = conditioned
        self._states: Dict[Key, _LearnedState] = {}
        self._histories: Dict[Key, History] = {}
        self._branches: Dict[str, Tuple[str, ...]] = {}  # states that are on their own, by path
        self._running: Set[str] = set()  # paths of containers
        self._go_on: Set[str] = set()  # those that ran when the program was stopped

    def take(self, event: Event) -> Optional[str]:
        """Follow one event. Return the action at a DECISION ('not known' included), else None."""
        if event.kind == EventKind.TRIAL_START:
            self._begin_trial()
        elif event.kind == EventKind.RESUMED:
            self._go_on = set(self._running)
        elif event.kind == EventKind.CONTAINER_END and event.outcome:
            self._running.discard(event.path)
        elif event.kind == EventKind.CONTAINER_START:
            self._begin_execution(event)
        elif event.kind == EventKind.FAILURE:
            self._failed(event)
        elif event.kind == EventKind.TRANSITION:
            self._left(event)
        elif event.kind == EventKind.PRECONDITION_END:
            self._state(event).preconditions.append(event.outcome == 'met')
        elif event.kind == EventKind.SUPERSEDE:
            self._superseded(event)
        elif event.kind == EventKind.DECISION:
            self._state(event).held_back = decided_by(event) is Decider.HELD_BACK
            return None if self._state(event).held_back else self._decided(event)
        return None

    def _begin_trial(self) -> None:
        self._running.clear()
        for history in self._histories.values():
            history.begin_trial()
        for state in self._states.values():
            state.recoveries = 0
        self._restarts = 0

    def _decided(self, event: Event) -> str:
        """Decide, and note what was done instead."""
        tried = self._decide(event)
        self._state(event).recoveries += event.outcome not in _STAYS
        self._restarts += event.outcome == Action.RESTART.value
        return tried

    def rate(self, event: Event) -> float:
        """Return what it has learned of the event's state."""
        return self._state(event).estimator.rate

    def _state(self, event: Event) -> _LearnedState:
        key = (event.path, event.state)
        if key not in self._states:
            self._states[key] = _LearnedState(self._settings)
        return self._states[key]

    def _begin_execution(self, event: Event) -> None:
        if event.path in self._go_on:
            self._go_on.discard(event.path)
            return
        self._running.add(event.path)
        branches = branches_of(event)
        self._branches[event.path] = branches
        for key in [(event.path, state) for state in branches] or [(event.path, '')]:
            self._histories.setdefault(key, History(ENOUGH_VISITS)).begin_execution()

    def _history(self, event: Event) -> History:
        """Return the chain of the event's container, or of its state where that is on its own."""
        alone = event.state in self._branches.get(event.path, ())
        key = (event.path, event.state if alone else '')
        return self._histories.setdefault(key, History(ENOUGH_VISITS))

    def _failed(self, event: Event) -> None:
        state, history = self._state(event), self._history(event)
        state.interrupted = event.failure_kind == FailureKind.INTERRUPTED
        if state.interrupted:
            state.context = None
            return
        successes = state.estimator.successes
        state.context = history.failure_context(event.state, '', successes)
        state.preconditions = []
        history.failed(event.state, successes)
        state.estimator.add(True)
        self._visited(event, VisitResult.FAILURE)

    def _superseded(self, event: Event) -> None:
        if self._state(event).interrupted:
            return
        if self._state(event).held_back:
            self._visited(event, VisitResult.SUPERSEDED)
            return
        self._state(event).estimator.take_back_failure()
        self._history(event).supersede(event.outcome)

    def _left(self, event: Event) -> None:
        state = self._state(event)
        # the end of the visit whose failure is known, or of none: the state was held back
        if state.context is not None or state.interrupted or not event.outcome:
            return
        if not is_preempted(event.outcome) and is_counted(event):
            state.estimator.add(False)
            self._visited(event, VisitResult.SUCCESS)

    def _visited(self, event: Event, result: VisitResult) -> None:
        self._history(event).visited(Visit(event.state, event.outcome, result),
                                          self._conditioned.get((event.path, event.state), False))

    def begin_visit(self, event: Event) -> None:
        """Note that a state is about to run."""
        state = self._state(event)
        state.context, state.interrupted = None, False

    def _decide(self, event: Event) -> str:
        state = self._state(event)
        if decided_by(event) in _OUTSIDE_POLICIES:
            return (Action.ASK if self._policy.asks else Action.GIVE_UP).value
        failure_class = classify(state.estimator.rate, self._settings['moderate_from'],
                                 self._settings['high_from'])
        preconditions = self._preconditions(event, state, failure_class)
        if preconditions is None or state.context is None:
            return NOT_KNOWN
        actions = self._policy.may_do(Situation(
            failure_class, preconditions, self._policy.is_continuous(state.context),
            Past(state.recoveries, self._restarts)))
        return actions[0].value if len(actions) == 1 else NOT_KNOWN  # it would be drawn

    def _preconditions(self, event: Event, state: _LearnedState,
                       failure_class: FailureClass) -> Optional[Preconditions]:
        if self._conditioned.get((event.path, event.state)) is False:
            return Preconditions.NONE
        if not self._policy.runs_preconditions(failure_class):
            return Preconditions.NOT_MET
        if not state.preconditions:
            return None  # they were not run: nobody knows whether they would have been met
        return Preconditions.MET if all(state.preconditions) else Preconditions.NOT_MET


def _policy_of(settings: Mapping[str, Any]) -> Policy:
    prefix = 'policy.'
    return policy_named(settings['policy'], {key[len(prefix):]: value
                                             for key, value in settings.items()
                                             if key.startswith(prefix)})


def _changed(recorded: Mapping[str, Any], settings: Mapping[str, Any]) -> Dict[str, Any]:
    """Return the recorded settings with others. Another policy has the parameters it comes with."""
    kept = {key: value for key, value in recorded.items()
            if 'policy' not in settings or not key.startswith('policy.')}
    return {**kept, **settings}


def _conditioned(events: Iterable[Event], policy: Policy) -> Dict[Key, bool]:
    """Return whether states have preconditions, if known: those where some were run do.

    Those where none were run, though they would have been, do not.
    """
    known: Dict[Key, bool] = {}
    for event in events:
        key = (event.path, event.state)
        if event.kind == EventKind.PRECONDITION_START:
            known[key] = True
        elif (event.kind == EventKind.DECISION and decided_by(event) is Decider.POLICY
              and policy.runs_preconditions(FailureClass(event.failure_class))):
            known.setdefault(key, False)
    return known


def compare(trials: Sequence[Sequence[Event]], settings: Mapping[str, Any]) -> TriedSettings:
    """Put the decisions of one replicate to an oracle of other settings.

    :param trials: the events of each trial, in order.
    :raises BagError: where the record cannot be replayed under its own settings.
    """
    recorded = dict(summarise(trials[0]).settings)
    if not set(NEEDED) <= set(recorded):
        raise BagError('its trials do not tell the settings of their oracle')
    conditioned = _conditioned((event for trial in trials for event in trial),
                               _policy_of(recorded))
    own = Replay(recorded, conditioned)
    other = Replay(_changed(recorded, settings), conditioned)
    counts = dict.fromkeys((*OUTCOMES, GIVES_UP), 0)
    other_trials = 0
    for trial in trials:
        another = False
        for event in _that_count(trial):
            _check_rate(own, event)
            if event.kind == EventKind.STATE_START:
                own.begin_visit(event)
                other.begin_visit(event)
            done, tried = own.take(event), other.take(event)
            if done is not None and tried is not None:
                _check_decision(done, event)
                outcome = _outcome(event.outcome, tried)
                counts[outcome] += 1
                another = another or outcome not in (SAME, NOT_KNOWN)
        other_trials += another
    return TriedSettings(dict(settings), counts, len(trials), other_trials)


def _that_count(trial: Sequence[Event]) -> List[Event]:
    """Leave out what a program told before it was killed, and had not stored yet.

    The machine went on from before that.
    """
    found: List[Event] = []
    for event in trial:
        stored = facts.last_stored(event) if event.kind == EventKind.RESUMED else -1
        if stored >= 0:
            found = [each for each in found if each.seq <= stored]
        found.append(event)
    return found


def _check_rate(own: Replay, event: Event) -> None:
    if event.kind != EventKind.FAILURE or event.failure_kind == FailureKind.INTERRUPTED:
        return
    if abs(own.rate(event) - event.rate) > _ROUNDING:
        raise BagError(
            '{}: {} failed at a rate of {:.4f}, by the record of its results it is {:.4f}: states '
            'with '
            'settings of their own, rates kept from elsewhere, or trials that are missing'.format(
                event.trial_id, event.state, event.rate, own.rate(event)))


def _check_decision(done: str, event: Event) -> None:
    if done not in (event.outcome, NOT_KNOWN):
        raise BagError('{}: {}: it decided {}, where its own settings say {}'.format(
            event.trial_id, event.state, event.outcome, done))


def _outcome(recorded: str, tried: str) -> str:
    if tried in (recorded, NOT_KNOWN):
        return SAME if tried == recorded else tried
    if tried in _STAYS:
        return 'would ask' if tried == Action.ASK.value else GIVES_UP
    return 'would recover' if recorded in _STAYS else 'recovers otherwise'


def format_tried_settings(rows: Sequence[TriedSettings]) -> str:
    """Return a line for each oracle that was tried."""
    names = [
        ', '.join('{} {}'.format(*item) for item in row.settings.items()) or 'as recorded'
        for row in rows
    ]
    columns = OUTCOMES + ((GIVES_UP,) if any(row.counts[GIVES_UP] for row in rows) else ())
    width = max(len(name) for name in names + ['settings'])
    lines = [
        '{:<{}}  decisions'.format('settings', width) +
        ''.join('{:>20}'.format(name) for name in columns) + '   trials with another'
    ]
    for name, row in zip(names, rows):
        lines.append('{:<{}}  {:>9}'.format(name, width, sum(row.counts.values())) + ''.join(
            '{:>20}'.format(row.counts[outcome]) for outcome in columns)
            + '   {} of {}'.format(row.other_trials, row.trials))
    return '\n'.join(lines) + '\n'


def as_data(folder: str, rows: Sequence[TriedSettings]) -> Dict[str, Any]:
    """Return a folder's table as plain data, decisions counted by what became of them."""
    return {'folder': folder, 'tried': [{
        'settings': row.settings, 'decisions': sum(row.counts.values()),
        'outcomes': {name: row.counts[name] for name in OUTCOMES + (GIVES_UP,)},
        'trials': row.trials, 'trials_with_another': row.other_trials
    } for row in rows]}


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command, and return its exit code."""
    parser = argparse.ArgumentParser(prog='what_if', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folders', nargs='+', metavar='FOLDER', type=path_of,
                        help='with bags in it or below it')
    parser.add_argument('--memory', nargs='+', type=int, metavar='N', help='values to try')
    parser.add_argument('--policy', nargs='+', choices=sorted(POLICIES), help='policies to try')
    for name in ('moderate_from', 'high_from', 'prior'):
        parser.add_argument('--' + name.replace('_', '-'), nargs='+', type=float, metavar='X',
                            help='values to try')
    parser.add_argument('--json', metavar='OUT', type=path_of,
                        help='write the tables and what was skipped as JSON')
    args = parser.parse_args(argv)
    varied = {name: values for name, values in vars(args).items()
              if name not in ('folders', 'json') and values}
    skipped: List[SkippedBag] = []
    try:
        replicates = load_replicates(args.folders, skipped)
    except (BagError, ImportError) as err:
        return report_error('what_if', err)
    replayed = []
    for folder, trials in sorted(replicates.items()):
        try:
            rows = [
                compare(trials, dict(zip(varied, values)))
                for values in itertools.product(*varied.values())
            ]
        except OracleError as err:
            skipped.append(SkippedBag(folder, str(err)))
        else:
            sys.stdout.write('{}\n{}'.format(folder, format_tried_settings(rows)))
            replayed.append(as_data(folder, rows))
    code = report_skipped(skipped)
    if args.json:
        try:
            write_json(args.json, {'folders': replayed, 'skipped': plain(skipped)})
        except OSError as err:
            return report_error('what_if', '{}: {}'.format(args.json, err.strerror))
    if not replayed:
        return report_error('what_if', '{}: no trials with an oracle that could be replayed'.format(
            ', '.join(args.folders)))
    return code
