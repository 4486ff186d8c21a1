#!/usr/bin/env python3
"""The operator console in a real browser: real node, real master, a real machine under a real
oracle.
"""

import os
import subprocess
import sys
import unittest

import rosbag
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, YOURS, ConsolePage
from waiting import wait_for

from smach_oracle.msg import ConsoleCommand, OracleEvent

QUESTION = '.question-row[data-key^="/alpha/"]'
UNKNOWN_SUCCESS = """return import("/static/js/answering/state_choices.js").then(
({ stateLines }) => (
  stateLines({ state: "PICK", success: null, class: 0, visits: 0, missing: [], preconditions: [],
    blocked: "", repeats: [], runs_again: [], helped: [0, 0], helped_s: null,
    recommended: "", container: "" },
  { state: "PLACE", running: false }).map((line) => line ? line.textContent : "").join("")))"""
DOUBTFUL = """return import("/static/js/answering/state_choices.js").then(
({ stateLines }) => (
  stateLines({ state: "INSPECT", success: 0.95, class: 1, visits: 0, missing: [],
    preconditions: ["DETECT"], blocked: "", repeats: [], runs_again: [], helped: [0, 0],
    helped_s: null, recommended: "", container: "" },
  { state: "DETECT", running: false, history: [] }).map((line) => (
    line ? line.textContent : "")).join(", ")))"""
NO_PLACE = """return import("/static/js/robots/graph_view.js").then(({ GraphView }) => {
  const states = [[1, 2, 3, 4], null].map((at) => ({ label: "S" + at, nested: false, at }));
  const view = new GraphView(() => {});
  view.set("/alpha", { path: "A", oracle: "O", drawn: true, size: [9, 9], states, outcomes: [],
    edges: [], bundled: {}, refused: 0 },
  { active: {}, latest: {}, failed: {}, rates: {}, counts: {}, paths: [] });
  return view.root.querySelectorAll(".state").length;
})"""

