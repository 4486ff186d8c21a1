#!/usr/bin/env python3
"""What a subscriber of ~oracle/events and ~oracle/rates sees, over a real master."""

import sys
import threading
import time
import unittest
from typing import List, NamedTuple

import rospy
from waiting import wait_for

from smach_oracle.msg import NodeTrials, OracleEvent, OracleRates
from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.publishers import EventPublisher, RatesPublisher
from smach_oracle.ros.trials.trials_publisher import TrialsPublisher


class FakeRow(NamedTuple):
    path: str
    state: str
    rate: float
    failure_class: int
    successes: int
    failures: int
    recoveries: int
    has_preconditions: bool


class FakeContainer:
    """A wrapped machine as the publishers see it."""

    def __init__(self) -> None:
        self.events = EventSource(rospy.logerr)
        self.trial_id = 'trial-1'
        self.visits = 0

    def rates(self) -> List[FakeRow]:
        return [FakeRow('TOP', 'PICK', 0.1, 1, self.visits, 0, 0, False)]

    def transition_counts(self) -> List[tuple]:
        return [('TOP', 'PICK', 'succeeded', 'PLACE', self.visits)]

    def step(self) -> None:
        self.visits += 1
        self.events.emit(EventKind.TRANSITION, 'TOP', state='PICK')


class PublishersTest(unittest.TestCase):
    def setUp(self) -> None:
        self.machine = FakeContainer()

    def subscribe(self, topic: str, kind: type, **options: object) -> list:
        messages: list = []
        subscriber = rospy.Subscriber(topic, kind, messages.append, **options)
        self.addCleanup(subscriber.unregister)
        return messages

    def test_events_arrive_in_order_without_a_gap(self) -> None:
        publisher = EventPublisher()
        self.addCleanup(publisher.close)
        received = self.subscribe('~oracle/events', OracleEvent)
        self.assertTrue(wait_for(lambda: publisher._publisher.get_num_connections() == 1))
        self.machine.events.observers.append(publisher)
        self.machine.events.begin_trial('trial-1')
        for _ in range(500):
            self.machine.step()
        self.assertTrue(wait_for(lambda: len(received) == 500), len(received))
        self.assertEqual([event.seq for event in received], list(range(500)))
        self.assertGreater(received[0].header.stamp.to_sec(), 0.0)

    def test_a_subscriber_that_hangs_does_not_hold_the_machine_and_sees_the_gap(self) -> None:
        publisher = EventPublisher('~oracle/narrow', queue_size=5)
        self.addCleanup(publisher.close)
        go_on = threading.Event()
        received = []

        def slow(event: OracleEvent) -> None:
            go_on.wait(20.0)
            received.append(event)

        subscriber = rospy.Subscriber('~oracle/narrow', OracleEvent, slow, buff_size=1024)
        self.addCleanup(subscriber.unregister)
        self.assertTrue(wait_for(lambda: publisher._publisher.get_num_connections() == 1))
        source = self.machine.events
        source.observers.append(publisher)
        source.begin_trial('trial-1')
        started = time.monotonic()
        for _ in range(300):  # 30 MB: far more than the sockets in between hold
            source.emit(EventKind.WARNING, 'TOP', text='x' * 100000)
        self.assertLess(time.monotonic() - started, 10.0)
        go_on.set()
        self.assertTrue(wait_for(lambda: bool(received) and received[-1].seq == 299, 20.0))
        self.assertLess(len(received), 300)

    def test_rates_are_latched_and_published_at_most_five_times_a_second(self) -> None:
        publisher = RatesPublisher()
        self.addCleanup(publisher.close)
        early = self.subscribe('~oracle/rates', OracleRates)
        publisher.watch(self.machine)
        self.assertTrue(wait_for(lambda: len(early) == 1), 'not published when first watched')
        started = time.monotonic()
        while time.monotonic() - started < 1.5:
            self.machine.step()
            time.sleep(0.001)  # the pace of a brisk machine
        self.assertTrue(wait_for(lambda: early[-1].states[0].successes == self.machine.visits))
        elapsed_s = time.monotonic() - started
        self.assertLessEqual(len(early), 2 + elapsed_s / 0.2)
        self.assertGreater(len(early), 2)
        late = self.subscribe('~oracle/rates', OracleRates)
        self.assertTrue(wait_for(lambda: len(late) == 1), 'not latched')
        self.assertEqual(late[0].transitions[0].count, self.machine.visits)

    def test_rates_are_published_at_once_when_a_trial_ends(self) -> None:
        publisher = RatesPublisher('~oracle/rates_at_end', period_s=3600.0)
        self.addCleanup(publisher.close)
        received = self.subscribe('~oracle/rates_at_end', OracleRates)
        self.assertTrue(wait_for(lambda: publisher._publisher.get_num_connections() == 1))
        publisher.watch(self.machine)
        self.machine.step()
        self.machine.events.emit(EventKind.TRIAL_END, 'TOP', outcome='succeeded')
        self.assertTrue(
            wait_for(lambda: len(received) == 1 and received[0].states[0].successes == 1)
        )

    def test_who_comes_late_hears_which_trial_runs_and_its_counts(self) -> None:
        publisher = TrialsPublisher(period_s=0.01)
        source = self.machine.events
        publisher.watch('TOP', source)
        nobody_yet = self.subscribe('~oracle/trials', NodeTrials)
        for trial in ('trial-1', 'trial-2'):
            source.begin_trial(trial)
            source.emit(EventKind.TRIAL_START, 'TOP')
            source.emit(EventKind.FAILURE, 'TOP', state='PICK')
            source.emit(EventKind.QUERY_OPENED, 'TOP', state='PICK', query_id=trial)
            if trial == 'trial-1':
                source.emit(EventKind.TRIAL_END, 'TOP', outcome='aborted')

        def told() -> tuple:
            found = nobody_yet[-1].trials[0]
            return found.trial_id, found.nth, found.failures, found.questions, found.running

        self.assertTrue(
            wait_for(lambda: nobody_yet and told() == ('trial-2', 2, 1, 1, True)), nobody_yet
        )
        late = self.subscribe('~oracle/trials', NodeTrials)
        self.assertTrue(wait_for(lambda: len(late) == 1), 'not latched')
        self.assertEqual(late[0].trials, nobody_yet[-1].trials)
        source.emit(EventKind.TRIAL_END, 'TOP', outcome='succeeded')
        self.assertTrue(wait_for(lambda: not late[-1].trials[0].running))
        self.assertEqual((late[-1].trials[0].ending, late[-1].trials[0].seq), ('success', 3))

    def test_a_machine_that_is_gone_is_forgotten(self) -> None:
        publisher = RatesPublisher('~oracle/rates_of_nobody', period_s=0.01)
        self.addCleanup(publisher.close)
        observer = publisher.watch(self.machine)
        self.machine = None
        observer(_end_event())
        self.assertIsNone(observer._machine())


def _end_event() -> object:
    events: list = []
    source = EventSource(rospy.logerr)
    source.observers.append(events.append)
    source.emit(EventKind.TRIAL_END, 'TOP')
    return events[0]


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_publishers')
    rostest.rosrun('smach_oracle', 'oracle_publishers', PublishersTest, sys.argv)
