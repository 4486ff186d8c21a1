"""`after_preempt_s`: what an author has drawn behind `preempted` runs after a signal, in a script
that is no node. Real processes, real signals.
"""
import os
import signal
import subprocess
import sys
import time

import pytest

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.settings import Settings

RUNNER = 'from smach_oracle.ros.oracle_run.script_runner import main; main()'
SCRIPT = '''
import sys, threading, time
import smach
smach.set_loggers(*[lambda text, *args: None] * 4)
how = sys.argv[1]
def say(text):
    sys.stdout.write(text + '\\n')  # at once: several threads say something
    sys.stdout.flush()
class Work(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['preempted'])
    def execute(self, userdata):
        say('working')
        while not self.preempt_requested():
            time.sleep(0.01)
        self.service_preempt()
        return 'preempted'
class Stow(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['stowed', 'preempted'])
    def execute(self, userdata):
        say('stowing')
        if how == 'for_ever':
            while not self.preempt_requested():
                time.sleep(0.01)
        time.sleep(0.3)  # an arm takes a while
        say('stowed')
        return 'stowed'
def run():
    top = smach.StateMachine(outcomes=['stowed', 'preempted'])
    with top:
        inner = smach.StateMachine(outcomes=['stowed', 'preempted'])
        with inner:
            smach.StateMachine.add('WORK', Work(), {'preempted': 'STOW'})
            smach.StateMachine.add('STOW', Stow())
        smach.StateMachine.add('INNER', inner)
    say(str(top.execute()))
if how == 'in_a_thread':
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
else:
    run()
    run()
'''
END_LIMIT_S = 2.0 + 1.0  # two seconds are promised; the third is for ending a process at all


class Program:
    """The script, once it works."""

    def __init__(self, folder, how, settings):
        (folder / 'task.py').write_text(SCRIPT)
        (folder / 'oracle.yaml').write_text(settings)
        environment = dict(os.environ, ROS_MASTER_URI='http://localhost:1')  # nobody is there
        self.process = subprocess.Popen(
            [sys.executable, '-c', RUNNER, '--config', 'oracle.yaml', 'task.py', how],
            cwd=str(folder), env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            universal_newlines=True)
        self.says('working')

    def says(self, text):
        assert self.process.stdout.readline().strip() == text

    def rest(self):
        """All further lines, its exit code, what it says of errors, and how long that took."""
        begun = time.monotonic()
        output, errors = self.process.communicate(timeout=60)
        return output.split(), self.process.returncode, errors, time.monotonic() - begun


@pytest.fixture
def program(tmp_path):
    begun = []

    def begin(how='', settings='after_preempt_s: 20'):
        begun.append(Program(tmp_path, how, settings))
        return begun[-1]
    yield begin
    for each in begun:
        each.process.kill()
        each.process.communicate()


@pytest.mark.parametrize('number, code', [(signal.SIGINT, -2), (signal.SIGTERM, 143)])
def test_what_is_behind_the_preempt_runs_before_the_signal_ends_the_script(program, number, code):
    running = program()
    running.process.send_signal(number)
    output, ended, errors, _ = running.rest()
    assert (output, ended) == (['stowing', 'stowed'], code)
    assert ('KeyboardInterrupt' in errors) == (number == signal.SIGINT)
    assert 'shutdown.py' not in errors


@pytest.mark.parametrize('settings', ['{}', 'after_preempt_s: 0'])
def test_by_default_the_signal_ends_it_at_once(program, settings):
    running = program(settings=settings)
    running.process.send_signal(signal.SIGINT)
    assert running.rest()[:2] == ([], -2)


def test_a_machine_in_a_thread_ends_with_its_outcome(program):
    running = program('in_a_thread')
    running.process.send_signal(signal.SIGTERM)
    output, code, _, _ = running.rest()
    assert output[:2] == ['stowing', 'stowed'] and code == 143


def test_the_limit_ends_it(program):
    running = program('for_ever', 'after_preempt_s: 1')
    running.process.send_signal(signal.SIGINT)
    output, code, _, took_s = running.rest()
    assert output == ['stowing'] and code == -2
    assert 0.9 < took_s < 1.0 + END_LIMIT_S


def test_a_second_signal_ends_it_at_once(program):
    running = program('for_ever')
    running.process.send_signal(signal.SIGINT)
    running.says('stowing')
    running.process.send_signal(signal.SIGINT)
    output, code, _, took_s = running.rest()
    assert (output, code) == ([], -2)
    assert took_s < END_LIMIT_S


@pytest.mark.parametrize('given', [-1, 'soon', True, float('nan'), 3601])
def test_a_wrong_time_is_refused(given):
    with pytest.raises(SettingsError, match='after_preempt_s.*seconds from 0 to 3600'):
        Settings.from_dict({'after_preempt_s': given})


def test_the_default_is_what_smach_does():
    assert Settings().after_preempt_s == 0
