"""`oracle_run --check` refuses a name in the settings that nothing has. A start does so where a
state would run that its author forbids or limits.
"""

import os
import textwrap

import pytest
from machine_scripts import MACHINES, RUNNER

CHAIN = "machine('HOME', 'GRASP').execute()"


@pytest.fixture
def run(tmp_path, warm_python):
    """Run a script under oracle_run, or check it; returns exit code, output and errors."""

    def run_script(settings, text=CHAIN, *options):
        (tmp_path / 'task.py').write_text('import smach\n' + MACHINES + textwrap.dedent(text))
        (tmp_path / 'oracle.yaml').write_text(settings)
        environment = dict(os.environ, ROS_MASTER_URI='http://localhost:1')  # nobody is there
        done = warm_python.run(
            ['-c', RUNNER, '--config', 'oracle.yaml', *options, 'task.py'],
            cwd=str(tmp_path),
            env=environment,
            timeout=120,
        )
        return done.returncode, done.stdout, done.stderr

    return run_script


ALL_UNKNOWN = """
tree: {nested: [ARMM]}
checkpoint:
  on_resume: state:GRAPS
  map: {OLD: HOEM}
states:
  GRAPS: {on_retry: confirm}
  HOME: {failure_outcomes: [abortde]}
  ARM*/**: {memory: 3}
expert:
  on_no_answer: {goto: HOEM}
  interfaces:
    by_hand: {action: by_hand, states: [GRSAP]}
"""


def test_a_check_names_every_unknown_name_in_any_setting_and_ends_with_2(run):
    code, _, errors = run(ALL_UNKNOWN, CHAIN, '--check')
    told = [line for line in errors.splitlines() if line.startswith('oracle_run: oracle.yaml line')]
    assert code == 2 and len(told) == 8, errors
    for part in (
        "states.GRAPS: 'GRAPS' is no state (did you mean GRASP?)",
        'states.ARM*/**: ',
        'line 2: tree.nested',
        'line 11: expert.on_no_answer',
        'line 4: checkpoint.on_resume',
        'line 5: checkpoint.map.OLD',
        'line 13: expert.interfaces.by_hand.states',
        "states.HOME.failure_outcomes: 'abortde' is no outcome (did you mean aborted?)",
    ):
        assert any(part in line for line in told), (part, told)


@pytest.mark.parametrize('given', ['on_retry: confirm', 'preconditions: [HOME]', 'time_limit_s: 9'])
def test_a_start_is_refused_where_an_unknown_state_is_protected(run, given):
    code, out, errors = run('states: {GRAPS: {' + given + '}}')
    assert (code, 'STATE RUNS' in out) == (2, False), errors
    assert "oracle_run: oracle.yaml line 1: states.GRAPS: 'GRAPS' is no state (did" in errors


def test_a_start_warns_of_another_unknown_name(run):
    code, out, errors = run('states: {GRAPS: {memory: 3}}')
    assert (code, out.count('STATE RUNS')) == (0, 2), errors
    assert "states.GRAPS: 'GRAPS' is no state (did you mean GRASP?)" in errors + out


LATER = """
    machine('HOME').execute()
    for label in ['POUR', 'POUR_%d' % 3, 'TO_' + 'LEFT'.lower()]:
        machine(label).execute()
"""


@pytest.mark.parametrize('label', ['POUR', 'POUR_3', 'TO_left', 'POUR_*'])
def test_a_state_of_a_machine_that_is_made_later_is_known(run, label):
    settings = 'states: {%s: {on_retry: never}}' % label
    code, out, errors = run(settings, LATER)
    assert (code, out.count('STATE RUNS')) == (0, 4), errors
    code, report, errors = run(settings, LATER, '--check')
    assert code == 0 and 'All is well' in report, report + errors


def test_a_state_of_another_machine_that_is_there_is_known_without_a_word(run):
    code, out, errors = run(
        'states: {POUR: {on_retry: never}}',
        """
        first, second = machine('HOME'), machine('POUR')
        first.execute()
        second.execute()
    """,
    )
    assert (code, out.count('STATE RUNS')) == (0, 2) and 'is no state' not in out + errors, errors


