"""Many trials of a machine, each with one random fault: which failures never recover."""

import contextlib
import os
import random
import tempfile
from typing import Callable, Iterable, Iterator, List, NamedTuple, Optional, Tuple, TypeVar, Union

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.asking.question import Expert
from smach_oracle.oracle.settings.failing_outcomes import FailingNames
from smach_oracle.oracle.settings.settings import PreconditionLists, SettingsLike, as_settings

from .bench import LIMIT_S, Bench
from .errors import FaultError, ScriptError, TrialLimitError
from .faults import Fault, FaultKind, crash, fail, hang, overrun
from .observed_trial import ObservedTrial
from .places import StatePlace, find_place, places_of
from .soak_report import SoakReport, SoakTrial

MachineOrFactory = Union[smach.StateMachine, Callable[[], smach.StateMachine]]
Name = TypeVar('Name', str, FaultKind)
KINDS = (FaultKind.OUTCOME, FaultKind.EXCEPTION)


class SoakPlan(NamedTuple):
    """The plan of a soak. Each of its trials follows from this and its number."""

    machine: MachineOrFactory
    seed: int = 0
    kinds: Tuple[FaultKind, ...] = KINDS
    states: Tuple[str, ...] = ()  # LABEL or PATH/LABEL. () means all that hold no others
    most_in_row: Optional[int] = 3  # visits in a row at which a fault happens, at most. None: all
    overrun_s: float = 1.0
    expert: Optional[Expert] = None
    settings: SettingsLike = None
    preconditions: PreconditionLists = None
    limit_s: float = LIMIT_S


def soak(
    machine: MachineOrFactory,
    trials: int = 1000,
    *,
    seed: int = 0,
    kinds: Iterable[FaultKind] = KINDS,
    states: Iterable[str] = (),
    most_in_row: Optional[int] = 3,
    overrun_s: float = 1.0,
    expert: Optional[Expert] = None,
    settings: SettingsLike = None,
    preconditions: PreconditionLists = None,
    limit_s: float = LIMIT_S,
) -> SoakReport:
    """Run many trials, each with one random fault, and report which failures never recover.

    Trial n of a seed is always the same. Each begins with nothing learned, and with the userdata
    that the machine has now. States may keep something in themselves from one trial to the next. A
    function that builds the machine is called for each trial, so its states keep nothing.

    >>> import smach
    >>> from smach_oracle.testing import soak
    >>> pick = smach.CBState(lambda userdata: 'succeeded', outcomes=['succeeded', 'aborted'])
    >>> sm = smach.StateMachine(['succeeded', 'aborted'])
    >>> with sm:
    ...     _ = smach.StateMachine.add('PICK', pick)
    >>> print(soak(sm, trials=20))
    20 trials with one fault each, seed 0: 20 recovered, 0 did not.
    Always recovered:
      PICK: exception: 9 of 9 recovered
      PICK: outcome 'aborted': 11 of 11 recovered

    :param machine: a machine, or a function that builds one.
    :param kinds: of faults. HANG is of use for states with a time limit alone.
    :param states: which fail, LABEL or PATH/LABEL. Default: all that hold no states themselves.
    :param most_in_row: a fault happens at 1 to so many visits in a row. None means at every visit.
    :param overrun_s: seconds of wall time that an OVERRUN takes.
    :param expert: who answers, such as `expert(function)`. None means as with `Bench`.
    :param limit_s: seconds of wall time after which a trial counts as not recovered.
    :raises FaultError: for a state that is not there, where nothing can fail, and for a number
        below 1.
    :raises SettingsError: naming key, value and what is allowed.
    :raises AssertionError: where the machine does not end well without a fault.
    """
    _check_count('trials', trials)
    plan = SoakPlan(
        machine,
        seed,
        _kinds(kinds),
        _names(states),
        most_in_row,
        overrun_s,
        expert,
        settings,
        preconditions,
        limit_s,
    )
    runner = _SoakRunner(plan)
    told = []
    with runner.unchanged():
        runner.draw_candidates()
        told = [runner.told(number) for number in range(1, trials + 1)]
    return SoakReport(seed, told, runner.not_visited, lambda number: _alone(plan, number))


