"""The machine: one state at a time, its outcome deciding which comes next."""

import threading
import traceback
from typing import Any, Dict, List, Mapping, Optional, Sequence

import smach
from smach.container import Container, Edge
from smach.hooks import is_hooked
from smach.state import State
from smach.transitions import end_of, inconsistencies, search_target
from smach.visit import StateVisit

__all__ = ['StateMachine']


class StateMachine(Container):
    """A container that executes its states one after the other.

    ``outcomes`` are those of the machine itself. Its states are added inside a ``with`` block, and
    the first one added is where it begins unless :meth:`set_initial_state` says otherwise.
    """

    # Made again rather than copied or pickled.
    _UNPICKLED = ('_state_transitioning_lock', '_visits')

    _is_preempt_passed_on = False  # whether a state was asked since the latest request

    # until execute() has looked: whether a method of smach.hooks was overridden or patched
    _is_hooked = True

    def __init__(
        self,
        outcomes: Sequence[str],
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
    ) -> None:
        Container.__init__(self, outcomes, input_keys, output_keys)
        self._states: Dict[str, State] = {}
        self._transitions: Dict[str, Dict[str, Optional[str]]] = {}
        self._remappings: Dict[str, Mapping[str, str]] = {}
        self._constants: Dict[str, Mapping[str, Any]] = {}
        self._initial_state_label: Optional[str] = None

        self._is_running = False
        # Held while the machine moves from one state to the next. Re-entrant so that callbacks may
        # request a preempt.
        self._state_transitioning_lock = threading.RLock()
        self._current_label: Optional[str] = None
        self._current_state: Optional[State] = None
        self._current_transitions: Optional[Dict[str, Optional[str]]] = None
        self._current_outcome: Optional[str] = None
        self._preempted_label: Optional[str] = None
        self._preempted_state: Optional[State] = None
        self._visits: Dict[str, StateVisit] = {}

        # What add_auto() left to be connected to the next state added.
        self._last_added_label: Optional[str] = None
        self._connector_outcomes: Sequence[str] = ()

    # -- construction

    @staticmethod
    def add(
        label: str,
        state: State,
        transitions: Optional[Mapping[str, Optional[str]]] = None,
        remapping: Optional[Mapping[str, str]] = None,
        constants: Optional[Mapping[str, Any]] = None,
    ) -> State:
        """Add a state to the innermost open machine and return it.

        ``transitions`` maps outcomes of the state to labels or to outcomes of the machine. Outcomes
        left out, or mapped to None, end the machine with its outcome of the same name.
        ``remapping`` maps the state's userdata keys to the machine's. ``constants`` maps keys of
        the machine to values: they are written before each visit of the state, and stay.

        :raises InvalidStateError: for a label already used.
        :raises InvalidTransitionError: for a transition from an outcome the state does not have.
        """
        machine = StateMachine._currently_opened_container()
        if transitions is not None and not isinstance(transitions, Mapping):
            raise smach.InvalidTransitionError(
                "The transitions of state '%s' must map outcomes to labels, not be %r."
                % (label, transitions)
            )
        transitions = {} if transitions is None else dict(transitions)
        machine.check_state_spec(label, state, transitions)
        missing: Dict[str, Optional[str]] = {
            outcome: None
            for outcome in state.get_registered_outcomes()
            if outcome not in transitions
        }
        transitions.update(missing)
        smach.logdebug("State '%s' (%r) leaves by %s" % (label, state, transitions))
        machine._enter_in_tables(label, state, transitions, remapping, constants)
        return state

    def _enter_in_tables(
        self,
        label: str,
        state: State,
        transitions: Dict[str, Optional[str]],
        remapping: Optional[Mapping[str, str]],
        constants: Optional[Mapping[str, Any]],
    ) -> None:
        if self._initial_state_label is None:
            self._initial_state_label = label
        self._states[label] = state
        self._transitions[label] = transitions
        self._remappings[label] = {} if remapping is None else remapping
        if constants is not None:  # most have none, and each step asks whether there are any
            self._constants[label] = constants
        if self._connector_outcomes and self._last_added_label is not None:
            for outcome in self._connector_outcomes:
                self._transitions[self._last_added_label][outcome] = label
        self._connector_outcomes = ()
        self._last_added_label = None

    @staticmethod
    def add_auto(
        label: str,
        state: State,
        connector_outcomes: Sequence[str],
        transitions: Optional[Mapping[str, Optional[str]]] = None,
        remapping: Optional[Mapping[str, str]] = None,
        constants: Optional[Mapping[str, Any]] = None,
    ) -> State:
        """Add a state whose ``connector_outcomes`` lead to the state that is added next."""
        machine = StateMachine._currently_opened_container()
        StateMachine.add(label, state, transitions, remapping, constants)
        registered = state.get_registered_outcomes()
        if not all(outcome in registered for outcome in connector_outcomes):
            raise smach.InvalidStateError(
                "State '%s' cannot lead on by the outcomes %s: it has registered only %s"
                % (label, connector_outcomes, registered)
            )
        machine._last_added_label = label
        machine._connector_outcomes = connector_outcomes
        return state

    def check_state_spec(
        self, label: str, state: State, transitions: Mapping[str, Optional[str]]
    ) -> None:
        """Raise InvalidStateError for a used label, InvalidTransitionError for a wrong outcome."""
        if label in self._states:
            raise smach.InvalidStateError("This state machine has a state '%s' already." % label)
        registered = state.get_registered_outcomes()
        for outcome in transitions:
            if outcome not in registered:
                raise smach.InvalidTransitionError(
                    "There is a transition from outcome '%s' of state '%s', which has only %s"
                    % (outcome, label, registered)
                )

    def check_consistency(self) -> None:
        """Raise InvalidTransitionError where there is no initial state, or a dead transition."""
        errors = inconsistencies(
            self._states,
            self._transitions,
            self._initial_state_label,
            self.get_registered_outcomes(),
        )
        if errors:
            known = set(self._states).union(self.get_registered_outcomes())
            raise smach.InvalidTransitionError(
                'This state machine is inconsistent:\n\t%s\nIts states and outcomes: %s'
                % ('\n\t'.join(errors), sorted(known, key=str))
            )

    # -- execution

    def execute(self, parent_ud: Any = None) -> Optional[str]:
        """Run to the end and return the outcome.

        It is None if the machine is inconsistent or everything is shut down.

        :raises InvalidUserCodeError: if a state raised.
        :raises InvalidTransitionError: if a state ended with an outcome that it has not registered
            or that leads nowhere.
        """
        self._is_running = True
        self._is_hooked = is_hooked(self)
        try:
            if not self._is_consistent():
                return None
            with self._state_transitioning_lock:
                self._start(parent_ud)
                outcome = None
                while True:  # CPython 3.11 makes no other kind of long loop faster as it runs
                    if not self._is_running or smach.is_shutdown():
                        break
                    if self._pause_requested:
                        self._wait_while_paused()
                    outcome = self._update_once()
                    if outcome is not None:
                        break
            self._copy_output_keys(self.userdata, parent_ud)
            return outcome
        finally:
            self._is_running = False

    def _start(self, parent_ud: Any) -> None:
        """Go to the initial state, take over the input keys and call the start callbacks."""
        if self._preempted_state is not None:
            # it ignored a request of the last run, or was asked after an error had ended that;
            # a request that stands is passed on to the initial state
            self._preempted_state.recall_preempt()
        self._preempted_label = None
        self._preempted_state = None
        self._set_current_state(self._initial_state_label)
        self._copy_input_keys(parent_ud, self.userdata)
        self._tell_start()
        self.call_start_cbs()

    def _tell_start(self) -> None:
        smach.loginfo(
            "State machine starting in initial state '%s' with userdata: \n\t%s"
            % (self._current_label, list(self.userdata.keys()))
        )

    def _set_current_state(self, state_label: Optional[str]) -> None:
        """Make this state the one that is executed next, or None after the last."""
        self._current_label = state_label
        self._current_outcome = None
        if state_label is None:
            self._current_state = None
            self._current_transitions = None
        else:
            self._current_state = self._states[state_label]
            self._current_transitions = self._transitions[state_label]

    def _update_once(self) -> Optional[str]:
        """Execute the current state and make the transition: None to go on, or the outcome of the
        machine.

        Called with the transitioning lock held. It lets go of it while the state executes. Every
        transition takes this path, so it is one flat piece. What is rare is in methods of its own.
        """
        if self._preempt_requested or (self._is_hooked and self.preempt_requested()):
            self._pass_preempt_on()
        label: Any = self._current_label
        state: Any = self._current_state
        try:
            visit = self._visits[label]
        except KeyError:
            visit = None
        if (
            visit is None
            or visit.state is not state
            or visit.userdata is not self.userdata
            or visit.input_keys is not state._input_keys
            or visit.output_keys is not state._output_keys
            or visit.remapping is not self._remappings[label]
        ):
            visit = self._prepare_visit(label, state)
        lock = self._state_transitioning_lock
        lock.release()
        try:
            if self._constants and label in self._constants:
                for key, value in self._constants[label].items():
                    self.userdata[key] = value
            outcome = state.execute(visit.remapper)
        except smach.InvalidUserCodeError:
            smach.logerr("State '%s' ended in an error." % label)
            raise
        except Exception as err:
            raise smach.InvalidUserCodeError(
                "Could not execute state '%s' of type '%s': %s"
                % (label, state, traceback.format_exc())
            ) from err
        finally:
            lock.acquire()
        try:
            target = _SEARCH
            if outcome in state._outcomes:
                target = self._current_transitions[outcome]  # type: ignore
        except (AttributeError, KeyError, TypeError):
            target = _SEARCH
        if target is _SEARCH:
            target = search_target(label, state, outcome, self._current_transitions)
        self._current_outcome = outcome
        if target in self._states:
            self._set_current_state(target)
            try:
                said_of, text = visit.texts[outcome]
            except KeyError:
                said_of = text = None
            smach.loginfo(text if said_of is target else visit.text_of(label, outcome, target))
            if self._transition_cbs or self._is_hooked:
                self.call_transition_cbs()
            return None
        return self._terminate(label, outcome, target)

    def _wait_while_paused(self) -> None:
        self._state_transitioning_lock.release()
        try:
            Container._wait_while_paused(self)
        finally:
            self._state_transitioning_lock.acquire()

    def _prepare_visit(self, label: str, state: Any) -> StateVisit:
        """Make the state's view of the userdata. Keep it for its next visit where that is safe."""
        if label not in self._states:
            raise smach.InvalidStateError(
                "The current state '%s' is none of %s" % (label, list(self._states))
            )
        visit = StateVisit(state, self.userdata, self._remappings[label])
        if visit.may_be_kept:
            self._visits[label] = visit
        return visit

    def _terminate(self, label: str, outcome: str, target: Optional[str]) -> str:
        """End the machine with the container outcome of the target's name, else of the outcome's
        own.
        """
        container_outcome = end_of(label, outcome, target, self.get_registered_outcomes())
        preempted = self._preempted_state
        if self._preempt_requested and preempted is not None and not preempted.preempt_requested():
            self._preempt_requested = False
        self._set_current_state(None)
        smach.loginfo(
            "State machine terminating '%s':'%s':'%s'" % (label, outcome, container_outcome)
        )
        self.call_termination_cbs([label], container_outcome)
        return container_outcome

    # -- preemption

    def request_preempt(self) -> None:
        """Ask the active state to stop. If it ends without servicing this, the next one is asked
        before it runs.
        """
        self._is_preempt_passed_on = False
        # before the lock: a machine that moves fast may hold it nearly all the time
        State.request_preempt(self)
        with self._state_transitioning_lock:
            # The machine may have seen the request meanwhile and passed it on: asking twice would
            # stop two states. Or it took it for that of an earlier request just serviced, and has
            # dropped it.
            if not self._is_preempt_passed_on and self._current_state is not None:
                self._preempt_requested = True
                self._preempt_current_state()

    def _preempt_current_state(self) -> None:
        self._is_preempt_passed_on = True
        state: Any = self._current_state
        asked = self._preempted_state
        if asked is not None and not (asked is state and state.preempt_requested()):
            asked.recall_preempt()
        elif asked is not None and not isinstance(state, Container):  # in which some have gone on
            return
        self._preempted_label = self._current_label
        self._preempted_state = state
        try:
            state.request_preempt()
        except Exception:
            smach.logerr(
                "Preempting state '%s' raised:\n%s" % (self._current_label, traceback.format_exc())
            )

    def _pass_preempt_on(self) -> None:
        """Preempt the state that is to run, unless the last one serviced the pending request."""
        smach.loginfo('The state machine is to be preempted before its next state runs.')
        preempted = self._preempted_state
        if preempted is None:
            self._preempt_current_state()
        elif preempted.preempt_requested():
            smach.loginfo(
                "State '%s' has not serviced the preempt; it goes on to state '%s'."
                % (self._preempted_label, self._current_label)
            )
            if preempted is self._current_state:  # or it would look as if it had been asked already
                preempted.recall_preempt()
            self._preempt_current_state()
        else:
            self._preempt_requested = False
            self._preempted_state = None

    # -- what outsiders may ask

    def is_running(self) -> bool:
        """Whether execute() is under way."""
        return self._is_running

    def __getitem__(self, key: str) -> State:
        if key not in self._states:
            text = "This state machine has no state '%s', only %s" % (key, list(self._states))
            smach.logerr(text)
            raise KeyError(text)
        return self._states[key]

    def get_children(self) -> Dict[str, State]:
        """Return the states by label."""
        return self._states

    def get_initial_states(self) -> List[str]:
        """Return the label at which execution begins, in a list."""
        return [str(self._initial_state_label)]

    def set_initial_state(
        self, initial_states: Sequence[str], userdata: Optional[smach.UserData] = None
    ) -> None:
        """Begin at this label (one, in a list) from now on, with the keys of ``userdata`` added to
        the machine's.
        """
        smach.logdebug('Setting initial states to %s' % (initial_states,))
        labels = [initial_states] if isinstance(initial_states, str) else list(initial_states)
        if len(labels) > 1:
            smach.logwarn(
                'A state machine begins in one state; of the initial states %s the first is taken.'
                % labels
            )
        if labels:
            self._initial_state_label = labels[0]
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> List[str]:
        """Return the label of the current state, in a list. 'None' while there is none."""
        return [str(self._current_label)]

    def get_internal_edges(self) -> List[Edge]:
        """Return all transitions (outcome, from, to). To is None if the outcome falls through."""
        return [
            (outcome, label, to)
            for label, transitions in self._transitions.items()
            for outcome, to in transitions.items()
        ]

    # -- copies

    def __getstate__(self) -> Dict[str, Any]:
        attributes = self.__dict__.copy()  # in one step: another thread may execute it meanwhile
        return {
            key: value for key, value in attributes.items() if key not in StateMachine._UNPICKLED
        }

    def __setstate__(self, state: Dict[str, Any]) -> None:
        state = dict(
            state, _state_transitioning_lock=threading.RLock(), _visits={}, _is_running=False
        )
        # by setattr, as an instance whose __dict__ was never asked for is faster
        for name, value in state.items():
            setattr(self, name, value)


# Stands for a target that has to be looked for, where None means one that falls through.
_SEARCH: Any = object()
