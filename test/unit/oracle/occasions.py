"""Small machines, one for each reason why the oracle is entered, in which no phase has a verdict.

The policy and the level above ask, the expert is there and does not answer, and without an answer
the machine goes to AWAY. So each phase that there is runs. `Options` give one of them a verdict.
"""

import threading
from typing import Any, Callable, Dict, List, NamedTuple, Optional

import guarded_machines
import pytest
from guarded_machines import OUTCOMES
from machines import FakeHealth, Scripted, Watched, goto, supersede
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, Expert, Question
from smach_oracle.oracle.records.events import Event, EventKind

ALL_ASK = {
    'policy': 'always_ask',
    'escalate': True,
    'on_no_answer': {'goto': 'AWAY'},
    'health_settle_s': 0.01,
    'memory': 1000,
}
SOON = {'still_running_s': 0.05, 'still_running_factor': 1}
GUARDED = {'states': {'B': {'on_retry': 'confirm'}}}
ENDS = (EventKind.JUMP, EventKind.SUPERSEDE, EventKind.CONTAINER_END)


class Options(NamedTuple):
    """The part of a machine that may have a verdict."""

    answer: Optional[Answer] = None  # of the expert, to the question about the occasion
    policy: str = 'always_ask'
    above: str = 'always_ask'  # the policy of the level above
    escalate: bool = True
    guarded: bool = True  # whether the state may not be repeated by itself, where it matters
    closes: bool = True  # whether the place closes to which the machine was sent before


class Answers(Expert):
    """A fake expert that gives these answers in turn, and then none."""

    def __init__(self, *answers: Optional[Answer]) -> None:
        self._answers = list(answers)
        self.questions: List[Question] = []

    def ask(self, question, cancelled, progress):
        if question.failed_state == 'HANG':
            return supersede('ok')
        self.questions.append(question)
        return self._answers.pop(0) if self._answers else None

    def run_interface(self, offer, question, cancelled, progress):
        return None


class Occasion(NamedTuple):
    """One trial in which the oracle is entered for one reason."""

    machine: Watched
    expert: Answers
    path: str  # of the container whose oracle is entered
    state: str
    begins: Callable[[Event], bool]  # whether an event is its first one
    visits_before: List[str] = []  # results of the state's visits before
    failures_before: int = 0
    runs: Callable[[Watched], Any] = Watched.run

    def questions(self) -> List[Question]:
        """The questions about the state, those from before the occasion among them."""
        return [
            each
            for each in self.expert.questions
            if (each.container_path, each.failed_state) == (self.path, self.state)
        ]

    def run(self) -> List[str]:
        """Run the trial. Return what the container tells, from the occasion to its verdict."""
        self.runs(self.machine)
        told = [event for event in self.machine.events if event.path == self.path]
        begin = next(index for index, event in enumerate(told) if self.begins(event))
        end = next(
            index
            for index, event in enumerate(told)
            if index > begin and (event.kind in ENDS or event.kind is EventKind.STATE_START)
        )
        told = [
            event
            for event in told[begin : end + 1]
            if event.kind not in (EventKind.CONTAINER_END, EventKind.STATE_START)
        ]
        return [event.kind.name for event in told]


class Heeds(smach.State):
    """Waits once for its preempt, and then until `until` returns. With `fails` it fails first."""

    def __init__(self, fails: bool) -> None:
        smach.State.__init__(self, outcomes=['ok', 'aborted', 'preempted'])
        self._fails = fails
        self.until: Callable[[], Any] = bool
        self.asked = threading.Event()

    def execute(self, ud):
        if self._fails:
            self._fails = False
            return 'aborted'
        if self.asked.is_set():
            return 'ok'
        assert wait_for(self.preempt_requested)
        self.asked.set()
        self.until()
        self.service_preempt()
        return 'preempted'


class Hangs(smach.State):
    """Heeds nothing until it is let go: it is abandoned at its time limit, and closed then."""

    def __init__(self) -> None:
        smach.State.__init__(self, outcomes=['ok', 'aborted', 'preempted'])
        self.lets_go = threading.Event()

    def execute(self, ud):
        assert self.lets_go.wait(20)
        return 'ok'


class WaitsForIt(smach.State):
    """Goes on once it is told to, or preempted."""

    def __init__(self, told: threading.Event) -> None:
        smach.State.__init__(self, outcomes=['ok'])
        self._told = told

    def execute(self, ud):
        assert wait_for(lambda: self._told.is_set() or self.preempt_requested())
        return 'ok'


def chain(**states: Any) -> smach.StateMachine:
    """States in this order, and AWAY, which ends the machine well, and which none leads to."""
    machine = guarded_machines.chain(**states)
    with machine:
        smach.StateMachine.add('AWAY', Scripted(), {'ok': 'done'})
    return machine


def told_of(
    kind: EventKind, state: str = 'B', target: str = '', outcome: str = ''
) -> Callable[[Event], bool]:
    return lambda event: (
        event.kind is kind
        and event.state == state
        and target in ('', event.target)
        and outcome in ('', event.outcome)
    )


