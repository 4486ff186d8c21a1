"""Machines that run in a thread, and an operator who holds them."""

import threading
import time
from typing import Any, Callable, List, Optional

from guarded_machines import OUTCOMES
from machines import Scripted, Watched
from waiting import wait_for

import smach
from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.oracle.records.events import EventKind

LIMIT_S = 20.0


def eventually(condition: Callable[[], Any]) -> None:
    """Wait until a condition holds."""
    assert wait_for(condition, LIMIT_S), 'it did not come to pass within {} s'.format(LIMIT_S)


class Gate:
    """What a scripted state does: it waits until it is opened, or its state is preempted."""

    def __init__(self, outcome: str = 'ok', heeds: bool = True) -> None:
        self.entered = threading.Event()
        self.opened = threading.Event()
        self._outcome = outcome
        self._heeds = heeds

    def __call__(self, state: Any, ud: Any) -> str:
        self.entered.set()
        until_s = time.monotonic() + LIMIT_S
        while not self.opened.wait(0.005):
            assert time.monotonic() < until_s, 'nobody has opened the gate'
            if self._heeds and state.preempt_requested():
                state.service_preempt()
                return 'preempted'
        return self._outcome


class Held(Watched):
    """A machine that executes in a thread of its own, with an operator's hand on it."""

    def __init__(self, machine: Any, **wrap: Any) -> None:
        super().__init__(machine, **wrap)
        self.hand = OperatorHand(self.machine)
        self.outcome: Any = None
        self.error: Optional[BaseException] = None
        self._thread: Optional[threading.Thread] = None

    def __enter__(self) -> 'Held':
        return self

    def __exit__(self, *exc_info: object) -> None:
        """Let it end, whatever the test has come to."""
        if self.running():
            self.hand.preempt()
        if self._thread is not None:
            self._thread.join(LIMIT_S)

    def begin(self) -> 'Held':
        """Execute in a thread."""
        self._thread = threading.Thread(target=self._execute, daemon=True)
        self._thread.start()
        return self

    def _execute(self) -> None:
        try:
            self.outcome = self.machine.execute()
        except BaseException as err:
            self.error = err

    def running(self) -> bool:
        """Whether its thread lives."""
        return self._thread is not None and self._thread.is_alive()

    def end(self) -> Any:
        """Wait for the end; return the outcome."""
        assert self._thread is not None
        self._thread.join(LIMIT_S)
        assert not self._thread.is_alive(), 'it hangs: {}'.format(self.hand.status())
        assert self.error is None, self.error
        return self.outcome

    def held(self) -> List[str]:
        """PATH/STATE before which its containers wait now."""
        return [
            '{}/{}'.format(each.path, each.state)
            for each in self.hand.status().active
            if each.held_by
        ]

    def waits_before(self, *places: str) -> None:
        """Wait until it waits before these, and no others."""
        eventually(lambda: sorted(self.held()) == sorted(places))

    def told(self, kind: EventKind) -> List[str]:
        """Outcomes of the events of a kind."""
        return [event.outcome for event in self.of(kind)]


class Trail:
    """The labels of the states that have run, in order."""

    def __init__(self):
        self.ran = []

    def state(self, label, *script, outcomes=('ok', 'aborted', 'preempted')):
        """A state that does as told, and looks at no preempt unless its script does."""

        def noted(step):
            def run(state, ud):
                self.ran.append(label)
                return step(state, ud) if callable(step) else step

            return run

        return Scripted(*map(noted, script or ['ok'] * 9), outcomes=outcomes)

    def cleaned(self, *work, clean=None, ends='preempted'):
        """A machine of these states, A and B, each of which leads to CLEAN at a preempt.

        `ends`: the machine's outcome after CLEAN.
        """
        a, b = work or (self.state('A'), self.state('B'))
        machine = smach.StateMachine(OUTCOMES)
        with machine:
            smach.StateMachine.add('A', a, self._ways(a, 'B'))
            smach.StateMachine.add('B', b, self._ways(b, 'done'))
            smach.StateMachine.add('CLEAN', clean or self.state('CLEAN'), {'ok': ends})
        return machine

    def _ways(self, state, good):
        outcomes = state.get_registered_outcomes()
        return {
            **{each: good for each in ('ok', 'done') if each in outcomes},
            **({'preempted': 'CLEAN'} if 'preempted' in outcomes else {}),
        }
