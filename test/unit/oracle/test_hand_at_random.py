"""An operator who commands at random: nothing hangs, no thread is left, every pause ends."""

import random
import threading
import time
from typing import Any, List

import pytest
from held_machines import Held, eventually
from machines import Scripted, chain_of

import smach
from smach_oracle.oracle.errors import OperatorError
from smach_oracle.oracle.records.events import EventKind

COMMANDS = 40


class Busy(Scripted):
    """Takes a moment, fails now and then, and heeds preempts where it is polite."""

    def __init__(self, rng: random.Random) -> None:
        super().__init__(outcomes=('ok', 'aborted', 'preempted'))
        self._rng = random.Random(rng.random())
        self._polite = rng.random() < 0.5

    def execute(self, ud: Any) -> str:
        until_s = time.monotonic() + self._rng.choice((0.0, 0.001, 0.01))
        while time.monotonic() < until_s:
            if self._polite and self.preempt_requested():
                self.service_preempt()
                return 'preempted'
            time.sleep(0.001)  # stands for the work of a state
        return 'aborted' if self._rng.random() < 0.1 else 'ok'


def tree(rng: random.Random, depth: int) -> smach.StateMachine:
    """A machine of a few states, some of them machines or two of them side by side."""
    states: List[smach.State] = []
    for _ in range(rng.randint(1, 3)):
        kind = rng.random() if depth else 1.0
        if kind < 0.3:
            states.append(renamed(tree(rng, depth - 1)))
        elif kind < 0.5:
            both = smach.Concurrence(['ok', 'aborted', 'preempted'], 'ok')
            with both:
                smach.Concurrence.add('L', tree(rng, depth - 1))
                smach.Concurrence.add('R', tree(rng, depth - 1))
            states.append(both)
        else:
            states.append(Busy(rng))
    return chain_of(*states)


def renamed(machine: smach.StateMachine) -> smach.StateMachine:
    """The same with the outcome `ok` for `done`."""
    outer = smach.StateMachine(outcomes=['ok', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add('M', machine, {'done': 'ok'})
    return outer


def command(rng: random.Random, held: Held) -> None:
    """Give one command; what is refused is fine."""
    hand = held.hand
    active = hand.status().active
    place = rng.choice(active) if active else None
    labels = list(held.machine._oracle.labels())
    choices = [
        hand.pause,
        hand.pause,
        hand.resume,
        hand.step,
        hand.step,
        hand.confirm,
        lambda: hand.set_breakpoint(rng.choice(('*', 'A', '**/L/*'))),
        lambda: hand.remove_breakpoint(rng.choice(('*', 'A', '**/L/*'))),
        lambda: hand.set_autonomy(
            rng.choice(('B', '**/R/*')), rng.choice(('run', 'announce', 'confirm', ''))
        ),
        lambda: hand.go_to('', rng.choice(labels)),
        lambda: hand.go_to(place.path if place else '', 'A'),
    ]
    if rng.random() < 0.03:
        choices = [hand.preempt, held.machine.request_preempt]
    try:
        rng.choice(choices)()
    except OperatorError:
        pass


@pytest.mark.parametrize('seed', range(12))
def test_whatever_is_asked_the_machine_ends(seed: int) -> None:
    rng = random.Random(seed)
    before = threading.active_count()
    held = Held(tree(rng, 2), settings={'max_recoveries': 2, 'states': {}})
    with held.begin():
        for _ in range(COMMANDS):
            command(rng, held)
            time.sleep(rng.choice((0.0, 0.001, 0.005)))  # instants at random are the point
            if not held.running():
                held.begin()
        let_go(held)
        held.end()
    eventually(lambda: threading.active_count() <= before)
    starts, ends = held.of(EventKind.HOLD_START), held.of(EventKind.HOLD_END)
    assert sorted((each.path, each.state) for each in starts) == sorted(
        (each.path, each.state) for each in ends
    )
    assert not held.held()


@pytest.mark.parametrize('seed', range(8))
def test_a_paused_tree_ends_at_a_preempt(seed: int) -> None:
    rng = random.Random(1000 + seed)
    held = Held(tree(rng, 2), settings={'max_recoveries': 2})
    with held.begin():
        for _ in range(rng.randint(0, 6)):
            time.sleep(0.003)  # some way into the tree, wherever that is
            held.hand.pause()
            try:
                held.hand.step()
            except OperatorError:
                pass
        held.machine.request_preempt()
        held.end()
    assert not held.held()


def let_go(held: Held) -> None:
    """Take back all that holds it."""
    hand = held.hand
    for pattern in hand.status().breakpoints:
        hand.remove_breakpoint(pattern)
    for pattern in hand.status().autonomy:
        hand.set_autonomy(pattern, 'run')
    hand.resume()