def soak_trial(
    machine: MachineOrFactory,
    number: int,
    *,
    seed: int = 0,
    kinds: Iterable[FaultKind] = KINDS,
    states: Iterable[str] = (),
    most_in_row: Optional[int] = 3,
    overrun_s: float = 1.0,
    expert: Optional[Expert] = None,
    settings: SettingsLike = None,
    preconditions: PreconditionLists = None,
    limit_s: float = LIMIT_S,
) -> ObservedTrial:
    """Run one trial of a soak alone, by its number from 1. The arguments are those of `soak`.

    :raises FaultError: for a state that is not there, where nothing can fail, and for a number
        below 1.
    :raises SettingsError: naming key, value and what is allowed.
    :raises ScriptError: where a question did not go with the script of the expert.
    :raises TrialLimitError: where the trial did not end in time.
    :raises AssertionError: where the machine does not end well without a fault.
    """
    return _alone(
        SoakPlan(
            machine,
            seed,
            _kinds(kinds),
            _names(states),
            most_in_row,
            overrun_s,
            expert,
            settings,
            preconditions,
            limit_s,
        ),
        number,
    )


def _alone(plan: SoakPlan, number: int) -> ObservedTrial:
    _check_count('number', number)
    runner = _SoakRunner(plan)
    with runner.unchanged():
        runner.draw_candidates()
        return runner.run([runner.fault(number)])


def _kinds(given: Iterable[FaultKind]) -> Tuple[FaultKind, ...]:
    allowed = ', '.join(kind.value for kind in FaultKind)
    try:
        return tuple(FaultKind(kind) for kind in _names(given))
    except ValueError as err:
        raise FaultError('kinds: {}; allowed is a list of {}'.format(err, allowed)) from err


def _names(given: Iterable[Name]) -> Tuple[Name, ...]:
    """Return what was given as a list. A single text is one name, and not its letters."""
    return (given,) if isinstance(given, str) else tuple(given)


class _Candidate(NamedTuple):
    """One way in which one state may fail."""

    path: str
    kind: FaultKind
    outcome: str
    visits: int  # of the state in a trial without faults

    @property
    def name(self) -> str:
        """Return the kind, with the outcome where there is one."""
        return '{} {!r}'.format(self.kind.value, self.outcome) if self.outcome else self.kind.value


