#!/usr/bin/env python3
"""Our introspection server over real topics, as a viewer and smach_ros's client see it."""

import base64
import pickle
import subprocess
import threading
import unittest
from unittest import mock

import rospy
import rostest
from smach_ros_support import InBackground, LogWatch, userdata
from waiting import stays, wait_for

import smach
from smach_common.introspection import introspection_server
from smach_common.introspection.introspection_server import IntrospectionServer
from smach_common.introspection.plain_pickle import decode_userdata
from smach_msgs.msg import (
    SmachContainerInitialStatusCmd,
    SmachContainerStatus,
    SmachContainerStructure,
)
from smach_ros import IntrospectionClient

MD5 = {
    SmachContainerStatus: '5ba2bb79ac19e3842d562a191f2a675b',
    SmachContainerStructure: '3d3d1e0d0f99779ee9e58101a5dcf7ea',
    SmachContainerInitialStatusCmd: '45f8cf31fc29b829db77f23001f788d6',
}


class Touched(object):
    """Its pickle would set off an alarm in whoever loads it."""

    alarms = []

    def __reduce__(self):
        return eval, ("__import__('smach_ros_introspection').Touched.alarms.append(1)",)


class Step(smach.State):
    """Ends with 'next' after the machine's gate opens."""

    def __init__(self, gate=None, visits=None, label=''):
        smach.State.__init__(self, outcomes=['next'])
        self.gate, self.visits, self.label = gate, visits, label

    def execute(self, ud):
        if self.visits is not None:
            self.visits.append(self.label)
        if self.gate is not None:
            self.gate.acquire(timeout=60)
        return 'next'


def machine_with_inner(gate=None, visits=None):
    """OUTER: A -> IN (machine of X -> Y) -> B -> done."""
    outer = smach.StateMachine(outcomes=['done'])
    inner = smach.StateMachine(outcomes=['next'])
    with inner:
        smach.StateMachine.add('X', Step(gate, visits, 'X'), {'next': 'Y'})
        smach.StateMachine.add('Y', Step(gate, visits, 'Y'))
    with outer:
        smach.StateMachine.add('A', Step(gate, visits, 'A'), {'next': 'IN'})
        smach.StateMachine.add('IN', inner, {'next': 'B'})
        smach.StateMachine.add('B', Step(gate, visits, 'B'), {'next': 'done'})
    return outer, inner


