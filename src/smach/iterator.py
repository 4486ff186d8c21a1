"""A container that executes one state once for each item of a list."""

import traceback
from typing import Any, Callable, Dict, Iterable, List, Mapping, Optional, Sequence, Union
from typing import Iterator as Iterator_

import smach
from smach.container import Container, Edge
from smach.state import State

__all__ = ['Iterator']

Items = Union[Iterable[Any], Callable[[], Iterable[Any]]]


class Iterator(Container):
    """Executes its contained state per item, the item in userdata under ``it_label``.

    ``it`` is an iterable, or a callable that returns one and is called when execution begins. The
    iteration stops at an outcome of the contained state that is a break outcome, or at a preempt,
    and ends with that outcome. When the items run out it ends with ``exhausted_outcome``. Either is
    mapped through ``final_outcome_map``. The contained state works on the iterator's own userdata:
    there is no remapping, and nothing needs to be declared.
    """

    def __init__(
        self,
        outcomes: Sequence[str],
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
        it: Items = (),
        it_label: str = 'it_data',
        exhausted_outcome: str = 'exhausted',
    ) -> None:
        Container.__init__(self, outcomes, input_keys, output_keys)
        self.register_outcomes([exhausted_outcome])
        self._items: Items = it
        self._items_label = it_label
        self._exhausted_outcome = exhausted_outcome
        self._is_running = False
        self._state_label = ''
        self._state: Optional[State] = None
        self._loop_outcomes: List[str] = []
        self._break_outcomes: List[str] = []
        self._final_outcome_map: Dict[str, str] = {}

    # -- construction

    @staticmethod
    def set_iteritems(it: Items, it_label: str = 'it_data') -> None:
        """Set what the innermost open iterator goes through."""
        iterator = Iterator._currently_opened_container()
        iterator._items = it
        iterator._items_label = it_label

    @staticmethod
    def set_contained_state(
        label: str,
        state: State,
        loop_outcomes: Sequence[str] = (),
        break_outcomes: Sequence[str] = (),
        final_outcome_map: Optional[Mapping[str, str]] = None,
    ) -> None:
        """Set the state that the innermost open iterator executes.

        Of ``loop_outcomes`` (go on with the next item) and ``break_outcomes`` (stop) one is enough:
        the other are the remaining outcomes of the state. Without either, every outcome stops.
        """
        iterator = Iterator._currently_opened_container()
        if loop_outcomes and break_outcomes:
            smach.logwarn(
                'An iterator was given loop_outcomes as well as break_outcomes; either follows '
                'from '
                'the other.'
            )
        outcomes = state.get_registered_outcomes()
        iterator._state_label = label
        iterator._state = state
        iterator._break_outcomes = list(break_outcomes) or [
            name for name in outcomes if name not in loop_outcomes
        ]
        iterator._loop_outcomes = (
            list(loop_outcomes)
            if not break_outcomes
            else [name for name in outcomes if name not in break_outcomes]
        )
        iterator._final_outcome_map = dict(final_outcome_map or {})

    def check_consistency(self) -> None:
        """Do nothing: an iterator is always consistent.

        One without a state can only be run over no items.
        """

    # -- execution

    def execute(self, parent_ud: Any = None) -> str:
        """Go through the items and return the outcome. It raises InvalidUserCodeError if the state
        or the iterable raised.
        """
        with self._execution() as execution:
            self._is_running = True
            try:
                self._take_inputs(parent_ud)
                self.call_start_cbs()
                last_outcome = self._iterate(self._fresh_items())
                if self._preempt_requested:
                    self._end_preempt()
            finally:
                self._is_running = False
            outcome = self._final_outcome_map.get(last_outcome, last_outcome)
            # The label itself, not a list of one: it is what callbacks of an iterator have always
            # been given.
            self.call_termination_cbs(self._state_label, outcome)
            self._copy_output_keys(self.userdata, parent_ud)
            execution.outcome = outcome
        return outcome

    def _fresh_items(self) -> Iterator_[Any]:
        hook = self.execution_hook
        items = self._items if hook is None else hook.items(self, self._items)
        return iter(items() if callable(items) else items)

    def _iterate(self, items: Iterator_[Any]) -> str:
        """Execute the state until something stops it, and return its last outcome, or that of
        exhaustion.
        """
        outcome = self._exhausted_outcome
        state = runner = None
        while not smach.is_shutdown():
            self._wait_while_paused()
            try:
                item = next(items)
            except StopIteration:
                return self._exhausted_outcome
            except Exception as err:
                raise smach.InvalidUserCodeError(
                    "Could not get the next item of iterator container's '%s': %s"
                    % (self._items, traceback.format_exc())
                ) from err
            smach.loginfo('Iterating %s of %s' % (item, self._items))
            self.userdata[self._items_label] = item
            if runner is None or self._state is not state:
                state = self._state
                runner = self._runner_of_state()
            outcome = self._execute_state(runner)
            if self._stops_at(outcome) or self.preempt_requested():
                return outcome
            self.call_transition_cbs()
        return outcome

    def _stops_at(self, outcome: str) -> bool:
        """Whether to leave the remaining items. An outcome the state never registered is logged, as
        nobody maps it.
        """
        if outcome in self._break_outcomes:
            return True
        if outcome in self._loop_outcomes:
            return False
        smach.logerr(
            "Iterator state '%s' returned outcome '%s', which is neither a loop nor a break "
            'outcome: %s.'
            % (self._state_label, outcome, 'stopping' if self._loop_outcomes else 'going on')
        )
        return bool(self._loop_outcomes)

    def _runner_of_state(self) -> Any:
        if self._state is None:
            raise smach.InvalidStateError(
                'This iterator has no state to repeat; give it one with '
                'Iterator.set_contained_state().'
            )
        return self._runner(self._state_label, self._state)

    def _execute_state(self, runner: Any) -> str:
        # before the first item: later ones are not reached with a preempt pending
        if self.preempt_requested():
            runner.request_preempt()
        try:
            outcome: str = runner.execute(self.userdata)
        except smach.InvalidUserCodeError:
            smach.logerr("Could not execute iterator state '%s'" % self._state_label)
            raise
        except Exception as err:
            raise smach.InvalidUserCodeError(
                "Could not execute iterator state '%s' of type '%s': %s"
                % (self._state_label, self._state, traceback.format_exc())
            ) from err
        return outcome

    # -- preemption

    def request_preempt(self) -> None:
        """Stop after the current item, and ask the contained state to stop within it."""
        self._preempt_requested = True
        if self._is_running and self._state is not None:
            self._runner(self._state_label, self._state).request_preempt()

    def _end_preempt(self) -> None:
        """Stopping is servicing. A state that did not notice must not find the old request in its
        next run.
        """
        self._preempt_requested = False
        if self._state is not None:
            self._take_back_preempt(self._state_label, self._state)

    # -- what outsiders may ask

    def __getitem__(self, key: str) -> State:
        if key != self._state_label or self._state is None:
            text = "This iterator has no state '%s', only '%s'." % (key, self._state_label)
            smach.logerr(text)
            raise KeyError(text)
        return self._state

    def get_children(self) -> Dict[str, State]:
        """Return the contained state under its label."""
        return {} if self._state is None else {self._state_label: self._state}

    def get_initial_states(self) -> List[str]:
        """Return the label of the contained state, in a list."""
        return [self._state_label]

    def set_initial_state(self, initial_states: Sequence[str], userdata: Any = None) -> None:
        """Add the keys of ``userdata`` to the container's. It raises KeyError for another label
        than that of the only state.
        """
        for label in initial_states:
            if label != self._state_label:
                smach.logwarn(
                    "An iterator begins in its only state '%s', not in '%s'."
                    % (self._state_label, label)
                )
                self[label]
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> List[str]:
        """Return the label of the contained state while it is iterated over, else nothing."""
        return [self._state_label] if self._is_running else []

    def get_internal_edges(self) -> List[Edge]:
        """Return the edges of the loop, the breaks and the end.

        Loop outcomes lead back to the state, break outcomes to the final outcome map's value, or to
        None.
        """
        label = self._state_label
        edges: List[Edge] = [(outcome, label, label) for outcome in self._loop_outcomes]
        edges.extend(
            (outcome, label, self._final_outcome_map.get(outcome))
            for outcome in self._break_outcomes
        )
        return edges