BARS = """return import("/static/js/questions/claim_bar.js").then(({ claimBar }) => {
  const use = { leave() {}, claim() {}, takeOver() {} };
  const now = { holder: "ann", status: "claimed", interface: "" };
  return [false, true].map((mayAnswer) => claimBar({ settled: false, now, mine: false, held: false,
    claiming: false, sending: false, problem: "", mayAnswer }, use).textContent);
})"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class ConsoleInABrowser(ConsolePage, unittest.TestCase):
    whole_browser = True

    @classmethod
    def setUpClass(cls):
        cls.bags = cls.make_folder()
        rospy.set_param('/alpha/record', cls.bags)
        cls.audited, cls.events = [], []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        rospy.Subscriber('/alpha/oracle/events', OracleEvent, cls.events.append)
        cls.begin('console_robot.py', 'PICK', '0.1', '0', '4')

    @staticmethod
    def token_of(role, path):
        with open(path) as file:
            return next(line.split()[1] for line in file if line.startswith(role))

    def told(self, command):
        return [told for told in self.audited if told.command == command]

    def outcomes(self, kind, field):
        return [getattr(event, field) for event in self.events if event.kind == kind]

    def test_1_a_question_is_shown_whole_and_answered_in_two_actions(self):
        browser = self.browser
        browser.find(QUESTION)
        self.assertTrue(
            wait_for(lambda: browser.driver.title.startswith('(1)')), 'the title says so'
        )
        browser.click(QUESTION)
        self.assertTrue(browser.says('Nobody works on it.', '.claim-bar'), 'to read is free')
        for told in (
            'raised an exception',
            '<b>mug</b>',
            'window.hacked',
            'missing: grasp',
            'assist',
            '"mug"',
        ):
            self.assertIn(told, browser.text())
        self.assertTrue(browser.says('DETECT unknown'), 'the preconditions are looked at')
        self.assertEqual(self.told('claim'), [], 'reading has taken nothing')
        self.assertIsNone(
            browser.run('return window.hacked || document.querySelector(".failure b") || null'),
            'what a robot says is text',
        )
        self.assertTrue(
            wait_for(
                lambda: browser.run(
                    'return document.getElementById("/alpha/KITCHEN/FETCH/PICK")'
                    '.classList.contains("failed")'
                )
            ),
            'the failed state is marked in its graph',
        )
        browser.find('[data-output=grasp]').send_keys('{"width_m": 0.04}')
        self.assertTrue(browser.says(YOURS), 'the first key of an answer takes it')
        browser.click('.choice.supersede[data-name=succeeded]')
        self.assertTrue(
            browser.says('PICK counts as having ended with succeeded.', '.follow-up'),
            'what happened next',
        )
        self.assertTrue(
            wait_for(lambda: 'succeeded' in self.outcomes(OracleEvent.TRIAL_END, 'outcome'))
        )
        self.assertEqual(self.outcomes(OracleEvent.QUERY_ANSWERED, 'by')[0], 'operator')
        self.assertTrue(
            wait_for(lambda: 'answer' in [told.command for told in self.audited if told.ok])
        )
        self.assertEqual(browser.errors(), [])

    def test_2_a_page_comes_back_with_its_claim_after_the_server_was_restarted(self):
        browser = self.browser
        browser.click('.follow-up [data-action=back]')
        browser.find(QUESTION)
        browser.run('document.activeElement.blur()')
        browser.press('n')
        browser.find('input.why').send_keys('typed before')
        self.assertTrue(browser.says(YOURS), 'the reason is part of an answer')
        levels = [each.split() for each in browser.texts('.way .level')]
        self.assertEqual(
            levels,
            [
                'KITCHEN MOVE_ARMS_ASIDE ✓ FETCH ▾ in it'.split(),
                'KITCHEN/FETCH DETECT ✓ PICK ✗'.split(),
            ],
            'the whole way',
        )
        type(self).console.stop()
        self.assertTrue(browser.says('connection lost', '#status'))
        type(self).console = self.start_console()
        self.assertTrue(browser.says('live', '#status', 40.0))
        self.assertTrue(browser.says(YOURS, limit_s=40.0), 'the claim is kept')
        self.assertEqual(
            browser.find('input.why').get_attribute('value'), 'typed before', 'no work is lost'
        )

    def test_2_trials_that_began_before_the_server_was_restarted_are_listed(self):
        browser = self.browser
        browser.click('#tab-trials')
        self.assertTrue(browser.says('1 failure · 1 question', '.trial'), browser.text('.panel'))
        self.assertIn('running', browser.text('.trial'))
        self.assertTrue(browser.says('trial 2 of its program', '.trial-detail p'))
        self.assertIn('events were not heard', browser.text('.trial-detail p'))
        browser.click('#tab-questions')
        self.assertTrue(browser.says(YOURS), 'the question is still there')
        self.assertTrue(
            browser.says('this console has not heard all', '.way .level'), 'no wrong way is shown'
        )

    def test_3_a_second_console_takes_over_and_answers(self):
        browser = self.browser
        browser.driver.switch_to.new_window('tab')
        browser.driver.get(self.page)
        browser.click('#person')
        name = browser.find('#expert')
        name.clear()
        name.send_keys('bob')
        browser.click('#save-name')
        self.assertTrue(browser.says('bob', '#person'))
        browser.click(QUESTION)
        self.assertTrue(browser.says('operator works on it.'))
        self.assertFalse(
            browser.find('.choice.goto').is_enabled(), 'nobody answers what another one holds'
        )
        browser.click('[data-action=take-over]')
        self.assertTrue(browser.says(YOURS))
        first, second = browser.driver.window_handles
        browser.driver.switch_to.window(first)
        self.assertTrue(browser.says('bob has taken this question over.'))
        browser.driver.switch_to.window(second)
        browser.find('.stage').click()
        self.assertTrue(
            wait_for(lambda: browser.settled(browser.find('.choice.goto[data-name=PLACE]')))
        )
        browser.find('body').send_keys('3')
        self.assertTrue(browser.says('The machine goes to PLACE.', '.follow-up'))
        self.assertEqual(self.outcomes(OracleEvent.QUERY_ANSWERED, 'by')[-1], 'bob')
        self.assertIn(
            ('take_over', 'bob', True),
            [(told.command, told.expert, told.ok) for told in self.audited],
        )

    def test_3_on_a_phone_two_taps_answer_and_what_happens_next_is_at_the_top(self):
        browser = self.browser
        browser.click('.follow-up [data-action=back]')
        browser.driver.execute_cdp_cmd(
            'Emulation.setDeviceMetricsOverride',
            {'width': 390, 'height': 844, 'deviceScaleFactor': 1, 'mobile': True},
        )
        self.addCleanup(browser.driver.execute_cdp_cmd, 'Emulation.clearDeviceMetricsOverride', {})
        browser.tap(QUESTION)
        self.assertTrue(
            browser.says('led on 1 of 1', '.choice.goto[data-name=PLACE]'),
            'how often it led on before',
        )
        self.assertTrue(
            wait_for(lambda: browser.find('.choice.goto[data-name=PLACE]').is_enabled())
        )
        browser.tap('.choice.goto[data-name=PLACE]')
        self.assertTrue(browser.says('The trial ended with succeeded.', '.follow-up'))
        top, bottom = browser.run(
            'const box = document.querySelector(".follow-up").getBoundingClientRect();'
            'return [box.top, box.bottom]'
        )
        self.assertTrue(0 < top < bottom < 844, (top, bottom))

    def test_4_back_forward_reload_and_a_link_lead_where_they_say(self):
        browser, driver = self.browser, self.browser.driver
        browser.click('.follow-up [data-action=back]')
        browser.click(QUESTION)
        browser.find('.detail')
        question = driver.current_url
        self.assertIn('#questions//alpha/expert_query+', question)
        browser.click('#tab-machines')
        browser.click('[id="/alpha/KITCHEN/FETCH"] .box')
        self.assertTrue(browser.says('KITCHEN/FETCH', '.machine-card h2'))
        machine = driver.current_url
        self.assertTrue(machine.endswith('#machines//alpha+KITCHEN/FETCH'), machine)
        driver.back()
        driver.back()
        browser.find('.detail')
        self.assertEqual(driver.current_url, question)
        driver.back()
        self.assertTrue(wait_for(lambda: not browser.text('.detail')), 'the list, and the console')
        driver.forward()
        browser.find('.detail')
        driver.refresh()
        self.assertTrue(browser.says('PICK', '.detail-head h2'), 'a reload shows the same')
        driver.get('about:blank')
        driver.get(machine)
        self.assertTrue(browser.says('KITCHEN/FETCH', '.machine-card h2'), 'so does a link')
        browser.click('#tab-trials')
        browser.click('.trial:last-child')
        trial = browser.find('.trial[aria-current=true]').get_attribute('data-trial')
        self.assertIn('#trials/', driver.current_url)
        driver.refresh()
        browser.find('.trial[aria-current=true][data-trial="{}"]'.format(trial))
        driver.get(self.page + '#questions/nobody+asks')
        self.assertTrue(browser.says('The question of this address is not open', '.stage'))
        browser.click(QUESTION)
        browser.find('.detail')
        browser.press('\ue00c')  # Escape
        self.assertTrue(wait_for(lambda: not browser.text('.detail')))
        self.assertEqual(browser.errors(), [])

    def test_4_machines_and_trials_are_shown(self):
        browser = self.browser
        browser.click('#tab-machines')
        browser.find('[id="/alpha/KITCHEN/MOVE_ARMS_ASIDE"].known')
        browser.click('[id="/alpha/KITCHEN/FETCH"] .box')
        browser.find('[id="/alpha/KITCHEN/FETCH/DETECT"]')
        browser.find('.used > .oracle-edge')
        browser.click('#tab-trials')
        self.assertTrue(browser.says('with oracle', '.panel.trials table'))
        browser.click('.trial:first-child')
        self.assertTrue(browser.says('failed', '.event-log'))
        added = (
            'return import("/static/js/page/format.js").then(({ added }) => '
            '["It warns: no cup", "PICK failed."].map((words) => added({ words, text: "no cup" })))'
        )
        self.assertEqual(browser.run(added), ['', ' no cup'], 'nothing is told twice')
        self.assertEqual(browser.run(UNKNOWN_SUCCESS), 'PICK–', 'not drawn as a failure')
        doubtful = browser.run(DOUBTFUL)
        for told in ('est. 95% ok', 'low failure rate', 'DETECT has just failed'):
            self.assertIn(told, doubtful)
        self.assertEqual(browser.run(NO_PLACE), 1, 'it costs the other states nothing')
        viewers, operators = browser.run(BARS)
        self.assertIn('as a viewer', viewers)
        self.assertEqual(operators, 'ann works on it. Take it over', 'a role may change')
        browser.find('.timeline .mark')
        self.assertTrue(
            wait_for(lambda: not browser.text('.trial-detail p').startswith('0 s')), 'it runs on'
        )
        self.assertEqual(browser.errors(), [])

    def test_5_every_command_about_a_trial_is_in_its_bag(self):
        def told():
            commands = []
            for path in sorted(os.listdir(self.bags)):
                if path.endswith('.bag'):
                    with rosbag.Bag(os.path.join(self.bags, path)) as bag:
                        commands += [
                            message.command
                            for _, message, _ in bag.read_messages('/alpha/expert_query/audit')
                        ]
            return commands

        self.assertTrue(wait_for(lambda: 'take_over' in told()))
        self.assertEqual(told()[:2], ['claim', 'answer'])

    def sign_in(self, token):
        field = self.browser.find('#token')
        field.clear()
        field.send_keys(token)
        self.browser.click('#sign-in')

    def test_6_with_tokens_a_viewer_signs_in_and_only_watches(self):
        browser, tokens = self.browser, os.path.join(self.bags, 'tokens')
        type(self).console.stop()
        type(self).console = self.start_console('_token_file:=' + tokens)
        first, second = browser.driver.window_handles
        for page in (second, first):
            browser.driver.switch_to.window(page)
            browser.find('#token')
        # both have begun a session, and the cookie is of the one that came last: here not of the
        # page that is looked at
        browser.driver.delete_all_cookies()
        browser.run('return fetch("session").then((answer) => answer.json())')
        self.sign_in('no such token')
        self.assertTrue(browser.says('There is no such token.'), browser.text())
        self.sign_in(self.token_of('viewer', tokens))
        self.assertTrue(browser.says('(viewer)', '#person'), browser.text())
        browser.driver.switch_to.window(second)
        self.assertTrue(
            browser.says('bob (viewer)'), 'the other page is signed in, too, once it is looked at'
        )
        self.assert_accessible('a viewer')
        browser.click('#person')
        browser.click('dialog button')
        for page in (second, first):
            browser.driver.switch_to.window(page)
            self.assertTrue(
                browser.says('Sign in', 'form h2'), 'to sign out ends all pages of this browser'
            )
            self.assertTrue(
                browser.says('You have signed out' + (' on another page' if page == first else '.'))
            )
            self.assert_accessible('the sign-in')
            self.assertEqual(
                browser.text('#nav'), '', 'nothing leads back to what was shown before'
            )
        self.sign_in(self.token_of('viewer', tokens))
        browser.click('#tab-questions')
        browser.click(QUESTION)
        self.assertTrue(browser.says('You are signed in as a viewer'))
        self.assertFalse(browser.find('.choice.goto').is_enabled())

    def test_7_encrypted_the_page_and_its_socket_work_and_the_cookie_is_for_nothing_else(self):
        browser, tokens = self.browser, os.path.join(self.bags, 'tokens')
        certificate, key = (os.path.join(self.bags, name) for name in ('own.pem', 'own.key'))
        subprocess.run(
            [
                'openssl',
                'req',
                '-x509',
                '-newkey',
                'rsa:2048',
                '-nodes',
                '-days',
                '2',
                '-subj',
                '/CN=localhost',
                '-keyout',
                key,
                '-out',
                certificate,
            ],
            check=True,
            stderr=subprocess.PIPE,
        )
        type(self).console.stop()
        browser.driver.delete_all_cookies()
        type(self).console = self.start_console(
            '_token_file:=' + tokens, '_certificate:=' + certificate, '_private_key:=' + key
        )
        self.assertTrue(wait_for(self.page_is_served, 40.0))
        browser.driver.get(self.page.replace('http', 'https'))
        browser.find('#token', 40.0).send_keys(self.token_of('operator', tokens))
        browser.click('#sign-in')
        self.assertTrue(browser.says('live', '#status'), 'its socket is encrypted as well')
        self.assertEqual(
            browser.run(
                'return fetch("session").then((answer) => answer.json()).then((it) => it.role)'
            ),
            'operator',
        )
        (cookie,) = [
            each for each in browser.driver.get_cookies() if each['name'].startswith('console_')
        ]
        self.assertEqual(
            (cookie['secure'], cookie['httpOnly'], cookie['sameSite']), (True, True, 'Strict')
        )
        self.assertEqual(browser.run('return document.cookie'), '', 'no script can read it')

    def test_8_the_page_runs_nothing_that_is_not_its_own(self):
        browser = self.browser
        image = '\'<img src=x onerror="window.hacked = 1">\''
        for attack in (
            'document.body.insertAdjacentHTML("beforeend", {})'.format(image),
            'document.body.innerHTML = ' + image,
            'eval("window.hacked = 1")',
            'new Function("window.hacked = 1")()',
            'setTimeout("window.hacked = 1")',
            'const it = document.createElement("script"); it.append("window.hacked = 1");'
            'document.body.append(it)',
            'location.href = "javascript:window.hacked = 1"',
            'const it = document.createElement("b"); it.setAttribute("onclick", '
            '"window.hacked = 1");'
            'document.body.append(it); it.click()',
        ):
            browser.run(  # not at once: the policy does not bind what a test runs itself
                'return new Promise((done) => setTimeout(() => {{ '
                'setTimeout(done, 100); {} }}))'.format(attack)
            )
            self.assertIsNone(browser.run('return window.hacked'), attack)
        browser.run(
            'return fetch("https://127.0.0.1:{}/session").catch(() => null)'.format(self.port)
        )
        self.assertTrue(
            any('connect-src' in error for error in browser.errors()),
            'and it speaks to nobody else',
        )


if __name__ == '__main__':
    rospy.init_node('console_browser')
    rostest.rosrun('smach_oracle', 'console_browser', ConsoleInABrowser)
