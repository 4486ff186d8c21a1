"""Runs a SMACH script as it is, with each of its machines on a test bench."""

import contextlib
import runpy
import sys
from typing import Any, Callable, Dict, Iterable, Iterator, List, Optional, Sequence, Tuple, Type

import smach
from smach_oracle.oracle.asking.question import Expert
from smach_oracle.oracle.settings.settings import SettingsLike, as_settings

from .bench import LIMIT_S, Bench
from .faults import Fault
from .observed_trial import ObservedTrial


class ScriptRun:
    """A script that has run: its trials in order, and how it ended."""

    def __init__(self, trials: Sequence[ObservedTrial], exit_code: int) -> None:
        self.trials = tuple(trials)
        self.exit_code = exit_code  # as of a process. 0: the script was left after its trials

    @property
    def trial(self) -> ObservedTrial:
        """Return the last trial.

        :raises AssertionError: where the script has executed no machine.
        """
        if not self.trials:
            raise AssertionError(
                'the script has executed no machine; it ended with exit code {}'.format(
                    self.exit_code
                )
            )
        return self.trials[-1]


class _EnoughTrials(BaseException):
    """Leaves the script from within. It never leaves this module."""


def run_script(
    path: str,
    args: Sequence[str] = (),
    *,
    faults: Iterable[Fault] = (),
    expert: Optional[Expert] = None,
    settings: SettingsLike = None,
    most_trials: int = 0,
    limit_s: float = LIMIT_S,
    ros: bool = False,
) -> ScriptRun:
    """Run a script in this process, as `python3 PATH ARGS` would, and its machines on a bench.

    Each top-level `execute` of a machine is a trial. The script gets the outcome, or the error.
    What the script itself raises comes through.

    :param faults: of each trial. Every machine that the script executes must have their states.
    :param expert: who is asked. A script of answers begins again in each trial.
    :param settings: of the oracle, where the script has not wrapped the machine itself.
    :param most_trials: leave the script after so many trials. 0 means let it come to its end.
    :param limit_s: seconds of wall time after which a trial is an error.
    :param ros: attach the machines to the ROS node of the script, as `Bench` does.
    :raises FaultError: for a fault that fits no state.
    :raises ScriptError: where a question did not go with the script of the expert.
    :raises TrialLimitError: where a trial did not end in time.
    :raises SettingsError: naming key, value and what is allowed.
    """
    __tracebackhide__ = True
    checked = None if settings is None else as_settings(settings, None)
    given = tuple(faults)

    def on_bench(machine: smach.StateMachine) -> Bench:
        return Bench(machine, given, expert=expert, settings=checked, limit_s=limit_s, ros=ros)

    with contextlib.ExitStack() as stack:
        trials = _ScriptTrials(on_bench, most_trials, stack)
        stack.enter_context(_executions_caught(trials))
        code = _run(path, args)
    return ScriptRun(trials.done, code)


def _run(path: str, args: Sequence[str]) -> int:
    __tracebackhide__ = True
    before = list(sys.argv)
    sys.argv[:] = [path] + list(args)
    try:
        runpy.run_path(path, run_name='__main__')
    except _EnoughTrials:
        return 0
    except SystemExit as err:
        return err.code if isinstance(err.code, int) else 0 if err.code is None else 1
    finally:
        sys.argv[:] = before
    return 0


class _ScriptTrials:
    """Runs the machines that a script executes."""

    def __init__(
        self,
        on_bench: Callable[[smach.StateMachine], Bench],
        most: int,
        stack: contextlib.ExitStack,
    ) -> None:
        self.done: List[ObservedTrial] = []
        self.under_way = False
        self._on_bench = on_bench
        self._most = most
        self._stack = stack
        self._benches: Dict[int, Bench] = {}  # by id of the machine, which they hold

    def execute(
        self, machine: smach.StateMachine, parent: Optional[smach.UserData]
    ) -> Optional[str]:
        """Run one trial, and return the outcome, or raise what the machine raised."""
        __tracebackhide__ = True
        self.under_way = True
        try:
            bench = self._benches.get(id(machine))
            if bench is None:
                bench = self._stack.enter_context(self._on_bench(machine))
                self._benches[id(machine)] = bench
            trial = bench.run(parent=parent)
        finally:
            self.under_way = False
        self.done.append(trial)
        if self._most and len(self.done) >= self._most:
            raise _EnoughTrials
        if trial.error is not None:
            raise trial.error
        return trial.outcome


@contextlib.contextmanager
def _executions_caught(trials: _ScriptTrials) -> Iterator[None]:
    """Within it every `execute` of a machine, of any class, goes through `trials`."""
    changed: List[Tuple[Type[smach.StateMachine], Any]] = []

    def catch(cls: Type[smach.StateMachine]) -> None:
        if 'execute' not in cls.__dict__:
            return
        original = cls.__dict__['execute']

        def execute(machine: smach.StateMachine, *args: Any, **kwargs: Any) -> Any:
            __tracebackhide__ = True
            if trials.under_way:
                return original(machine, *args, **kwargs)
            return trials.execute(machine, args[0] if args else kwargs.get('parent_ud'))

        changed.append((cls, original))
        setattr(cls, 'execute', execute)

    def __init_subclass__(cls: Type[smach.StateMachine], **kwargs: Any) -> None:
        super(smach.StateMachine, cls).__init_subclass__(**kwargs)
        catch(cls)

    for cls in list(_family(smach.StateMachine)):
        catch(cls)
    setattr(smach.StateMachine, '__init_subclass__', classmethod(__init_subclass__))
    try:
        yield
    finally:
        delattr(smach.StateMachine, '__init_subclass__')
        for cls, original in changed:
            setattr(cls, 'execute', original)


def _family(cls: Type[smach.StateMachine]) -> Iterator[Type[smach.StateMachine]]:
    yield cls
    for child in cls.__subclasses__():
        yield from _family(child)
