"""A headless Chromium for tests of web pages, with a profile of its own."""

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
import time

from selenium import webdriver
from selenium.common.exceptions import (
    ElementClickInterceptedException,
    ElementNotInteractableException,
    StaleElementReferenceException,
    WebDriverException,
)
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from urllib3.exceptions import MaxRetryError
from waiting import wait_for

# Debian's Chromium without windows and tabs: it starts for 1.3 s of processor time less
SHELL = '/usr/lib/chromium/chromium-headless-shell'
# chromedriver's first page does not come up in it, if it is not given one
START_SHELL = '#!/bin/sh\nexec {} about:blank --headless=old "$@"\n'.format(SHELL)
EVERY_S = 0.05  # a look at the page takes 4 ms of three processes
FLAGS = [
    '--headless=new',
    '--no-sandbox',
    '--disable-gpu',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
    '--disable-dev-shm-usage',
    '--disable-extensions',
    '--mute-audio',
    '--disable-background-timer-throttling',
]
# what is about to be replaced, moved, or uncovered
NOT_YET = (
    StaleElementReferenceException,
    ElementClickInterceptedException,
    ElementNotInteractableException,
)
# WebDriver's own ways to find what is shown, and to read its text, compute 4 and 20 times as long
SHOWN = """
const shown = [...document.querySelectorAll(arguments[0])].find((each) => (
  each.checkVisibility({ opacityProperty: true, visibilityProperty: true })
  && [...each.getClientRects()].some(({ width, height }) => width || height))) || null;"""
TEXT = """
const it = document.querySelector(arguments[0]);
return it && it.checkVisibility() ? it.innerText ?? it.textContent : "";"""
# the page refuses a click that comes too soon after a change
SETTLED = """
const settled = (it) => {
  const deliberate = it.closest("[data-deliberate]");
  if (!deliberate || deliberate.hasAttribute("data-settled")) return true;
  deliberate.scrollIntoView({ block: "center" });
  return false;
};"""
CLICKABLE = (
    SHOWN + SETTLED + 'return shown && !shown.matches(":disabled") && settled(shown)'
    ' ? [shown, document.body.dataset.refused] : null;'
)


