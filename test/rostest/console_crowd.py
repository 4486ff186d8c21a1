#!/usr/bin/env python3
"""A crowd without a token stops nobody who has one: 1,100 idle connections at the usual limit on
files, and wrong tokens from many addresses. A person signs in, claims and answers among them.
"""

import http.client
import json
import os
import resource
import socket
import sys
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

    def test_who_has_a_token_comes_in_and_answers(self):
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
