#!/usr/bin/env python3
"""A stop reaches the robot while the ROS master is dead, hangs or is another one: from the console
and from the terminal. A master and nodes of its own. No browser.
"""

import json
import os
import socket
import sys
import threading
import time
import unittest
import urllib.request

import rospy
import rostest
import tornado.httpclient
import tornado.ioloop
import tornado.websocket

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from expert_fixtures import Process, start_master
from waiting import stays, wait_for

from smach_oracle.experiment.launching import free_port
from smach_oracle.expert.repeating import repeat
from smach_oracle.expert.stop_calls import StopCalls
from smach_oracle.expert.terminal.operator_commands import OperatorCommands
from smach_oracle.msg import ControlStatus
from smach_oracle.ros.master_watch import start_master_watch

ROBOT = '/alpha'
MACHINE = 'KITCHEN'
# a master that hangs is noticed after 5 s. What is logged then must not wait for it either
NOTICED_S = 8.0
PROMPT_S = 4.0  # a stop from the terminal may ask the master for 2 s
HERE = os.path.dirname(os.path.abspath(__file__))


class StopWithoutMaster(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.master_port, cls.port = free_port(), free_port()
        os.environ['ROS_MASTER_URI'] = 'http://localhost:{}'.format(cls.master_port)
        cls.master = start_master(cls.master_port)
        cls.console = Process.installed(
            'expert_console', '_port:={}'.format(cls.port), '__name:=expert_console'
        )
        cls.robot = Process(
            sys.executable,
            os.path.join(HERE, 'console_robot.py'),
            'PICK',
            '0.1',
            '0',
            '9',
            '__name:=alpha',
        )
        rospy.init_node('stop_without_master', disable_signals=True)
        start_master_watch()  # as the terminal does
        cls.machines = []
        rospy.Subscriber(
            ROBOT + '/oracle/control',
            ControlStatus,
            lambda message: setattr(cls, 'machines', message.machines),
        )
        cls.stop_calls = StopCalls()
        cls.terminal = OperatorCommands('ann', stop_calls=cls.stop_calls)
        repeat(cls.terminal.look_up, 0.5)

    @classmethod
    def tearDownClass(cls):
        for process in (cls.robot, cls.console, cls.master):
            process.kill()

    def setUp(self):
        """All know each other, and the machine runs."""
        self.assertTrue(wait_for(lambda: [each.path for each in self.machines] == [MACHINE], 40.0))
        self.assertTrue(wait_for(lambda: self.stop_calls.address_of(ROBOT)))
        self.assertTrue(wait_for(self.page_is_served, 40.0))
        self.assertTrue(wait_for(lambda: self.console_says('resume_machine')['ok'], 40.0))
        self.assertTrue(wait_for(lambda: not self.machines[0].paused))

    def page_is_served(self):
        with socket.socket() as probe:
            return probe.connect_ex(('127.0.0.1', self.port)) == 0

    def console_says(self, command):
        """What the console answers to a page, within 30 s."""
        return tornado.ioloop.IOLoop().run_sync(lambda: self.ask_console(command), 30)

    async def ask_console(self, command):
        page = 'http://localhost:{}/'.format(self.port)
        with urllib.request.urlopen(page + 'session', timeout=20) as reply:
            session = json.loads(reply.read().decode())
            cookie = reply.headers['Set-Cookie'].split(';')[0]
        page_socket = await tornado.websocket.websocket_connect(
            tornado.httpclient.HTTPRequest(
                page.replace('http', 'ws', 1) + 'socket',
                headers={'Origin': page.rstrip('/'), 'Cookie': cookie},
            )
        )
        beat, message = None, {}
        await page_socket.write_message(
            json.dumps({'do': 'hello', 'xsrf': session['xsrf'], 'expert': 'bob', 'id': 1})
        )
        while beat is None:
            message = json.loads(await page_socket.read_message())
            beat = message.get('sections', {}).get('heard', {}).get('beat')
        await page_socket.write_message(
            json.dumps(
                dict(
                    {'do': command, 'robot': ROBOT, 'path': MACHINE, 'id': 2},
                    **({'seen': beat} if command == 'resume_machine' else {}),
                )
            )
        )
        while message.get('re') != 2:
            message = json.loads(await page_socket.read_message())
        page_socket.close()
        return message

    def check_that_both_stop_it(self):
        """Each in its turn: the console pauses it, and the terminal stops it."""
        reply = self.console_says('pause_machine')
        self.assertTrue(reply['ok'], reply)
        self.assertIn(MACHINE + ' is paused', reply['message'])
        self.assertTrue(wait_for(lambda: self.machines[0].paused_by == 'bob'), 'the robot says so')
        asked_s = time.monotonic()
        ((text, style),) = self.terminal.carry_out('preempt')
        self.assertEqual(style, 'green', text)
        self.assertIn(MACHINE + ' is asked to stop', text)
        self.assertLess(time.monotonic() - asked_s, PROMPT_S)
        self.assertTrue(wait_for(lambda: not self.machines[0].paused), 'a preempt ends the pause')
        ((text, style),) = self.terminal.carry_out('pause ' + ROBOT)
        self.assertEqual(style, 'green', text)
        self.assertTrue(wait_for(lambda: self.machines[0].paused_by == 'ann'))

    def test_1_while_the_master_is_dead_and_when_another_one_is_there(self):
        self.master.kill()
        try:
            self.assertTrue(stays(lambda: self.machines, NOTICED_S))
            self.check_that_both_stop_it()
            ((text, style),) = self.terminal.carry_out('resume')
            self.assertEqual(
                (style, text.startswith('resume: the master does not answer')),
                ('red', True),
                'what lets go is refused',
            )
        finally:
            type(self).master = start_master(self.master_port)
        # the robot may not be known there yet
        self.assertEqual(self.terminal.carry_out('pause')[0][1], 'green')
        self.assertTrue(self.console_says('pause_machine')['ok'])

    def test_2_while_the_master_hangs(self):
        self.master.freeze()
        try:
            self.assertTrue(stays(lambda: self.machines, NOTICED_S))
            rest = threading.Thread(target=rospy.logwarn, args=('A line of the log.',), daemon=True)
            rest.start()
            rest.join(1.0)
            self.assertFalse(rest.is_alive(), 'a line of the log waits for no master')
            self.check_that_both_stop_it()
        finally:
            self.master.thaw()


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'stop_without_master', StopWithoutMaster)