class Browser:
    """One browser; everything is waited for, since the machine may be loaded.

    `whole`: with tabs, and windows that lose the focus.
    """

    def __init__(self, width=1360, height=860, whole=True):
        self._profile = tempfile.mkdtemp(prefix='console-browser-')
        options = Options()
        for flag in FLAGS + [
            '--user-data-dir=' + self._profile,
            '--window-size={},{}'.format(width, height),
        ]:
            options.add_argument(flag)
        if not whole and os.path.exists(SHELL):
            options.binary_location = self._start_of_shell()
        options.accept_insecure_certs = True  # such as tests make themselves
        options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
        self.driver = webdriver.Chrome(
            service=Service(shutil.which('chromedriver')), options=options
        )
        self.driver.set_page_load_timeout(30)

    def _start_of_shell(self):
        path = os.path.join(self._profile, 'start_shell')
        with open(path, 'w') as script:
            script.write(START_SHELL)
        os.chmod(path, 0o755)
        return path

    def close(self):
        """End it, with its profile."""
        with contextlib.suppress(WebDriverException, MaxRetryError):  # it may have been killed
            self.driver.quit()
        shutil.rmtree(self._profile, ignore_errors=True)

    def kill(self):
        """As when its machine loses its power; it can only be closed then."""
        for pid in _below(self.driver.service.process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def find(self, selector, limit_s=40.0):
        """The first element that is there and shown; raises where none comes in time."""
        found = wait_for(lambda: self._shown(selector), limit_s, EVERY_S)
        if not found:
            raise AssertionError(
                'nothing on the page for {!r}; it says:\n{}'.format(selector, self.text()[:2000])
            )
        return found

    def click(self, selector, limit_s=40.0):
        """Click what is there, shown and enabled; the page may replace, move or cover it in
        between.
        """

        def clicked():
            try:
                found = self.run(CLICKABLE, selector)
                if not found:
                    return False
                element, before = found
                element.click()
                return self._refused() == before
            except NOT_YET:
                return False

        if not wait_for(clicked, limit_s, EVERY_S):
            raise AssertionError(
                '{!r} cannot be clicked; the page says:\n{}'.format(selector, self.text()[:2000])
            )

    def settled(self, element):
        """Whether a click on an element would be taken as meant: the page refuses one that comes
        too soon after a change.
        """
        return self.run(SETTLED + 'return settled(arguments[0])', element)

    def _refused(self):
        return self.run('return document.body.dataset.refused')

    def press(self, key):
        """A key, to whatever has the focus, once the page takes it as meant."""

        def pressed():
            before = self._refused()
            ActionChains(self.driver, duration=0).send_keys(key).perform()
            return self._refused() == before

        if not wait_for(pressed):
            raise AssertionError(
                '{!r} is refused; the page says:\n{}'.format(key, self.text()[:2000])
            )

    def hold(self, key):
        """Press a key and hold it, once the page takes it as meant."""

        def held():
            before = self._refused()
            ActionChains(self.driver, duration=0).key_down(key).perform()
            if self._refused() == before:
                return True
            ActionChains(self.driver, duration=0).key_up(key).perform()
            return False

        if not wait_for(held):
            raise AssertionError(
                '{!r} cannot be held; the page says:\n{}'.format(key, self.text()[:2000])
            )

    def tap(self, selector):
        """With a finger, in the middle of what is there and shown, once the page takes it as
        meant.
        """
        self.run('arguments[0].scrollIntoView({ block: "center" })', self.find(selector))
        if not wait_for(lambda: self._tapped(selector)):
            raise AssertionError(
                '{!r} takes no tap; the page says:\n{}'.format(selector, self.text()[:2000])
            )

    def _tapped(self, selector):
        element, before = self.find(selector), self._refused()
        if not self.settled(element):
            return False
        x, y = self.run(
            'window.tapped = false;'
            'window.addEventListener("click", () => { window.tapped = true },'
            '{ capture: true, once: true });'
            'const { x, y, width, height } = arguments[0].getBoundingClientRect();'
            'return [x + width / 2, y + height / 2]',
            element,
        )
        for kind, points in (('touchStart', [{'x': x, 'y': y}]), ('touchEnd', [])):
            self.driver.execute_cdp_cmd(
                'Input.dispatchTouchEvent', {'type': kind, 'touchPoints': points}
            )
        wait_for(lambda: self.run('return window.tapped') or self._refused() != before)
        return self._refused() == before

    def says(self, text, selector='body', limit_s=40.0):
        """Whether an element comes to hold a text."""
        return bool(wait_for(lambda: text in self.text(selector), limit_s, EVERY_S))

    def text(self, selector='body'):
        """The lines of text of the first such element, '' where none is shown."""
        lines = self.run(TEXT, selector).splitlines()
        return '\n'.join(' '.join(line.split()) for line in lines if line.strip())

    def texts(self, selector):
        """The text of each such element."""
        return self.run(
            'return [...document.querySelectorAll(arguments[0])].map((each) => each.innerText)',
            selector,
        )

    def run(self, script, *arguments):
        """Run JavaScript in the page."""
        return self.driver.execute_script(script, *arguments)

    def errors(self):
        """What the page's console complains of: exceptions and violations of its policy, not lost
        connections.
        """
        return [
            entry['message']
            for entry in self.driver.get_log('browser')
            if entry['level'] == 'SEVERE'
            and 'net::ERR_' not in entry['message']
            and 'WebSocket connection' not in entry['message']
        ]

    def screenshot(self, path, width=None, height=None):
        """A picture of the page, at another size where given."""
        if width:
            self.driver.execute_cdp_cmd(
                'Emulation.setDeviceMetricsOverride',
                {'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': width < 500},
            )
            time.sleep(0.5)  # for the picture alone: nothing is proven by it
        self.driver.save_screenshot(path)

    def _shown(self, selector):
        return self.run(SHOWN + 'return shown', selector)


def _below(process):
    """The processes that a process has started, and those that they have."""
    listed = subprocess.run(
        ['ps', '-e', '-o', 'pid=,ppid='], stdout=subprocess.PIPE, check=True
    ).stdout.decode()
    pairs = [tuple(map(int, line.split())) for line in listed.splitlines()]
    found = []
    new = [pid for pid, parent in pairs if parent == process]
    while new:
        found += new
        new = [pid for pid, parent in pairs if parent in new]
    return found
