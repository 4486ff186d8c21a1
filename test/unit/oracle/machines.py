"""States that do as they are told, a fake expert, and machines made of them."""

import threading
from typing import Any, Callable, Dict, List, Optional

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert, Question
from smach_oracle.oracle.records.events import Event, EventKind

OUTCOMES = ('ok', 'aborted', 'preempted')


class Scripted(smach.State):
    """Ends as told, one entry per visit, then with 'ok'. An exception is raised, a callable called
    with (self, ud).
    """

    def __init__(self, *script: Any, outcomes=OUTCOMES, **keys: Any) -> None:
        smach.State.__init__(self, outcomes=list(outcomes), **keys)
        self.script = list(script)
        self.runs = 0
        self.otherwise = outcomes[0]

    def execute(self, ud: Any) -> Any:
        self.runs += 1
        step = self.script.pop(0) if self.script else self.otherwise
        if isinstance(step, BaseException):
            raise step
        return step(self, ud) if callable(step) else step


class FakeExpert(Expert):
    """Answers from a list (an Answer, a callable of the question, or an exception), then not at
    all.
    """

    def __init__(
        self, *answers: Any, interface: Optional[Callable[..., Optional[Answer]]] = None
    ) -> None:
        self.answers = list(answers)
        self.questions: List[Question] = []
        self._interface = interface

    def ask(self, question, cancelled, progress):
        self.questions.append(question)
        if not self.answers:
            return None
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer(question, cancelled, progress) if callable(answer) else answer

    def run_interface(self, offer, question, cancelled, progress):
        return self._interface(offer, question, cancelled, progress) if self._interface else None


class FakeWaiting:
    """Notes what was waited for, and calls a function then."""

    def __init__(self, then=lambda: None):
        self.waited = []
        self._then = then

    def wait(self, seconds, what, scope):
        self.waited.append((seconds, what))
        self._then()


class FakeHealth:
    """A fake of what knows whether the robot is well; says what a test tells it to."""

    def __init__(self, *said):
        self.said = list(said)  # then for good what `now` is
        self.now = ''
        self.asked = 0

    def __call__(self):
        self.asked += 1
        said = self.said.pop(0) if self.said else self.now
        if isinstance(said, Exception):
            raise said
        return said


def contents(userdata: Any) -> Dict[str, Any]:
    """What is in a machine's userdata."""
    return {key: userdata[key] for key in userdata.keys()}


def waits(question, cancelled: threading.Event, progress) -> None:
    """An expert who looks at the question until it is taken back."""
    assert cancelled.wait(20), 'nobody took the question back'


def goto(state: str, **more: Any) -> Answer:
    return Answer(AnswerKind.GOTO, state=state, by='eva', **more)


def supersede(outcome: str, **more: Any) -> Answer:
    return Answer(AnswerKind.SUPERSEDE, outcome=outcome, by='eva', **more)


def give_up(outcome: str = '', **more: Any) -> Answer:
    return Answer(AnswerKind.GIVE_UP, outcome=outcome, by='eva', **more)


def interface(name: str) -> Answer:
    return Answer(AnswerKind.INTERFACE, interface=name, by='eva')


def chain_of(
    *states: Any,
    outcomes=('done', 'aborted', 'preempted'),
    machine_class=smach.StateMachine,
    **keys: Any,
):
    """A machine of states A, B, C, ...: 'ok' leads to the next, from the last to 'done'; all else
    falls through.
    """
    machine = machine_class(outcomes=list(outcomes), **keys)
    labels = [chr(ord('A') + index) for index in range(len(states))]
    with machine:
        for index, (label, state) in enumerate(zip(labels, states)):
            target = labels[index + 1] if index + 1 < len(labels) else 'done'
            first = (
                'ok'
                if 'ok' in state.get_registered_outcomes()
                else sorted(state.get_registered_outcomes())[0]
            )
            smach.StateMachine.add(label, state, {first: target})
    return machine


class Watched:
    """A machine under an oracle and the events of its trials."""

    def __init__(self, machine: Any, **wrap: Any) -> None:
        self.machine = OracleContainer.wrap(machine, **wrap)
        self.events: List[Event] = []
        self.machine.events.observers.append(self.events.append)

    def run(self) -> Any:
        """Execute; returns the outcome."""
        return self.machine.execute()

    def of(self, *kinds: EventKind) -> List[Event]:
        """The events of these kinds."""
        return [event for event in self.events if event.kind in kinds]

    def kinds(self) -> List[str]:
        """Names of all events in order."""
        return [event.kind.name for event in self.events]

    def visits(self) -> List[str]:
        """Labels of the states that were entered, in order."""
        return [event.state for event in self.of(EventKind.STATE_START)]

    def decisions(self) -> List[tuple]:
        """(action, target) of every decision."""
        return [(event.outcome, event.target) for event in self.of(EventKind.DECISION)]

    def rate(self, label: str) -> Any:
        """The row of a state's learned rate."""
        return next(row for row in self.machine.rates() if row.state == label)


def watched(*states: Any, outcomes=('done', 'aborted', 'preempted'), **wrap: Any) -> Watched:
    """A chain of states under an oracle."""
    return Watched(chain_of(*states, outcomes=outcomes), **wrap)


def offered_hand(expert: Any) -> Watched:
    """A, which fails and has the interface `hand` on offer, and B."""
    return watched(
        Scripted('aborted'),
        Scripted(),
        expert=expert,
        settings={'max_recoveries': 0, 'interfaces': {'hand': {'action': 'hand/assist'}}},
    )


class Gate:
    """Lets a state wait for a test and a test for a state."""

    def __init__(self) -> None:
        self.entered = threading.Event()
        self.go = threading.Event()

    def __call__(self, state: Any, ud: Any) -> str:
        """Say that the state is here, wait until preempted or let go."""
        self.entered.set()
        for _ in range(2000):
            if state.preempt_requested():
                state.service_preempt()
                return 'preempted'
            if self.go.wait(0.01):
                return 'ok'
        raise AssertionError('nobody let the state go')


def in_thread(function: Callable[[], Any]) -> 'Call':
    """Call in a thread of its own."""
    return Call(function)


class Call:
    """A call under way in another thread."""

    def __init__(self, function: Callable[[], Any]) -> None:
        self._result: Any = None
        self._error: Optional[BaseException] = None
        self._thread = threading.Thread(target=self._run, args=(function,), daemon=True)
        self._thread.start()

    def _run(self, function: Callable[[], Any]) -> None:
        try:
            self._result = function()
        except BaseException as err:
            self._error = err

    def result(self, timeout_s: float = 20.0) -> Any:
        """Wait for the result; raises what the call raised."""
        self._thread.join(timeout_s)
        assert not self._thread.is_alive(), 'the call did not return'
        if self._error is not None:
            raise self._error
        return self._result
