"""The console as a node of its own, a robot that asks, and a real browser at the page: for a class
of tests.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile

from roslib.packages import find_node
from waiting import wait_for

from smach_oracle.experiment.launching import free_port

HERE = os.path.dirname(os.path.abspath(__file__))
YOURS = 'It is yours.'
WITH_BROWSER = bool(shutil.which('chromedriver'))
# pressed in the very frame in which it comes: no wall clock has a part in it
PRESS_AT_ONCE = """
const [selector, done] = arguments;
const look = () => {
  const button = [...document.querySelectorAll(selector)].find((each) => each.offsetParent);
  if (!button || button.disabled) { requestAnimationFrame(look); return; }
  const it = { bubbles: true, cancelable: true, detail: 1 };
  button.dispatchEvent(new PointerEvent("pointerdown", it));
  button.dispatchEvent(new MouseEvent("click", it));
  done(Number(document.body.dataset.refused || 0));
};
look();"""
# a page's view of a question of the robot /r, for ann, and what a test does with it: `said` has the
# list tell who holds it, `replies` are those to claims, `told` are the names of all commands
OF_A_QUESTION = """
const paths = ["questions/question_detail.js", "page/store.js", "page/liveness.js"];
return Promise.all(paths.map((path) => import("/static/js/" + path))).then(async (
  [{ QuestionDetail }, { Store }, { Liveness }]) => {
  const store = new Store();
  const question = { key: "s q", server: "s", id: "q", trial: "t", robot: "/r", path: "TASK",
    state: "PICK", what: "failed", outcome: "", text: "", class: 0, rate: null, continuous: false,
    recoveries: 0, reason: "", tried: [], status: "claimed", holder: "bob", idle: 0, interface: "",
    asked: 0, deadline: null, fallback: "", history: [], above: [], choices: [], supersede: [],
    outputs: [], give_up: [], give_up_above: [], interfaces: [], userdata: [], running: false };
  const replies = [];
  const told = [];
  const request = async (name) => {
    told.push(name);
    return (name === "claim" && replies.shift()) || { ok: true, message: "" };
  };
  const app = { store, expert: "ann", mayAnswer: true, role: "operator", current: "questions",
    connection: { connected: true, request, browser: "b1" }, liveness: new Liveness(store),
    went() {}, isMine: ({ holder, session }) => holder === "ann" && session === "b1" };
  const detail = new QuestionDetail(app, question, { leave() {}, choose() {} });
  store.onChange((names) => detail.draw(names));
  const said = (holder) => {
    const session = holder === "ann" ? "b1" : "";
    const status = holder ? "claimed" : "pending";
    store.receive({ now: 0, sections: { questions: [{ ...question, holder, session, status }] } });
    return detail.root.querySelector(".claim-bar").textContent;
  };
%s
});"""


class Node:
    """A node of its own process."""

    def __init__(self, *command):
        self._process = subprocess.Popen(command)

    def freeze(self):
        """SIGSTOP: its connections stay, and nothing answers."""
        self._process.send_signal(signal.SIGSTOP)

    def thaw(self):
        """SIGCONT."""
        self._process.send_signal(signal.SIGCONT)

    def kill(self):
        """SIGKILL: it takes leave of nobody."""
        self._process.kill()
        self._process.wait(20)

    def stop(self):
        """Ctrl-C, as from a shell."""
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait(20)


class ConsolePage:
    """Beside unittest.TestCase."""

    whole_browser = False

    @classmethod
    def begin(cls, robot, *arguments, size=(), name='operator'):
        """Start the console, the robot /alpha (a file beside this one, and its arguments) and a
        browser at the page, of somebody who has given that name before.
        """
        from browser import Browser

        cls.port = free_port()
        cls.page = 'http://localhost:{}/'.format(cls.port)
        cls.console = cls.start_console()
        cls.robot = cls.start_robot(robot, *arguments)
        cls.browser = Browser(*size, whole=cls.whole_browser)
        wait_for(cls.page_is_served, 40.0)
        cls.browser.driver.get(cls.page)
        if name:
            cls.remember_name(cls.browser, name)

    def sign_in_to_machines(self, role):
        """With the token of a role, in the file `tokens` of the test."""
        with open(self.tokens) as lines:
            token = next(line.split()[1] for line in lines if line.startswith(role))
        self.browser.find('#token').send_keys(token)
        self.browser.click('#sign-in')
        self.browser.click('#tab-machines')

    @staticmethod
    def remember_name(browser, name):
        """As if it had been given before; the page begins again."""
        browser.run('localStorage.setItem("expert", arguments[0])', name)
        browser.driver.refresh()

    @classmethod
    def start_robot(cls, robot, *arguments):
        return Node(sys.executable, os.path.join(HERE, robot), *arguments, '__name:=alpha')

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.robot.stop()
        cls.console.stop()

    @classmethod
    def make_folder(cls):
        """An empty one, for as long as the class runs."""
        folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, folder, ignore_errors=True)
        return folder

    @classmethod
    def start_console(cls, *more):
        return Node(
            find_node('smach_oracle', 'expert_console')[0],
            '_port:={}'.format(cls.port),
            '__name:=expert_console',
            *more,
        )

    def take(self, browser=None):
        """Take the question that is shown: to read it takes nothing."""
        browser = browser or self.browser
        browser.click('[data-action=claim]')
        self.assertTrue(browser.says(YOURS), browser.text('.claim-bar'))

    @classmethod
    def page_is_served(cls):
        with socket.socket() as probe:
            return probe.connect_ex(('127.0.0.1', cls.port)) == 0

    def assert_wide_at(self, width, selector, least):
        """An element has so many px in a window of that width."""
        driver, size = self.browser.driver, {'deviceScaleFactor': 1, 'mobile': False}
        driver.execute_cdp_cmd(
            'Emulation.setDeviceMetricsOverride', dict(size, width=width, height=768)
        )
        wide = 'return document.querySelector(arguments[0]).getBoundingClientRect().width'
        self.assertGreater(self.browser.run(wide, selector), least)
        driver.execute_cdp_cmd('Emulation.clearDeviceMetricsOverride', {})

    def assert_accessible(self, view):
        """axe-core finds nothing wrong with what the page shows now, in any of its colours."""
        from accessibility import violations

        self.assertEqual([view] + violations(self.browser), [view])

    def press_at_once(self, selector):
        """As soon as it is there; how often the page has refused anything by then."""
        self.browser.driver.set_script_timeout(60)
        return self.browser.driver.execute_async_script(PRESS_AT_ONCE, selector)
