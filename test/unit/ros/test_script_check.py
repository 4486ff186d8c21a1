"""`oracle_run --check` executes no machine, reaches no master but its own, and reports."""

import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from machine_scripts import MACHINES, RUNNER

NOBODY = 'http://localhost:1'
PRELUDE = (
    """
import sys, threading, rospy, smach, smach_ros
print('SCRIPT SAYS THIS', flush=True)
"""
    + MACHINES
)
GOOD = """
max_recoveries: 3
states:
  PICK:
    preconditions: [HOME]
    time_limit_s: 20
    memory: 4
  HOME:
    max_recoveries: 0
expert:
  interfaces:
    by_hand: {action: by_hand, states: [PICK]}
"""


class SpyMaster:
    """A master that has parameters, and notes whatever else it is asked."""

    def __init__(self, parameters):
        self.parameters = parameters
        self.calls = []
        self.server = SimpleXMLRPCServer(('localhost', 0), logRequests=False)
        self.server.register_instance(self)
        self.uri = 'http://localhost:{}'.format(self.server.server_address[1])
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def _dispatch(self, method, arguments):
        self.calls.append((method,) + tuple(arguments[1:]))
        return 1, '', self.parameters

    def close(self):
        self.server.shutdown()
        self.server.server_close()


@pytest.fixture
def spy():
    master = SpyMaster({'speed': 7, 'use_sim_time': True, 'task': {'oracle': {'prior': 0.2}}})
    yield master
    master.close()


@pytest.fixture
def check(tmp_path, warm_python):
    """Check a script with settings; returns exit code, report and stderr."""

    def run(text, settings='', master=NOBODY, options=()):
        (tmp_path / 'task.py').write_text(PRELUDE + textwrap.dedent(text))
        (tmp_path / 'oracle.yaml').write_text(settings)
        done = warm_python.run(
            ['-c', RUNNER, '--check', '--config', 'oracle.yaml', *options, 'task.py'],
            cwd=str(tmp_path),
            timeout=120,
            env=dict(os.environ, ROS_MASTER_URI=master, ROS_HOSTNAME='localhost'),
        )
        assert 'STATE RUNS' not in done.stdout + done.stderr
        assert all(len(line) <= 100 for line in done.stdout.splitlines())
        return done.returncode, done.stdout, done.stderr

    return run


def test_the_report_says_what_the_oracle_may_do_in_each_state(check):
    code, report, errors = check(
        """
        sm = machine('HOME', 'PICK')
        with sm:
            smach.StateMachine.add('HELP', Runs(), {'aborted': 'HOME'})
        print('OUTCOME', sm.execute())
    """,
        GOOD,
    )
    assert code == 0, errors
    lines = [' '.join(line.split()) for line in report.splitlines()]
    for line in (
        'TASK begins at HOME; ends in aborted, preempted, succeeded',
        'set max_recoveries 3',
        'HOME (Runs)',
        'succeeded to PICK',
        'aborted ends in aborted failure, the oracle takes it up',
        'preconditions HOME',
        'time limit 20 s',
        'interfaces by_hand',
        'set memory 4',
        "aborted to HOME failure, the author's own way is kept",
        'set max_recoveries 0',
        'on a failure ask',
        'It is not executed; the script goes on with the outcome succeeded.',
        'All is well: no error in the settings for 1 machine.',
    ):
        assert line in lines, report
    assert 'rate below 0.4: retry or step back; 0.4 to 0.75: retry or ask; from 0.75: ask' in (
        ' '.join(lines)
    )
    assert 'OUTCOME succeeded' in errors and 'SAYS' not in report


def test_the_report_says_where_the_other_branches_may_have_a_failure_kept(check):
    code, report, errors = check(
        """
        both = smach.Concurrence(['succeeded', 'aborted'], 'aborted', outcome_map={},
                                 child_termination_cb=lambda outcomes: True)
        with both:
            smach.Concurrence.add('BUMPER', Runs())
            smach.Concurrence.add('DRIVE', Runs())
        sm = smach.StateMachine(['succeeded', 'aborted'])
        with sm:
            smach.StateMachine.add('BOTH', both)
        sm.execute()
    """,
        'states: {BOTH/DRIVE: {author_recoveries: override}}',
    )
    assert code == 0, errors
    bumper, drive = report[report.index('  BUMPER (Runs)') :].split('  DRIVE (Runs)')
    meant = 'failure, the oracle takes it up'
    unless = ' unless child_termination_cb stops others'
    assert meant + unless in ' '.join(bumper.split())
    assert meant in drive and unless not in ' '.join(drive.split())


