"""A mistake in the settings ends oracle_run with exit code 2 before any state runs."""

import os
import textwrap

import pytest
from machine_scripts import MACHINES, RUNNER

PRELUDE = (
    """
print('SCRIPT RUNS', flush=True)
import smach
"""
    + MACHINES
    + """
def ready(userdata):
    return True
"""
)


@pytest.fixture
def run(tmp_path, warm_python):
    """Run a script under oracle_run with settings; returns exit code, output and errors."""

    def run_script(settings, text='machine("HOME", "PICK").execute()'):
        (tmp_path / 'task.py').write_text(PRELUDE + textwrap.dedent(text))
        (tmp_path / 'oracle.yaml').write_text(settings)
        (tmp_path / 'checks.py').write_text('def clear(userdata):\n    return True\n')
        environment = dict(os.environ, ROS_MASTER_URI='http://localhost:1')  # nobody is there
        done = warm_python.run(
            ['-c', RUNNER, '--config', 'oracle.yaml', 'task.py'],
            cwd=str(tmp_path),
            env=environment,
            timeout=60,
        )
        return done.returncode, done.stdout, done.stderr

    return run_script


def precondition(given, state='PICK'):
    return 'states:\n  {}:\n    preconditions: [{}]\n'.format(state, given)


@pytest.mark.parametrize(
    'name, why',
    [
        ('python:no_such_module:clear', "No module named 'no_such_module'"),
        ('python:checks:claer', "the module checks has no 'claer' (did you mean clear?)"),
        ('python:__main__:raedy', "the script has no 'raedy' (did you mean ready?)"),
        ('python:json.no_such_module:x', "No module named 'json.no_such_module'"),
        ('python:checks', 'the form is python:module:attribute'),
    ],
)
def test_a_wrong_python_name_is_told_before_the_script_runs(run, name, why):
    code, out, errors = run(precondition('"{}"'.format(name)))
    assert (code, out) == (2, '')
    assert errors.startswith('oracle_run: oracle.yaml line 3: states.PICK.preconditions')
    assert name in errors and why in errors and 'Traceback' not in errors
    assert 'Error(' not in errors, 'in the words of Python'
    assert "allowed: 'python:module:attribute', which names a function or state" in errors


def test_the_line_of_the_wrong_item_of_a_list_is_told(run):
    settings = (
        'states:\n  PICK:\n    preconditions:\n    - HOME\n'
        '    - check: "python:__main__:ready"\n      achieve: "python:__main__:raedy"\n'
    )
    code, _, errors = run(settings)
    assert code == 2
    assert errors.startswith(
        'oracle_run: oracle.yaml line 6: states.PICK.preconditions[1].achieve: '
        "'python:__main__:raedy' cannot be found: the script has no 'raedy'"
    ), errors


def test_a_module_that_fails_to_import_is_told_with_its_error(run, tmp_path):
    (tmp_path / 'broken.py').write_text('def ok(userdata):\n    return True\n1 / 0\n')
    code, _, errors = run(precondition('"python:broken:ok"'))
    assert code == 2
    assert errors.splitlines()[-1].startswith(
        "oracle_run: oracle.yaml line 3: states.PICK.preconditions[0]: 'python:broken:ok' cannot "
        'be found: importing it raised ZeroDivisionError: division by zero; allowed: '
    ), errors


def test_a_python_name_of_a_value_is_told_by_its_name(run):
    code, _, errors = run(precondition('"python:json.decoder:NaN"'))
    assert code == 2
    assert errors.splitlines()[-1].endswith(
        "states.PICK.preconditions[0]: 'python:json.decoder:NaN' names a value of type float; "
        'allowed: the name of a callable or a smach.State'
    ), errors


