#!/usr/bin/env python3
"""The console commands nothing by accident, and says what an answer has led to: in a real browser,
with a real machine under a real oracle.
"""

import os
import sys
import unittest

import rosgraph
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import OF_A_QUESTION, WITH_BROWSER, YOURS, ConsolePage
from waiting import stays, wait_for

from smach_oracle.msg import ConsoleCommand, OpenQueries, OracleEvent
from smach_oracle.srv import ClaimQuery, ClaimQueryRequest

QUESTION = '.question-row[data-key^="/alpha/"]'
OWN_SERVER = '/a_server_of_its_own'
GO_TO_PLACE = '.choice.goto[data-name=PLACE]'
PLACE_KEY = '3'
GIVE_UP = '.choice.give_up[data-name=""]'
# what a second tap, and then its key, do as soon as there is something to tap: no wall clock has a
# part in it
TAP_AT_ONCE = """
const [row, answer, done] = arguments;
const tap = (element) => {
  const it = { bubbles: true, cancelable: true, detail: 1 };
  element.dispatchEvent(new PointerEvent("pointerdown", it));
  element.dispatchEvent(new MouseEvent("click", it));
};
tap(document.querySelector(row));
const look = () => {
  const button = document.querySelector(answer);
  if (!button || button.disabled) { requestAnimationFrame(look); return; }
  tap(button);
  const key = button.querySelector("kbd").textContent;
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  done(key);
};
look();"""
# opened in the very frame in which it is listed, and left at once
OPEN_AND_LEAVE = """
const [row, done] = arguments;
const shown = () => Boolean(document.querySelector(".detail"));
const look = () => {
  const found = document.querySelector(row);
  if (!found) { requestAnimationFrame(look); return; }
  const it = { bubbles: true, cancelable: true, detail: 1 };
  found.dispatchEvent(new PointerEvent("pointerdown", it));
  found.dispatchEvent(new MouseEvent("click", it));
  const opened = shown();
  const key = (name) => document.body.dispatchEvent(
    new KeyboardEvent("keydown", { key: name, bubbles: true }));
  key("Escape");
  key("n");
  const openedByKey = shown();
  key("Escape");
  done([opened, openedByKey, shown(), Number(document.body.dataset.refused || 0)]);
};
look();"""
# moved where it is drawn: what comes in above may leave a card that sticks, and all on it, in place
MOVE_AND_TAP = """
const [selector] = arguments;
const form = document.querySelector(".answer-form");
const button = document.querySelector(selector);
const top = () => button.getBoundingClientRect().top;
const before = top();
form.style.position = "relative";
form.style.top = "60px";
const moved = top() - before;
button.click();
form.removeAttribute("style");
return moved;"""
# somebody takes a question over; the list that shows it comes later than the reply
TAKEN = (
    OF_A_QUESTION
    % """
  said("bob");
  await detail.claim("take_over");
  said("bob");
  return [said("ann"), said("carl")];"""
)
# it was taken over, and comes back: nothing that was said of the one contradicts the other
BACK_AGAIN = (
    OF_A_QUESTION
    % """
  said("");
  await detail.claim("claim");
  said("ann");
  return [said("carl"), said("ann")];"""
)
# a press that was not meant opens another question than the one that is worked on: what was told
# while that one was only read, then, after the way back, and once the other one has been seen;
# which one the others are told that it is; and what is still typed
ANOTHER_BY_ACCIDENT = (
    OF_A_QUESTION
    % """
  const { questions } = await import("/static/js/questions/question_panel.js");
  const panel = questions.create(app);
  document.body.append(panel.root);
  let viewed = "";
  app.connection.request = (name, about) => {
    if (name === "view") viewed = about.question;
    return request(name);
  };
  const list = ["a", "b"].map((key) => ({ ...question, key, holder: "", status: "pending" }));
  store.receive({ now: 0, sections: { questions: list } });
  panel.draw(["questions"]);
  const sent = () => told.filter((name) => name !== "view").join();
  const press = (key) => panel.queue.querySelector(`[data-key=${key}]`).click();
  const typed = () => panel.stage.querySelector(".why").value;
  panel.choose("a", true);
  const read = sent();
  const why = panel.stage.querySelector(".why");
  why.value = "the mug lies";
  why.dispatchEvent(new Event("input", { bubbles: true }));
  for (let turn = 0; turn < 9; turn += 1) await null; // the replies are there, and no time is over
  press("b");
  const seen = [read, sent(), panel.detail.key];
  press("a");
  seen.push(sent(), panel.detail.key, typed());
  await new Promise((done) => setTimeout(done, 1000)); // longer than 0.7 s
  seen.push(sent());
  press("b");
  await new Promise((done) => setTimeout(done, 1500)); // others are told within 1 s
  seen.push(sent(), panel.detail.key, viewed);
  press("a");
  seen.push(typed());
  panel.close();
  app.current = "";
  panel.root.remove();
  return seen;"""
)
# "No, go back" from giving up a container above that may end as the failed one may
GO_BACK = """
return import("/static/js/answering/answer_form.js").then(({ AnswerForm }) => {
  const form = new AnswerForm({ choices: [], interfaces: [], state: "PICK", path: "TOP/FETCH",
    outputs: [], userdata: [], supersede: [], history: [], give_up: ["aborted"],
    give_up_above: [{ container: "TOP", outcome: "aborted" }], running: false },
  () => {}, () => {});
  document.body.append(form.root);
  form.show(true, {}, 0);
  form.root.querySelector(".ends-above").open = true;
  form.giveUp.ask("aborted", "TOP");
  form.cancel();
  const focused = document.activeElement.dataset.container;
  form.root.remove();
  return focused;
});"""
# which outcome the key `s` sends, of states with these outcomes and what they mean
SENT_BY_S = """
return import("/static/js/answering/answer_form.js").then(({ AnswerForm }) => (
  arguments[0].map((outcomes) => {
    const sent = [];
    const form = new AnswerForm({ choices: [], interfaces: [], state: "TURN", path: "TASK",
      outputs: [], userdata: [], give_up: [], give_up_above: [], running: false, history: [],
      supersede: outcomes.map(([outcome, meaning]) => ({ outcome, meaning, target: "NEXT" })) },
    ({ name }) => sent.push(name), () => {});
    form.show(true, {}, 0);
    form.press("s");
    return sent.join();
  })));"""
