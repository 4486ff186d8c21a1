"""OracleContainer: a StateMachine that recovers from failures (paper, section IV)."""

from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Tuple, cast

import smach

from .asking.question import Expert
from .errors import SettingsError
from .execution.boundary import before_step
from .execution.settings_check import check_arguments
from .execution.step import Step
from .execution.transitions import end_plainly
from .execution.trial import ContainerRun
from .execution.visiting import execute_observed, execute_watched
from .execution.wrapping import WrapArguments, execute_bare, sync_oracle, wrap_machine
from .identity import renew_attributes
from .machine.oracle import oracle_of, read_by_hand, write_by_hand
from .machine.tree import Tree, new_id
from .machine.tree_node import TreeNode, entered_by_failures_alone, marked_node
from .machine.userdata import StateView, write_constants
from .machine.wrapped_classes import rebuild, two_classes
from .records.events import EventKind
from .records.visits import StateRateRow, TransitionRow
from .settings.health import HealthFunction
from .settings.names import Nested, Strictness, checked_nested
from .settings.settings import PreconditionLists, SettingsLike, as_settings
from .smach_private import Transitions, data_of, is_executing, keys_of, opened_container
from .under_way import is_under_way_elsewhere

EDGE_TO_ORACLE = 'failure'
TRANSITION = EventKind.TRANSITION  # looked up once
RAISED = object()  # in place of an outcome, as which a state may have None


