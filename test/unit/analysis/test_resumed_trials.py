"""What if, for trials of a machine that was killed and went on."""

import pickle
import random

import pytest
from killed_machines import Points, in_a_process

import smach
from smach_oracle.analysis import what_if
from smach_oracle.oracle import Expert, OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind
from smach_oracle.oracle.records.events import EventKind, FailureKind

SETTINGS = {'on_resume': 'recover', 'checkpoint_synchronous': 'OFF', 'max_recoveries': 20}


class Chance(smach.State):
    def __init__(self, generator):
        smach.State.__init__(self, ['succeeded', 'aborted'])
        self._generator = generator

    def execute(self, userdata):
        return 'succeeded' if self._generator.random() < 0.6 else 'aborted'


class ByHand(Expert):
    """Does by hand whatever it is asked about."""

    def ask(self, question, cancelled, progress):
        return Answer(AnswerKind.SUPERSEDE, outcome='succeeded')


def part(folder, seed, kill_at, expert=None, **settings):
    """Run one trial, or what is left of it, in a process that is killed at an event."""

    def work():
        points, generator = Points(kill_at), random.Random(seed)
        inner = smach.StateMachine(['succeeded', 'aborted'])
        machine = smach.StateMachine(['succeeded', 'aborted'])
        with inner:
            smach.StateMachine.add('GRASP', Chance(generator), {'succeeded': 'LIFT'})
            smach.StateMachine.add('LIFT', Chance(generator))
        with machine:
            smach.StateMachine.add('LOOK', Chance(generator), {'succeeded': 'PICK'})
            smach.StateMachine.add('PICK', inner, {'succeeded': 'PLACE'})
            smach.StateMachine.add('PLACE', Chance(generator))
        OracleContainer.wrap(
            machine,
            name='TOP',
            expert=expert,
            settings=dict(SETTINGS, checkpoint=str(folder / 'robot.db'), **settings),
        )

        def record(event):
            with open(str(folder / 'events'), 'ab') as stream:
                pickle.dump(event, stream)
            points()

        machine._oracle.events.observers.append(record)
        machine.execute()

    told = in_a_process(work)
    assert not told, told['error']


def events_of(folder):
    found = []
    with open(str(folder / 'events'), 'rb') as stream:
        while stream.peek(1):
            found.append(pickle.load(stream))
    return found


@pytest.mark.parametrize('kill_at', range(3, 24, 4))
def test_a_resumed_trial_is_replayed_and_of_what_was_interrupted_nothing_is_known(
    tmp_path, kill_at
):
    part(tmp_path, kill_at, kill_at)
    part(tmp_path, kill_at + 1, 0)
    events = events_of(tmp_path)
    assert EventKind.RESUMED in [event.kind for event in events]
    recorded = what_if.Recorded([events])  # it raises where a rate is another
    counts = what_if.compare(recorded, {}).counts
    assert counts['same'] + counts['not known'] == sum(counts.values())
    if FailureKind.INTERRUPTED in [event.failure_kind for event in events]:
        assert counts['not known'] >= 1


@pytest.mark.parametrize('kill_at', range(3, 16))  # before any of the trials has ended
def test_a_person_who_did_what_was_interrupted_takes_no_failure_back(tmp_path, kill_at):
    part(tmp_path, kill_at, kill_at)
    part(tmp_path, kill_at + 1, 0, ByHand(), on_retry='confirm')
    events = events_of(tmp_path)
    assert [event.kind for event in events].count(EventKind.RESUMED) == 1
    what_if.Recorded([events])  # it raises where a rate is another
