#!/usr/bin/env python3
"""A robot asks, and the console calls people: over real HTTP and SMTP, one of whom hangs. The page
shows whom it has called, and stays as quick as before.
"""

import os
import sys
import time
import unittest

import rospy
import rostest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, '..', 'unit', 'support')]
import receiving
from console_page import WITH_BROWSER, ConsolePage
from waiting import wait_for

QUESTION = '.question-row[data-key^="/alpha/"]'
FILE = """
secrets: secrets
mail: {{server: 127.0.0.1, port: {port}, security: none, sender: robots@example.org}}
people:
  ann: {{mail: ann@example.org}}
  bob: {{webhook: broken}}
  eve: {{webhook: hanging}}
  team: {{webhook: chat, form: slack}}
order:
  - {{call: [ann, bob, eve]}}
  - {{call: team, after_s: 8}}
"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Calls(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.mail, cls.chat = receiving.MailServer(), receiving.WebhookServer()
        cls.broken = receiving.WebhookServer([404])
        cls.hanging = receiving.RudeServer(receiving.hangs)
        cls.mail.start()
        for server in (cls.mail, cls.chat, cls.broken, cls.hanging):
            cls.addClassCleanup(server.stop)
        folder = cls.make_folder()
        cls.on_call = os.path.join(folder, 'on_call.yaml')
        with open(cls.on_call, 'w') as file:
            file.write(FILE.format(port=cls.mail.bound_port))
        secrets = os.path.join(folder, 'secrets')
        with open(os.open(secrets, os.O_WRONLY | os.O_CREAT, 0o600), 'w') as file:
            file.write('broken {}\nchat {}\n'.format(cls.broken.url, cls.chat.url))
            file.write('hanging http://127.0.0.1:{}/x\n'.format(cls.hanging.port))
        cls.begin('console_robot.py', 'PICK', '0.1', '0', '9')

    @classmethod
    def start_console(cls, *more):
        return super().start_console(
            '_on_call:=' + cls.on_call, '_public_address:=' + cls.page, *more
        )

    def test_1_the_first_are_called_with_a_link_that_opens_the_question(self):
        self.assertTrue(wait_for(lambda: self.mail.taken))
        content = self.mail.taken[0].content.decode()
        self.assertIn('Subject: /alpha asks about PICK', content)
        link = next(word for word in content.split() if word.startswith(self.page + '#questions/'))
        self.browser.driver.get(link)
        self.browser.find('.detail[data-question^="/alpha/"]')
        self.assertTrue(self.browser.says('ann by e-mail', '.calls'))

    def test_2_who_was_not_reached_is_shown(self):
        self.assertTrue(
            self.browser.says('bob by json was not reached (it answered with status 404)', '.calls')
        )
        self.assertTrue(self.browser.says('bob by json, it answered with status 404', '.unreached'))
        self.assertTrue(self.browser.says('eve by json now', '.calls'), 'it hangs')
        self.assert_accessible('whom the console has called')
        self.assertNotIn(receiving.PASSWORD, self.browser.driver.page_source)

    def test_3_the_next_is_called_since_nobody_came(self):
        self.assertTrue(wait_for(lambda: self.chat.taken))
        self.assertIn('PICK', self.chat.taken[0][1]['text'])
        self.assertTrue(self.browser.says('team by slack', '.calls'))

    def test_4_a_receiver_that_hangs_delays_no_answer(self):
        self.browser.click('[data-action=claim]')
        self.assertTrue(self.browser.says('It is yours.'))
        begun_s = time.monotonic()
        self.browser.click('.choice.goto[data-name=PLACE]')
        self.assertTrue(self.browser.says('The machine goes to PLACE.', '.follow-up'))
        self.assertLess(time.monotonic() - begun_s, 10.0)
        self.assertEqual(self.browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_reach')
    rostest.rosrun('smach_oracle', 'console_reach', Calls)