class _Shown:
    """An attribute of the container's oracle, seen on the container too."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, machine: object, owner: type) -> Any:
        return self if machine is None else getattr(oracle_of(machine), self._name)


class OracleContainer(smach.StateMachine):
    """A `smach.StateMachine` with an ORACLE state.

    It is built like any state machine, or made of one with `wrap`. All its own data
    is in one attribute, `_oracle`, so that it hides no name of a subclass.

    >>> import smach
    >>> from smach_oracle.oracle import OracleContainer
    >>> results = iter(['aborted', 'succeeded'])
    >>> pick = smach.CBState(lambda userdata: next(results), outcomes=['succeeded', 'aborted'])
    >>> machine = OracleContainer(['succeeded', 'aborted'], settings={'max_recoveries': 3})
    >>> with machine:
    ...     _ = OracleContainer.add('PICK', pick, prior=0.2)
    >>> machine.execute()  # PICK fails, and the oracle enters it again
    'succeeded'
    >>> [(row.state, row.successes, row.failures) for row in machine.rates()]
    [('PICK', 1, 1)]
    """

    _constants: Dict[str, Mapping[str, Any]] = {}  # of engines that have none, never written
    _pause_requested = False  # of engines that do not pause

    def __init__(
        self,
        outcomes: Sequence[str],
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
        *,
        settings: SettingsLike = None,
        preconditions: PreconditionLists = None,
        name: str = '',
        expert: Optional[Expert] = None,
        recover: bool = True,
        strict: Strictness = True,
        health: Optional[HealthFunction] = None,
    ) -> None:
        """Make an empty machine under an oracle.

        `settings`: a Settings or a dictionary of them. `preconditions`: lists by LABEL or
        PATH/LABEL. `health`: says whether the robot is well, by True or '', or what is wrong.

        :raises SettingsError: naming key, value and what is allowed.
        """
        check_arguments(name, expert, recover, strict, health)
        checked = as_settings(settings, preconditions)
        smach.StateMachine.__init__(self, outcomes, list(input_keys), list(output_keys))
        tree = Tree(OracleContainer, recover, expert, health)
        self._oracle = TreeNode(self, tree, checked, name)
        self._oracle.in_force.strict, self._oracle.in_force.nested = strict, checked.nested

    @classmethod
    def wrap(
        cls,
        machine: smach.StateMachine,
        preconditions: PreconditionLists = None,
        settings: SettingsLike = None,
        nested: Optional[Nested] = None,
        name: str = '',
        expert: Optional[Expert] = None,
        strict: Strictness = True,
        recover: bool = True,
        health: Optional[HealthFunction] = None,
    ) -> 'OracleContainer':
        """Put `machine` under an oracle and return it.

        It stays the same object, with a class made of this class and its own.

        With `nested` (default: the setting of this name) every StateMachine inside it, at any
        depth, is wrapped too, or those at the paths of a list.
        With `recover=False` it is only observed. Wrapping again gives new
        settings.

        >>> import smach
        >>> from smach_oracle.oracle import OracleContainer
        >>> results = iter(['aborted', 'succeeded'])
        >>> pick = smach.CBState(lambda userdata: next(results), outcomes=['succeeded', 'aborted'])
        >>> sm = smach.StateMachine(['succeeded', 'aborted'])
        >>> with sm:
        ...     _ = smach.StateMachine.add('PICK', pick)
        >>> OracleContainer.wrap(sm, settings={'deadline_s': 60}) is sm
        True
        >>> sm.execute()  # PICK fails, and the oracle enters it again
        'succeeded'

        :raises SettingsError: naming key, value and what is allowed.
        :raises LabelError: where a state has a label that is not text.
        """
        check_arguments(name, expert, recover, strict, health)
        checked = as_settings(settings, preconditions)
        tree = Tree(OracleContainer, recover, expert, health)
        within = checked.nested if nested is None else checked_nested('nested', nested)
        arguments = WrapArguments(checked, within, name, strict)
        wrapped = wrap_machine(cls, machine, tree, arguments)
        return cast('OracleContainer', wrapped)

    @staticmethod
    def add(
        label: str,
        state: smach.State,
        transitions: Optional[Mapping[str, Optional[str]]] = None,
        remapping: Optional[Mapping[str, str]] = None,
        constants: Optional[Mapping[str, Any]] = None,
        preconditions: Optional[List[Any]] = None,
        prior: Optional[float] = None,
        time_limit_s: Optional[float] = None,
        on_retry: Optional[str] = None,
        autonomy: Optional[str] = None,
    ) -> smach.State:
        """Add a state, with settings of its own, to the innermost open machine.

        The rest is as with `smach.StateMachine.add`.

        Settings of the container for the same state win.

        >>> import smach
        >>> from smach_oracle.oracle import OracleContainer
        >>> look = smach.CBState(lambda userdata: 'seen', outcomes=['seen'])
        >>> pick = smach.CBState(lambda userdata: 'picked', outcomes=['picked', 'aborted'])
        >>> machine = OracleContainer(['picked', 'aborted'])
        >>> with machine:
        ...     _ = OracleContainer.add('LOOK', look, {'seen': 'PICK'})
        ...     _ = OracleContainer.add('PICK', pick, preconditions=['LOOK'], time_limit_s=30)
        >>> machine.execute()
        'picked'

        :raises SettingsError: for a setting that is not allowed. `StateMachine.add` may raise other
            errors.
        """
        own = {
            'preconditions': preconditions,
            'prior': prior,
            'time_limit_s': time_limit_s,
            'on_retry': on_retry,
            'autonomy': autonomy,
        }
        given = {key: value for key, value in own.items() if value is not None}
        machine: Any = opened_container()
        if given:
            if not isinstance(machine, OracleContainer):
                raise SettingsError(
                    'add',
                    sorted(given),
                    'these settings in an OracleContainer, not {!r}'.format(machine),
                )
            marked_node(machine).settings.with_states({label: given})
        more = {} if constants is None else {'constants': constants}
        smach.StateMachine.add(label, state, transitions, remapping, **more)
        if given:
            marked_node(machine).in_force.give_with_add(label, given)
        return state

    # -- what adapters read. See oracle_of

    name = _Shown('name')
    path = _Shown('path')
    settings = _Shown('settings')
    events = _Shown('events')
    trial_id = _Shown('trial_id')
    is_top = _Shown('is_top')
    recovers = _Shown('recovers')

    @property
    def expert(self) -> Optional[Expert]:
        """Return the expert whom every container of the tree asks."""
        return oracle_of(self).expert

    @expert.setter
    def expert(self, expert: Optional[Expert]) -> None:
        oracle_of(self).expert = expert

    def new_trial_id(self) -> str:
        """Return the id of the trial about to begin. Override it to give your own ids."""
        return new_id()

    def rates(self) -> List[StateRateRow]:
        """Return the learned rate of every state, of this container and all below it."""
        return oracle_of(self).rates()

    def transition_counts(self) -> List[TransitionRow]:
        """Return how often each transition was taken, in this container and all below it."""
        return oracle_of(self).transition_counts()

    def save_rates(self, path: str) -> None:
        """Write the learned rates to a file, atomically.

        :raises OSError: where it cannot be written. An old file is then untouched.
        """
        write_by_hand(self._oracle, path)

    def load_rates(self, path: str) -> None:
        """Take over the learned rates of a file that `save_rates` wrote.

        A missing or damaged file is logged and changes nothing.
        """
        read_by_hand(self._oracle, path)

    # -- structure

    def get_children(self) -> Dict[str, smach.State]:
        """Return the states by label, ORACLE among them.

        :raises SettingsError: where ORACLE's name is another's.
        """
        sync_oracle(self._oracle)
        children: Dict[str, smach.State] = super().get_children()
        return children

    def get_internal_edges(self) -> List[Tuple[str, str, Optional[str]]]:
        """Return all edges (outcome, from, to).

        They are the author's, one from every state to ORACLE, and ORACLE's to all.

        :raises SettingsError: where ORACLE's name is another's.
        """
        sync_oracle(self._oracle)
        edges = list(super().get_internal_edges())
        if self._oracle.tree.recover:
            meta = self._oracle.settings.oracle_label
            edges += [(EDGE_TO_ORACLE, label, meta) for label in self._oracle.labels()]
        return edges

    def set_initial_state(
        self, initial_states: Sequence[str], userdata: Optional[smach.UserData] = None
    ) -> None:
        """Begin at this label (one, in a list) from now on, with these keys added to the userdata.

        :raises InvalidStateError: for ORACLE, which failures alone enter. Nothing is changed then.
        """
        labels = [initial_states] if isinstance(initial_states, str) else initial_states
        for label in labels:
            if self._oracle.is_oracle(label):
                raise entered_by_failures_alone(label)
        if userdata is None:
            super().set_initial_state(initial_states)
        else:
            super().set_initial_state(initial_states, userdata)

    def check_consistency(self) -> None:
        """Raise what a StateMachine raises for an inconsistent machine.

        ORACLE is brought up to date before.

        :raises SettingsError: where ORACLE's name is another's.
        """
        sync_oracle(self._oracle)
        super().check_consistency()

    # -- execution

    def execute(self, *args: Any, **kwargs: Any) -> Optional[str]:
        """Run the machine. The outermost running machine of a tree begins and ends a trial.

        It raises what a StateMachine raises.
        """
        if self._oracle.tree.is_parents() and not is_executing(self):
            return execute_bare(self, *args, **kwargs)
        run = ContainerRun(self._oracle)
        try:
            if run.begins(self.new_trial_id):
                run.outcome = super().execute(*args, **kwargs)
        except BaseException as err:
            run.error = err
            raise
        finally:
            run.is_over()
        return run.outcome

    def is_running(self) -> bool:
        """Whether it is executed, also while the oracle begins or ends the trial.

        As with a bare machine, another thread may wait for its end as long as this is true.
        """
        is_running: bool = super().is_running()
        return is_running or is_under_way_elsewhere(self)

    def request_preempt(self) -> None:
        """Ask it to stop, and wake what waits in its tree, such as an operator's hold."""
        super().request_preempt()
        self._oracle.tree.scope.wake()

    def call_start_cbs(self) -> None:
        """Forget the execution before: the machine has its initial state now."""
        node = self._oracle
        if node.engine.stepped:
            node.begin_once_more()
        if node.execution.is_led():
            self._start_elsewhere()
        super().call_start_cbs()

    def _start_elsewhere(self) -> None:
        node, how = self._oracle, 'starting'
        if node.execution.starts_in in self._states:
            self._set_current_state(node.execution.starts_in)
        entry = node.tree.resumed.take_entry(node.records)
        if entry is not None:
            entry.enter()
            how = 'going on'
        smach.loginfo(
            "State machine {} in state '{}' with userdata: \n\t{}".format(
                how, self._current_label, list(self.userdata.keys())
            )
        )

    def _tell_start(self) -> None:
        """Log where it starts. Upstream's engine does not ask."""
        if not self._oracle.execution.is_led():
            super()._tell_start()

    def _update_once(self) -> Optional[str]:
        """Execute the current state and make the transition, and go on with the next state.

        It goes on while each is a plain success, the engine's own loop has called it, and nothing
        makes that stop or pause. It returns None, or the container's outcome at the end.

        Every transition takes this way: a plain success costs what is on this page.
        """
        node = self._oracle
        lock = self._state_transitioning_lock
        engine, records, history = node.engine, node.records, node.records.history
        abandoned = node.tree.workers.abandoned
        states, transitions_of, remappings = self._states, self._transitions, self._remappings
        constants_of = self._constants
        # a machine that runs has a current state, with its label and its transitions
        label: str = self._current_label  # type: ignore[assignment]
        state: smach.State = self._current_state  # type: ignore[assignment]
        transitions: Transitions = self._current_transitions  # type: ignore[assignment]
        while True:
            try:
                record = records.by_label[label]
            except KeyError:
                record = node.record(label)
            if self._preempt_requested or engine.attentive:
                stop = before_step(node)
                if stop is not None:
                    return stop.outcome
            view, userdata = record.view, self.userdata
            if (
                view is None
                or view.state is not state
                or view.userdata is not userdata
                or view.remapping is not remappings[label]
                or view.keys != keys_of(state)
            ):
                view = record.view = StateView(self, label, state)
            record.snapshot = data_of(userdata).copy()
            observed = node.events.observers
            constants = constants_of.get(label) if constants_of else None
            outcome: Any  # a user's state may return anything
            error = None
            if engine.lock_is_held:
                lock.release()
            try:
                try:
                    if constants:
                        write_constants(userdata, constants)
                    if record.special or abandoned:
                        outcome = execute_watched(node, record, state, view.remapper)
                    elif observed:
                        outcome = execute_observed(node, record, state, view.remapper)
                    else:
                        outcome = state.execute(view.remapper)
                except Exception as err:
                    outcome, error = RAISED, err
                finally:
                    lock.acquire()
                try:
                    edge = record.fast[outcome]
                    target = edge.target
                    plain = transitions[outcome] is target and not self._preempt_requested
                except Exception:
                    # seen for the first time, no plain success, or no outcome at all
                    plain = False
                if not plain:
                    ended = end_plainly(node, record, outcome, states, transitions)
                    if ended is not None:
                        return ended
                    return Step(node, record).ended(outcome, error)
                edge.count += 1
                history.visits.append(edge.visit)
                if not record.has_preconditions:
                    history.unconditioned = label
                if history.succeeded != label:
                    history.succeeded_other = history.succeeded
                    history.succeeded = label
                if observed:
                    node.events.emit(TRANSITION, node.path, node.trial_id, label, outcome, target)
                self._current_label = label = target
                self._current_state = state = states[target]
                self._current_transitions = transitions = transitions_of[target]
                smach.loginfo(edge.message)
                if self._transition_cbs or engine.tells_transitions:
                    self.call_transition_cbs()
                if (
                    not engine.has_own_loop
                    or not self._is_running
                    or smach.is_shutdown()
                    or self._pause_requested
                ):
                    return None
            finally:
                if not engine.lock_is_held:
                    lock.release()

    def _state_ended(self, outcome: object, error: Optional[Exception]) -> Optional[str]:
        """Go on behind the current state, which was executed elsewhere, with the lock held."""
        return Step(self._oracle, self._oracle.record(cast('str', self._current_label))).ended(
            outcome, error
        )

    # -- pickling and copying

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Make the class again on unpickling: a class made by wrapping cannot be found by name."""
        reduced = super().__reduce_ex__(max(2, protocol))
        classes = two_classes(type(self))
        return reduced if classes is None else (rebuild, classes) + tuple(reduced[2:])

    def __setstate__(self, state: Dict[str, object]) -> None:
        """A shallow copy gets a node of its own. A deep or pickled one brings it."""
        set_base: Optional[Callable[[Any], None]] = getattr(super(), '__setstate__', None)
        if set_base is not None:
            set_base(state)
        else:
            self.__dict__.update(state)
        if self._oracle.machine is not self:
            self._oracle = self._oracle.twin_for(self)
        renew_attributes(self)