@pytest.mark.parametrize(
    'settings, why',
    [
        (
            'max_recovries: 3\n',
            'line 1: max_recovries: no such setting (did you mean max_recoveries?)',
        ),
        (
            'preconditions: {PICK: [HOME]}\n',
            'line 1: preconditions: no such setting here (it belongs '
            'to a state: below states: LABEL:)',
        ),
        (
            'states:\n  PICK:\n    policy: prose\n',
            'line 3: states.PICK.policy: no such setting of a '
            'state (it holds for the whole machine: move it to the top of the settings)',
        ),
    ],
)
def test_an_unknown_key_is_told_with_the_one_that_may_be_meant(run, settings, why):
    code, out, errors = run(settings)
    assert (code, out) == (2, '')
    assert errors.startswith('oracle_run: oracle.yaml {}; allowed: one of the keys '.format(why))


@pytest.mark.parametrize(
    'name, why',
    [
        ('python:no_such_module:well', "No module named 'no_such_module'"),
        ('python:checks:wlel', "checks has no 'wlel'"),
        ('checks', "'checks' is not allowed; allowed: 'python:module:attribute'"),
    ],
)
def test_a_wrong_function_of_health_is_told_before_the_script_runs(run, name, why):
    code, out, errors = run('policy: prose\nhealthy:\n- {{function: "{}"}}\n'.format(name))
    assert (code, out) == (2, '')
    assert errors.startswith('oracle_run: oracle.yaml line 3: healthy[0].function: ')
    assert why in errors and 'Traceback' not in errors


def test_a_right_function_of_health_is_asked_at_a_failure(run):
    code, out, errors = run(
        'healthy: {function: "python:__main__:well"}\n',
        """
        said = [False]
        def well():
            print('ASKED', flush=True)
            return not said or said.pop()
        sm = machine('HOME', 'PICK')
        outcomes = ['aborted']
        sm['PICK'].execute = lambda userdata: outcomes.pop() if outcomes else 'succeeded'
        print(sm.execute())
    """,
    )
    assert code == 0 and out.splitlines()[-1] == 'succeeded', errors
    assert out.count('ASKED') > 2
    assert 'TASK/PICK failed while the robot is not well (well)' in out + errors


@pytest.mark.parametrize(
    'name',
    ['python:checks:clear', 'python:__main__:ready', 'python:os.path:exists', 'python:math:isnan'],
)
def test_a_right_python_name_is_taken(run, name):
    code, out, errors = run(precondition('"{}"'.format(name)))
    assert (code, out.count('STATE RUNS')) == (0, 2), errors


@pytest.mark.parametrize(
    'text',
    [
        'import sys, os\nos.mkdir("more")\n'
        'open("more/late.py", "w").write("def ok(u): return True")\n'
        'sys.path.append("more")\nmachine("HOME", "PICK").execute()',
    ],
)
def test_a_module_that_the_script_alone_makes_known_is_believed(run, text):
    code, out, errors = run(precondition('"python:late:ok"'), text)
    assert (code, out.count('STATE RUNS')) == (0, 2), errors


def test_a_package_that_looks_for_its_modules_elsewhere_is_believed(run):
    text = """
        import os
        os.mkdir('elsewhere')
        open('elsewhere/ready.py', 'w').write('def ok(userdata): return True')
        os.mkdir('split')
        open('split/__init__.py', 'w').write('__path__.append("elsewhere")')
        machine('HOME', 'PICK').execute()
        """
    assert run('{}', text)[0] == 0  # the package is there at the next start
    code, out, errors = run(precondition('"python:split.ready:ok"'))
    assert (code, out.count('STATE RUNS')) == (0, 2), errors


def test_one_file_serves_several_machines_of_a_script(run):
    text = """
        first, second = machine('DETECT', 'GRASP'), machine('GRASP', 'PLACE')
        first.execute()
        second.execute()
        """
    code, out, errors = run(precondition('DETECT', 'GRASP'), text)
    assert (code, out.count('STATE RUNS')) == (0, 4), errors
    code, out, errors = run(precondition('PLACE', 'GRASP'), text)
    assert (code, out.count('STATE RUNS')) == (0, 4), errors