GOOD, BAD = 'success', 'failure'
# a robot that is held after an answer, and whose silence ends
HELD = """
return import("/static/js/answering/follow_up.js").then(({ FollowUp }) => {
  let gone = "";
  const app = { current: "questions", connection: { request: async () => ({}) },
    store: { questions: [], onEvents: () => () => {} }, liveness: { gone: () => gone } };
  const question = { id: "q", trial: "t", robot: "/r", path: "TASK", state: "PICK" };
  const shown = new FollowUp(app, question, { leave() {}, choose() {} });
  shown.begin({ kind: "goto", name: "PLACE", container: "" });
  const events = [["query_answered", "q"], ["jump", ""], ["hold_start", ""]].map(
    ([kind, query]) => ({ kind, query, words: kind, text: "" }));
  shown.take({ trial: "t", from: 0, events });
  return ["", "gone", ""].map((now) => {
    gone = now;
    shown.draw();
    return shown.root.querySelector(".hint-of-steps").textContent;
  });
});"""
# how a machine stands whose state ORACLE is its oracle, by its graph or as no other state, or not
STANDING = """
return import("/static/js/robots/hand_words.js").then(({ standingWords }) => {
  const machine = { path: "TOP", running: true, paused: true, by: "ann", breakpoints: [], active: [
    { path: "TOP", state: "ORACLE", held: "", confirm: false },
    { path: "TOP", state: "PICK", held: "", confirm: false }] };
  const asked = { robot: "/r", path: "TOP", state: "GRASP", interface: "hand" };
  const words = (oracle, others, ...questions) => standingWords(machine, "/r", { questions,
    get: (name) => (name === "graph /r TOP" ? { oracle, states: ["PICK", ...others].map(
      (label) => ({ label })) } : undefined) });
  return [words("", ["ORACLE"], { ...asked, status: "pending" }), words("ORACLE", []),
    words("", [], { ...asked, status: "pending" }),
    words("ORACLE", [], { ...asked, status: "interface" })];
});"""
# many buttons in a box that shows few of them: how often within a second it is looked for what lies
# over a button; whether the first one, and the last one, are settled before that one is scrolled
# to, at once after that, and later
MANY = """
const done = arguments[arguments.length - 1];
const box = document.createElement("div");
box.style.cssText = "position: fixed; left: 0; top: 0; height: 200px; overflow: auto; z-index: 99";
for (let number = 0; number < 300; number += 1) {
  const button = document.createElement("button");
  button.dataset.deliberate = button.textContent = "made-up " + number;
  button.style.display = "block";
  box.append(button);
}
document.body.append(box);
const [first, last] = [box.firstChild, box.lastChild];
const settled = () => [first, last].map((button) => button.hasAttribute("data-settled"));
const pause = (ms) => new Promise((over) => setTimeout(over, ms));
const look = document.elementFromPoint.bind(document);
(async () => {
  await pause(2500);
  const found = [settled()];
  let looks = 0;
  document.elementFromPoint = (x, y) => { looks += 1; return look(x, y); };
  await pause(1000);
  delete document.elementFromPoint;
  last.scrollIntoView();
  await pause(200);
  found.push(settled());
  await pause(2500);
  found.push(settled());
  box.remove();
  done([looks, ...found]);
})();"""
REFUSED = 'the page had just changed there'


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class OnPurpose(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.audited, cls.events = [], []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        rospy.Subscriber('/alpha/oracle/events', OracleEvent, cls.events.append)
        rospy.set_param('/alpha/own_introspection', True)
        cls.listed = []
        rospy.Subscriber('/alpha/expert_query/open', OpenQueries, cls.listed.append)
        cls.begin('console_robot.py', 'PICK', '0.05', '6', '9')

    def answers(self):
        """The kinds of the answers that the console was told to send."""
        return [told.arguments for told in self.audited if told.command == 'answer']

    def press(self, key):
        self.browser.run('document.activeElement.blur()')
        self.browser.find('body').send_keys(key)

    def open_question(self):
        self.browser.click(QUESTION)
        self.assertTrue(wait_for(lambda: self.browser.settled(self.browser.find(GO_TO_PLACE))))

    def claims(self):
        return [told for told in self.audited if told.command == 'claim']

    def test_0_to_open_a_question_is_never_refused_and_sends_nothing(self):
        browser = self.browser
        browser.find(QUESTION)
        browser.driver.refresh()
        browser.driver.set_script_timeout(40)
        self.assertEqual(
            browser.driver.execute_async_script(OPEN_AND_LEAVE, QUESTION), [True, True, False, 0]
        )
        browser.driver.refresh()
        self.assertEqual(self.press_at_once(QUESTION), 0)
        self.assertTrue(browser.says('Nobody works on it.', '.claim-bar'))
        self.assertEqual(self.press_at_once(GIVE_UP), 0, 'it only asks')
        self.assertTrue(browser.says('Give up? The work of PICK stays undone'))
        self.assertEqual(self.press_at_once('[data-action=confirm-give-up]'), 1, 'this sends')
        self.assertTrue(stays(lambda: not self.claims(), 1.5), 'who only reads takes nothing')
        self.press('\ue00c')
        self.press('\ue00c')
        self.assertTrue(
            wait_for(lambda: not browser.run('return document.querySelector(".detail")'))
        )
        browser.driver.refresh()
        self.assertEqual(self.answers(), [])

    def test_0_what_is_out_of_sight_is_looked_at_seldom_and_settles_once_it_is_seen(self):
        self.browser.driver.set_script_timeout(40)
        looks, *found = self.browser.driver.execute_async_script(MANY)
        self.assertLess(looks, 1500, 'with all of them ten times a second it is 3000')
        self.assertTrue(found[0][0], 'it lies there')
        self.assertEqual(found[1], [False, False], 'one is gone, the other has just come')
        self.assertTrue(found[2][1], 'it has been seen for long enough')

    def test_1_the_second_tap_of_a_double_tap_answers_nothing(self):
        browser = self.browser
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(QUESTION))))
        browser.driver.set_script_timeout(40)
        key = browser.driver.execute_async_script(TAP_AT_ONCE, QUESTION, GO_TO_PLACE)
        self.assertEqual(key, PLACE_KEY)
        self.assertTrue(browser.says(REFUSED), browser.text())
        self.assertEqual(self.answers(), [])
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(GO_TO_PLACE))))
        self.assertAlmostEqual(browser.run(MOVE_AND_TAP, GO_TO_PLACE), 60.0, places=1)
        self.assertEqual(
            browser.run('return document.body.dataset.refused'),
            '3',
            'the tap, the key, and what has moved under the pointer',
        )
        self.assertEqual((self.answers(), self.claims()), ([], []))
        self.assertTrue(
            browser.says('Waits for an answer about PICK in KITCHEN/FETCH.', '.detail .standing'),
            browser.text('.detail .standing'),
        )

    def test_2_giving_up_is_confirmed_and_can_be_undone(self):
        browser = self.browser
        self.press('g')
        self.assertTrue(browser.says('Give up? The work of PICK stays undone'))
        self.press('g')
        self.assertTrue(stays(lambda: not self.answers(), 0.5), 'the key alone sends nothing')
        browser.click('[data-action=confirm-give-up]')
        self.assertTrue(browser.says('Giving up in'))
        self.assertTrue(browser.says(YOURS), 'it is taken before it is sent')
        self.assertFalse(browser.find('.choice.goto').is_enabled())
        browser.click('[data-action=undo-give-up]')
        self.assertTrue(wait_for(lambda: browser.find(GIVE_UP).is_enabled()))
        browser.click(GIVE_UP)
        browser.click('[data-action=confirm-give-up]')
        self.assertTrue(browser.says('Giving up in'))
        self.press('\ue00c')  # Escape
        self.assertTrue(
            browser.says('as the failure would have ended', '.give-up-part'),
            'undone, and the question is still shown',
        )
        browser.click('.other-ends summary')
        browser.click('.choice.give_up[data-name=succeeded]')
        self.assertTrue(browser.says('KITCHEN/FETCH ends with succeeded', '.give-up-asking'))
        browser.click('[data-action=confirm-give-up]')
        self.assertTrue(browser.find('.follow-up'))
        self.assertEqual(len(self.answers()), 1, 'sent once, undone twice')
        self.assertTrue(
            wait_for(lambda: OracleEvent.GIVE_UP in [event.kind for event in self.events])
        )
        self.assertTrue(
            browser.says('The robot gives up, as you said', '.follow-up .gave-up'),
            'that is no success',
        )
        self.assertTrue(
            browser.says('The trial is over: it ended with succeeded.', '.follow-up'),
            'after more than eight steps',
        )
        self.assertIn('earlier steps are left out', browser.text('.follow-up'))

    def test_3_single_letter_keys_can_be_turned_off(self):
        browser = self.browser
        browser.click('.follow-up [data-action=back]')
        browser.find(QUESTION)
        browser.click('#keys')
        self.press('n')
        self.assertTrue(
            stays(lambda: not browser.run('return document.querySelector(".detail")'), 0.5)
        )
        browser.click('#keys')
        browser.press('n')
        browser.find('.detail')
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(GO_TO_PLACE))))
        browser.click('#keys')
        for key in (PLACE_KEY, 's', 'g'):
            self.press(key)
        self.assertTrue(
            stays(lambda: len(self.answers()) == 1 and browser.find(GO_TO_PLACE).is_enabled(), 0.5)
        )
        self.assertNotIn('Give up?', browser.text())
        browser.click('#keys')
        self.assertEqual(browser.errors(), [])

    def claim(self, action):
        """As bob, from elsewhere."""
        self.assertTrue(wait_for(lambda: self.listed[-1].queries))
        call = rospy.ServiceProxy('/alpha/expert_query/claim', ClaimQuery)
        question = self.listed[-1].queries[0].query.query_id
        self.assertTrue(call(ClaimQueryRequest(action, question, 'bob', 30.0)).ok)

    def test_4_what_follows_an_answer_leads_to_the_next_question(self):
        browser = self.browser
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(GO_TO_PLACE))))
        browser.click('.choice.goto[data-name=DETECT]')
        self.assertTrue(browser.says('It asks again, about PICK.', '.follow-up'))
        browser.click('[data-action=next-question]')
        browser.click('.choice.goto[data-name=PLACE]')
        self.assertTrue(browser.says('The trial is over: it ended with succeeded.', '.follow-up'))
        browser.click('.follow-up [data-action=back]')

    def test_5_what_somebody_else_works_on_is_told(self):
        browser = self.browser
        browser.find(QUESTION)
        self.claim(ClaimQueryRequest.CLAIM)
        self.assertTrue(browser.says('Somebody works on the open question.'))
        self.assertNotIn('All quiet', browser.text())
        self.claim(ClaimQueryRequest.RELEASE)
        self.assertTrue(browser.says('1 question waits'))
        mine, taken = browser.run(TAKEN)
        self.assertEqual(mine, 'It is yours. Leave it to others')
        self.assertIn('carl has taken this question over.', taken)
        taken, mine = browser.run(BACK_AGAIN)
        self.assertIn('carl has taken this question over.', taken)
        self.assertEqual(mine, 'It is yours. Leave it to others')
        self.assertEqual(browser.run(GO_BACK), 'TOP', 'the focus is where it was')
        self.assertEqual(
            browser.run(ANOTHER_BY_ACCIDENT),
            [
                '',
                'claim',
                'b',
                'claim',
                'a',
                'the mug lies',
                'claim',
                'claim,release',
                'b',
                'b',
                '',
            ],
        )
        self.assertEqual(
            browser.run(
                SENT_BY_S,
                [
                    [['succeeded', GOOD], ['aborted', BAD]],
                    [['aborted', BAD], ['turned', 'other end'], ['done', GOOD]],
                    [['aborted', BAD], ['preempted', 'preempted']],
                    [['left', GOOD], ['right', GOOD]],
                    [['kept', GOOD], ['succeeded', GOOD]],
                ],
            ),
            ['succeeded', 'done', '', '', 'succeeded'],
            'the key stands for what an outcome means, not for its place',
        )
        waits = 'It waits until somebody lets it go on.'
        self.assertEqual(browser.run(HELD), [waits, 'gone', waits])
        ends = 'Paused by ann. Runs to its end: PICK in TOP.'
        self.assertEqual(
            browser.run(STANDING),
            [
                'Paused by ann. Runs to its end: ORACLE in TOP, PICK in TOP.',
                ends + ' The oracle of TOP decides what follows.',
                ends + ' Waits for an answer about GRASP in TOP.',
                ends + ' Interface hand runs for GRASP in TOP.',
            ],
        )
        self.assertEqual(browser.errors(), [])

    def test_6_a_machine_with_a_server_of_its_own_is_listed_once(self):
        def known():
            heard = dict(rosgraph.Master('/test').getSystemState()[1])
            return '/expert_console' in heard.get(OWN_SERVER + '/smach/container_structure', [])

        browser = self.browser
        self.assertTrue(wait_for(known), 'the console follows it')
        browser.click('#tab-machines')
        browser.find('[id="/alpha/KITCHEN/FETCH"]')
        # it tells its structure every 2 s
        self.assertTrue(
            stays(
                lambda: (
                    browser.run(
                        'return [...document.querySelectorAll(".picker .robot")]'
                        '.map((robot) => robot.textContent)'
                    )
                    == ['/alpha']
                ),
                5.0,
            )
        )


if __name__ == '__main__':
    rospy.init_node('console_on_purpose')
    rostest.rosrun('smach_oracle', 'console_on_purpose', OnPurpose)
