"""Scripts under oracle_run, in a process without a ROS master: they run as they run by
themselves.
"""

import os
import subprocess
import sys
import textwrap

import pytest

RUNNER = 'from smach_oracle.ros.oracle_run.script_runner import main; main()'
PRELUDE = '''
import smach
smach.set_loggers(*[lambda text, *args: None] * 4)
class Turn(smach.State):
    """Ends as told, in turn; then succeeds."""
    def __init__(self, *outcomes):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
        self.left = list(outcomes)
        self.visits = 0
    def execute(self, userdata):
        self.visits += 1
        return self.left.pop(0) if self.left else 'succeeded'
def machine(*outcomes, cls=smach.StateMachine):
    sm = cls(outcomes=['succeeded', 'aborted', 'preempted'])
    with sm:
        smach.StateMachine.add('ONLY', Turn(*outcomes))
    return sm
'''


@pytest.fixture
def run(tmp_path, warm_python):
    """Run a script under oracle_run, or directly; returns the finished process."""

    def run_script(text, *args, options=(), directly=False, name='task.py'):
        path = tmp_path / name
        path.write_text(PRELUDE + textwrap.dedent(text))
        environment = dict(os.environ, ROS_MASTER_URI='http://localhost:1')  # nobody is there
        if not directly:
            command = ['-c', RUNNER, *options, name, *args]
            return warm_python.run(command, cwd=str(tmp_path), env=environment, timeout=60)
        return subprocess.run(
            [sys.executable, name, *args],
            cwd=str(tmp_path),
            env=environment,
            timeout=60,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            universal_newlines=True,
        )

    return run_script


def both(run, text, *args):
    """Under oracle_run and directly."""
    return run(text, *args), run(text, *args, directly=True)


@pytest.mark.parametrize(
    'text',
    [
        'import sys; print(sys.argv, __file__, sys.path[0], __name__, __package__, __spec__)',
        'import sys; print(sys.modules["__main__"].Turn is Turn)',
        'import inspect; print(inspect.getsource(machine))',
        'import pickle; print(type(pickle.loads(pickle.dumps(Turn("aborted")))) is Turn)',
        'import sys; sys.exit(7)',
        'import sys; sys.exit("no robot")',
        'raise SystemExit',
        'import os; os._exit(3)',
        'import atexit; atexit.register(lambda: print(Turn))',
        'import threading\nthreading.Timer(0.3, lambda: print("late", Turn)).start()',
        'def deep():\n    raise ValueError("odd")\ndeep()',
        'import sys\nsys.excepthook = lambda *error: print("mine", error[0])\n'
        'raise ValueError("odd")',
        'raise KeyboardInterrupt',
        'from dataclasses import dataclass\n@dataclass\nclass Pose:\n    x: float\n'
        'print(Pose(1.0))',
    ],
)
def test_a_script_behaves_as_when_it_runs_by_itself(run, text):
    under, alone = both(run, text, '--config', 'x', '_rate:=5')
    assert (under.returncode, under.stdout, under.stderr) == (
        alone.returncode,
        alone.stdout,
        alone.stderr,
    )


def test_a_syntax_error_is_shown_as_python_shows_it(run):
    under, alone = both(run, 'def broken(:\n    pass\n')
    assert under.returncode == alone.returncode == 1
    assert under.stderr.replace('Traceback (most recent call last):\n', '') == alone.stderr


def test_a_module_beside_the_script_is_found(run, tmp_path):
    (tmp_path / 'beside.py').write_text('where = __name__\n')
    assert run('import beside; print(beside.where)').stdout == 'beside\n'


def test_a_failing_machine_recovers_and_one_that_is_only_observed_does_not(run):
    text = 'print(machine("aborted").execute())'
    assert run(text).stdout == 'succeeded\n'
    assert run(text, options=['--without-oracle']).stdout == 'aborted\n'
    assert run(text, directly=True).stdout == 'aborted\n'


WRAPS_ITSELF = """
    from smach_oracle.ros.container import OracleContainer
    smach.set_loggers(print, print, print, print)
    inner, top = machine(), smach.StateMachine(['succeeded', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('INNER', inner, {'succeeded': 'AGAIN'})
        smach.StateMachine.add('AGAIN', Turn())
    OracleContainer.wrap(top, settings={'policy': 'always_ask'}, name='TASK')
    for _ in range(2):
        print(top.execute(), top.settings.policy)
"""