def of_b(
    options: Options,
    b: smach.State,
    begins: Callable[[Event], bool],
    settings: Dict[str, Any],
    first: Any = (),
    c: Optional[smach.State] = None,
    health: Optional[FakeHealth] = None,
    **more: Any,
) -> Occasion:
    """An occasion of B in TOP/WORK."""
    expert = Answers(*first, options.answer)
    work = chain(A=Scripted(), B=b, C=c or Scripted())
    own = {**ALL_ASK, **settings, 'policy': options.policy, 'escalate': options.escalate}
    OracleContainer.wrap(work, settings=own)  # it keeps its policy below the other machine
    machine = Watched(
        chain(HOME=Scripted(), WORK=work),
        name='TOP',
        expert=expert,
        health=health,
        settings={**own, 'policy': options.above},
    )
    return Occasion(machine, expert, 'TOP/WORK', 'B', begins, **more)


def failed(folder, options):
    return of_b(options, Scripted('aborted'), told_of(EventKind.FAILURE), {})


def overran(folder, options):
    return of_b(
        options,
        Heeds(False),
        told_of(EventKind.FAILURE),
        {'states': {'B': {'time_limit_s': 0.05, 'grace_period_s': 20}}},
    )


def held_back(folder, options):
    """C fails, and the expert goes back to A without a word on B, which is guarded."""
    return of_b(
        options,
        Scripted(),
        told_of(EventKind.TRANSITION, 'B', 'ORACLE'),
        GUARDED,
        first=[goto('A')],
        c=Scripted('aborted'),
        visits_before=['SUCCESS'],
    )


def stopped_in_b(machine: Watched) -> None:
    """Its program is stopped while B runs, and begun again."""
    with pytest.raises(KeyboardInterrupt):
        machine.run()
    del machine.events[:]
    machine.run()


def interrupted(folder, options, on_resume='recover'):
    return of_b(
        options,
        Scripted(KeyboardInterrupt()),
        told_of(EventKind.FAILURE),
        {
            'checkpoint': str(folder / 'robot.db'),
            'checkpoint_synchronous': 'OFF',
            'on_resume': on_resume,
        },
        runs=stopped_in_b,
    )


def interrupted_and_asked(folder, options):
    return interrupted(folder, options, 'ask')


def unwell(options: Options, times: int, begins: EventKind, settings: Dict[str, Any]) -> Occasion:
    """B fails so often while the robot is not well. It is as soon as the machine waits for it."""
    health = FakeHealth()

    def fails(state, ud):
        health.now = 'motors: off'
        return 'aborted'

    def heals(event):
        if event.kind is EventKind.HEALTH_WAIT_START:
            health.now = ''

    occasion = of_b(options, Scripted(*[fails] * times), told_of(begins), settings, health=health)
    occasion.machine.machine.events.observers.append(heals)
    return occasion


def robot_unwell(folder, options):
    return unwell(options, 1, EventKind.HEALTH_WAIT_START, GUARDED if options.guarded else {})


def often_unwell(folder, options):
    """The first failure is not counted, the second one is."""
    return unwell(options, 2, EventKind.FAILURE, {'max_recoveries': 1})


def beside(
    options: Options,
    b: smach.State,
    first: List[Answer],
    path: str,
    state: str,
    outcome: str = '',
    **more: Any,
) -> Occasion:
    """B is in WORK, and the expert goes from there to TOP/C.

    A branch beside WORK closes C while the machine is on its way there.
    """
    hangs, told = Hangs(), b.asked if isinstance(b, Heeds) else threading.Event()
    both = smach.Concurrence(outcomes=OUTCOMES, default_outcome='done')
    with both:
        smach.Concurrence.add('WORK', chain(B=b))
        smach.Concurrence.add(
            'BESIDE', chain(WAIT=WaitsForIt(told), HANG=hangs if options.closes else Scripted())
        )
    expert = Answers(*first, options.answer)
    machine = Watched(
        chain(HOME=Scripted(), BOTH=both, C=hangs),
        name='TOP',
        expert=expert,
        settings={
            **ALL_ASK,
            **SOON,
            'states': {'HANG': {'time_limit_s': 0.05, 'grace_period_s': 0}},
        },
    )
    if options.closes and isinstance(b, Heeds):
        b.until = lambda: wait_for(
            lambda: any(event.state == 'HANG' for event in machine.of(EventKind.FAILURE))
        )

    def runs(machine: Watched) -> None:
        if not options.closes:
            hangs.lets_go.set()
        try:
            machine.run()
        finally:
            hangs.lets_go.set()

    return Occasion(
        machine,
        expert,
        path,
        state,
        told_of(EventKind.TRANSITION, state, 'ORACLE', outcome),
        runs=runs,
        **more,
    )


def taken_out(folder, options):
    return beside(
        options,
        Heeds(True),
        [goto('B'), goto('C', container='TOP')],
        'TOP/BOTH/WORK',
        'B',
        'preempted',
        visits_before=['FAILURE'],
        failures_before=1,
    )


def arrived(folder, options):
    return beside(options, Scripted('aborted'), [goto('C', container='TOP')], 'TOP', 'BOTH')


OCCASIONS: Dict[str, Callable[..., Occasion]] = {
    'failed': failed,
    'overran': overran,
    'held back': held_back,
    'interrupted': interrupted,
    'interrupted, asked first': interrupted_and_asked,
    'taken out': taken_out,
    'arrived from elsewhere': arrived,
    'robot unwell': robot_unwell,
    'often unwell': often_unwell,
}