@pytest.mark.parametrize(
    'inside, states, seen',
    [
        ("machine('LOOK', 'PICK')", '{PICK: {time_limit_s: 20}}', '2 machines'),
        ('Runs()', '{}', '1 machine'),
    ],
)
def test_the_report_says_which_machine_runs_without_an_oracle(check, inside, states, seen):
    script = """
        sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
        with sm:
            smach.StateMachine.add(0, {})
        print('OUTCOME', sm.execute())
    """
    code, report, errors = check(script.format(inside), 'states: ' + states)
    assert code == 0, errors
    why = (
        "Warning: TASK: the label 0 of a state is not text; allowed: text, such as '0'. It runs "
        'without an oracle'
    )
    assert why in ' '.join(report.split())
    assert ('begins at LOOK' in report) == ('time limit    20 s' in report) == ('PICK' in states)
    assert '1 warning: no error in the settings for {}.'.format(seen) in report
    assert 'OUTCOME succeeded' in errors


PARKS = """
    carry = smach.StateMachine(['done', 'left'])
    with carry:
        smach.StateMachine.add('LIFT', Runs(), {'succeeded': 'done', 'aborted': 'left',
                                                'preempted': 'left'})
    sm = smach.StateMachine(['parked', 'aborted'])
    with sm:
        smach.StateMachine.add('CARRY', carry, {'done': 'parked', 'left': 'parked'})
    sm.execute()
"""


def test_the_report_names_ends_that_say_neither_success_nor_failure_and_what_settles_it(check):
    code, report, errors = check(PARKS)
    assert code == 0, errors
    top, nested = ' '.join(report.split()).split('TASK/CARRY begins')
    assert 'other ends parked: nothing says whether' in top and 'failing_outcomes' in top
    assert 'other ends left: a failure leads here' in nested
    code, report, errors = check(PARKS, 'failing_outcomes: [aborted]')
    assert code == 0 and 'other ends' not in report, errors


def test_the_report_has_the_menu_and_what_a_step_back_may_run_again(check):
    code, report, errors = check(
        "machine('HOME', 'LOOK', 'PICK').execute()",
        'policy: escalating\nstates: {PICK: {max_recoveries: 2}}\n',
    )
    assert code == 0, errors
    told = ' '.join(report.split())
    assert 'may run again LOOK, HOME' in told
    assert (
        'the one first that costs least for its hope, of: again, after 10 s or 60 s, from 1, 2, '
        '4... states back, from the start; after 4 in a row, 8 in a trial, or where none costs '
        'less than to ask: ask'
    ) in told
    assert 'after 4 in a row (max_recoveries cuts them to 2), 8 in a trial' in told


def test_the_report_warns_of_options_that_a_machine_does_not_get_as_its_program_wraps_it(check):
    code, report, errors = check("""
        from smach_oracle.oracle import OracleContainer
        OracleContainer.wrap(machine('A'), name='OWN').execute()
        machine('B', 'C').execute()
    """)
    assert code == 0, errors
    told = ' '.join(report.split())
    assert told.count('not in force') == 1 and '1 warning' in told
    assert 'Warning: OWN: --config is not in force here' in told


def test_the_report_says_what_on_retry_leaves_out_of_what_may_run_again(check):
    code, report, errors = check(
        "machine('HOME', 'LOOK', 'POUR', 'WIPE').execute()", 'states: {POUR: {on_retry: confirm}}\n'
    )
    assert code == 0, errors
    told = ' '.join(report.split())
    assert (
        'may run again nothing; it does not go back to POUR, LOOK, HOME, since that may repeat '
        'what on_retry protects'
    ) in told
    assert told.count('may run again HOME') == 1


def test_a_script_with_several_machines_goes_on_and_ends_when_one_comes_again(check):
    code, report, _ = check("""
        first, second = machine('A', 'B'), machine('C')
        while True:
            assert first.execute() == second.execute() == 'succeeded'
    """)
    assert code == 0
    assert 'TASK begins at A' in report and 'TASK_2 begins at C' in report
    assert 'executes a machine for the second time' in report and 'for 2 machines' in report


TWO = "machine('A').execute(); machine('B').execute(); machine('A').execute()"


@pytest.mark.parametrize(
    'text, options, names',
    [
        (TWO, (), ('TASK', 'TASK_2')),
        (TWO, ('--machine-name', 'kitchen'), ('kitchen', 'kitchen_2')),
        ("rospy.init_node('cook')\n" + TWO, (), ('cook', 'cook_2')),
    ],
)
def test_names_are_those_of_a_real_run(check, text, options, names):
    code, report, errors = check(text, options=options)
    assert code == 0, errors
    assert '{} begins at A'.format(names[0]) in report, report
    assert '{} begins at B'.format(names[1]) in report, report
    assert '{}: another machine of the same structure'.format(names[0]) in report
    assert 'for 2 machines' in report


