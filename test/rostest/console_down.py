#!/usr/bin/env python3
"""A machine that was killed, on the console in a real browser: until it goes on."""
import os
import signal
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage
from oracle_support import oracle_run, script
from waiting import wait_for

from smach_oracle.experiment.launching import free_port

if WITH_BROWSER:
    from browser import Browser
SCRIPT = '''
import os, sys, time, smach
class Pick(smach.State):
    def __init__(self):
        smach.State.__init__(self, ['succeeded'], ['cup'])
    def execute(self, userdata):
        print('PICKS', flush=True)
        while not os.path.exists(sys.argv[1]):
            time.sleep(0.05)
        return 'succeeded'
sm = smach.StateMachine(['succeeded'])
sm.userdata.cup = '<b>red</b>'
with sm:
    smach.StateMachine.add('PICK', Pick(), {'succeeded': 'succeeded'})
print('OUTCOME', sm.execute(), flush=True)
'''
DOWN = '.down-machine[data-machine=TASK]'
TOKENS = {role: role + '-token-of-sufficient-length' for role in ('viewer', 'operator')}


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class DownTest(ConsolePage, unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.port = free_port()
        cls.folder = cls.make_folder()
        cls.store = os.path.join(cls.folder, 'robot.db')
        cls.console = cls.start_console('_stores:=' + cls.store)
        cls.browser = Browser(1360, 1000)
        wait_for(cls.page_is_served, 40.0)
        cls.browser.driver.get('http://localhost:{}/#machines'.format(cls.port))
        cls.remember_name(cls.browser, 'operator')

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.console.stop()

    def test_a_killed_machine_is_shown_until_it_goes_on(self):
        browser, done = self.browser, os.path.join(self.folder, 'done')
        self.assertTrue(browser.says('there is no such store', '.down-problem'))
        words = ('--checkpoint', self.store, '--resume', script(self, SCRIPT), done)
        task = oracle_run(self, *words)
        self.assertTrue(task.says('PICKS', 40.0), task.output())
        self.assertTrue(wait_for(lambda: not browser.run(
            'return document.querySelector(".down-machines:not([hidden])") !== null'), 20.0),
            'it lives')
        task.signal(signal.SIGKILL)
        task.wait()
        self.assertTrue(browser.says('down since', DOWN))
        told = browser.text(DOWN + ' summary')
        self.assertIn('TASK', told)
        self.assertIn('TASK/PICK was under way', told)
        browser.click(DOWN + ' summary')
        self.assertTrue(browser.says('"<b>red</b>"', DOWN))
        told = browser.text(DOWN)
        self.assertIn('By default it asks a person first', told)
        self.assertIn('oracle_state {} show --trial 1'.format(self.store), told)
        self.assert_accessible('a machine that is down')
        again = oracle_run(self, *words)
        self.assertTrue(again.says('PICKS', 40.0), again.output())
        self.assertTrue(wait_for(lambda: not browser.run(
            'return document.querySelector(arguments[0]) !== null', DOWN), 20.0), 'it goes on')
        with open(done, 'w'):
            pass
        self.assertTrue(again.says('OUTCOME succeeded', 40.0), again.output())


if __name__ == '__main__':
    rospy.init_node('console_down')
    rostest.rosrun('smach_oracle', 'console_down', DownTest)