@pytest.mark.parametrize(
    'options, told',
    [
        (['--policy', 'retry'], '--policy is not in force'),
        (['--policy=retry', '--without-oracle'], '--policy and --without-oracle are not in force'),
        (['--config', 'mine.yaml', '--no-nested'], '--config and --no-nested are not in force'),
        (['--checkpoint', 'a.db', '--resume=ask'], '--checkpoint and --resume are not in force'),
    ],
)
def test_a_program_that_wraps_its_machine_is_told_once_which_options_are_not_in_force(
    run, tmp_path, options, told
):
    (tmp_path / 'mine.yaml').write_text('policy: retry\n')
    result = run(WRAPS_ITSELF, options=options)
    assert result.stdout.count('not in force') == 1, result.stderr
    assert 'TASK: {}'.format(told) in result.stdout
    assert result.stdout.count('succeeded always_ask\n') == 2


def test_nothing_is_told_where_no_option_is_out_of_force(run, tmp_path):
    assert 'in force' not in run(WRAPS_ITSELF, options=['--machine-name', 'TASK']).stdout
    wrapped_here = """
        smach.set_loggers(print, print, print, print)
        top = smach.StateMachine(['succeeded', 'aborted', 'preempted'])
        with top:
            smach.StateMachine.add('INNER', machine())
        for _ in range(2):
            print(top.execute(), top.settings.policy)
    """
    result = run(wrapped_here, options=['--policy', 'retry'])
    assert 'in force' not in result.stdout
    assert result.stdout.count('succeeded retry\n') == 2


def test_without_an_expert_a_machine_ends_as_it_would_have(run):
    assert run('print(machine(*["aborted"] * 99).execute())').stdout == 'aborted\n'


def test_the_scripts_handle_is_the_wrapped_machine(run):
    result = run(
        """
        sm = machine('aborted')
        sm.userdata.box = 3
        print(sm.execute(), type(sm).__name__, sm.name, sm.userdata.box,
              isinstance(sm, smach.StateMachine))
        print(sorted(sm.get_children()))
    """,
        name='my_task.py',
    )
    assert result.stdout.splitlines() == [
        'succeeded StateMachine MY_TASK 3 True',
        "['ONLY', 'ORACLE']",
    ], result.stderr


def test_an_execute_of_the_authors_own_runs_once(run):
    result = run("""
        class Mine(smach.StateMachine):
            def execute(self, *args):
                print('before')
                outcome = super().execute(*args)
                print('after')
                return outcome
        class Mixin:
            def execute(self, *args):
                print('mixed in')
                return super().execute(*args)
        class Mixed(Mixin, smach.StateMachine):
            pass
        print(machine('aborted', cls=Mine).execute())
        print(machine('aborted', cls=Mixed).execute())
    """)
    assert result.stdout.split() == ['before', 'after', 'succeeded', 'mixed', 'in', 'succeeded'], (
        result.stderr
    )


def test_machines_in_threads_are_wrapped(run):
    result = run("""
        import threading
        machines = [machine('aborted') for _ in range(5)]
        outcomes = []
        threads = [threading.Thread(target=lambda sm=sm: outcomes.append(sm.execute()))
                   for sm in machines]
        for thread in threads: thread.start()
        for thread in threads: thread.join()
        print(outcomes)
    """)
    assert result.stdout == str(['succeeded'] * 5) + '\n', result.stderr


def test_a_sequence_is_wrapped(run):
    result = run("""
        sq = smach.Sequence(outcomes=['succeeded', 'aborted', 'preempted'],
                            connector_outcome='succeeded')
        with sq:
            smach.Sequence.add('A', Turn())
            smach.Sequence.add('B', Turn('aborted'))
        print(sq.execute())
    """)
    assert result.stdout == 'succeeded\n', result.stderr


NESTED = """
inner = machine('aborted')
outer = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with outer:
    smach.StateMachine.add('INNER', inner)
print(outer.execute(), hasattr(inner, 'rates'), hasattr(outer, 'rates'), inner['ONLY'].visits)
"""


def test_nested_machines_are_wrapped_unless_told_otherwise(run):
    assert run(NESTED).stdout == 'succeeded True True 2\n'
    assert run(NESTED, options=['--no-nested']).stdout == 'succeeded False True 2\n'


@pytest.mark.parametrize(
    'add',
    [
        "top = smach.Concurrence(outcomes=['succeeded', 'aborted'], default_outcome='aborted',\n"
        "                        outcome_map={'succeeded': {'INNER': 'succeeded'}})\n"
        "with top:\n    smach.Concurrence.add('INNER', inner)",
        "top = smach.Iterator(outcomes=['succeeded', 'aborted', 'preempted'], input_keys=[], "
        'output_keys=[], it=[1, 2],\n'
        "                     it_label='i', exhausted_outcome='succeeded')\n"
        "with top:\n    smach.Iterator.set_contained_state('INNER', inner, "
        "loop_outcomes=['succeeded'])",
    ],
)
def test_machines_inside_a_concurrence_or_an_iterator_at_the_top_are_wrapped(run, add):
    result = run(
        "inner = machine('aborted')\n" + add + "\nprint(top.execute(), hasattr(inner, 'rates'))"
    )
    assert result.stdout == 'succeeded True\n', result.stderr


