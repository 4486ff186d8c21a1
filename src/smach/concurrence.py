"""A container that executes all its states at the same time, one thread each."""

import traceback
from typing import Any, Callable, Collection, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import smach
from smach.container import Container, Edge
from smach.parallel import Outcomes, ParallelRun
from smach.state import State

__all__ = ['Concurrence']

OutcomeCallback = Callable[[Outcomes], Optional[str]]
ChildTerminationCallback = Callable[[Outcomes], Union[bool, None, Sequence[str]]]


class Concurrence(Container):
    """Executes all children in parallel and ends when all have ended.

    The outcome is, in this order: what ``outcome_cb({label: outcome})`` returns, if anything. The
    entry of ``outcome_map`` ({outcome: {label: child outcome, ...}}) whose conditions all hold, the
    one with most conditions if several do; 'preempted', if that is an outcome, the container was
    preempted and all children serviced it; ``default_outcome``.

    ``child_termination_cb({label: outcome or None})`` is called whenever a child ends. Returning
    True preempts the children still running, returning a list of labels preempts those.
    """

    def __init__(
        self,
        outcomes: Sequence[str],
        default_outcome: str,
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
        outcome_map: Optional[Mapping[str, Mapping[str, str]]] = None,
        outcome_cb: Optional[OutcomeCallback] = None,
        child_termination_cb: Optional[ChildTerminationCallback] = None,
    ) -> None:
        Container.__init__(self, outcomes, input_keys, output_keys)
        self._states: Dict[str, State] = {}
        self._remappings: Dict[str, Mapping[str, str]] = {}
        self._default_outcome = default_outcome
        self._outcome_map: Mapping[str, Mapping[str, str]] = (
            {} if outcome_map is None else outcome_map
        )
        self._outcome_cb = outcome_cb
        self._child_termination_cb = child_termination_cb
        self._run: Optional[ParallelRun] = None  # while it executes
        self._child_outcomes: Outcomes = {}  # so far, while it executes. Subclasses write it, too
        # A preempt nobody serviced stays visible to the parent after the run, but it is not meant
        # for the next run.
        self._preempt_is_over = False
        self._check_outcome_policy(outcomes)

    def _check_outcome_policy(self, outcomes: Sequence[str]) -> None:
        registered = self.get_registered_outcomes()
        allowed = sorted(set(registered).union(outcomes), key=str)
        default = self._default_outcome
        errors = []
        if not isinstance(default, str) or (default not in registered and default not in outcomes):
            errors.append(
                "The default outcome '%s' is not among its outcomes %s." % (default, allowed)
            )
        errors.extend(
            "The outcome map leads to '%s', which is not among its outcomes %s."
            % (outcome, allowed)
            for outcome in self._outcome_map
            if outcome not in registered and outcome not in outcomes
        )
        errors.extend(
            '%s is not callable: %r.' % (name, callback)
            for name, callback in (
                ('outcome_cb', self._outcome_cb),
                ('child_termination_cb', self._child_termination_cb),
            )
            if callback is not None and not callable(callback)
        )
        if errors:
            raise smach.InvalidStateError(
                'This concurrence cannot find its outcome:\n\t%s' % '\n\t'.join(errors)
            )

    # -- construction

    @staticmethod
    def add(label: str, state: State, remapping: Optional[Mapping[str, str]] = None) -> State:
        """Add a state to the innermost open concurrence and return it."""
        concurrence = Concurrence._currently_opened_container()
        if label in concurrence._states:
            smach.logwarn(
                "Concurrence already has a state '%s'; the new one takes its place." % label
            )
        concurrence._states[label] = state
        concurrence._remappings[label] = {} if remapping is None else remapping
        return state

    def check_consistency(self) -> None:
        """Raise KeyError for an unknown label in the outcome map, InvalidTransitionError for an
        unknown outcome, TypeError where the map or its conditions are no mapping.
        """
        for _, conditions in _entries(self._outcome_map):
            for label, outcome in _entries(conditions):
                registered = self[label].get_registered_outcomes()
                if outcome not in registered:
                    raise smach.InvalidTransitionError(
                        "The outcome map waits for outcome '%s' of state '%s', which has only: %s"
                        % (outcome, label, registered)
                    )

    # -- execution

    def execute(self, parent_ud: Any = None) -> str:
        """Run all children to their ends and return the outcome.

        :raises InvalidStateError: if there are none, or one of them raised.
        :raises InvalidUserCodeError: if a callback raised.
        """
        if not self._states:
            raise smach.InvalidStateError(
                'This concurrence has no states; they are added inside `with concurrence:`.'
            )
        with self._execution() as execution:
            self._take_inputs(parent_ud)
            smach.loginfo('Concurrence starting with userdata: \n\t%s' % list(self.userdata.keys()))
            self.call_start_cbs()
            self._wait_while_paused()
            run = self._run_children()
            serviced = self._settle_preempt(run)
            self._raise_error_of(run)
            smach.loginfo('Concurrent Outcomes: %s' % run.outcomes)
            outcome = self._determine_outcome(run.outcomes, serviced)
            self.call_termination_cbs(list(self._states), outcome)
            self._copy_output_keys(self.userdata, parent_ud)
            execution.outcome = outcome
        return outcome

    def _run_children(self) -> ParallelRun:
        run = ParallelRun(
            self._states,
            self._runner,
            self._take_back_preempt,
            self._execute_child,
            self._child_began,
            self._child_ended,
        )
        self._run, self._child_outcomes = run, run.outcomes
        if self._preempt_is_over:
            self._preempt_is_over = False
            self._preempt_requested = False
        try:
            if self.preempt_requested():
                run.preempt()
            run.run()
        finally:
            self._run, self._child_outcomes = None, {}
            self._preempt_is_over = self._preempt_requested
        return run

    def _execute_child(self, label: str) -> Any:
        state = self._states[label]
        return self._runner(label, state).execute(
            smach.Remapper(
                self.userdata,
                state.get_registered_input_keys(),
                state.get_registered_output_keys(),
                self._remappings[label],
            )
        )

    def _child_began(self, label: str) -> None:
        self.call_transition_cbs()

    def _child_ended(self, label: str) -> None:
        self.call_transition_cbs()
        run = self._run
        if self._child_termination_cb is None or run is None:
            return
        try:
            preempt_others = self._child_termination_cb(run.outcomes)
        except Exception as err:
            raise smach.InvalidUserCodeError(
                'Could not execute child termination callback: %s' % traceback.format_exc()
            ) from err
        if isinstance(preempt_others, (list, tuple, set, frozenset)):
            run.preempt(preempt_others)
        elif preempt_others:
            run.preempt()

    def _settle_preempt(self, run: ParallelRun) -> bool:
        """Whether this container was preempted and its children serviced that. It leaves no request
        with any child.

        A preempt that came when no child was running any more reached nobody. It stays with the
        container, so that its parent sees that it was not serviced.
        """
        deaf = [
            label for label, state in self._states.items() if self._take_back_preempt(label, state)
        ]
        if not self.preempt_requested():
            return False
        for label in deaf:
            smach.logwarn(
                "State '%s' of the concurrence has ended without servicing its preempt." % label
            )
        if deaf or not run.preempted:
            return False
        smach.loginfo('Concurrence serviced preempt.')
        self.service_preempt()
        return True

    def _raise_error_of(self, run: ParallelRun) -> None:
        if isinstance(run.error, smach.InvalidStateError):
            raise smach.InvalidStateError(
                'A state of the concurrence raised an exception.'
            ) from run.error
        if run.error is not None:
            raise run.error

    def _determine_outcome(self, outcomes: Outcomes, preempt_serviced: bool) -> str:
        outcome = self._mapped_outcome(outcomes)
        if outcome is None:
            serviced = preempt_serviced and 'preempted' in self.get_registered_outcomes()
            outcome = 'preempted' if serviced else self._default_outcome
        if self._outcome_cb is None:
            return outcome
        try:
            cb_outcome = self._outcome_cb(outcomes)
        except Exception as err:
            raise smach.InvalidUserCodeError(
                "Could not execute outcome callback '%s': %s"
                % (self._outcome_cb, traceback.format_exc())
            ) from err
        if cb_outcome and isinstance(cb_outcome, str):
            return cb_outcome
        log = smach.logerr if cb_outcome else smach.logwarn
        log("Outcome callback returned %r, using outcome '%s'" % (cb_outcome, outcome))
        return outcome

    def _mapped_outcome(self, outcomes: Outcomes) -> Optional[str]:
        """The entry of the outcome map with most conditions of those that hold, the first of
        several such. An entry without conditions never holds.
        """
        holding = [
            (len(conditions), outcome)
            for outcome, conditions in _entries(self._outcome_map)
            if conditions
            and all(outcomes[label] == wanted for label, wanted in _entries(conditions))
        ]
        return max(holding, key=lambda entry: entry[0])[1] if holding else None

    def request_preempt(self) -> None:
        """Ask all running children to stop."""
        self._preempt_requested = True
        self._preempt_is_over = False
        run = self._run
        if run is not None:
            run.preempt()

    # -- what outsiders may ask

    def __getitem__(self, key: str) -> State:
        return self._states[key]

    def get_children(self) -> Dict[str, State]:
        """Return the states by label."""
        return self._states

    def get_initial_states(self) -> List[str]:
        """Return all labels."""
        return list(self._states)

    def set_initial_state(self, initial_states: Sequence[str], userdata: Any = None) -> None:
        """Add the keys of ``userdata`` to the container's. All states are initial ones, whatever is
        asked for.
        """
        if set(initial_states) != set(self._states):
            smach.logwarn(
                'A concurrence begins in all its states %s; it cannot begin in %s alone.'
                % (list(self._states), initial_states)
            )
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> List[str]:
        """Return the labels of the children that are running."""
        run = self._run
        return [] if run is None else run.active()

    def get_internal_edges(self) -> List[Edge]:
        """Return each condition of the outcome map as (child outcome, label, container outcome)."""
        return [
            (outcome, label, container_outcome)
            for container_outcome, conditions in _entries(self._outcome_map)
            for label, outcome in _entries(conditions)
        ]

    # -- copies

    def __getstate__(self) -> Dict[str, Any]:
        return dict(self.__dict__, _run=None, _child_outcomes={})


def _entries(conditions: Any) -> List[Tuple[Any, Any]]:
    """The entries of an outcome map, or of the conditions in it. Whatever is empty has none.

    :raises TypeError: where it is no mapping.
    """
    if isinstance(conditions, Mapping):
        return list(conditions.items())
    if isinstance(conditions, Collection) and not conditions:
        return []
    raise TypeError(
        "An outcome map is written {outcome: {label: child's outcome}}; %r is no "
        'mapping.' % (conditions,)
    )
