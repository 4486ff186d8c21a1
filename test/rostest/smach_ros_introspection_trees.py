#!/usr/bin/env python3
"""Our introspection server over large and broken trees, through starts and stops, beside others."""

import threading
import time
import unittest

import rosgraph
import rospy
import rostest
from smach_ros_support import LogWatch
from waiting import stays, wait_for

import smach
from smach_common.introspection.plain_pickle import decode_userdata
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from smach_oracle.ros.introspection import IntrospectionServer

STATUS, STRUCTURE = '/smach/container_status', '/smach/container_structure'
VIEWER_QUEUE = 50  # as smach_viewer has it
CALLBACKS = ('_start_cbs', '_transition_cbs', '_termination_cbs')


def steps(count):
    """A machine of so many states, one after the other."""
    machine = smach.StateMachine(outcomes=['done'])
    with machine:
        for number in range(count):
            following = 'S{}'.format(number + 1) if number + 1 < count else 'done'
            smach.StateMachine.add(
                'S{}'.format(number),
                smach.CBState(lambda ud: 'next', outcomes=['next']),
                {'next': following},
            )
    return machine


def around(children):
    """A machine that holds these containers, by label, one after the other."""
    machine = smach.StateMachine(outcomes=['done'])
    labels = list(children)
    with machine:
        for label, following in zip(labels, labels[1:] + ['done']):
            smach.StateMachine.add(label, children[label], {'done': following})
    return machine


def raising(error):
    """An object that cannot be pickled: that raises this."""

    class Raises(object):
        def __reduce__(self):
            raise error

    return Raises()


class SilentError(Exception):
    """Has no text."""

    def __str__(self):
        raise ValueError('no text')


class Mute(smach.StateMachine):
    """Cannot say where it leads."""

    def get_internal_edges(self):
        raise AttributeError('not yet built')


class DrawingViewer:
    """Takes 1 ms for each message, and meanwhile rospy keeps the last fifty of what comes."""

    def __init__(self, name):
        self._paths = set(), set()
        self._subscribers = [
            rospy.Subscriber(name + topic, kind, self._draw, paths, queue_size=VIEWER_QUEUE)
            for topic, kind, paths in (
                (STATUS, SmachContainerStatus, self._paths[0]),
                (STRUCTURE, SmachContainerStructure, self._paths[1]),
            )
        ]

    def _draw(self, message, paths):
        time.sleep(0.001)  # so long it draws
        paths.add(message.path)

    def seen(self):
        """Of how many containers status and structure have come."""
        return tuple(len(paths) for paths in self._paths)

    def forget(self):
        for paths in self._paths:
            paths.clear()

    def leave(self):
        for subscriber in self._subscribers:
            subscriber.unregister()


def published():
    """The topics of this node, as the master knows them."""
    publications, subscriptions, _ = rosgraph.Master('/test').getSystemState()
    return {topic for topic, nodes in publications + subscriptions if rospy.get_name() in nodes}