@pytest.mark.parametrize('options', [[], ['--no-nested']])
def test_a_machine_that_a_state_runs_inside_is_wrapped_too(run, options):
    result = run(
        """
        class RunsOne(smach.State):
            def __init__(self):
                smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
            def execute(self, userdata):
                return machine('aborted').execute()
        sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
        with sm:
            smach.StateMachine.add('RUNS_ONE', RunsOne())
        print(sm.execute(), [row.failures for row in sm.rates()])
    """,
        options=options,
    )
    assert result.stdout == 'succeeded [0]\n', result.stderr


def test_machines_of_one_structure_share_a_name_and_others_get_their_own(run):
    result = run("""
        other = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
        with other:
            smach.StateMachine.add('OTHER', Turn())
        machines = [machine(), machine(), other]
        for sm in machines: sm.execute()
        print([sm.name for sm in machines])
    """)
    assert result.stdout == "['TASK', 'TASK', 'TASK_2']\n", result.stderr


def test_a_name_can_be_given(run):
    text = 'sm = machine(); sm.execute(); print(sm.name)'
    assert run(text, options=['--machine-name', 'KITCHEN']).stdout == 'KITCHEN\n'
    refused = run(text, options=['--machine-name', 'a/b'])
    assert refused.returncode == 2 and 'a name without /' in refused.stderr


def test_learned_rates_are_kept_across_runs(run):
    text = """
        sm = machine('aborted')
        sm.execute()
        print([(row.successes, row.failures) for row in sm.rates()])
    """
    options = ['--rates-file', 'rates.json']
    assert run(text, options=options).stdout == '[(1, 1)]\n'
    assert run(text, options=options).stdout == '[(2, 2)]\n'


def test_a_script_that_is_no_node_is_recorded_too(run, tmp_path):
    result = run(
        'print(machine("aborted").execute(), machine().execute())', options=['--record', 'bags']
    )
    assert result.stdout == 'succeeded succeeded\n', result.stderr
    assert len(list((tmp_path / 'bags').glob('*.bag'))) == 2


def test_preconditions_can_be_named_in_the_script_itself(run, tmp_path):
    (tmp_path / 'oracle.yaml').write_text(
        'states:\n  ONLY:\n    preconditions: ["python:__main__:ready"]\n'
    )
    result = run(
        """
        asked = []
        def ready(userdata):
            asked.append(userdata)
            return True
        print(machine('aborted').execute(), len(asked))
    """,
        options=['--config', 'oracle.yaml'],
    )
    assert result.stdout == 'succeeded 1\n', result.stderr


@pytest.mark.parametrize('options', [(), ('--check',)])
def test_a_script_may_leave_the_folder_in_which_its_settings_are(run, tmp_path, options):
    (tmp_path / 'elsewhere').mkdir()
    (tmp_path / 'oracle.yaml').write_text('rates_file: rates.json\ncheckpoint: robot.db')
    text = 'import os; os.chdir("elsewhere"); print(machine("aborted").execute())'
    done = run(text, options=('--config', 'oracle.yaml', *options))
    assert done.returncode == 0, done.stderr
    assert not list((tmp_path / 'elsewhere').iterdir())
    kept = {'rates.json', 'robot.db'} & {each.name for each in tmp_path.iterdir()}
    assert len(kept) == (0 if options else 2)


def test_an_error_names_the_settings_as_they_were_given(run, tmp_path):
    (tmp_path / 'oracle.yaml').write_text('states: {POUR: {on_retry: never}}')
    text = 'import os; os.chdir("/"); machine().execute()'
    done = run(text, options=('--config', 'oracle.yaml'))
    assert done.returncode == 2 and 'oracle_run: oracle.yaml line 1: states.POUR' in done.stderr


@pytest.mark.parametrize('states', ['', 'states: {ONLY: {time_limit_s: 20}}'])
def test_a_machine_with_labels_that_are_no_text_runs_without_an_oracle(run, tmp_path, states):
    (tmp_path / 'oracle.yaml').write_text(states)
    text = """
        smach.set_loggers(*[print] * 4)
        top = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
        inner = machine('aborted')
        with top:
            smach.StateMachine.add(0, machine('succeeded'), {'succeeded': 1})
            smach.StateMachine.add(1, inner)
        print(top.execute(), inner['ONLY'].visits, type(top) is smach.StateMachine)
    """
    done = run(text, options=('--config', 'oracle.yaml'))
    assert done.stdout.splitlines()[-1] == 'succeeded 2 True', done.stdout + done.stderr
    why = (
        "the label 0 of a state is not text; allowed: text, such as '0'. It runs without an oracle"
    )
    assert done.stdout.count(why) == 1
