#!/usr/bin/env python3
"""The queue of ten robots that ask at the same time: told apart, sorted, searched, and answered
alike. Real nodes, a real console, a real browser.
"""

import os
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import HERE, WITH_BROWSER, ConsolePage, Node
from waiting import wait_for

from smach_oracle.msg import ConsoleCommand, OpenQueries
from smach_oracle.srv import ClaimQuery, ClaimQueryRequest

ROBOTS = 10
ODD = 4  # has no PLAN_0
ROW = '.question-row[data-key^="/robot_{}/"]'
ALIKE = '.alike-row[data-key^="/robot_{}/"]'
ORDER = (
    'return [...document.querySelectorAll(".question-row")]'
    '.map((each) => Number(/robot_(\\d+)/.exec(each.dataset.key)[1]))'
)

# orders, groups, advice and causes of questions that are made up
PURE = """
const done = arguments[arguments.length - 1];
import("/static/js/questions/queue_wishes.js").then(({ wanted, grouped, advice, causeOf }) => {
  const it = (key, robot, deadline, rank, continuous, what) => ({ key, robot, deadline, continuous,
    class: rank, what, rate: 0.5, asked: key.charCodeAt(0), path: "T", state: "S", outcome: "",
    text: "", holder: "", choices: [] });
  const open = [it("a", "/r10", null, 1, false, "failed"),
    it("b", "/r11", 90, 3, false, "failed x"), it("c", "/r2", 80, 1, true, "failed"),
    it("d", "/r1", null, 2, true, "failed y")];
  const is = { waits: () => true, isMine: () => false };
  const orders = {};
  for (const order of ["oldest", "deadline", "severity", "robot"]) {
    orders[order] = wanted(open, { order, filter: "all", text: "" }, is).map(({ key }) => key);
  }
  const groups = grouped(open, true).map(({ questions }) => questions.map(({ key }) => key));
  const choice = (state, helped, recommended) => ({ state, helped, recommended });
  const advised = [
    [choice("H", [3, 3], ""), choice("R", [0, 0], "because")],
    [choice("X", [0, 2], ""), choice("Y", [1, 2], ""), choice("H", [2, 3], "")],
    [choice("X", [0, 2], "")],
  ].map((choices) => advice({ choices })).map((each) => (
    each ? each.choice.state + " " + each.why : null));
  done([orders, groups, advised, [causeOf("Traceback:\\n  line 1\\nKeyError: x\\n"), causeOf("")]]);
});"""

# signs of made-up robots, and whether they have the same colours whichever of them asks first
MARKS = """
const [names, done] = arguments;
const path = "/static/js/robots/robot_mark.js";
const marks = async (part, first) => {
  const { knowRobots, robotMark } = await import(path + "?" + part);
  knowRobots(first);
  return names.map((name) => {
    const mark = robotMark(name);
    return [mark.textContent, mark.style.getPropertyValue("--hue")];
  });
};
Promise.all([marks("1", names), marks("2", [...names].reverse())]).then(([one, other]) => (
  done([one.map(([sign]) => sign), String(one) === String(other)])));"""

