"""The way to where a trial stands: what a console derives from events is what the executive itself
knows, or says what is not known.
"""

import os
import random
import signal

import pytest
from killed_machines import in_a_process

import smach
from smach_oracle.expert.console.feeds.views import event_of
from smach_oracle.expert.console.trials.ways import (
    MOST_LEVELS,
    MOST_TRIALS,
    MOST_VISITS,
    TrialWay,
    TrialWays,
)
from smach_oracle.msg import OracleEvent
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert
from smach_oracle.oracle.machine.places import nodes_of_tree
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.ros.event_messages import to_msg

OUTCOMES = ['succeeded', 'aborted', 'preempted']


class Chancy(smach.State):
    """Fails with a chance."""

    def __init__(self, draw, share):
        smach.State.__init__(self, OUTCOMES)
        self._draw, self._share = draw, share

    def execute(self, ud):
        return 'aborted' if self._draw.random() < self._share else 'succeeded'


def machine(draw, share, depth):
    """States one after the other, one of which is such a machine, down to a depth. Half of them
    are in a Concurrence.
    """
    sm = smach.StateMachine(OUTCOMES)
    labels = ['A', 'B', 'C', 'D']
    nested = draw.choice(labels) if depth else ''
    with sm:
        for label, following in zip(labels, labels[1:] + ['succeeded']):
            state = Chancy(draw, share)
            if label == nested:
                state = machine(draw, share, depth - 1)
                if draw.random() < 0.5:
                    state = beside(state)
            smach.StateMachine.add(label, state, {'succeeded': following})
    return sm


def beside(state):
    """A Concurrence with a single branch, so that the draws come in one order."""
    both = smach.Concurrence(
        OUTCOMES, default_outcome='aborted', outcome_map={'succeeded': {'X': 'succeeded'}}
    )
    with both:
        smach.Concurrence.add('X', state)
    return both


class Comparing(Expert):
    """Compares what the executive knows at each question with what a console has derived."""

    def __init__(self, draw, events, told):
        self._draw, self._events, self._told = draw, events, told
        self.top = None
        self.compared = 0
        self.missing = []  # of all levels that were shown
        self.wrong = []  # an assertion in the thread that asks would be lost

    def ask(self, question, cancelled, progress):
        levels = self._told().above(self._events[-1].trial_id, question.container_path)
        nodes = {node.path: node for node in nodes_of_tree(self.top) if node.site.is_container}
        for level in levels:
            self.missing.append(level.missing)
            node = nodes.get(level.path)
            if node is None:  # a Concurrence, whose branches have visits of their own
                continue
            known = list(node.records.history.visits)
            shown = list(level.visits)
            whole = {'': shown == known, 'older': shown == known[-MOST_VISITS:]}
            if not whole.get(level.missing, shown == known[len(known) - len(shown) :]):
                self.wrong.append((level, known))
            self.compared += len(shown)
        states = [choice.state for choice in question.choices if not choice.container]
        elsewhere = [choice for choice in question.choices if choice.container]
        kind = self._draw.choice(['goto', 'above', 'supersede', 'give_up'])
        if kind == 'above' and elsewhere:
            chosen = self._draw.choice(elsewhere)
            return Answer(AnswerKind.GOTO, state=chosen.state, container=chosen.container, by='ann')
        if kind == 'supersede':
            return Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='ann')
        if kind == 'give_up':
            return Answer(AnswerKind.GIVE_UP, by='ann')
        return Answer(AnswerKind.GOTO, state=self._draw.choice(states), by='ann')


def run(seed, lost=lambda seq: False, trials=6):
    """Trials of a drawn machine. Return the expert, and the events as a console takes them in.

    `lost`: whether the console does not hear the event of a number.
    """
    draw = random.Random(seed)
    events, told = [], TrialWays()

    def observe(event):
        events.append(event_of(to_msg(event)))
        if not lost(event.seq):
            told.add(events[-1])

    sm = machine(draw, 0.3, depth=3)
    oracle = OracleContainer.wrap(sm, name='TASK', settings={'policy': 'always_ask'})
    oracle.events.observers.append(observe)
    expert = oracle.expert = Comparing(draw, events, lambda: told)
    expert.top = oracle._oracle
    for _ in range(trials):
        oracle.execute()
    return expert, events


@pytest.mark.parametrize('seed', range(12))
def test_the_way_is_that_which_the_executive_knows(seed):
    expert, _ = run(seed)
    assert not expert.wrong
    assert expert.compared > 5
    assert 'unheard' not in expert.missing