class _SoakRunner:
    """Runs the trials of a plan."""

    def __init__(self, plan: SoakPlan) -> None:
        if plan.most_in_row is not None:
            _check_count('most_in_row', plan.most_in_row)
        self._plan = plan
        self._candidates: List[_Candidate] = []
        self._fresh: Callable[[], None] = _nothing
        self.not_visited: List[str] = []

    @contextlib.contextmanager
    def unchanged(self) -> Iterator[None]:
        """Let each trial of the body find the machine as it is now, and whoever comes after it."""
        machine = self._plan.machine
        if not isinstance(machine, smach.StateMachine):
            yield
            return
        with tempfile.TemporaryDirectory(prefix='smach_oracle-soak-') as folder:
            self._fresh = _back_to_now(machine, os.path.join(folder, 'rates.json'))
            try:
                yield
            finally:
                self._fresh()

    def draw_candidates(self) -> None:
        """Find out, by a trial without faults, what may fail.

        :raises FaultError: for a state that is not there, or where nothing can fail.
        :raises AssertionError: where the machine does not end well.
        """
        machine = self._machine()
        failing = FailingNames(self._failing_outcomes(machine))
        places = self._places(machine)
        trial = self.run([], machine)
        if not trial.ended_well:
            raise AssertionError(
                'the machine does not end well even without a fault\n{}'.format(trial)
            )
        visits = trial.visits()
        self.not_visited = [place.path for place in places if place.path not in visits]
        self._candidates = [
            each
            for place in places
            for each in self._candidates_of(place, visits.count(place.path), failing)
        ]
        if not self._candidates:
            raise FaultError(
                'a soak: nothing can fail by {}; the states are {}'.format(
                    ', '.join(kind.value for kind in self._plan.kinds) or 'no kind of fault',
                    ', '.join(place.path for place in places) or 'none',
                )
            )

    def _failing_outcomes(self, machine: smach.StateMachine) -> Optional[Tuple[str, ...]]:
        if isinstance(machine, OracleContainer) and self._plan.settings is None:
            return oracle_of(machine).settings.failing_outcomes
        return as_settings(self._plan.settings, None).failing_outcomes

    def _places(self, machine: smach.StateMachine) -> List[StatePlace]:
        places = places_of(machine)
        if self._plan.states:
            return [find_place(places, name, 'a soak') for name in self._plan.states]
        return [place for place in places if not place.is_container]

    def _candidates_of(
        self, place: StatePlace, visits: int, failing: FailingNames
    ) -> Iterator[_Candidate]:
        for kind in self._plan.kinds:
            outcomes = ['']
            if kind is FaultKind.OUTCOME:
                outcomes = [
                    outcome
                    for outcome in sorted(place.state.get_registered_outcomes(), key=str)
                    if outcome in failing
                ]
            for outcome in outcomes:
                yield _Candidate(place.path, kind, outcome, visits)

    def fault(self, number: int) -> Fault:
        """Return the fault of a trial."""
        return self._draw(number)[1]

    def _draw(self, number: int) -> Tuple[_Candidate, Fault]:
        drawn = random.Random('{}/{}'.format(self._plan.seed, number))
        chosen = drawn.choice(self._candidates)
        visits: Optional[range] = None
        if self._plan.most_in_row is not None:
            first = drawn.randint(1, max(1, chosen.visits))
            visits = range(first, first + drawn.randint(1, self._plan.most_in_row))
        if chosen.kind is FaultKind.OUTCOME:
            return chosen, fail(chosen.path, visit=visits, outcome=chosen.outcome)
        if chosen.kind is FaultKind.EXCEPTION:
            return chosen, crash(chosen.path, visit=visits)
        if chosen.kind is FaultKind.HANG:
            return chosen, hang(chosen.path, visit=visits)
        return chosen, overrun(chosen.path, self._plan.overrun_s, visit=visits)

    def told(self, number: int) -> SoakTrial:
        """Run a trial, and tell how it went.

        :raises TrialLimitError: where the machine itself still runs, so that nothing can follow.
        """
        chosen, fault = self._draw(number)
        name, machine = chosen.name, self._machine()
        try:
            trial = self.run([fault], machine)
        except (ScriptError, TrialLimitError) as err:
            if machine.is_running() and machine is self._plan.machine:
                raise
            return SoakTrial(
                number, chosen.path, name, fault, True, False, False, str(err).splitlines()[0]
            )
        return SoakTrial(
            number,
            chosen.path,
            name,
            fault,
            not trial.unused_faults,
            trial.ended_well,
            bool(trial.asked_about()),
            trial.ending(),
        )

    def run(
        self, faults: List[Fault], machine: Optional[smach.StateMachine] = None
    ) -> ObservedTrial:
        """Run one trial.

        :raises ScriptError: where a question did not go with the script of the expert.
        :raises TrialLimitError: where the trial did not end in time.
        """
        plan = self._plan
        self._fresh()
        with Bench(
            self._machine() if machine is None else machine,
            faults,
            expert=plan.expert,
            settings=plan.settings,
            preconditions=plan.preconditions,
            limit_s=plan.limit_s,
        ) as bench:
            return bench.run()

    def _machine(self) -> smach.StateMachine:
        machine = self._plan.machine
        made = machine if isinstance(machine, smach.StateMachine) else machine()
        if not isinstance(made, smach.StateMachine):
            raise FaultError(
                'a soak: {!r} is no StateMachine, nor a function that builds one'.format(made)
            )
        return made


def _check_count(name: str, count: object) -> None:
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise FaultError('a soak: {} is {!r}; give a whole number from 1'.format(name, count))


def _nothing() -> None:
    """Stand for what brings a machine back, where each trial has one of its own."""


def _back_to_now(machine: smach.StateMachine, rates_path: str) -> Callable[[], None]:
    """Return what brings a machine back to the userdata and the learned rates of now."""
    states = [machine] + [place.state for place in places_of(machine)]
    kept = {
        id(each): (each.userdata, dict(each.userdata._data))
        for each in states
        if isinstance(each, smach.Container)
    }
    wrapped = machine if isinstance(machine, OracleContainer) else None
    if wrapped is not None:
        oracle_of(wrapped).rates()  # so that all states have a rate to keep
        OracleContainer.save_rates(wrapped, rates_path)

    def bring_back() -> None:
        for userdata, data in kept.values():
            userdata._data.clear()
            userdata._data.update(data)
        if wrapped is not None:
            OracleContainer.load_rates(wrapped, rates_path)

    return bring_back
