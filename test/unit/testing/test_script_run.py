"""Scripts as they are, with their machines on the bench."""

import sys

import pytest

import smach
from smach_oracle.testing import FaultError, ScriptError, crash, expert, fail, goto, run_script

SCRIPT = """
import sys
import smach

class Works(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'])

    def execute(self, userdata):
        return 'succeeded'

class OwnMachine(smach.StateMachine):
    def __init__(self):
        smach.StateMachine.__init__(self, ['succeeded', 'aborted'], input_keys=['cup'])
        with self:
            smach.StateMachine.add('PICK', Works())

    def execute(self, parent_ud=smach.UserData()):
        print('OWN EXECUTE')
        return smach.StateMachine.execute(self, parent_ud)

def main():
    machine = {machine}
    with machine:
        smach.StateMachine.add('PLACE', Works())
    for _ in range({trials}):
        print('OUTCOME', machine.execute())
    sys.exit(3 if '--badly' in sys.argv else 0)

if __name__ == '__main__':
    main()
"""
PLAIN = "smach.StateMachine(['succeeded', 'aborted'])"


def script(tmp_path, machine=PLAIN, trials=1):
    path = tmp_path / 'task.py'
    path.write_text(SCRIPT.replace('{machine}', machine).replace('{trials}', str(trials)))
    return str(path)


def test_a_script_recovers_from_a_fault_and_comes_to_its_end(tmp_path, capsys):
    argv, main = list(sys.argv), sys.modules['__main__']
    run = run_script(script(tmp_path), ['--badly'], faults=[fail('PLACE', visit=1)])
    run.trial.assert_recovered('PLACE')
    assert run.exit_code == 3 and capsys.readouterr().out == 'OUTCOME succeeded\n'
    assert sys.argv == argv and sys.modules['__main__'] is main


def test_each_execute_is_a_trial(tmp_path):
    run = run_script(script(tmp_path, trials=3), faults=[fail('PLACE', visit=1)])
    assert len(run.trials) == 3 and run.exit_code == 0
    for trial in run.trials:
        trial.assert_failed('PLACE', times=1).assert_recovered()


def test_a_script_can_be_left_after_a_trial(tmp_path, capsys):
    run = run_script(script(tmp_path, trials=3), most_trials=2)
    assert len(run.trials) == 2 and capsys.readouterr().out == 'OUTCOME succeeded\n'


def test_a_class_of_the_scripts_own_runs_its_execute_once(tmp_path, capsys):
    run = run_script(script(tmp_path, machine='OwnMachine()'), faults=[fail('PICK', visit=1)])
    run.trial.assert_recovered('PICK')
    assert capsys.readouterr().out.count('OWN EXECUTE') == 1


def test_an_error_of_the_machine_reaches_the_script(tmp_path):
    with pytest.raises(smach.InvalidUserCodeError):
        run_script(script(tmp_path), faults=[crash('PLACE')], settings={'max_recoveries': 0})


def test_a_question_too_many_fails_the_test(tmp_path):
    with pytest.raises(ScriptError):
        run_script(
            script(tmp_path),
            faults=[fail('PLACE')],
            expert=expert(goto('PLACE')),
            settings={'max_recoveries': 0},
        )


def test_everything_is_put_back(tmp_path):
    execute = smach.StateMachine.execute
    with pytest.raises(FaultError, match="no state 'PIKC'; there are PLACE"):
        run_script(script(tmp_path), faults=[fail('PIKC')])
    assert smach.StateMachine.execute is execute
    assert '__init_subclass__' not in vars(smach.StateMachine)


def test_a_script_without_a_machine_has_no_trial(tmp_path):
    run = run_script(script(tmp_path, trials=0))
    with pytest.raises(AssertionError, match='has executed no machine; it ended with exit code 0'):
        run.trial.assert_no_failures()
