#!/usr/bin/env python3
"""Large machines on the page: what failed is seen at once, all else is found. Small and large
pages: what is needed has room.
"""

import os
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import HERE, WITH_BROWSER, ConsolePage, Node
from waiting import wait_for

from smach_oracle.analysis.graphs.container_graph import MOST_STATES

FAILED = 'STEP_150_OF_A_LONG_JOB'
# pixels between the middle of the failed row and the middle of its list
FROM_MIDDLE = """
const row = document.querySelector(".states tr.failed").getBoundingClientRect();
const frame = document.querySelector(".machine-card .table-frame").getBoundingClientRect();
return Math.abs(row.top + row.height / 2 - frame.top - frame.height / 2);"""

# a panel that is drawn twice, once while something in it is pressed: what stays, what is heard
VIEWS = """const scripts = ["dom.js", "redraw.js"];
return Promise.all(scripts.map((name) => import("/static/js/page/" + name))).then(
([{ h, pick }, { keep, render }]) => {
  const heard = [];
  const kept = h("canvas", {});
  const typed = h("input", {});
  const view = (number, names) => h("section", { class: "of-" + number },
    keep(typed), names.map((name) => h("button", { key: name, "data-name": name,
      onclick: () => heard.push(number + name) }, name)), h("div", {}, keep(kept)));
  const root = h("section", {});
  document.body.append(root);
  const button = (name) => root.querySelector("[data-name=" + name + "]");
  render(root, view(1, ["a", "b"]));
  const [b, place] = [button("b"), kept.parentElement];
  typed.focus();
  render(root, view(2, ["b", "c"]));
  const stays = b === button("b") && place === kept.parentElement && root.contains(kept);
  const focused = document.activeElement === typed;
  b.click();
  const press = (type) => b.dispatchEvent(new PointerEvent(type, { bubbles: true }));
  press("pointerdown");
  render(root, view(3, ["c"]));
  const waits = root.className + " " + root.contains(b);
  b.click();
  const after = root.className + " " + root.contains(b);
  const other = h("canvas", {});
  for (const each of [kept, other]) render(root, h("section", {}, keep(each)));
  const turned = root.firstElementChild === other && root.childElementCount === 1;
  for (const names of [[], ["a", "b", "c"]]) {
    render(root, h("section", {}, pick({}, names.map((name) => [name, name]), "a", () => {})));
  }
  const picked = root.querySelector("select").value;
  root.remove();
  return { heard: heard.join(), stays, focused, waits, after, turned, picked };
})"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class LargeMachines(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.begin('console_robot.py', FAILED, '0', '300', '1')
        cls.others = [
            Node(
                sys.executable,
                os.path.join(HERE, 'console_robot.py'),
                *(failing, '0', size, '1'),
                '__name:=' + name,
            )
            for name, failing, size in (
                ('beta', 'STEP_30_OF_A_LONG_JOB', '58'),
                ('gamma', 'FETCH', str(MOST_STATES + 1)),
            )
        ]

    @classmethod
    def tearDownClass(cls):
        for robot in cls.others:
            robot.stop()
        super().tearDownClass()

    def open_machine(self, robot):
        browser = self.browser
        browser.click('#tab-machines')
        browser.click('.group[aria-label="{}"] .path[title="KITCHEN"]'.format(robot), 90.0)

    def see(self, way):
        self.browser.click('.machine-card [data-way={}]'.format(way))

    def text(self, selector):
        return self.browser.run(
            'return document.querySelector(arguments[0])?.textContent || ""', selector
        )

    def says(self, selector, words):
        self.assertTrue(
            wait_for(lambda: words in self.text(selector), 40.0), self.text('.machine-card')
        )

    def test_1_of_300_states_the_failed_one_is_shown_with_what_is_around(self):
        browser = self.browser
        self.open_machine('/alpha')
        self.says('.around-state', FAILED + 'failed')
        self.says('.around section:first-child', 'STEP_149_OF_A_LONG_JOB succeeded')
        self.says('.around section:last-child', 'STEP_151_OF_A_LONG_JOB succeeded')
        self.says('.machine-view .note', 'It has 302 states.')
        self.assertFalse(browser.run('return document.querySelector(".machine-card .graph")'))
        self.assert_accessible('what is around a state')

    def test_2_a_person_walks_on_from_there_and_comes_back(self):
        browser = self.browser
        browser.click('.around section:last-child .link')
        self.says('.around-name', 'STEP_151_OF_A_LONG_JOB')
        browser.click('.around .tool')
        self.says('.around-name', FAILED)

    def test_3_a_state_is_found_by_a_part_of_its_name(self):
        browser = self.browser
        search = browser.find('.machine-card .state-search input')
        search.send_keys('step_29')
        self.says('.state-search', '11 of 302 states')
        self.says('.around-name', 'STEP_29_OF_A_LONG_JOB')
        browser.press('\ue007')  # Enter
        self.says('.around-name', 'STEP_290_OF_A_LONG_JOB')
        self.see('list')
        self.assertTrue(
            wait_for(lambda: len(browser.run('return [...document.querySelectorAll("tr")]')) == 12)
        )
        browser.find('.machine-card .state-search input').clear()
        browser.run(
            'document.querySelector(".state-search input").dispatchEvent(new Event("input"))'
        )

    def test_4_the_list_begins_at_the_failed_row(self):
        self.assertTrue(wait_for(lambda: self.browser.run(FROM_MIDDLE) < 60))
        self.assert_accessible('the list of states')

    def test_5_sixty_states_are_drawn_and_their_ways_to_preempted_are_one_number(self):
        browser = self.browser
        browser.run('localStorage.removeItem("machine-view")')  # as for a new person
        self.open_machine('/beta')
        self.says('.graph .bundled', 'from 60 states')
        self.assertTrue(wait_for(lambda: browser.run('return !!document.querySelector(".state")')))
        self.assertEqual(
            browser.run(
                'return [...document.querySelectorAll(".graph .edge-label")]'
                '.filter((each) => each.textContent.startsWith("preempted")).length'
            ),
            0,
        )
        self.assertTrue(browser.find('.graph-map'), 'not all of it is seen')
        browser.find('.machine-card .state-search input').send_keys('arms_aside')
        self.assertTrue(
            wait_for(lambda: 'MOVE_ARMS_ASIDE' in self.text('.state.found')), 'found in the drawing'
        )
        self.assert_accessible('a drawing with a map')

    def test_6_more_than_anybody_can_read_is_refused_politely(self):
        self.open_machine('/gamma')
        self.says(
            '.machine-view .note',
            'It has {} states, which are too many to be shown.'.format(MOST_STATES + 3),
        )
        self.assertEqual(self.browser.errors(), [])

    def at(self, width, height):
        """The page at another size."""
        self.browser.driver.execute_cdp_cmd(
            'Emulation.setDeviceMetricsOverride',
            {'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': width < 500},
        )
        self.assertTrue(wait_for(lambda: self.browser.run('return innerWidth') == width))

    def test_7_a_question_has_the_room_of_a_tablet_and_the_queue_that_of_a_wall(self):
        browser = self.browser
        browser.click('#tab-questions')
        self.at(2560, 1440)
        columns = 'return getComputedStyle(document.querySelector(".queue")).gridTemplateColumns'
        self.assertTrue(wait_for(lambda: len(browser.run(columns).split()) >= 4))
        self.at(768, 1024)
        browser.click('.question-row')
        self.assertGreater(browser.find('.detail').size['width'], 560)
        self.assertFalse(browser.find('.detail .back').size['width'] == 0)
        self.assert_accessible('a question on a tablet')

    def test_8_what_the_page_tells_lies_not_over_the_way_back(self):
        browser = self.browser
        self.at(390, 844)
        browser.run('import("/static/js/page/dom.js").then(({ toast }) => toast("told", "good"))')
        self.assertTrue(browser.says('told', '#toasts'))
        self.assertTrue(
            browser.run(
                'const { x, y, width, height } = arguments[0].getBoundingClientRect();'
                'return arguments[0].contains(document.elementFromPoint(x + width / 2,'
                ' y + height / 2));',
                browser.find('.detail .back'),
            )
        )
        browser.click('.toast')
        self.assertTrue(
            wait_for(lambda: not browser.run('return document.querySelector(".toast")'))
        )

    def test_9_a_view_keeps_what_is_there_and_waits_for_a_press(self):
        self.assertEqual(
            self.browser.run(VIEWS),
            {
                'heard': '2b,2b',  # the listener of the newest view that had the button
                'stays': True,
                'focused': True,
                'waits': 'of-2 true',
                'after': 'of-3 false',
                'turned': True,  # one that is kept is never made like another one
                'picked': 'a',  # of options that come later
            },
        )


if __name__ == '__main__':
    rospy.init_node('console_large')
    rostest.rosrun('smach_oracle', 'console_large', LargeMachines, sys.argv)
