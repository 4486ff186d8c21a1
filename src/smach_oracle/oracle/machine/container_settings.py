"""The settings in force in one container."""

from typing import Any, Dict, Optional

from ..decision.policy import Policy, policy_named
from ..settings.failing_outcomes import FailingNames
from ..settings.names import Nested, Strictness
from ..settings.settings import ALLOW, RUN, Settings, StateSettings


class ContainerSettings:
    """The settings of one container.

    They are those of the whole machine, those given with `add()`, and what follows from them.
    """

    def __init__(self, settings: Settings) -> None:
        self.given_with_add: Dict[str, Dict[str, Any]] = {}  # by label
        self.strict: Strictness = True
        self.nested: Nested = True
        self.inherits = False  # wrapped for being nested: under the settings of the top machine
        self.use(settings)

    def use(self, settings: Settings) -> None:
        """Put settings of the whole machine into force. Those given with `add()` stay."""
        self.of_machine = settings
        self._checked_states = -1  # number of states for which they were last checked
        self.policy: Policy = policy_named(settings.policy, settings.policy_parameters)
        self.failing = FailingNames(settings.failing_outcomes)
        self.deep_copy_keys = settings.deep_copy_keys

    def wrap_with(
        self,
        strict: Optional[Strictness] = None,
        nested: Optional[Nested] = None,
        inherits: bool = False,
    ) -> None:
        """Check names, and wrap what is nested, in these ways. None: as before."""
        self.strict = self.strict if strict is None else strict
        self.nested = self.nested if nested is None else nested
        self.inherits = self.inherits or inherits

    def is_unchecked(self, states: int) -> bool:
        """Whether they were not checked yet for so many states."""
        return self._checked_states != states

    def note_checked(self, states: int) -> None:
        """Note that they are."""
        self._checked_states = states

    def guards_states(self) -> bool:
        """Whether a state may be guarded: whether `on_retry` is set, for all or for one."""
        return self._sets('on_retry', ALLOW)

    def limits_autonomy(self) -> bool:
        """Whether a state may not simply be entered: whether `autonomy` is set for all or one."""
        return self._sets('autonomy', RUN)

    def _sets(self, key: str, usual: str) -> bool:
        if getattr(self.of_machine.defaults, key) != usual:
            return True
        if not (self.of_machine.states or self.given_with_add):
            return False
        given = [*self.of_machine.states.values(), *self.given_with_add.values()]
        return any(each.get(key, usual) != usual for each in given)

    def of_state(self, path: str, label: str) -> StateSettings:
        """Return the settings of a state of the container at `path`, relative to the top machine.

        What was given with `add()` counts unless the same key is set from outside.
        """
        own = self.given_with_add.get(label)
        settings = self.of_machine
        if own:
            settings = settings.with_states({label: {**own, **(settings.states.get(label) or {})}})
        return settings.for_state(path, label)
