#!/usr/bin/env python3
"""The tutorial does as its page shows: its files, its commands in order, and what they print."""
import os
import pty
import re
import select
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import roslib.packages
import rostest

PAGE = os.path.join(roslib.packages.get_pkg_dir('smach_oracle'), 'doc', 'tutorial.md')
LIMIT_S = 60.0
# the test runs in an environment that has been set up, in a folder and on a master of its own
DONE_BEFORE = {'scripts/setup', 'source scripts/ros_env', 'roscore', 'mkdir ~/fetch', 'cd ~/fetch'}
# a file with its name in the line above, or what is typed and shown, with what the test does there
BLOCK = re.compile(r'(?:`(\S+)`:\n\n|<!-- test: (.*?) -->\n\n)?^```(\w+)\n(.*?)^```$', re.M | re.S)
CONTROL = re.compile(r'\x1b\[[0-9;?]*[A-Za-z]|[\r╭╮╰╯│─█░]')
CHANGING = re.compile(r'\d{9,}\.\d+|[0-9a-f]{12}|\d{8}T\d{6}\.\d{3}Z|\(\w+\)$')


def plain(text):
    """Text without colours, frames and bars, each run of spaces as one."""
    return '\n'.join(' '.join(line.split()) for line in CONTROL.sub('', text).splitlines())


def pattern(line):
    """What a line of the page stands for: times, ids and names are others in each run."""
    parts, at = [], 0
    for match in CHANGING.finditer(line):
        parts += [re.escape(line[at:match.start()]), r'[\w.()]+']
        at = match.end()
    return ''.join(parts) + re.escape(line[at:])


class Program:
    """A command at a terminal of its own."""

    def __init__(self, command, folder):
        self.command, self.text = command, ''
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen(
            ['bash', '-c', command], cwd=folder, stdin=slave, stdout=slave, stderr=slave,
            start_new_session=True, env=dict(os.environ, COLUMNS='120', TERM='xterm'))
        os.close(slave)

    def read(self):
        """Add what it has printed meanwhile. Return False once it has closed its terminal."""
        if not select.select([self.master], [], [], 0.1)[0]:
            return True
        try:
            data = os.read(self.master, 65536)
        except OSError:
            return False
        if b'\x1b[6n' in data:  # prompt_toolkit asks where the cursor is
            os.write(self.master, b'\x1b[1;1R')
        self.text += data.decode('utf-8', 'replace')
        return bool(data)

    def wait_for(self, lines):
        """Wait until it has printed these lines, in this order, others between them."""
        wanted = re.compile('.*?'.join(pattern(line) for line in plain(lines).splitlines() if line),
                            re.S)
        deadline, goes_on = time.monotonic() + LIMIT_S, True
        while not wanted.search(plain(self.text)):
            if not goes_on or time.monotonic() > deadline:
                raise AssertionError('{}: expected:\n{}\nprinted:\n{}'.format(
                    self.command, lines, plain(self.text)))
            goes_on = self.read()

    def type(self, line):
        os.write(self.master, line.encode() + b'\r')

    def end(self):
        """Wait until it ends by itself; return its exit code."""
        deadline = time.monotonic() + LIMIT_S
        while self.read() and time.monotonic() < deadline:
            pass
        return self.process.wait(timeout=LIMIT_S)

    def stop(self):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        os.close(self.master)


class Tutorial(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.going_on = self.latest = None
        self.typed = []

    def test_it_does_as_the_page_shows(self):
        with open(PAGE, encoding='utf-8') as page:
            blocks = BLOCK.findall(page.read())
        self.assertGreater(len(blocks), 12)
        for name, note, language, text in blocks:
            if name:
                with open(os.path.join(self.folder, name), 'w', encoding='utf-8') as file:
                    file.write(text)
            elif language == 'console':
                self.run_block(note, text)
            elif note.startswith('put above the last line of '):
                self.put_above_the_last_line(note.split()[-1], text)
        self.assertEqual(len(os.listdir(os.path.join(self.folder, 'bags'))), 3)
        self.assertIsNone(self.going_on, 'the page shows how it ends')

    def put_above_the_last_line(self, name, text):
        path = os.path.join(self.folder, name)
        with open(path, encoding='utf-8') as file:
            lines = file.read().splitlines(True)
        with open(path, 'w', encoding='utf-8') as file:
            file.writelines(lines[:-1] + [text] + lines[-1:])

    def run_block(self, note, text):
        if note.startswith('what the command that goes on'):
            self.going_on.wait_for(text)
            self.assertEqual(self.going_on.end(), 0)
            self.going_on = None
        elif not text.startswith('$ '):
            self.answer(text)
        for command, shown in re.findall(r'^\$ (.*)\n((?:(?!\$ ).*\n)*)', text, re.M):
            if command not in DONE_BEFORE:
                self.run_command(note, command, shown)

    def run_command(self, note, command, shown):
        program = Program(command, self.folder)
        self.addCleanup(program.stop)
        if note.startswith('type'):
            self.latest, self.typed = program, re.findall('"(.*?)"', note)
            program.wait_for(shown.rsplit('\n', 2)[0])
            program.wait_for('answer:')
            return
        program.wait_for(shown)
        if note.startswith('this command goes on'):
            self.going_on = program
        else:
            self.assertEqual(program.end(), 0, program.text)

    def answer(self, shown):
        """Type what the page says, and see what it shows then."""
        choice, reason, leave = self.typed
        self.latest.type(choice)
        self.latest.wait_for('reason (optional):')
        self.latest.type(reason)
        self.latest.wait_for(shown)
        self.latest.type(leave)
        self.assertEqual(self.latest.end(), 0)


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'tutorial', Tutorial)
