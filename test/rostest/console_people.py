#!/usr/bin/env python3
"""Who works on a question: a name is asked for, a claim belongs to one browser, who else looks is
shown, and an answer needs a claim. Two real browsers, and a raw socket.
"""

import json
import os
import sys
import unittest
import urllib.request

import rospy
import rostest
import tornado.httpclient
import tornado.ioloop
import tornado.websocket

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, YOURS, ConsolePage
from waiting import wait_for

from smach_oracle.msg import OpenQueries, OracleEvent

if WITH_BROWSER:
    from selenium.webdriver.common.keys import Keys
QUESTION = '.question-row[data-key^="/alpha/"]'
ANSWER = '.choice.goto[data-name=PLACE]'
IDLE_S = 6.0
# how often a question has rung, as it stands at some times: status, periods of idleness, time
RUNG = """
return import("/static/js/page/alerts.js").then(({ Alerts }) => {
  const alerts = new Alerts();
  let rung = 0;
  alerts.ring = () => { rung += 1; };
  alerts.look([], 0);
  return arguments[0].map(([status, idle, now]) => {
    const question = { key: "s q", status, idle, holder: "ann", state: "PICK", stands: "failed",
      robot: "/r", deadline: 200 };
    alerts.look([question], now);
    return rung;
  });
});"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class People(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        from browser import Browser

        cls.open, cls.answered = [], []
        rospy.Subscriber(
            '/alpha/expert_query/open',
            OpenQueries,
            lambda message: cls.open.append(message.queries),
        )
        rospy.Subscriber(
            '/alpha/oracle/events',
            OracleEvent,
            lambda message: (
                message.kind == OracleEvent.QUERY_ANSWERED and cls.answered.append(message.by)
            ),
        )
        cls.begin('console_robot.py', 'PICK', '0.1', '0', '9', name='')
        cls.phone = Browser(390, 844, whole=False)
        cls.phone.driver.get(cls.page)

    @classmethod
    def start_console(cls, *more):
        return super().start_console('_idle_s:={}'.format(IDLE_S), *more)

    @classmethod
    def tearDownClass(cls):
        cls.phone.close()
        super().tearDownClass()

    def holder(self):
        return self.open[-1][0].claimed_by if self.open and self.open[-1] else None

    def give_name(self, browser, name):
        browser.find('.name-demand #expert').send_keys(name)
        browser.click('.name-demand #save-name')

    def test_1_a_name_is_asked_for_before_the_first_claim(self):
        browser = self.browser
        self.assertTrue(browser.says('Your name?', '#person'))
        self.assertEqual(browser.text('#sound'), 'Allow sound', 'nobody would hear it yet')
        browser.click(QUESTION)
        self.assertTrue(browser.says('Sound on', '#sound'), 'a press has allowed it')
        self.assertTrue(browser.says('Nobody works on it.', '.claim-bar'), 'anybody may read')
        self.assertTrue(browser.find(ANSWER).is_enabled())
        browser.click(ANSWER)
        browser.find('.name-demand')
        self.assertEqual(self.holder(), '', 'nobody claims without a name')
        self.assert_accessible('whose name is asked for')
        self.assertEqual(browser.run('return document.activeElement.id'), 'expert')
        self.assertTrue(
            browser.run(
                'return document.querySelector(".name-demand")'
                '.getBoundingClientRect().top > innerHeight / 2'
            ),
            'what stops a hand is at the top',
        )
        browser.find('#no-name').send_keys(Keys.ESCAPE)
        self.assertTrue(
            browser.says('your name is needed', '.claim-bar .problem'),
            'Esc leaves the dialog alone',
        )
        self.assertEqual(self.answered, [], 'and nothing is answered')
        browser.click('[data-action=claim]')
        browser.click('#no-name')
        self.assertTrue(browser.says('your name is needed', '.claim-bar .problem'))
        self.assertTrue(browser.says('Nobody works on it.'))
        browser.click('[data-action=claim]')
        self.give_name(browser, 'ann')
        self.assertTrue(browser.says(YOURS))
        self.assertEqual((browser.text('#person'), self.holder()), ('ann', 'ann'))
        browser.driver.refresh()
        self.assertTrue(browser.says('ann', '#person'), 'it is remembered')
        browser.click(QUESTION)
        self.assertTrue(browser.says(YOURS), "the claim is this browser's")

    def test_2_another_browser_of_the_same_name_does_not_hold_the_claim(self):
        phone = self.phone
        phone.click('#person')
        phone.find('#expert').send_keys('ann')
        phone.click('#save-name')
        self.assertTrue(phone.says('ann', '#person'))
        phone.click(QUESTION)
        self.assertTrue(phone.says('the same name, in another browser', '.claim-bar'))
        self.assertFalse(phone.find(ANSWER).is_enabled())
        self.assertTrue(self.browser.says(YOURS), 'it stays where it was')

    def test_3_who_else_looks_is_shown(self):
        self.assertTrue(
            self.browser.says('Also looking at it: ann (in another browser).', '.onlookers')
        )
        self.phone.click('.detail-head .back')
        self.assertTrue(
            wait_for(lambda: self.browser.run('return document.querySelector(".onlookers").hidden'))
        )
        self.phone.click(QUESTION)
        self.assertTrue(self.browser.says('Also looking at it', '.onlookers'))

    def test_4_a_raw_socket_answers_nothing_that_it_has_not_claimed(self):
        said = tornado.ioloop.IOLoop().run_sync(self.answer_raw, 40)
        self.assertEqual([each['ok'] for each in said], [False] * 3)
        for told, reply in zip(
            (
                'say your name first',
                'take it over first',
                'ann works on this question in another browser',
            ),
            said,
        ):
            self.assertIn(told, reply['message'])
        self.assertEqual(self.answered, [])
        self.assertEqual(self.holder(), 'ann')

    async def answer_raw(self):
        """Without a name; then under the name of who holds the claim, with and without claiming."""
        with urllib.request.urlopen(self.page + 'session') as reply:
            session = json.loads(reply.read().decode())
            cookie = reply.headers['Set-Cookie'].split(';')[0]
        socket = await tornado.websocket.websocket_connect(
            tornado.httpclient.HTTPRequest(
                self.page.replace('http', 'ws', 1) + 'socket',
                headers={'Origin': self.page.rstrip('/'), 'Cookie': cookie},
            )
        )
        key = '/alpha/expert_query ' + self.open[-1][0].query.query_id
        answer = {'do': 'answer', 'question': key, 'kind': 'goto', 'name': 'PLACE'}
        replies = {}
        for number, command in enumerate(
            (
                {'do': 'hello', 'xsrf': session['xsrf'], 'expert': ''},
                answer,
                {'do': 'hello', 'xsrf': session['xsrf'], 'expert': 'ann'},
                answer,
                {'do': 'claim', 'question': key},
            ),
            1,
        ):
            await socket.write_message(json.dumps(dict(command, id=number)))
            while number not in replies:
                message = json.loads(await socket.read_message())
                replies[message.get('re')] = message
        socket.close()
        return replies[2], replies[4], replies[5]

    def test_5_who_takes_it_over_answers_and_the_other_is_told(self):
        self.phone.click('[data-action=take-over]')
        self.assertTrue(self.phone.says(YOURS))
        self.assertTrue(self.browser.says('ann (in another browser) has taken this question over.'))
        self.assertFalse(self.browser.find(ANSWER).is_enabled())
        self.phone.click(ANSWER)
        self.assertTrue(self.phone.says('The machine goes to PLACE.', '.follow-up'))
        self.assertTrue(wait_for(lambda: self.answered == ['ann']))

    def test_6_who_only_reads_is_named_and_keeps_nobody_from_answering(self):
        self.browser.press(Keys.ESCAPE)  # its own one is closed
        self.phone.click('.follow-up [data-action=back]')
        self.phone.click(QUESTION)
        self.assertTrue(self.browser.says('waiting · ann reads', QUESTION))
        self.assertEqual(self.holder(), '', 'reading takes nothing')
        self.browser.click(QUESTION)
        self.assertTrue(self.browser.says('Nobody works on it.', '.claim-bar'))
        self.browser.find('input.why').send_keys('it lies')
        self.assertTrue(self.browser.says(YOURS), 'the first key of an answer takes it')
        self.assertTrue(self.phone.says('the same name, in another browser', '.claim-bar'))
        self.assertFalse(self.phone.find(ANSWER).is_enabled())
        self.browser.click(ANSWER)
        self.assertTrue(wait_for(lambda: len(self.answered) == 2))

    def test_7_a_question_calls_again_whose_holder_presses_nothing(self):
        self.browser.click('.follow-up [data-action=back]')
        self.phone.click('.detail-head .back')
        self.browser.click(QUESTION)
        self.take()
        self.assertTrue(self.phone.says('ann', QUESTION))
        self.assertTrue(wait_for(lambda: self.phone.driver.title == 'Operator console'))
        self.assertTrue(self.phone.says('ann · idle', QUESTION), 'its holder presses nothing')
        self.assertTrue(wait_for(lambda: self.phone.driver.title.startswith('(1)')))
        self.browser.find('input.why').send_keys('still here')
        self.assertTrue(
            wait_for(lambda: 'idle' not in self.phone.text(QUESTION)), 'its holder is at work again'
        )
        seen = [
            ('pending', 0, 0),
            ('claimed', 0, 10),
            ('claimed', 1, 60),
            ('claimed', 1, 61),
            ('claimed', 2, 105),
            ('claimed', 0, 106),
            ('claimed', 0, 141),
            ('claimed', 0, 142),
            ('pending', 0, 143),
        ]
        self.assertEqual(self.browser.run(RUNG, seen), [1, 1, 2, 2, 3, 3, 4, 4, 4])
        self.assertEqual(self.browser.errors() + self.phone.errors(), [])
        self.assertEqual(self.browser.errors() + self.phone.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_people')
    rostest.rosrun('smach_oracle', 'console_people', People)
