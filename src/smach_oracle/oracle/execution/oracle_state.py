"""The meta state (paper, section IV-A).

Every state has an edge to it, and it has one to every state and container outcome.
"""
import threading
from typing import Any, Dict, Optional, Tuple

import smach

from ..errors import TrialError
from ..recovery.recovery import Recovery
from ..recovery.verdict import Verdict


class OracleState(smach.State):
    """The ORACLE state of one container.

    Its outcomes are the labels of all states and all container outcomes.
    """

    def __init__(self) -> None:
        smach.State.__init__(self, outcomes=[])
        self._lock = threading.Lock()
        self._recovery: Optional[Recovery] = None

    def lead_to(self, labels: Tuple[str, ...]) -> Dict[str, Optional[str]]:
        """Have these outcomes and no others; return the transitions, each to its own name."""
        self._outcomes = set(labels)
        return {label: label for label in labels}

    def begin(self, recovery: Recovery) -> None:
        """Be ready to recover from a failure.

        From now on a preempt request reaches the recovery.
        """
        with self._lock:
            self._preempt_requested = False
            self._recovery = recovery

    def recover(self) -> Verdict:
        """Recover from the failure handed to `begin`.

        :raises TrialError: where no failure was handed over.
        """
        recovery = self._recovery
        if recovery is None:
            raise TrialError('the meta state is entered by failures alone')
        try:
            return recovery.run()
        finally:
            with self._lock:
                self._recovery = None

    def execute(self, ud: smach.UserData) -> str:
        """Recover; return where to go ('' where the machine raises)."""
        return self.recover().leads_to()

    def request_preempt(self) -> None:
        """End the recovery: a precondition that runs is preempted, an open question taken back."""
        smach.State.request_preempt(self)
        with self._lock:
            recovery = self._recovery
        if recovery is not None:
            recovery.cancel()

    def __getstate__(self) -> Dict[str, Any]:
        """Without the lock and a recovery under way: neither travels with a pickled machine."""
        state = dict(self.__dict__)
        state.update(_lock=None, _recovery=None)
        return state

    def __setstate__(self, state: Dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = threading.Lock()