def test_like_machines_of_a_concurrence_have_names_of_their_own(check):
    code, report, errors = check("""
        both = smach.Concurrence(['succeeded'], 'succeeded')
        with both:
            smach.Concurrence.add('LEFT', machine('A'))
            smach.Concurrence.add('RIGHT', machine('A'))
        both.execute()
        machine('A').execute()
    """)
    assert code == 0, errors
    assert 'TASK begins at A' in report
    assert 'TASK_2: another machine of the same structure' in report, report
    assert 'TASK: another machine of the same structure' in report, 'it runs after them'


WRAPPED = """
    from smach_oracle import OracleContainer
    rospy.init_node('task')
    for label in 'AB':
        OracleContainer.wrap(machine(label), name='SAME', settings={'memory': 7}).execute()
"""


def test_machines_wrapped_in_code_take_the_parameters_of_their_node(check, spy):
    code, report, errors = check(WRAPPED, master=spy.uri)
    assert code == 0, errors
    assert 'SAME begins at A' in report and 'SAME begins at B' in report, report
    assert report.count('prior 0.2') == 2 and report.count('memory 7') == 2, report


def test_a_wrong_parameter_of_a_machine_wrapped_in_code_is_an_error(check, spy):
    spy.parameters['task']['oracle'] = {'prior': 'high'}
    code, _, errors = check(WRAPPED, master=spy.uri)
    assert code == 2
    last = errors.splitlines()[-1]
    assert last.startswith('oracle_run: ') and "'high' is not allowed" in last
    assert 'parameter /task/oracle' in last


def test_an_older_key_of_the_settings_is_told_once(check):
    code, _, errors = check('machine("HOME", "PICK").execute()', 'deadline_s: 60\n')
    assert code == 0
    assert errors.count('deadline_s is now called expert.deadline_s') == 1, errors


@pytest.mark.parametrize(
    'settings, why',
    [
        ('memory: many', "memory: 'many' is not allowed"),
        ('states: {PICK: {preconditions: [HOEM]}}', "'HOEM' is not allowed"),
        ('states: {PICK: {preconditions: ["python:__main__:ready"]}}', "has no 'ready'"),
        ('oracle_label: PICK', 'oracle_label'),
        ('expert: {on_no_answer: {jump: HOME}}', 'expert.on_no_answer'),
    ],
)
def test_a_mistake_in_the_settings_ends_it_as_in_a_real_run(check, settings, why):
    code, _, errors = check('machine("HOME", "PICK").execute()', settings)
    assert code == 2
    assert why in errors.splitlines()[-1] and errors.splitlines()[-1].startswith('oracle_run: ')


@pytest.mark.parametrize('kind', ['StateMachine', 'Concurrence'])
@pytest.mark.parametrize('method', ['get_children', 'get_registered_outcomes', '__getattribute__'])
def test_a_machine_that_raises_as_it_is_looked_at_is_refused_in_one_line(check, kind, method):
    code, report, errors = check(
        """
armed = False
class Odd(smach.{0}):
    def {1}(self, *given):
        if armed and (not given or given[0] in ('_states', '_outcome_map', 'get_children')):
            raise OSError('no disk')
        return getattr(smach.{0}, '{1}')(self, *given)
ends = ['succeeded', 'aborted', 'preempted']
odd = Odd(ends, *['aborted'] * ('{0}' == 'Concurrence'))
with odd:
    smach.{0}.add('A', Runs())
top = smach.StateMachine(ends)
with top:
    smach.StateMachine.add('ODD', odd)
armed = True
top.execute()
""".format(kind, method)
    )
    said = errors.splitlines()
    assert code == 2 and 'All is well' not in report, report + errors
    assert 'Traceback' not in errors
    assert re.match(r'oracle_run: .*: OSError: no disk \(.*task.py line \d+\)$', said[-1]), said


def test_a_name_that_is_no_outcome_or_state_is_told(check):
    code, report, errors = check('machine("HOME", "PICK").execute()', 'states: {PIKC: {memory: 4}}')
    assert code == 2 and 'All is well' not in report
    assert errors.splitlines()[-1].startswith(
        "oracle_run: oracle.yaml line 1: states.PIKC: 'PIKC' is no state (did you mean PICK?)"
    )