@pytest.mark.parametrize('seed', range(12))
@pytest.mark.parametrize('missing', [5, 17, 60])
def test_after_lost_events_it_is_right_or_said_not_to_be_known(seed, missing):
    for lost in (lambda seq: missing <= seq < missing + 3, lambda seq: seq < missing):
        assert not run(seed, lost=lost)[0].wrong


def test_once_events_are_lost_the_way_is_not_known_until_a_container_begins_anew():
    told = [run(seed, lost=lambda seq: seq in (5, 6))[0].missing for seed in range(12)]
    found = [missing for each in told for missing in each]
    assert found.count('unheard') > 20
    assert found.count('') > 20, 'it is known again later'


def nested():
    """A, then F with X and Y, of which Y kills its process, or fails where that was done."""
    inner = smach.StateMachine(OUTCOMES)
    with inner:
        smach.StateMachine.add('X', Chancy(random.Random(1), 0.0), {'succeeded': 'Y'})
        smach.StateMachine.add('Y', smach.CBState(lambda ud: 'aborted', outcomes=OUTCOMES))
    sm = smach.StateMachine(OUTCOMES)
    with sm:
        smach.StateMachine.add('A', Chancy(random.Random(1), 0.0), {'succeeded': 'F'})
        smach.StateMachine.add('F', inner)
    return sm


def events_of_process(folder, kills):
    """Run it in a process of its own, which is killed as it enters Y, or gives up there. Return the
    events that it had told before it was asked, or killed.
    """
    path = str(folder / 'events')
    open(path, 'w').close()

    class Written(Expert):
        def ask(self, question, cancelled, progress):
            os.rename(path, path + '.asked')
            return Answer(AnswerKind.GIVE_UP, by='ann')

    def work():
        oracle = OracleContainer.wrap(
            nested(),
            name='TASK',
            settings={'policy': 'always_ask', 'checkpoint': str(folder / 'robot.db')},
            expert=Written(),
        )

        def observe(event):
            with open(path, 'ab') as stream:
                to_msg(event).serialize(stream)
                stream.write(b'|END|')
            if kills and (event.kind, event.state) == (EventKind.STATE_START, 'Y'):
                os.kill(os.getpid(), signal.SIGKILL)

        oracle.events.observers.append(observe)
        oracle.execute()

    in_a_process(work)
    with open(path if kills else path + '.asked', 'rb') as stream:
        told = stream.read().split(b'|END|')[:-1]
    return [event_of(OracleEvent().deserialize(each)) for each in told]


@pytest.mark.parametrize('heard', ['all', 'second', 'without RESUMED', 'with a gap'])
def test_a_trial_that_goes_on_after_a_kill_has_the_way_from_before(tmp_path, heard):
    before, after = events_of_process(tmp_path, True), events_of_process(tmp_path, False)
    assert after[0].kind is EventKind.RESUMED
    told = {
        'all': before + after,
        'second': after,
        'without RESUMED': before + after[1:],
        'with a gap': before[:-3] + after,
    }[heard]
    way = TrialWay()
    for event in told:
        way.add(event)
    (level,) = way.above('TASK/F')
    visits = [visit.state for visit in level.visits]
    assert (level.state, visits, level.missing) == (
        ('F', ['A'], '') if heard == 'all' else ('F', [], 'unheard')
    )


def test_what_is_kept_is_bounded():
    told = TrialWays()
    for trial in range(MOST_TRIALS + 5):
        told.add(Event(EventKind.TRIAL_START, 't%d' % trial, 0, 1.0, 'T'))
        told.add(Event(EventKind.CONTAINER_START, 't%d' % trial, 1, 1.0, 'T'))
    assert told.above('t4', 'T/F')[0].missing == 'unheard'
    assert told.above('t5', 'T/F')[0].missing == ''
    for seq in range(2, 2 + 2 * (MOST_VISITS + 10), 2):
        told.add(Event(EventKind.STATE_START, 't9', seq, 1.0, 'T', 'S' * 5000))
        told.add(Event(EventKind.TRANSITION, 't9', seq + 1, 1.0, 'T', 'S' * 5000, 'done', 'B'))
    (level,) = told.above('t9', 'T/F')
    assert (len(level.visits), level.missing) == (MOST_VISITS, 'older')
    assert max(len(visit.state) for visit in level.visits) < 300
    for depth in range(1000):
        told.add(Event(EventKind.CONTAINER_START, 't10', depth + 2, 1.0, 'T' + '/F' * depth))
    deep = told.above('t10', 'T' + '/F' * 900)
    assert len(deep) == MOST_LEVELS
    assert told.above('t10', '') == []