class TreesTest(unittest.TestCase):
    def setUp(self):
        self.name = '/' + self._testMethodName[5:]
        self.statuses, self.structures = [], []

    def serve(self, machine, name=''):
        server = IntrospectionServer(name or self.name, machine, '/ROOT')
        server.start()
        self.addCleanup(server.stop)
        return server

    def listen(self, name=''):
        name = name or self.name
        subscribers = [
            rospy.Subscriber(
                name + STATUS, SmachContainerStatus, self.statuses.append, queue_size=VIEWER_QUEUE
            ),
            rospy.Subscriber(
                name + STRUCTURE,
                SmachContainerStructure,
                self.structures.append,
                queue_size=VIEWER_QUEUE,
            ),
        ]
        for subscriber in subscribers:
            self.addCleanup(subscriber.unregister)
        self.assertTrue(wait_for(lambda: self.statuses and self.structures))

    def leave(self):
        """As a viewer that goes."""
        self.doCleanups()
        self.statuses, self.structures = [], []

    def told(self, path):
        """What was told of a container, but heartbeats."""
        return [
            status.info
            for status in list(self.statuses)
            if status.path == path and status.info != 'HEARTBEAT'
        ]

    def test_a_viewer_that_draws_each_message_sees_all_of_a_large_tree(self):
        groups = {
            'GROUP{}'.format(number): around({'IN{}'.format(each): steps(3) for each in range(19)})
            for number in range(20)
        }
        self.serve(around(groups))
        drawn = DrawingViewer(self.name)
        self.addCleanup(drawn.leave)
        self.assertTrue(wait_for(lambda: drawn.seen() == (401, 401)), drawn.seen())
        drawn.forget()
        self.assertTrue(wait_for(lambda: drawn.seen() == (401, 401), 20.0), drawn.seen())

    def test_what_cannot_be_shown_hides_nothing_else(self):
        mute = Mute(outcomes=['done'])
        with mute:
            smach.StateMachine.add('X', steps(1), {'done': 'done'})
        odd = smach.StateMachine(outcomes=['done', 'not \ud800 text'])
        with odd:
            smach.StateMachine.add('X', steps(1), {'done': 'done'})
        with LogWatch() as log:
            self.serve(around({'MUTE': mute, 'ODD': odd, 'FINE': steps(1)}))
            self.listen()
            for _ in range(2):  # at the start, and with the heartbeat
                del self.structures[:]
                self.assertTrue(
                    wait_for(
                        lambda: (
                            {'/ROOT', '/ROOT/MUTE/X', '/ROOT/ODD', '/ROOT/FINE'}
                            <= {each.path for each in self.structures}
                        )
                    )
                )
        self.assertIn('/ROOT/MUTE', [each.path for each in self.statuses], 'its status is fine')
        self.assertEqual(log.text().count("cannot show '/ROOT/MUTE'"), 1)

    def test_nothing_in_userdata_silences_the_status(self):
        machine = steps(2)
        machine.userdata.count = 3
        for key, error in (
            ('exits', SystemExit(1)),
            ('ends', GeneratorExit()),
            ('textless', SilentError()),
            ('fails', ValueError('no')),
        ):
            machine.userdata[key] = raising(error)
        with LogWatch() as log:
            self.serve(machine)
            self.listen()
            del self.statuses[:]
            machine.execute()
            self.assertTrue(wait_for(lambda: len(self.told('/ROOT')) == 3))
            self.assertTrue(wait_for(lambda: self.statuses[-1].info == 'HEARTBEAT'))
        for status in self.statuses:
            self.assertEqual(decode_userdata(status.local_data), {'count': 3})
        for key in 'exits', 'ends', 'textless', 'fails':
            self.assertEqual(log.text().count("'{}'".format(key)), 1)

    def test_starts_and_stops_leave_nothing_behind(self):
        machine = around({'IN': steps(2)})
        own = []
        machine.register_start_cb(lambda ud, states: own.append(states))
        topics, callbacks = published(), [list(getattr(machine, name)) for name in CALLBACKS]
        threads = set(threading.enumerate())
        server = IntrospectionServer(self.name, machine, '/ROOT')
        for _ in range(4):
            server.start()
            self.listen()
            machine.execute()
            self.assertTrue(wait_for(lambda: 'TERMINATION done' in self.told('/ROOT')))
            self.assertEqual(self.told('/ROOT/IN'), ['START', 'TRANSITION', 'TERMINATION done'])
            self.leave()
            server.stop()
            server.stop()
            self.assertEqual([list(getattr(machine, name)) for name in CALLBACKS], callbacks)
        self.assertEqual(len(own), 4)
        self.assertTrue(wait_for(lambda: published() == topics), published() - topics)
        self.assertTrue(
            wait_for(
                lambda: (
                    not {each for each in set(threading.enumerate()) - threads if each.is_alive()}
                )
            )
        )

    def test_the_end_is_told_where_the_server_is_stopped_right_after(self):
        for attempt in range(5):
            machine = steps(5)
            server = self.serve(machine, self.name + str(attempt))
            self.listen(self.name + str(attempt))
            machine.execute()
            server.stop()
            self.assertTrue(
                wait_for(lambda: 'TERMINATION done' in self.told('/ROOT'), 10.0), self.told('/ROOT')
            )
            self.leave()

    def test_two_servers_on_one_machine_both_tell_and_one_may_go(self):
        machine = steps(1)
        for first, second in ((self.name, self.name + '_too'), (self.name + 3 * '_',) * 2):
            kept, gone = self.serve(machine, first), self.serve(machine, second)
            self.listen(second)
            machine.execute()
            self.assertTrue(wait_for(lambda: 'TERMINATION done' in self.told('/ROOT')))
            gone.stop()
            del self.statuses[:]
            if first != second:
                self.assertTrue(stays(lambda: not self.statuses, 0.3))
                self.listen(first)
            machine.execute()
            self.assertTrue(wait_for(lambda: 'TERMINATION done' in self.told('/ROOT')))
            self.assertEqual(self.told('/ROOT'), ['START', 'TERMINATION done'])
            self.leave()
            kept.stop()

    def test_a_server_that_begins_while_the_machine_runs_tells_what_follows(self):
        entered, go_on = threading.Event(), threading.Event()

        def wait(ud):
            entered.set()
            go_on.wait(40.0)
            return 'next'

        machine = smach.StateMachine(outcomes=['done'])
        with machine:
            smach.StateMachine.add('A', smach.CBState(wait, outcomes=['next']), {'next': 'B'})
            smach.StateMachine.add('B', steps(1), {'done': 'done'})
        run = threading.Thread(target=machine.execute)
        run.start()
        self.assertTrue(entered.wait(40.0))
        self.serve(machine)
        self.listen()
        self.assertTrue(
            wait_for(lambda: any(list(each.active_states) == ['A'] for each in self.statuses))
        )
        go_on.set()
        run.join(40.0)
        self.assertTrue(wait_for(lambda: self.told('/ROOT') == ['TRANSITION', 'TERMINATION done']))
        self.assertEqual(self.told('/ROOT/B'), ['START', 'TERMINATION done'])

    def test_a_change_of_structure_is_published(self):
        machine = steps(1)
        self.serve(machine)
        self.listen()
        with machine:
            smach.StateMachine.add(
                'LATE', smach.CBState(lambda ud: 'next', outcomes=['next']), {'next': 'S0'}
            )
        self.assertTrue(wait_for(lambda: 'LATE' in self.structures[-1].children))
        latest = self.structures[-1]
        self.assertIn(
            ('next', 'LATE', 'S0'),
            zip(latest.internal_outcomes, latest.outcomes_from, latest.outcomes_to),
        )

    def test_topics_are_remapped_as_any(self):
        self.serve(steps(1), 'remapped')
        self.assertTrue(wait_for(lambda: '/elsewhere/structure' in published()))
        self.assertNotIn('/remapped' + STRUCTURE, published())
        message = rospy.wait_for_message('/elsewhere/structure', SmachContainerStructure, 40.0)
        self.assertEqual(message.path, '/ROOT')


if __name__ == '__main__':
    rospy.init_node('smach_ros_introspection_trees')
    rostest.rosrun('smach_oracle', 'smach_ros_introspection_trees', TreesTest)
