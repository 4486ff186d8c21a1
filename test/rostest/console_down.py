#!/usr/bin/env python3
"""A machine that was killed, on the console in a real browser: looked at, changed, gone on."""

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
from smach_oracle.msg import ConsoleCommand
from smach_oracle.store.store_file import StoreFile

if WITH_BROWSER:
    from browser import Browser
    from selenium.webdriver.support.ui import Select
SCRIPT = """
import os, sys, time, smach
class Pick(smach.State):
    def __init__(self):
        smach.State.__init__(self, ['succeeded'], ['cup'])
    def execute(self, userdata):
        print('PICKS', flush=True)
        while not os.path.exists(sys.argv[1]):
            time.sleep(0.05)
        return 'succeeded'
class Place(smach.State):
    def __init__(self):
        smach.State.__init__(self, ['succeeded'], ['cup'])
    def execute(self, userdata):
        print('PLACES {}'.format(userdata.cup), flush=True)
        while not os.path.exists(sys.argv[1]):
            time.sleep(0.05)
        return 'succeeded'
sm = smach.StateMachine(['succeeded'])
sm.userdata.cup = '<b>red</b>'
with sm:
    smach.StateMachine.add('PICK', Pick(), {'succeeded': 'PLACE'})
    smach.StateMachine.add('PLACE', Place(), {'succeeded': 'succeeded'})
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
DOWN = '.down-machine[data-machine=TASK]'
GO_ON, CHANGE, DROP = (
    '{} [data-action={}-stored]'.format(DOWN, each) for each in ('goto', 'edit', 'drop')
)
STATE, KEY, JSON = (
    DOWN + ' ' + each
    for each in (
        '[aria-label^="State at"]',
        '[aria-label^="Userdata"]',
        '[aria-label^="New value"]',
    )
)
# a command of this browser without its page, and the reply to it
COMMAND = """
const [command, done] = arguments;
fetch("session").then((answer) => answer.json()).then(({ xsrf }) => {
  const socket = new WebSocket(location.origin.replace("http", "ws") + "/socket");
  const post = (id, what) => socket.send(JSON.stringify({ id, ...what }));
  socket.onopen = () => post(1, { do: "hello", xsrf, expert: "eva" });
  socket.onmessage = ({ data }) => {
    const { re, message } = JSON.parse(data);
    if (re === 1) post(2, command);
    if (re === 2) { socket.close(); done(message); }
  };
});"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class DownTest(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.port = free_port()
        cls.folder = cls.make_folder()
        cls.store, cls.tokens, cls.done = (
            os.path.join(cls.folder, name) for name in ('robot.db', 'tokens', 'done')
        )
        cls.audited = []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        cls.console = cls.start_console('_stores:=' + cls.store, '_token_file:=' + cls.tokens)
        cls.browser = Browser(1360, 1000, whole=False)
        cls.browser.driver.set_script_timeout(60)
        wait_for(cls.page_is_served, 40.0)
        cls.browser.driver.get('http://localhost:{}/#machines'.format(cls.port))
        cls.remember_name(cls.browser, 'eva')

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.console.stop()

    def start(self):
        return oracle_run(
            self, '--checkpoint', self.store, '--resume', script(self, SCRIPT), self.done
        )

    def kill(self, task):
        task.signal(signal.SIGKILL)
        task.wait()
        self.assertTrue(self.browser.says('down since', DOWN))
        self.browser.click(DOWN + ' summary')

    def is_shown(self, selector):
        return self.browser.run('return document.querySelector(arguments[0]) !== null', selector)

    def choose(self, selector, words):
        Select(self.browser.find(selector)).select_by_visible_text(words)

    def command(self, name, **arguments):
        """What the server replies."""
        given = dict({'do': name, 'down': self.store + '#1', 'moment': 1}, **arguments)
        return self.browser.driver.execute_async_script(COMMAND, given)

    def stored(self):
        """The last trial, and what was changed by hand."""
        store = StoreFile(self.store, read_only=True)
        try:
            return store.trials()[-1], store.log()
        finally:
            store.close()

    def test_1_a_killed_machine_is_shown_and_an_onlooker_changes_nothing(self):
        browser = self.browser
        self.sign_in_to_machines('viewer')
        self.assertTrue(browser.says('there is no such store', '.down-problem'))
        task = self.start()
        self.assertTrue(task.says('PICKS', 40.0), task.output())
        self.assertTrue(
            wait_for(lambda: not self.is_shown('.down-machines:not([hidden])'), 20.0), 'it lives'
        )
        self.kill(task)
        told = browser.text(DOWN + ' summary')
        self.assertIn('TASK', told)
        self.assertIn('TASK/PICK was under way', told)
        self.assertTrue(browser.says('"<b>red</b>"', DOWN))
        told = browser.text(DOWN)
        self.assertIn('By default it asks a person first', told)
        self.assertIn('oracle_state {} show --trial 1'.format(self.store), told)
        self.assertIn('needs the role of an operator', told)
        for button in (GO_ON, CHANGE, DROP):
            self.assertFalse(browser.find(button).is_enabled(), button)
        self.assertIn('viewers may not drop stored', self.command('drop_stored'))
        self.assertEqual(self.stored()[1], [])
        self.assert_accessible('a machine that is down, for a viewer')

    def test_2_an_operator_has_it_go_on_elsewhere_with_another_value(self):
        browser = self.browser
        browser.click('#person')
        browser.click('dialog button')
        self.sign_in_to_machines('operator')
        browser.click(DOWN + ' summary')
        self.choose(KEY, 'TASK cup')
        browser.find(JSON).send_keys('blue')
        browser.click(CHANGE)
        self.assertTrue(browser.says("'blue' is no JSON", DOWN + ' .problem'))
        browser.find(JSON).clear()
        browser.find(JSON).send_keys('"blue"')
        browser.click(CHANGE)
        self.assertTrue(browser.says('cup of TASK is changed.', DOWN))
        self.choose(STATE, 'PLACE')
        browser.click(GO_ON)
        self.assertTrue(browser.says('TASK will go on at PLACE.', DOWN))
        self.assertTrue(browser.says('TASK/PLACE was next', DOWN + ' summary'))
        self.assert_accessible('a machine that is down')
        log = self.stored()[1]
        self.assertEqual(
            [line.what for line in log], ['trial 1: TASK: cup = "blue"', 'trial 1: go to PLACE']
        )
        self.assertTrue(all(line.who.startswith('eva (console, session ') for line in log), log)
        self.assertTrue(
            wait_for(
                lambda: (
                    [
                        (each.command, each.role, each.expert, each.ok)
                        for each in self.audited
                        if each.command.endswith('_stored')
                    ]
                    == [
                        ('drop_stored', 'viewer', 'eva', False),
                        ('edit_stored', 'operator', 'eva', False),
                        ('edit_stored', 'operator', 'eva', True),
                        ('goto_stored', 'operator', 'eva', True),
                    ]
                )
            ),
            self.audited,
        )

    def test_3_while_it_runs_nobody_changes_it_and_dropped_it_is_over(self):
        browser = self.browser
        task = self.start()
        self.assertTrue(task.says('PLACES blue', 40.0), task.output())
        self.assertTrue(wait_for(lambda: not self.is_shown(DOWN), 20.0), 'it goes on')
        self.assertIn('machine TASK is held by process', self.command('drop_stored'))
        self.kill(task)
        browser.click(DROP)
        self.assertTrue(browser.says('It is never resumed', '.drop-asking'))
        self.assert_accessible('whether to drop a trial')
        browser.click(DOWN + ' [data-action=keep-stored]')
        browser.click(DROP)
        browser.click(DOWN + ' [data-action=confirm-drop-stored]')
        self.assertTrue(browser.says('Trial 1 of TASK is dropped', '#toasts'))
        self.assertTrue(wait_for(lambda: not self.is_shown(DOWN), 20.0), 'it is over')
        self.assertEqual(self.stored()[0].outcome, 'dropped')
        self.assertEqual(browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_down')
    rostest.rosrun('smach_oracle', 'console_down', DownTest)