MISTAKES = [
    (
        precondition('HOEM'),
        "line 3: states.PICK.preconditions: 'HOEM' is not allowed "
        '(did you mean HOME?); allowed: the labels of the other states there: HOME',
    ),
    (precondition('PICK'), "'PICK' is not allowed; allowed: "),
    (precondition('/HOEM'), "'/HOEM' is not allowed (did you mean /HOME?)"),
    (precondition('{check: "python:checks:clear", achieve: HOEM}'), "'HOEM' is not allowed"),
    (
        'oracle_label: PICK\n',
        "line 1: oracle_label: 'PICK' is not allowed; allowed: a name that is "
        'no state or outcome of TASK',
    ),
    ('oracle_label: succeeded\n', "oracle_label: 'succeeded' is not allowed"),
]


def test_a_path_of_the_machine_is_believed(run):
    code, out, errors = run(precondition('/HOME'))
    assert (code, out.count('STATE RUNS')) == (0, 2), errors


@pytest.mark.parametrize('settings, text', MISTAKES)
def test_what_the_machine_alone_can_tell_is_told_before_its_first_state(run, settings, text):
    code, out, errors = run(settings)
    assert code == 2 and 'SCRIPT RUNS' in out and 'STATE RUNS' not in out
    assert errors.splitlines()[-1].startswith('oracle_run: oracle.yaml ') and text in errors
    assert 'Traceback' not in errors


@pytest.mark.parametrize(
    'text',
    [
        """
    try:
        machine('HOME', 'PICK').execute()
    except:
        pass
    machine('OTHER').execute()
    """,
        """
    import sys
    try:
        machine('HOME', 'PICK').execute()
    finally:
        sys.exit(0)
    """,
        """
    import threading
    threading.Thread(target=machine('HOME', 'PICK').execute).start()
    threading.Event().wait(50)
    """,
        """
    import threading
    thread = threading.Thread(target=machine('HOME', 'PICK').execute)
    thread.start()
    thread.join()
    """,
        """
    outer = smach.Concurrence(outcomes=['succeeded', 'aborted'], default_outcome='aborted',
                              outcome_map={})
    with outer:
        smach.Concurrence.add('INNER', machine('HOME', 'PICK'))
    outer.execute()
    """,
    ],
)
def test_the_exit_code_is_2_whatever_the_script_makes_of_it(run, text):
    code, out, errors = run(precondition('HOEM'), text)
    assert code == 2 and 'SCRIPT RUNS' in out and 'STATE RUNS' not in out, errors
    assert errors.count('oracle_run: oracle.yaml line 3') == 1


def test_a_precondition_that_fits_one_of_several_nested_machines_is_taken(run):
    code, out, errors = run(
        precondition('HOME'),
        """
        outer = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
        with outer:
            smach.StateMachine.add('ONE', machine('PICK', 'AWAY'), {'succeeded': 'TWO'})
            smach.StateMachine.add('TWO', machine('PICK', 'HOME'))
        print(outer.execute())
    """,
    )
    assert (code, out.count('STATE RUNS')) == (0, 4), errors


def test_a_precondition_that_is_a_state_of_another_container_is_told_by_its_path(run):
    code, out, errors = run(
        precondition('TWO', state='ONE/PICK'),
        """
        outer = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
        with outer:
            smach.StateMachine.add('ONE', machine('PICK', 'AWAY'), {'succeeded': 'TWO'})
            smach.StateMachine.add('TWO', machine('PLACE'))
        outer.execute()
    """,
    )
    assert code == 2 and errors.splitlines()[-1].endswith(
        "'TWO' is not allowed (did you mean /TWO?); allowed: the labels of the other states "
        'there: AWAY'
    )


def test_a_precondition_of_a_nested_state_is_looked_up_beside_it(run):
    code, out, errors = run(
        precondition('TWO', state='ONE/PICK'),
        """
        outer = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
        with outer:
            smach.StateMachine.add('ONE', machine('PICK', 'AWAY'), {'succeeded': 'TWO'})
            smach.StateMachine.add('TWO', Runs())
        outer.execute()
    """,
    )
    assert code == 2 and 'SCRIPT RUNS' in out and 'STATE RUNS' not in out
    assert 'states.ONE/PICK.preconditions' in errors and 'other states there: AWAY' in errors
