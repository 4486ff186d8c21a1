"""Do what a page shows: write its files, run its commands in order, compare what they print.

A page shows a file below a line that ends with its name. A console block shows commands behind `$`
and some of the lines that they print. A comment above a block says what is special there:

* `test: this command goes on while the next ones run`. Later, above what it has printed since,
  `test: what the command that goes on has printed`.
* `test: this command goes on until the end` of the page.
* `test: this command ends with exit code 2`.
* `test: type "A", at "PROMPT" "B", after "TEXT" "C", "D"`: what a person types at the block's
  prompt, at a later one, when any command has printed TEXT, and after what the next block shows.
* `test: put above the last line of FILE`.
"""

import os
import pty
import re
import select
import shutil
import signal
import subprocess
import tempfile
import time

import roslib.packages

LIMIT_S = 60.0
# a page runs in an environment that has been set up, in a folder and on a master of its own
DONE_BEFORE = {'scripts/setup', 'source scripts/ros_env', 'roscore', 'mkdir ~/fetch', 'cd ~/fetch'}
# a file with its name in the line above, or what is typed and shown, with what is special there
BLOCK = re.compile(r'(?:`(\S+)`:\n\n|<!-- test: (.*?) -->\n\n)?^```(\w+)\n(.*?)^```$', re.M | re.S)
TYPED = re.compile(r'(?:(at|after) "(.*?)" )?"(.*?)"')
CONTROL = re.compile(r'\x1b\[[0-9;?]*[A-Za-z]|[\r╭╮╰╯│─█░]')
# times, ids, names of people, and which of several robots is the first
CHANGING = re.compile(r'\d{9,}\.\d+|[0-9a-f]{12}|\d{8}T\d{6}\.\d{3}Z|\(\w+\)$|(?<=/robot)\d')


def plain(text):
    """Text without colours, frames and bars, each run of spaces as one."""
    return '\n'.join(' '.join(line.split()) for line in CONTROL.sub('', text).splitlines())


def pattern(line):
    """What a line of the page stands for: times, ids and names are others in each run."""
    parts, at = [], 0
    for match in CHANGING.finditer(line):
        parts += [re.escape(line[at : match.start()]), r'[\w.()]+']
        at = match.end()
    return ''.join(parts) + re.escape(line[at:])


class Program:
    """A command at a terminal of its own."""

    def __init__(self, command, folder):
        self.command, self.text = command, ''
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen(
            ['bash', '-c', command],
            cwd=folder,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            env=dict(os.environ, COLUMNS='120', TERM='xterm'),
        )
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
        wanted = re.compile(
            '.*?'.join(pattern(line) for line in plain(lines).splitlines() if line), re.S
        )
        deadline, goes_on = time.monotonic() + LIMIT_S, True
        while not wanted.search(plain(self.text)):
            if not goes_on or time.monotonic() > deadline:
                raise AssertionError(
                    '{}: expected:\n{}\nprinted:\n{}'.format(self.command, lines, plain(self.text))
                )
            goes_on = self.read()

    def type(self, line):
        os.write(self.master, line.encode() + b'\r')

    def end(self):
        """Wait until it ends by itself; return its exit code."""
        deadline = time.monotonic() + LIMIT_S
        while self.read() and time.monotonic() < deadline:
            pass
        return self.process.wait(timeout=LIMIT_S)

    def end_with(self, wanted=0):
        code = self.end()
        assert code == wanted, '{}: exit code {}, printed:\n{}'.format(
            self.command, code, plain(self.text)
        )

    def stop(self):
        """End it as Ctrl-C does, and if it does not end, by force."""
        for kind in (signal.SIGINT, signal.SIGKILL):
            if self.process.poll() is None:
                os.killpg(self.process.pid, kind)
                self.end()
        os.close(self.master)


class ShownPage:
    """A page of doc/ and the folder in which its commands run."""

    def __init__(self, name):
        path = os.path.join(roslib.packages.get_pkg_dir('smach_oracle'), 'doc', name + '.md')
        with open(path, encoding='utf-8') as page:
            self.blocks = BLOCK.findall(page.read())
        self.folder = tempfile.mkdtemp()
        self.programs = []
        self.going_on = self.latest = None
        self.typed = []

    def do(self):
        """Do all that it shows.

        :raises AssertionError: where a command prints something else, or ends with an error.
        """
        for name, note, language, text in self.blocks:
            if name:
                self.write(name, text)
            elif language == 'console':
                self.run_block(note, text)
            elif note.startswith('put above the last line of '):
                self.put_above_the_last_line(note.split()[-1], text)
        assert self.going_on is None, 'the page does not show how a command ends that goes on'

    def write(self, name, text):
        path = os.path.join(self.folder, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, 'w', encoding='utf-8') as file:
            file.write(text)
        if text.startswith('#!'):
            os.chmod(path, 0o755)

    def put_above_the_last_line(self, name, text):
        with open(os.path.join(self.folder, name), encoding='utf-8') as file:
            lines = file.read().splitlines(True)
        self.write(name, ''.join(lines[:-1] + [text] + lines[-1:]))

    def run_block(self, note, text):
        if note.startswith('what the command that goes on'):
            self.going_on.wait_for(text)
            self.going_on.end_with()
            self.going_on = None
        elif not text.startswith('$ '):
            self.answer(text)
        for command, shown in re.findall(r'^\$ (.*)\n((?:(?!\$ ).*\n)*)', text, re.M):
            if command not in DONE_BEFORE:
                self.run_command(note, command, shown)

    def run_command(self, note, command, shown):
        program = Program(command, self.folder)
        self.programs.append(program)
        if note.startswith('type'):
            self.latest, self.typed = program, TYPED.findall(note)
            before, prompt = shown.rstrip().rsplit('\n', 1)
            program.wait_for(before)
            program.wait_for(prompt[: prompt.rindex(':') + 1])
            return
        program.wait_for(shown)
        if note.startswith('this command goes on while'):
            self.going_on = program
        elif not note.startswith('this command goes on until'):
            program.end_with(int(note.split()[-1]) if 'ends with exit code' in note else 0)

    def answer(self, shown):
        """Type what the page says, and see what it shows then."""
        for when, text, line in self.typed[:-1]:
            self.wait_until(when, text)
            self.latest.type(line)
        self.latest.wait_for(shown)
        self.latest.type(self.typed[-1][-1])
        self.latest.end_with()

    def wait_until(self, when, text):
        """Wait for a prompt of the latest command, or until any command has printed a text."""
        if when != 'after':
            self.latest.wait_for(text)
            return
        deadline = time.monotonic() + LIMIT_S
        while not any(text in plain(program.text) for program in self.programs):
            assert time.monotonic() < deadline, 'no command prints: ' + text
            for program in self.programs:
                program.read()

    def close(self):
        """Stop what still runs, and remove the folder."""
        for program in reversed(self.programs):
            program.stop()
        shutil.rmtree(self.folder, ignore_errors=True)