class IntrospectionTest(unittest.TestCase):
    def setUp(self):
        self.name = self._testMethodName[5:]
        self.statuses, self.structures = [], []

    def serve(self, machine):
        server = IntrospectionServer(self.name, machine, '/ROOT')
        server.start()
        self.addCleanup(server.stop)
        return server

    def listen(self):
        subscribers = [
            rospy.Subscriber(
                self.name + '/smach/container_status', SmachContainerStatus, self.statuses.append
            ),
            rospy.Subscriber(
                self.name + '/smach/container_structure',
                SmachContainerStructure,
                self.structures.append,
            ),
        ]
        for subscriber in subscribers:
            self.addCleanup(subscriber.unregister)
        self.assertTrue(wait_for(lambda: self.statuses and self.structures))
        return subscribers

    def active_states_of(self, path):
        return [
            tuple(status.active_states)
            for status in list(self.statuses)
            if status.path == path and status.info not in ('HEARTBEAT', 'REMOTE_INIT')
        ]

    def command(self, path, labels, local_data=''):
        publisher = rospy.Publisher(
            self.name + '/smach/container_init', SmachContainerInitialStatusCmd, queue_size=5
        )
        self.addCleanup(publisher.unregister)
        self.assertTrue(wait_for(publisher.get_num_connections))
        publisher.publish(path, labels, local_data)

    def test_messages_are_wire_compatible(self):
        for message, md5 in MD5.items():
            self.assertEqual(message._md5sum, md5)
            self.assertEqual(message._type, 'smach_msgs/' + message.__name__)

    def test_new_viewer_is_told_the_whole_tree_at_once(self):
        def knows_the_tree():
            return {message.path for message in self.structures} == {'/ROOT', '/ROOT/IN'}

        self.serve(machine_with_inner()[0])
        first = self.listen()
        self.assertTrue(wait_for(knows_the_tree), 'what is told of at the start')
        for subscriber in first:
            subscriber.unregister()
        self.statuses, self.structures = [], []
        self.listen()
        self.assertTrue(wait_for(knows_the_tree, 1.5))
        top = [message for message in self.structures if message.path == '/ROOT'][0]
        self.assertEqual(sorted(top.children), ['A', 'B', 'IN'])
        edges = set(zip(top.internal_outcomes, top.outcomes_from, top.outcomes_to))
        self.assertEqual(edges, {('next', 'A', 'IN'), ('next', 'IN', 'B'), ('next', 'B', 'done')})
        self.assertEqual(list(top.container_outcomes), ['done'])

    def test_a_viewer_that_hangs_does_not_pile_up_large_userdata(self):
        machine = smach.StateMachine(outcomes=['done'])
        machine.userdata.image = b'x' * 300000
        with machine:
            for number in range(60):
                smach.StateMachine.add(
                    str(number), Step(), {'next': str(number + 1) if number < 59 else 'done'}
                )
        read = threading.Event()
        with mock.patch.object(introspection_server, 'BACKLOG_BYTES', 3000000), LogWatch() as log:
            server = self.serve(machine)
            viewer = rospy.Subscriber(
                self.name + '/smach/container_status',
                SmachContainerStatus,
                lambda message: (read.wait(30), self.statuses.append(message)),
                buff_size=1000,
            )
            self.addCleanup(viewer.unregister)
            self.assertTrue(wait_for(server._status_pub.is_heard))
            machine.execute()
            self.assertTrue(wait_for(lambda: not server._changes))
            self.assertTrue(stays(lambda: server._waiting_bytes() < 4000000, 0.2))
        self.assertIn('does not keep up', log.text())
        read.set()
        self.assertTrue(
            wait_for(lambda: any(status.info.startswith('TERM') for status in self.statuses))
        )
        labels = [
            status.active_states[0] for status in self.statuses if status.info == 'TRANSITION'
        ]
        self.assertEqual(labels, [str(number) for number in range(1, 60)])
        self.assertIn('image', decode_userdata(self.statuses[0].local_data))

    def test_every_change_of_state_is_published_in_order(self):
        machine, _ = machine_with_inner()
        self.serve(machine)
        self.listen()
        for _ in range(20):
            machine.execute()
        expected = [('A',), ('IN',), ('B',), ('None',)] * 20
        self.assertTrue(wait_for(lambda: len(self.active_states_of('/ROOT')) >= len(expected)))
        self.assertEqual(self.active_states_of('/ROOT'), expected)
        self.assertEqual(self.active_states_of('/ROOT/IN'), [('X',), ('Y',), ('None',)] * 20)

    def test_heartbeat_comes_every_two_seconds(self):
        self.serve(machine_with_inner()[0])
        self.listen()

        def heartbeats():
            return [status for status in self.statuses if status.path == '/ROOT']

        self.assertTrue(wait_for(lambda: len(heartbeats()) >= 3))
        gap_s = (heartbeats()[-1].header.stamp - heartbeats()[-2].header.stamp).to_sec()
        self.assertAlmostEqual(gap_s, 2.0, delta=1.0)

    def test_states_added_later_appear(self):
        machine, _ = machine_with_inner()
        self.serve(machine)
        self.listen()
        late = smach.StateMachine(outcomes=['next'])
        with late:
            smach.StateMachine.add('Z', Step())
        with machine:
            smach.StateMachine.add('LATE', late, {'next': 'done'})
        self.assertTrue(
            wait_for(lambda: any(message.path == '/ROOT/LATE' for message in self.structures))
        )

    def test_userdata_that_cannot_be_pickled_is_left_out_and_named_once(self):
        machine, _ = machine_with_inner()
        machine.userdata.count = 3
        machine.userdata.lock = threading.Lock()
        with LogWatch() as log:
            self.serve(machine)
            self.listen()
            machine.execute()
            self.assertTrue(wait_for(lambda: ('None',) in self.active_states_of('/ROOT')))
        for status in self.statuses:
            if status.path == '/ROOT':
                self.assertEqual(decode_userdata(status.local_data), {'count': 3})
                self.assertEqual(pickle.loads(base64.b64decode(status.local_data)), {'count': 3})
        self.assertEqual(log.text().count("'lock'"), 1)

    def test_one_thread_serves_the_whole_tree_and_stop_ends_it(self):
        machine = smach.StateMachine(outcomes=['done'])
        with machine:
            for i in range(10):
                inner = smach.StateMachine(outcomes=['done'])
                with inner:
                    smach.StateMachine.add('X', Step(), {'next': 'done'})
                smach.StateMachine.add('IN%d' % i, inner)
        server = IntrospectionServer(self.name, machine, '/ROOT')

        def ours():
            return [t for t in threading.enumerate() if t.name == 'introspection ' + self.name]

        server.start()
        server.start()
        self.assertEqual(len(ours()), 1)
        server.stop()
        self.assertEqual(len(ours()), 0)
        server.start()
        self.addCleanup(server.stop)
        self.listen()
        machine.execute()
        self.assertTrue(wait_for(lambda: len(self.active_states_of('/ROOT')) == 2))
        self.assertEqual(self.active_states_of('/ROOT'), [('IN0',), ('None',)])

    def test_client_sets_where_an_idle_machine_starts_and_with_what(self):
        visits = []
        machine, inner = machine_with_inner(visits=visits)
        self.serve(machine)
        client = IntrospectionClient()
        self.assertIn('/' + self.name, client.get_servers())
        self.assertTrue(
            client.set_initial_state(
                self.name, '/ROOT', ['B'], userdata(x=b'5'), rospy.Duration(30.0)
            )
        )
        machine.execute()
        self.assertEqual((visits, machine.userdata.x), (['B'], b'5'))
        self.assertTrue(
            client.set_initial_state(self.name, '/ROOT/IN', ['Y'], timeout=rospy.Duration(30.0))
        )
        self.assertEqual(inner.get_initial_states(), ['Y'])
        confirmed = []
        with LogWatch() as log:
            self.assertTrue(
                wait_for(
                    lambda: (
                        confirmed.append(
                            client.set_initial_state(
                                self.name, '/ROOT', ['NOWHERE'], timeout=rospy.Duration(1.0)
                            )
                        )
                        or 'NOWHERE' in log.text()
                    )
                )
            )
        self.assertFalse(any(confirmed))
        self.assertFalse(
            client.set_initial_state(self.name, '/ELSEWHERE', ['A'], timeout=rospy.Duration(0.3))
        )

    def test_running_machine_goes_there_at_its_next_transition(self):
        gate, visits = threading.Semaphore(0), []
        machine, _ = machine_with_inner(gate, visits)
        self.serve(machine)
        run = InBackground(machine)
        self.assertTrue(wait_for(lambda: visits == ['A']))
        self.assertTrue(
            IntrospectionClient().set_initial_state(
                self.name, '/ROOT', ['B'], userdata(y=1), rospy.Duration(30.0)
            )
        )
        gate.release(5)
        self.assertEqual(run.outcome(), 'done')
        self.assertEqual((visits, machine.userdata.y), (['A', 'B'], 1))

    def test_pickle_that_names_code_is_refused_and_logged(self):
        machine, _ = machine_with_inner()
        self.serve(machine)
        evil = base64.b64encode(pickle.dumps({'x': Touched()}, 2)).decode()
        with LogWatch() as log:
            self.command('/ROOT', ['B'], evil)
            self.assertTrue(wait_for(lambda: 'refused' in log.text()))
        self.assertIn('eval', log.text())
        self.assertEqual(Touched.alarms, [])
        self.assertEqual(machine.get_initial_states(), ['A'])

    def test_command_line_tools_show_the_messages(self):
        self.assertIn(
            'string local_data',
            subprocess.check_output(['rosmsg', 'show', 'smach_msgs/SmachContainerStatus']).decode(),
        )
        self.serve(machine_with_inner()[0])
        self.assertIn(
            'path: "/ROOT',
            subprocess.check_output(
                ['rostopic', 'echo', '-n', '1', '/%s/smach/container_structure' % self.name],
                timeout=20,
            ).decode(),
        )

    def test_machine_with_a_server_can_still_be_pickled(self):
        machine = smach.StateMachine(outcomes=['next'])
        with machine:
            smach.StateMachine.add('ONLY', Step())
        self.serve(machine)
        self.assertEqual(pickle.loads(pickle.dumps(machine)).execute(), 'next')


if __name__ == '__main__':
    rospy.init_node('smach_ros_introspection')
    rostest.rosrun('smach_oracle', 'smach_ros_introspection', IntrospectionTest)
