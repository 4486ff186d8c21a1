"""The console as a node of its own, a robot that asks, and a real browser at the page: for a class
of tests.
"""
import os
import shutil
import signal
import socket
import subprocess
import sys

from roslib.packages import find_node
from waiting import wait_for

from smach_oracle.experiment.launching import free_port

HERE = os.path.dirname(os.path.abspath(__file__))
WITH_BROWSER = bool(shutil.which('chromedriver'))


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
        cls.browser = Browser(*size)
        wait_for(cls.page_is_served, 40.0)
        cls.browser.driver.get(cls.page)
        if name:
            cls.remember_name(cls.browser, name)

    @staticmethod
    def remember_name(browser, name):
        """As if it had been given before; the page begins anew."""
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
    def start_console(cls, *more):
        return Node(find_node('smach_oracle', 'expert_console')[0], '_port:={}'.format(cls.port),
                    '__name:=expert_console', *more)

    @classmethod
    def page_is_served(cls):
        with socket.socket() as probe:
            return probe.connect_ex(('127.0.0.1', cls.port)) == 0

    def assert_accessible(self, view):
        """axe-core finds nothing wrong with what the page shows now, in any of its colours."""
        from accessibility import violations
        self.assertEqual([view] + violations(self.browser), [view])
