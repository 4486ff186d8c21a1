#!/usr/bin/env python3
"""What is live and what is not, in a real browser: the console stopped, the master dead, the robot
stopped or killed. A master and nodes of its own.
"""

import os
import sys
import unittest

import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import OF_A_QUESTION, WITH_BROWSER, YOURS, ConsolePage
from expert_fixtures import start_master
from waiting import wait_for

from smach_oracle.experiment.launching import free_port

QUESTION = '.question-row[data-key^="/alpha/"]'
ANSWER = '.choice.goto[data-name=PLACE]'
LIVE = 'live'
SILENT = 'Nothing is heard from {} any more.'
# what a page says of a robot when neither it nor the console has been heard for a while
GONE = """
const paths = ["page/store.js", "page/liveness.js"];
return Promise.all(paths.map((path) => import("/static/js/" + path))).then((
  [{ Store }, { Liveness }]) => {
  const store = new Store();
  const liveness = new Liveness(store);
  const tell = (robot) => store.receive({ now: 0, sections: {
    servers: [{ name: "s", connected: true }],
    heard: { beat: 1, master: 0, servers: { s: 0 }, robots: { "/r": robot } } } });
  tell(0);
  liveness.running -= 9000;
  const silent = liveness.gone({ server: "s", robot: "/r" });
  tell(9);
  return [silent, liveness.gone({ server: "s", robot: "/r" })];
});"""
# what a page says of a question that has gone: of a robot that was killed or lived on, and of one
# whose shared server has gone
WENT = (
    OF_A_QUESTION
    % """
  const heard = (age, connected = true) => store.receive({ now: 0, sections: {
    servers: [{ name: "s", connected }],
    heard: { beat: 1, master: 0, servers: { s: 0 }, robots: { "/r": age } } } });
  const after = async (...ages) => {
    heard(0.5);
    said("");
    await new Promise((done) => { setTimeout(done, 20); });
    store.receive({ now: 0, sections: { questions: [] } });
    await new Promise((done) => { setTimeout(done, 20); });
    ages.forEach((age) => heard(age));
    return detail.root.querySelector(".claim-bar").textContent;
  };
  const found = [await after(4), await after(0, 9)];
  found.push(await after(4, 9));
  said("");
  heard(0.5, false);
  store.receive({ now: 0, sections: { questions: [] } });
  return [...found, detail.root.querySelector(".claim-bar").textContent];"""
)
# a claim that runs out, and cannot be made again at once: whether it is kept, and how often it was
# asked for
KEPT = (
    OF_A_QUESTION
    % """
  const asked = async () => {
    await new Promise((done) => { setTimeout(done); });
    return told.filter((name) => name === "claim").length;
  };
  said("");
  await detail.claim("claim");
  said("ann");
  detail.claimedAt = -Infinity;
  replies.push({ ok: false, message: "cannot be reached" });
  said("");
  const found = [await asked(), detail.held];
  detail.draw();
  found.push(await asked());
  detail.claimedAt = -Infinity;
  detail.draw();
  found.push(await asked(), said("ann"));
  return found;"""
)
# a console that was restarted has not heard of the question when the page is back: what is said of
# it then, whether it is claimed again once the console lists it, and what is said after that
NOT_LISTED_YET = (
    OF_A_QUESTION
    % """
  said("");
  await detail.claim("claim");
  said("ann");
  store.receive({ now: 0, sections: { questions: [] } });
  replies.push({ ok: false, message: "This question is open no longer." });
  detail.connected();
  await detail.claimed;
  const before = told.length;
  detail.claimedAt = -Infinity;
  said("");
  await detail.claimed;
  return [told.slice(before), detail.held, detail.problem, said("ann")];"""
)
# which commands wait for nothing, where all are silent and the person has no name
PASSES = """
return import("/static/js/page/gate.js").then(({ Gate }) => {
  const silent = () => "silent";
  const gate = new Gate({ store: { questions: [{ key: "q" }] }, refusal: silent,
    refusalOfRobot: silent }, () => false, async () => false);
  return arguments[0].filter((name) => gate.before(name, { question: "q", robot: "/r" }) === null);
});"""
STOPS = ['stop_hand', 'leave_wheel', 'release', 'stop_machine', 'pause_machine']
ANSWERS = ['answer', 'hand_over', 'resume_machine', 'step_machine', 'confirm_state']
GREY = 'return getComputedStyle(document.querySelector(".detail .answers")).filter'
# what lies between the button that stops and the page, by how it is shown
COLOURS_OF_STOP = """
let found = [];
for (let it = document.querySelector(".detail .machine-hand .stop"); it; it = it.parentElement) {
  found.push(getComputedStyle(it).filter);
}
return [...new Set(found)];"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Live(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.master_port = free_port()
        os.environ['ROS_MASTER_URI'] = 'http://localhost:{}'.format(cls.master_port)
        cls.master = start_master(cls.master_port)
        cls.begin('console_robot.py', 'PICK', '0.1', '0', '9')

    @classmethod
    def tearDownClass(cls):
        super().tearDownClass()
        cls.master.kill()

    def setUp(self):
        if not self.browser.text('.detail-head'):
            self.browser.click(QUESTION)
            self.take()
        self.assertTrue(self.answerable())

    def answerable(self):
        """Whether the question comes to be live, held, and may be answered."""
        browser = self.browser
        return (
            browser.says(LIVE, '#status')
            and browser.says(YOURS)
            and wait_for(lambda: browser.find(ANSWER).is_enabled() and browser.run(GREY) == 'none')
        )

    def refused(self, who):
        """Whether the page comes to say who is silent, is grey, and takes no answer."""
        browser = self.browser
        return browser.says(SILENT.format(who), '.silence-bar') and wait_for(
            lambda: browser.run(GREY) == 'grayscale(1)' and not browser.find(ANSWER).is_enabled()
        )

    def test_2_a_question_that_goes_says_whether_its_robot_went(self):
        at_first, lived_on, killed, no_server = self.browser.run(WENT)
        self.assertIn('answered elsewhere', at_first)
        self.assertIn('answered elsewhere', lived_on)
        self.assertIn('/r is gone', killed)
        self.assertIn('s is gone. /r asks again', no_server)

    def test_1_the_ages_of_the_last_words_are_shown(self):
        browser = self.browser
        for told, where in (
            ('console 0 s', '#ages'),
            ('master 0 s', '#ages'),
            ('heard 0 s ago', '.last-word'),
        ):
            self.assertTrue(browser.says(told, where), told)
        browser.click('#tab-machines')
        self.assertTrue(browser.says('/alpha · heard', '.machine-card .head'))
        browser.click('#tab-questions')

    def test_2_of_a_console_that_is_stopped_nothing_is_live_and_what_it_was_told_is_not_known(self):
        browser = self.browser
        self.console.freeze()
        try:
            browser.click(ANSWER)
            self.assertTrue(browser.says('console silent for', '#status'))
            self.assertTrue(self.refused('the console'))
            self.assertTrue(
                browser.says('whether it has your answer is not known', '.claim-bar .problem')
            )
            self.assertIn('No reply within 20 s to “answer”', browser.text('#toasts'))
            self.assertTrue(browser.says('conn', '#status'), 'it tries to come back')
        finally:
            self.console.thaw()
        self.assertTrue(self.answerable(), 'it comes back; the answer has come too late')

    def test_2_of_a_robot_nothing_is_known_while_the_console_is_silent(self):
        silent, gone = self.browser.run(GONE)
        self.assertEqual(silent, '')
        self.assertIn('/r is gone', gone)

    def test_2_what_stops_or_lets_go_waits_for_nothing(self):
        self.assertEqual(self.browser.run(PASSES, STOPS + ANSWERS), STOPS)

    def test_2_a_claim_that_could_not_be_made_again_is_tried_again(self):
        self.assertEqual(self.browser.run(KEPT), [2, True, 2, 3, 'It is yours. Leave it to others'])

    def test_2_a_claim_outlasts_a_console_that_was_restarted(self):
        told, is_held, problem, shown = self.browser.run(NOT_LISTED_YET)
        self.assertEqual((told, is_held, problem), (['claim'], True, ''))
        self.assertIn(YOURS, shown)

    def test_3_with_a_dead_master_no_answer_is_sent(self):
        self.master.kill()
        try:
            self.assertTrue(self.browser.says('master silent for', '#status'))
            self.assertTrue(self.refused('the ROS master'))
            self.assertTrue(self.browser.says('Your claim has run out', '.claim-bar'))
            # the robot gets a stop nevertheless
            self.browser.click('.detail [data-action=pause-machine]')
            # the robot's reply goes as soon as this line says the same, which may be at once
            self.assertTrue(self.browser.says('Paused by operator.', '.detail .standing'))
            self.assertEqual(self.browser.text('.detail .machine-hand .problem'), '')
            self.assertFalse(self.browser.find('.detail [data-action=resume-machine]').is_enabled())
        finally:
            type(self).master = start_master(self.master_port)
        self.browser.click('.detail [data-action=resume-machine]')
        self.assertTrue(self.browser.says('goes on', '.detail .hand-reply'))
        self.assertTrue(self.answerable())

    def test_4_a_robot_that_is_stopped_is_silent(self):
        self.robot.freeze()
        try:
            self.assertTrue(self.refused('/alpha'))
            self.assert_accessible('a robot that is silent')
            self.assertEqual(self.browser.run(COLOURS_OF_STOP), ['none'], 'it keeps its colours')
            self.assertEqual(self.browser.text('#status'), LIVE, 'the others are heard')
            self.browser.click('#tab-machines')
            self.assertTrue(
                wait_for(
                    lambda: self.browser.run(
                        'return Boolean(document.querySelector(".machine-card.silent"))'
                    )
                )
            )
            self.browser.click('#tab-questions')
        finally:
            self.robot.thaw()
        self.assertTrue(self.answerable())

    def test_5_a_robot_that_was_killed_reads_as_gone(self):
        browser = self.browser
        self.robot.kill()
        self.assertTrue(browser.says('/alpha is gone', '.claim-bar'))
        self.assertNotIn('answered elsewhere', browser.text())
        type(self).robot = self.start_robot('console_robot.py', 'PICK', '0.1', '0', '9')
        browser.find(QUESTION)
        self.assertIn(
            '/alpha is gone', browser.text('.claim-bar'), 'that question does not come back'
        )
        browser.click('.claim-bar .inline')
        browser.click(QUESTION)
        self.take()
        self.assertTrue(self.answerable())
        self.assertEqual(browser.errors(), [])


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'console_live', Live)
