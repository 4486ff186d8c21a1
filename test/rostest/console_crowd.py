#!/usr/bin/env python3
"""A crowd without a token stops nobody who has one: 1,100 idle connections at the usual limit on
files, requests that come byte by byte, and wrong tokens from many addresses. A person signs in,
claims and answers among them.
"""

import http.client
import json
import os
import resource
import socket
import sys
import time
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage, Node
from roslib.packages import find_node
from waiting import wait_for

from smach_oracle.msg import OracleEvent

USUAL_FILES = 1024
CROWD = 1100
DRIPPING = 120
DRIPS_S = 30.0  # the console gives a body 10 s
ADDRESSES = ['127.0.0.{}'.format(number) for number in range(1, 41)]
GO_TO_PLACE = '.choice.goto[data-name=PLACE]'


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Crowd(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(4 * CROWD, most), most))
        cls.folder = cls.make_folder()
        cls.tokens = os.path.join(cls.folder, 'tokens')
        cls.events = []
        rospy.Subscriber('/alpha/oracle/events', OracleEvent, cls.events.append)
        cls.begin('console_robot.py', 'PICK', '0.05', '0', '1')

    @classmethod
    def start_console(cls, *more):
        return Node(
            'prlimit',
            '--nofile={0}:{0}'.format(USUAL_FILES),
            find_node('smach_oracle', 'expert_console')[0],
            '_port:={}'.format(cls.port),
            '__name:=expert_console',
            '_token_file:=' + cls.tokens,
            *more,
        )

    def crowd(self):
        """Open them all; those that the console closes are let go of."""
        for number in range(CROWD):
            line = socket.create_connection(
                ('127.0.0.1', self.port), 20.0, (ADDRESSES[number % len(ADDRESSES)], 0)
            )
            self.addCleanup(line.close)

    def guess(self, address):
        """Four wrong tokens."""
        line = http.client.HTTPConnection('127.0.0.1', self.port, 20.0, (address, 0))
        self.addCleanup(line.close)
        line.request('GET', '/session')
        answer = line.getresponse()
        xsrf = json.loads(answer.read())['xsrf']
        headers = {
            'Cookie': answer.getheader('Set-Cookie').split(';')[0],
            'X-Xsrf': xsrf,
            'Origin': 'http://127.0.0.1:{}'.format(self.port),
        }
        headers['Host'] = '127.0.0.1:{}'.format(self.port)
        codes = set()
        for _ in range(4):
            line.request('POST', '/session', json.dumps({'token': 'guess'}), headers)
            answer = line.getresponse()
            answer.read()
            codes.add(answer.status)
        return codes

    def drip(self):
        """Requests that come byte by byte. Calling adds one each, and tells how many are left."""
        lines = []
        begun = b'POST /session HTTP/1.1\r\nHost: localhost\r\nContent-Length: 999\r\n\r\n{'
        for number in range(DRIPPING):
            address = (ADDRESSES[number % len(ADDRESSES)], 0)
            lines.append(socket.create_connection(('127.0.0.1', self.port), 20.0, address))
            self.addCleanup(lines[-1].close)
            lines[-1].sendall(begun)

        def left():
            for line in list(lines):
                try:
                    line.sendall(b'.')
                except OSError:
                    lines.remove(line)
            return len(lines)

        return left

    def test_1_requests_that_come_byte_by_byte_are_ended_and_hold_nobody_up(self):
        left = self.drip()
        self.assertGreater(left(), 0)
        slowest_s = 0.0
        begun_s = time.monotonic()
        while left() and time.monotonic() - begun_s < DRIPS_S:
            asked_s = time.monotonic()
            line = http.client.HTTPConnection('127.0.0.1', self.port, 20.0, ('127.0.1.1', 0))
            line.request('GET', '/')
            self.assertEqual(line.getresponse().status, 200)
            line.close()
            slowest_s = max(slowest_s, time.monotonic() - asked_s)
            rospy.rostime.wallsleep(0.2)  # how slowly they drip
        self.assertEqual(left(), 0)
        self.assertLess(slowest_s, 2.0)

    def test_2_who_has_a_token_comes_in_and_answers(self):
        browser = self.browser
        self.crowd()
        codes = set.union(*(self.guess(address) for address in ADDRESSES))
        self.assertEqual(codes, {401, 429})
        self.assertTrue(wait_for(lambda: os.path.exists(self.tokens)))
        browser.driver.get(self.page)
        browser.find('#token').send_keys(self.token())
        browser.click('#sign-in')
        browser.click('.question-row')
        browser.find(GO_TO_PLACE)
        self.crowd()
        browser.click(GO_TO_PLACE)
        self.assertTrue(
            wait_for(
                lambda: (
                    ('PLACE', OracleEvent.JUMP)
                    in [(event.target, event.kind) for event in self.events]
                )
            ),
            browser.text(),
        )
        self.assertEqual(browser.errors(), [])

    def token(self):
        """An operator's."""
        with open(self.tokens, encoding='utf-8') as lines:
            return next(line.split()[1] for line in lines if line.startswith('operator'))


if __name__ == '__main__':
    rospy.init_node('console_crowd')
    rostest.rosrun('smach_oracle', 'console_crowd', Crowd)
