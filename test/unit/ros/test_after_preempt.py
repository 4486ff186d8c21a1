"""`after_preempt_s`: what an author has drawn behind `preempted` runs after a signal, in a script
that is no node. Real processes, real signals.
"""

import os
import signal
import subprocess
import sys
import time

import pytest
from waiting import END_LIMIT_S

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.settings import Settings

RUNNER = 'from smach_oracle.ros.oracle_run.script_runner import main; main()'
SCRIPT = """
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
        if how == 'by_a_machine':
            arm = smach.StateMachine(outcomes=['done'])
            with arm:
                smach.StateMachine.add('BESIDE', Beside())
            arm.execute()
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
class Beside(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['done'])
    def execute(self, userdata):
        say('beside')
        # the longer one does not look at its preempt, and lasts longer than the arm takes
        time.sleep(1.0 if how == 'beside_long' else 0.05)
        return 'done'
if how == 'resuming':
    from smach_oracle.oracle.checkpoint import resuming
    def end_goals(top, resumption):
        say('resuming')
        while not resuming.must_stop(top):
            time.sleep(0.01)
    resuming._end_goals = end_goals  # as with a server that is not there
if how == 'beginning':
    from smach_oracle.oracle.execution import trial
    open_store = trial.open_store
    def on_a_slow_disk(node):
        say('beginning')
        time.sleep(1.0)
        return open_store(node)
    trial.open_store = on_a_slow_disk
if how.startswith('beside'):
    def go_on():
        while True:
            top = smach.StateMachine(outcomes=['done'])
            with top:
                smach.StateMachine.add('BESIDE', Beside())
            top.execute()
    threading.Thread(target=go_on, daemon=True).start()
if how == 'in_a_thread':
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
else:
    run()
    run()
"""


class Program:
    """The script, once it works."""

    def __init__(self, folder, how, settings):
        (folder / 'task.py').write_text(SCRIPT)
        (folder / 'oracle.yaml').write_text(settings)
        environment = dict(os.environ, ROS_MASTER_URI='http://localhost:1')  # nobody is there
        self.process = subprocess.Popen(
            [sys.executable, '-c', RUNNER, '--config', 'oracle.yaml', 'task.py', how],
            cwd=str(folder),
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            universal_newlines=True,
        )
        self.reads(how if how in ('beginning', 'resuming') else 'working')

    def reads(self, text):
        """Wait until it says something. Machines of other threads may say something before."""
        for line in self.process.stdout:
            if line.strip() == text:
                return
        raise AssertionError('it has not said {}: {}'.format(text, self.process.stderr.read()))

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


def test_a_signal_while_a_trial_begins_preempts_its_first_state(program):
    running = program('beginning', 'after_preempt_s: 5')
    running.process.send_signal(signal.SIGINT)
    output, code, _, took_s = running.rest()
    assert (output, code) == (['working', 'stowing', 'stowed'], -2)
    assert took_s < 5


def test_a_signal_while_a_trial_resumes_preempts_it(program):
    stored = 'checkpoint: {file: store, on_resume: recover}, after_preempt_s: 5'
    killed = program('', '{' + stored + '}')
    killed.process.kill()
    killed.process.wait()
    running = program('resuming', '{' + stored + '}')
    running.process.send_signal(signal.SIGINT)
    output, _, _, took_s = running.rest()
    assert 'working' not in output and took_s < 5


def test_no_trial_of_another_thread_begins_meanwhile(program):
    running = program('beside')
    running.process.send_signal(signal.SIGINT)
    output, code, errors, _ = running.rest()
    behind = output[output.index('stowing') : output.index('stowed')]
    assert behind.count('beside') <= 1, 'one may have begun before the signal'
    assert output.count('stowed') == 1 and code == -2 and 'KeyboardInterrupt' in errors


def test_the_script_goes_on_only_once_the_machines_of_all_threads_have_ended(program):
    running = program('beside_long')
    running.process.send_signal(signal.SIGINT)
    output, code, errors, _ = running.rest()
    assert output.count('stowed') == 1 and code == -2 and 'KeyboardInterrupt' in errors


def test_a_state_behind_the_preempt_may_execute_a_machine_itself(program):
    running = program('by_a_machine')
    running.process.send_signal(signal.SIGINT)
    assert running.rest()[:2] == (['stowing', 'beside', 'stowed'], -2)


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
