"""One execution of several states at the same time: the threads, who is running and who ended
how.
"""

import threading
import time
import traceback
from typing import Callable, Dict, Iterable, List, Mapping, Optional, Set

import smach
from smach.state import State

Outcomes = Dict[str, Optional[str]]

# How often the wait for the children looks for a shutdown.
_SHUTDOWN_POLL_S = 0.1
# How long children that were preempted by a shutdown or by Ctrl-C may take to end before they are
# left behind.
_GRACE_S = 1.0


class ParallelRun(object):
    """Executes each state in a thread of its own, once.

    ``runner(label, state)`` returns what takes the preempt requests of a state, and
    ``take_back(label, state)`` takes back one that was not serviced.
    ``execute(label)`` runs the state and returns its outcome. ``began(label)`` and ``ended(label)``
    are called in the state's thread, never for two states at once. The first error of any of them
    preempts the other states.
    """

    def __init__(
        self,
        states: Mapping[str, State],
        runner: Callable[[str, State], State],
        take_back: Callable[[str, State], bool],
        execute: Callable[[str], str],
        began: Callable[[str], object],
        ended: Callable[[str], object],
    ) -> None:
        self.outcomes: Outcomes = dict.fromkeys(states)
        self.error: Optional[smach.SmachError] = None
        self.preempted: Set[str] = set()
        self._states = states
        self._runner = runner
        self._take_back = take_back
        self._execute = execute
        self._began = began
        self._ended = ended
        self._changed = threading.Condition(threading.RLock())
        # Re-entrant, as a callback may execute or preempt the container that calls it.
        self._callback_lock = threading.RLock()
        self._ready = threading.Event()
        self._running = set(states)
        self._threads = {
            label: threading.Thread(
                name='concurrent_split:%s' % label, target=self._run, args=(label,), daemon=True
            )
            for label in states
        }
        self._unfinished: Set[str] = set()
        self._left_behind = False

    def active(self) -> List[str]:
        """Return the labels of the running states, in the order in which they were added."""
        return [label for label in self._states if label in self._running]

    def run(self) -> None:
        """Start all and return when all have ended. An interrupt of this thread preempts them and
        goes on.
        """
        try:
            for label, thread in self._threads.items():
                thread.start()
                self._unfinished.add(label)
            self._ready.set()
            self._wait_for_end()
        except BaseException:
            self._stop()
            raise

    def preempt(self, labels: Optional[Iterable[str]] = None) -> None:
        """Ask the states of these labels, or all, to stop, as far as they still run."""
        with self._changed:
            chosen = self._running.intersection(self._running if labels is None else labels)
            self.preempted |= chosen
        for label in chosen:
            self._preempt_state(label)

    def _preempt_state(self, label: str) -> None:
        state = self._states[label]
        try:
            self._runner(label, state).request_preempt()
        except Exception:
            smach.logerr("Preempting state '%s' raised:\n%s" % (label, traceback.format_exc()))
        with self._changed:
            ended_meanwhile = label not in self._running
        # It may have ended because of the request, which is then serviced. Else its next execution
        # must not find it.
        if ended_meanwhile and self._take_back(label, state):
            self.preempted.discard(label)

    # -- in the thread of each state

    def _run(self, label: str) -> None:
        self._ready.wait()
        try:
            if not self._left_behind:
                self._execute_between_callbacks(label)
        except BaseException as err:
            self._fail(err)
        finally:
            with self._changed:
                self._running.discard(label)
                self._unfinished.discard(label)
                self._changed.notify_all()

    def _execute_between_callbacks(self, label: str) -> None:
        with self._callback_lock:
            self._began(label)
        outcome = self._outcome_of(label)
        with self._changed:
            self.outcomes[label] = outcome
            self._running.discard(label)
        smach.loginfo(
            "Concurrent state '%s' returned outcome '%s' on termination." % (label, outcome)
        )
        with self._callback_lock:
            if not self._left_behind:
                self._ended(label)

    def _outcome_of(self, label: str) -> str:
        try:
            outcome = self._execute(label)
        except BaseException as err:
            raise smach.InvalidStateError(
                "Could not execute child state '%s': %s" % (label, traceback.format_exc())
            ) from err
        if outcome is None:
            raise smach.InvalidStateError(
                "State '%s' of the concurrence ended without an outcome." % label
            )
        registered = self._states[label].get_registered_outcomes()
        if outcome not in registered:
            smach.logerr(
                "Concurrent state '%s' returned outcome '%s', which it has not registered (only "
                '%s): no entry '
                'of the outcome map can match it.' % (label, outcome, registered)
            )
        return outcome

    def _fail(self, err: BaseException) -> None:
        if not isinstance(err, smach.SmachError):
            err = smach.InvalidUserCodeError(
                'A callback of a concurrence raised: %s' % traceback.format_exc()
            )
        with self._changed:
            self.error = self.error or err
        self.preempt()

    # -- in the thread of the container

    def _wait_for_end(self) -> None:
        with self._changed:
            while self._unfinished and not smach.is_shutdown():
                self._changed.wait(_SHUTDOWN_POLL_S)
            all_ended = not self._unfinished
        if not all_ended:
            self.preempt()
            self._wait_with_grace()

    def _stop(self) -> None:
        """After an interrupt: preempt the states that run, let none of the others begin, and wait a
        little.
        """
        if not self._ready.is_set():
            self._left_behind = True
            self._ready.set()
        self.preempt(self._unfinished.copy())
        self._wait_with_grace()

    def _wait_with_grace(self) -> None:
        deadline = time.monotonic() + _GRACE_S
        with self._changed:
            while self._unfinished and time.monotonic() < deadline:
                self._changed.wait(max(0.0, deadline - time.monotonic()))
            left = sorted(self._unfinished)
            self._left_behind = True
        if left:
            smach.logerr(
                'Concurrent states %s did not end within %.1f s of being preempted; leaving them '
                'behind.' % (left, _GRACE_S)
            )