def test_a_state_of_a_machine_in_a_module_beside_the_script_is_known(run, tmp_path):
    (tmp_path / 'later.py').write_text('import smach\nLABEL = "POUR"\n')
    code, out, errors = run(
        'states: {POUR: {on_retry: never}}',
        """
        machine('HOME').execute()
        import later
        machine(later.LABEL).execute()
    """,
    )
    assert (code, out.count('STATE RUNS')) == (0, 2), errors


LABELS = """import enum
Step = enum.Enum('Step', 'POUR WIPE')
class Place(enum.Enum):
    TABLE = 1
class Fetch: pass
PLAIN = 'PICK'
WORDS = 'LIFT-IT PUT-IT'.split()
JOINED = '_'.join(['LOOK', 'LEFT'])
TURNED = 'NEPO'[::-1]  # OPEN
"""


def test_a_label_is_known_that_stands_in_any_way_in_a_source(run, tmp_path):
    (tmp_path / 'labels.py').write_text(LABELS)  # it does not name SMACH
    settings = 'states: {%s}' % ', '.join(
        label + ': {on_retry: never}'
        for label in ('POUR', 'TABLE', 'Fetch', 'PICK', 'PUT-IT', 'LOOK_LEFT', 'OPEN')
    )
    text = """
        import sys, labels
        machine('HOME').execute()
        if sys.argv[1:]:
            machine(labels.Step.POUR.name).execute()
    """
    code, out, errors = run(settings, text)
    assert (code, out.count('STATE RUNS')) == (0, 1), errors
    code, report, errors = run(settings, text, '--check')
    assert code == 0 and '7 warnings' in report, report + errors


@pytest.mark.parametrize('option', [[], ['--check']])
def test_the_error_says_what_to_do_for_a_label_that_no_source_can_show(run, option):
    later = 'machine("HOME").execute()\nmachine("RUOP"[::-1]).execute()'
    code, _, errors = run('states: {POUR: {on_retry: never}}', later.splitlines()[0], *option)
    assert code == 2 and 'write the name somewhere in the script, for example in' in errors
    comment = '  ' + errors.splitlines()[-1].rsplit(', ', 1)[-1]
    assert run('states: {POUR: {on_retry: never}}', later + comment, *option)[0] == 0


def test_a_general_list_of_failures_may_hold_more_than_a_machine_has(run):
    code, report, errors = run('failure_outcomes: [aborted, timed_out]', CHAIN, '--check')
    assert code == 0 and "failure_outcomes: 'timed_out' is no outcome" in report, errors


def test_a_name_that_no_reached_machine_has_but_a_source_mentions_is_a_warning(run):
    code, report, _ = run(
        'states: {POUR: {on_retry: never}}', CHAIN + '\nNOT_MADE = "POUR"\n', '--check'
    )
    assert code == 0 and "Warning: oracle.yaml line 1: states.POUR: 'POUR' is no state" in report


def test_a_precondition_must_fit_one_of_the_machines_that_are_checked(run):
    text = "machine('A', 'GRASP').execute(); machine('GRASP', 'B').execute()"
    assert run('states: {GRASP: {preconditions: [B]}}', text, '--check')[0] == 0
    code, _, errors = run('states: {GRASP: {preconditions: [GRASP]}}', text, '--check')
    assert code == 2 and "'GRASP' is not allowed" in errors


@pytest.mark.parametrize(
    'text, told',
    [
        (
            "sm = machine('HOME')\nsm._transitions['HOME']['aborted'] = 'AWAY'\nsm.execute()",
            "TASK/HOME: its outcome 'aborted' leads to 'AWAY', which is no state or outcome "
            'of TASK',
        ),
        (
            "machine('HOME').execute()\nsm = machine('A')\nwith sm:\n"
            "    smach.StateMachine.add('B', Runs(), {'sucess': 'A'})\nsm.execute()",
            'task.py line 18: SMACH refuses the machine: InvalidTransitionError',
        ),
        (
            'from smach_oracle import OracleContainer\n'
            "OracleContainer.wrap(machine('A'), settings={'states': {'AA': {'memory': 3}}})"
            '.execute()',
            "states.AA: 'AA' is no state",
        ),
    ],
)
def test_a_check_of_a_machine_that_cannot_run_ends_with_2(run, text, told):
    code, report, errors = run('{}', text, '--check')
    assert code == 2 and 'All is well' not in report
    assert any(line.startswith('oracle_run: ') and told in line for line in errors.splitlines()), (
        errors
    )