def test_the_real_master_is_asked_for_its_parameters_alone(check, spy):
    code, report, errors = check(
        """
        from std_srvs.srv import Trigger
        import actionlib
        from actionlib.msg import TestAction, TestGoal
        rospy.init_node('task')
        rospy.wait_for_service('grip')
        rospy.ServiceProxy('grip', Trigger)()
        client = actionlib.SimpleActionClient('move', TestAction)
        assert client.wait_for_server() and client.send_goal_and_wait(TestGoal(3)) == 3
        from std_msgs.msg import String
        rospy.Publisher('go', String, queue_size=1).publish('now')
        assert rospy.wait_for_message('scan', String).data == ''
        rospy.set_param('speed', rospy.get_param('speed') + 1)
        rospy.sleep(0.1)
        print('SPEED', rospy.get_param('speed'))
        machine('HOME').execute()
        rospy.spin()
    """,
        master=spy.uri,
    )
    assert code == 0, errors
    assert spy.calls == [('getParam', '/')]
    assert 'SPEED 8' in errors
    for note in (
        'waits for service grip',
        'calls service /grip',
        'waits for action server move',
        'sends a goal to move',
        'waits for a message on scan',
    ):
        assert '- ' + note in report, report
    assert 'prior 0.2' in report


@pytest.mark.parametrize(
    'text, code, told',
    [
        ('machine("HOME")', 1, 'executed no machine'),
        ('raise ValueError("no robot")', 1, 'ended in the error above'),
        ('machine("HOME").execute()\nraise ValueError("no robot")', 0, 'no mistake of its own'),
        ('machine("HOME").execute()\nsys.exit(3)', 0, 'SystemExit(3)'),
    ],
)
def test_the_exit_code_says_whether_a_machine_was_reached(check, text, code, told):
    found, report, errors = check(text)
    assert (found, told in ' '.join(report.split())) == (code, True), report + errors
    assert ('ValueError: no robot' in errors) is ('ValueError' in text)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('begin', ["rospy.init_node('task')", 'signal.signal(15, print)'])
def test_a_signal_ends_the_check_of_a_script_that_sleeps(tmp_path, begin, number):
    (tmp_path / 'task.py').write_text(
        PRELUDE
        + textwrap.dedent("""
        import signal, time
        {}
        print('SLEEPS', flush=True)
        time.sleep(600)
    """).format(begin)
    )
    process = subprocess.Popen(
        [sys.executable, '-c', RUNNER, '--check', 'task.py'],
        cwd=str(tmp_path),
        env=dict(os.environ, ROS_MASTER_URI=NOBODY, ROS_HOSTNAME='localhost'),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
    )
    try:
        assert any('SLEEPS' in line for line in process.stderr)
        process.send_signal(number)
        report, _ = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 128 + number
    assert report.endswith('The check was ended by {}.\n'.format(number.name))


def test_what_the_oracle_may_do_in_branches_is_told(check):
    code, report, errors = check(
        """
        top, tour = smach.StateMachine(['succeeded', 'aborted']), smach.Iterator(
            ['succeeded', 'aborted'], [], [], it=[1, 2], it_label='item',
            exhausted_outcome='succeeded')
        with tour:
            smach.Iterator.set_contained_state('VISIT', Runs(), loop_outcomes=['succeeded'])
        with top:
            smach.StateMachine.add('TOUR', tour)
        top.execute()
    """,
        '{states: {TOUR/*: {memory: 3}}, tree: {nested: [TOUR/**], escalate: false}}',
    )
    assert code == 0, errors
    lines = [' '.join(line.split()) for line in report.splitlines()]
    for line in (
        'TASK/TOUR begins at VISIT; ends in aborted, succeeded',
        'succeeded to the next item',
        'policy prose; each state is on its own, so that a step back is a retry',
        'set memory 3',
    ):
        assert line in lines, report


def test_what_contains_machines_or_serves_them_is_not_executed_either(check):
    code, report, errors = check("""
        both = smach.Concurrence(['succeeded', 'aborted'], 'aborted')
        with both:
            smach.Concurrence.add('LEFT', Runs())
            smach.Concurrence.add('ARM', machine('REACH'))
        thread = threading.Thread(target=both.execute)
        thread.start()
        thread.join()
        from actionlib.msg import TestAction
        rospy.init_node('task')
        smach_ros.ActionServerWrapper('fetch', TestAction, machine('GRASP', 'LIFT'),
                                      ['succeeded'], ['aborted'], ['preempted']).run_server()
        rospy.spin()
    """)
    assert code == 0, errors
    assert 'begins at REACH' in report and 'begins at GRASP' in report and '2 machines' in report
