"""Machines that fail by chance, run by the executive, and their events."""

import contextlib
import random

import pytest

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert
from smach_oracle.ros.recorder import TrialRecorder

KEPT = {'memory': 10, 'policy': 'prose', 'prior': 0.1}


class Chance(smach.State):
    """Fails now and then."""

    def __init__(self, generator, share):
        super().__init__(outcomes=['succeeded', 'aborted'])
        self._generator = generator
        self._share = share
        self.stops = False

    def execute(self, userdata):
        if self.stops:
            raise KeyboardInterrupt
        return 'aborted' if self._generator.random() < self._share else 'succeeded'


class Hand(Expert):
    """Does the failed state's work, and now and then sends the machine back to it, or farther."""

    def __init__(self, generator, back_to=''):
        self._generator = generator
        self._back_to = back_to

    def ask(self, question, cancelled, progress):
        if self._generator.random() < 0.3:
            states = [choice.state for choice in question.choices]
            state = self._back_to if self._back_to in states else question.failed_state
            return Answer(AnswerKind.GOTO, state=state, by='hand')
        return Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='hand')


class NoWait:
    """Takes no time."""

    def wait(self, seconds, what, scope):
        pass


def run(count, seed=1, states=None, back_to='', health=None, stopped=0, **settings):
    """The events of some trials of one learning machine, by trial. PICK stops the first ones."""
    generator = random.Random(seed)
    inner = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    with inner:
        smach.StateMachine.add('REACH', Chance(generator, 0.3))
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add('LOOK', Chance(generator, 0.1), {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', Chance(generator, 0.5), {'succeeded': 'INNER'})
        smach.StateMachine.add('INNER', inner, {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', Chance(generator, 0.3))
    OracleContainer.wrap(
        machine,
        name='TOP',
        expert=Hand(generator, back_to),
        preconditions={'PICK': ['LOOK']},
        health=health,
        settings=dict(KEPT, states=states or {}, **settings),
    )
    oracle_of(machine).waiting = NoWait()
    events = []
    machine.events.observers.append(events.append)
    pick = machine.get_children()['PICK']
    for number in range(count):
        pick.stops = number < stopped
        with contextlib.suppress(KeyboardInterrupt):
            machine.execute()
    return by_trial(events)


def by_trial(events):
    found = {}
    for event in events:
        found.setdefault(event.trial_id, []).append(event)
    return list(found.values())


def record(folder, trials):
    recorder = TrialRecorder(str(folder), warn=pytest.fail)
    for trial in trials:
        for event in trial:
            recorder(event)
    assert recorder.close(20.0)