# in the list of two made-up questions: the cards that change as the same two are told again, and
# as the second one is claimed; then how the times of the first one have passed without a drawing
DRAWN = """
const done = arguments[arguments.length - 1];
const paths = ["questions/question_panel.js", "page/store.js", "page/liveness.js",
  "page/format.js"];
Promise.all(paths.map((path) => import("/static/js/" + path))).then((
  [{ questions }, { Store }, { Liveness }, { letTimePass }]) => {
  const store = new Store();
  const it = (robot) => ({ key: "s " + robot, server: "s", robot, path: "T", state: "S", what: "",
    text: "", class: 1, rate: 0.5, continuous: false, status: "pending", holder: "", idle: 0,
    interface: "", asked: 10, deadline: 100, outcome: "", choices: [] });
  const open = [it("/r1"), it("/r2")];
  const app = { store, expert: "ann", mayAnswer: true, current: "", isMine: () => false,
    connection: { connected: true, browser: "b" }, liveness: new Liveness(store), went() {} };
  const panel = questions.create(app);
  const list = panel.root.querySelector(".queue");
  const seen = new MutationObserver(() => {});
  const all = { attributes: true, characterData: true, childList: true, subtree: true };
  seen.observe(list, all);
  const give = (now) => {
    store.receive({ now, sections: { questions: structuredClone(open) } });
    panel.draw();
  };
  const changes = () => [...new Set(seen.takeRecords().map(({ target }) => (
    (target instanceof Element ? target : target.parentElement).closest("[data-key]")
  )).map((card) => card && card.dataset.key))];
  give(20);
  const drawn = [changes().length > 0];
  give(20);
  drawn.push(changes());
  open[1].status = "claimed";
  open[1].holder = "bob";
  give(20);
  drawn.push(changes());
  letTimePass(list, 95);
  drawn.push(list.querySelector(".times").textContent);
  give(95);
  drawn.push(list.querySelector(".left").className);
  done(drawn);
});"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Queue(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.open, cls.audited = {}, []
        for number in range(ROBOTS):
            rospy.Subscriber(
                '/robot_{}/expert_query/open'.format(number),
                OpenQueries,
                lambda message, each=number: cls.open.update({each: message.queries}),
            )
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        cls.begin('console_fleet_robots.py', str(ROBOTS), str(ODD), size=(1440, 900), name='ann')
        for number in range(ROBOTS):
            cls.browser.find(ROW.format(number), 60.0)

    @classmethod
    def start_robot(cls, robot, *arguments):
        """Ten of them, each of a name of its own."""
        return Node(sys.executable, os.path.join(HERE, robot), *arguments)

    def went(self, number):
        return rospy.get_param('/robot_{}/went'.format(number), [])

    def order(self):
        return self.browser.run(ORDER)

    def choose(self, title, value):
        self.browser.run(
            'const it = document.querySelector(`[aria-label="${arguments[0]}"]`);'
            'it.value = arguments[1]; it.dispatchEvent(new Event("change"))',
            title,
            value,
        )

    def test_1_ten_robots_are_told_apart_and_their_cards_say_what_to_choose_by(self):
        browser = self.browser
        self.assertTrue(browser.says('10 questions alike: JOB/WORK raised an exception'))
        marks = browser.run(
            'return [...document.querySelectorAll(".question-row .robot-mark")].map((each) => ('
            'each.textContent + getComputedStyle(each).backgroundColor))'
        )
        self.assertEqual(len(set(marks)), ROBOTS, marks)
        card = browser.text(ROW.format(7))
        for told in ('/robot_7', 'WORK', 'RuntimeError: /robot_7 is stuck', 'waits', 'left'):
            self.assertIn(told, card)
        self.assertRegex(card, '(moderate|high) failure rate')
        for width, columns in ((2560, 5), (1440, 2), (390, 1)):
            browser.screenshot(os.devnull, width, 900)
            places = browser.run(
                'return [...document.querySelectorAll(".question-row")]'
                '.map((each) => Math.round(each.getBoundingClientRect().x))'
            )
            self.assertGreaterEqual(len(set(places)), columns, width)
            self.assertEqual(
                browser.run('return document.documentElement.scrollWidth > innerWidth'), False
            )
            self.assert_accessible('queue at {}'.format(width))
        browser.driver.execute_cdp_cmd('Emulation.clearDeviceMetricsOverride', {})

    def test_2_they_are_sorted_searched_and_filtered(self):
        browser = self.browser
        self.choose('Order', 'robot')
        self.assertTrue(wait_for(lambda: self.order() == list(range(ROBOTS))), self.order())
        browser.run('document.activeElement.blur()')
        browser.press('/')
        browser.driver.switch_to.active_element.send_keys('robot_7 stuck')
        self.assertTrue(wait_for(lambda: self.order() == [7]), self.order())
        browser.driver.switch_to.active_element.send_keys(' nothing')
        self.assertTrue(browser.says('10 open questions, none of which is wanted.'))
        browser.click('[data-action=show-all]')
        self.assertTrue(wait_for(lambda: len(self.order()) == ROBOTS))
        self.choose('Which ones', 'mine')
        self.assertTrue(wait_for(lambda: self.order() == []))
        self.choose('Which ones', 'all')
        self.assertTrue(wait_for(lambda: len(self.order()) == ROBOTS))

    def test_3_the_key_n_goes_through_all_of_them_in_the_order_of_the_list(self):
        browser = self.browser
        browser.run('document.activeElement.blur()')
        seen = []
        for _ in range(ROBOTS + 1):
            browser.press('n')
            seen.append(browser.text('.detail-head p').split(' ')[0])
        names = ['/robot_{}'.format(number) for number in range(ROBOTS)]
        self.assertEqual(seen, names + names[:1])
        browser.press('\ue00c')  # Escape

    def test_4_one_answer_for_all_is_checked_and_sent_for_each_by_itself(self):
        browser = self.browser
        rospy.ServiceProxy('/robot_6/expert_query/claim', ClaimQuery)(
            ClaimQueryRequest.CLAIM, self.open[6][0].query.query_id, 'bob', 60.0
        )
        self.assertTrue(browser.says('bob', ROW.format(6)))
        browser.click('[data-action=alike]')
        browser.find('#alike-answer')
        options = browser.texts('#alike-answer option')
        self.assertIn('Go to PLAN_0 (offered by 9)', options)
        browser.run(
            'const it = document.querySelector("#alike-answer");'
            'it.selectedIndex = arguments[0]; it.dispatchEvent(new Event("change"))',
            options.index('Go to PLAN_0 (offered by 9)'),
        )
        self.assertTrue(browser.says('✗ PLAN_0 is not offered', ALIKE.format(ODD)))
        self.assertTrue(browser.says('✗ bob works on it', ALIKE.format(6)))
        self.assertTrue(browser.says('✓ offered', ALIKE.format(1)))
        browser.click(ALIKE.format(2) + ' input')
        self.assertTrue(browser.says('Send to 7', '[data-action=send-alike]'))
        self.assert_accessible('one answer for all')
        self.assertEqual([told.command for told in self.audited if told.command == 'claim'], [])
        browser.click('[data-action=send-alike]')
        self.assertTrue(browser.says('Sent to 7 of 7.', '.alike'), browser.text('.alike'))
        answered = [each for each in range(ROBOTS) if each not in (2, ODD, 6)]
        for number in range(ROBOTS):
            wanted = [0] if number in answered else []
            self.assertTrue(wait_for(lambda n=number, w=wanted: self.went(n) == w), number)
        told = [
            (each.robot, each.expert, each.ok) for each in self.audited if each.command == 'answer'
        ]
        self.assertEqual(
            sorted(told), [('/robot_{}'.format(each), 'ann', True) for each in answered]
        )
        browser.click('[data-action=leave-alike]')
        self.assertTrue(wait_for(lambda: self.order() == [2, 4, 6]), self.order())
        self.assertEqual(browser.errors(), [])

    def test_5_an_answer_that_a_robot_refuses_is_said_and_its_question_let_go(self):
        browser = self.browser
        # as if what the page knows were old: the robot has no such state
        refused = browser.driver.execute_async_script(
            """
            const done = arguments[arguments.length - 1];
            import("/static/js/questions/alike_answer.js").then(async ({ AlikeAnswer }) => {
              const told = [];
              const choices = [{ state: "GONE", container: "", blocked: "", missing: [],
                repeats: [], success: null, recommended: "" }];
              const question = { key: "s q", server: "s", robot: "/r", path: "T", state: "W",
                what: "failed", outcome: "", asked: 0, status: "pending", holder: "", choices,
                supersede: [], outputs: [] };
              const app = { mayAnswer: true, isMine: () => false,
                liveness: { whoIsSilent: () => "" },
                store: { questions: [question], get: () => undefined, now: () => 9 },
                connection: { request: async (name) => {
                  told.push(name);
                  return { ok: name !== "answer", message: "there is no state GONE" };
                } } };
              const view = new AlikeAnswer(app, [question], () => {});
              view.choice.selectedIndex = 1;
              view.show();
              await view.sendAll();
              done([told.join(), view.root.querySelector(".alike-list").textContent,
                view.said]);
            });"""
        )
        self.assertEqual(refused[0], 'claim,answer,release')
        self.assertIn('✗ there is no state GONE', refused[1])
        self.assertEqual(refused[2], 'Sent to 0 of 1.')

    def test_6_the_order_the_groups_and_the_advice_are_of_what_is_known(self):
        orders, groups, advised, causes = self.browser.driver.execute_async_script(PURE)
        self.assertEqual(
            orders,
            {
                'oldest': ['a', 'b', 'c', 'd'],
                'deadline': ['c', 'b', 'a', 'd'],  # those without a limit come last
                'severity': ['b', 'd', 'c', 'a'],
                'robot': ['d', 'c', 'a', 'b'],  # r2 before r10
            },
        )
        self.assertEqual(groups, [['a', 'c'], ['b'], ['d']])
        self.assertEqual(advised, ['R because', 'H ', None])
        self.assertEqual(causes, ['KeyError: x', ''])

    def test_7_robots_keep_their_signs_and_colours(self):
        for names, signs in (
            (['/robot_7', '/robot_12'], ['7', '12']),
            (['/r1/task', '/r2/task'], ['1', '2']),
            (['/fleet/alpha', '/fleet/bravo'], ['al', 'br']),
            (['/alpha/task', '/bravo/task', '/bravo/arm'], ['al', 'ta', 'ar']),
        ):
            self.assertEqual(self.browser.driver.execute_async_script(MARKS, names), [signs, True])

    def test_7_a_card_is_drawn_again_only_where_something_about_its_question_is_other(self):
        self.assertEqual(
            self.browser.driver.execute_async_script(DRAWN),
            [True, [], ['s /r2'], 'waits 1:25 min5 s left', 'left urgent'],
        )


if __name__ == '__main__':
    rospy.init_node('console_queue')
    rostest.rosrun('smach_oracle', 'console_queue', Queue)
