"""The meta state (paper, section IV-A).

Every state has an edge to it, and it has one to every state and container outcome.
"""

import threading
from typing import Any, Dict, Optional, Tuple

import smach

from ..errors import TrialError
from ..recovery.phases import recover
from ..recovery.recovering import Recovering
from ..recovery.verdict import Verdict, leads_to


class OracleState(smach.State):
    """The ORACLE state of one container.

    Its outcomes are the labels of all states and all container outcomes.
    """

    def __init__(self) -> None:
        smach.State.__init__(self, outcomes=[])
        self._lock = threading.Lock()
        self._recovering: Optional[Recovering] = None
        self._verdict: Optional[Verdict] = None

    def lead_to(self, labels: Tuple[str, ...]) -> Dict[str, Optional[str]]:
        """Have these outcomes and no others, and return the transitions, each to its own name."""
        self._outcomes = set(labels)
        return {label: label for label in labels}

    def begin(self, recovering: Recovering) -> None:
        """Be ready to recover from a failure.

        From now on a preempt request reaches the recovery.
        """
        with self._lock:
            self._preempt_requested = False
            self._recovering = recovering
            self._verdict = None

    def execute(self, ud: smach.UserData) -> str:
        """Recover from the failure handed to `begin`.

        :returns: where the machine goes, '' where it raises. It follows the verdict itself.
        :raises TrialError: where no failure was handed over.
        """
        recovering = self._recovering
        if recovering is None:
            raise TrialError('the meta state is entered by failures alone')
        try:
            self._verdict = recover(recovering)
            return leads_to(self._verdict)
        finally:
            with self._lock:
                self._recovering = None

    def take_verdict(self) -> Verdict:
        """Return what the recovery that `execute` ran has come to, once.

        :raises TrialError: where `execute` has run none.
        """
        verdict, self._verdict = self._verdict, None
        if verdict is None:
            raise TrialError('the meta state has executed without a recovery')
        return verdict

    def request_preempt(self) -> None:
        """End the recovery: a precondition that runs is preempted, an open question taken back."""
        smach.State.request_preempt(self)
        with self._lock:
            recovering = self._recovering
        if recovering is not None:
            recovering.cancel()

    def __getstate__(self) -> Dict[str, Any]:
        """Leave out what belongs to a recovery: neither that nor a lock travels with a machine."""
        state = dict(self.__dict__)
        state.update(_lock=None, _recovering=None, _verdict=None)
        return state

    def __setstate__(self, state: Dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = threading.Lock()
