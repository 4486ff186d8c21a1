"""scripts/test itself: what it counts, how it ends, and that it leaves nothing running."""

import os
import subprocess
import sys
import threading
import xml.etree.ElementTree as ElementTree

import pytest
from house import ROOT
from waiting import wait_for

sys.path.insert(0, str(ROOT / 'test/harness'))

import checks
import processes
import schedule
import upstream
from checks import (
    Bench,
    benchmark_checks,
    lint_checks,
    pytest_checks,
    rostest_checks,
    upstream_checks,
)
from processes import Runner, kill_marked
from report import (
    Outcome,
    on_upstream,
    read_junit,
    second_attempts,
    show,
    write_junit,
)

JUNIT = """<testsuite name="one" tests="4"><testcase classname="a" name="good"/>
<testcase classname="a" name="bad"><failure>1 is not 2</failure></testcase>
<testcase classname="a" name="worse"><error message="it fell"/></testcase>
<testcase classname="a" name="not_here"><skipped/></testcase></testsuite>"""
# a grandchild in a session of its own, as roslaunch starts its nodes
# whoever else runs these tests on this machine at the same time has another
UNIQUE = '{:07d}'.format(os.getpid())
DETACHED = (
    'import subprocess, sys, time; subprocess.Popen(["sleep", "{}"], start_new_session=True); {}'
)


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path, tmp_path, Runner())


def sleeping(seconds):
    listed = subprocess.run(
        ['pgrep', '-fx', 'sleep {}'.format(seconds)], stdout=subprocess.PIPE, check=False
    )
    return listed.stdout.decode().split()


def test_every_case_is_counted_and_the_failed_ones_are_told(tmp_path):
    (tmp_path / 'one.xml').write_text(JUNIT)
    outcome = Outcome('one')
    read_junit([tmp_path / 'one.xml'], outcome)
    assert (outcome.passed, outcome.failed, outcome.skipped) == (1, 2, 1)
    assert 'a.bad:\n1 is not 2' in outcome.detail and 'it fell' in outcome.detail


def test_a_result_that_is_cut_off_is_a_failure(tmp_path):
    (tmp_path / 'half.xml').write_text(JUNIT[:40])
    outcome = Outcome('half')
    read_junit([tmp_path / 'half.xml'], outcome)
    assert outcome.failed == 1


def test_a_check_without_any_case_has_not_passed(capsys):
    show(Outcome('empty'))
    assert capsys.readouterr().out.startswith('FAIL empty')


def test_all_results_are_in_one_file(tmp_path):
    (tmp_path / 'one.xml').write_text(JUNIT)
    write_junit(
        [
            Outcome('ruff', failed=1, detail='long line'),
            Outcome('unit', junit=[tmp_path / 'one.xml']),
        ],
        tmp_path / 'all.xml',
    )
    everything = Outcome('all')
    read_junit([tmp_path / 'all.xml'], everything)
    assert (everything.passed, everything.failed, everything.skipped) == (1, 3, 1)


def test_a_failing_command_shows_its_last_words(bench):
    outcome = bench.run(
        'words', [sys.executable, '-c', 'print("last words"); raise SystemExit(3)'], 20.0
    )
    assert not outcome.ok and 'last words' in outcome.detail and 'exit status 3' in outcome.detail


def test_a_command_that_hangs_is_ended_and_told(bench):
    outcome = bench.run('hang', ['sleep', '60'], 0.5)
    assert outcome.failed == 1 and 'not done after 0.5 s' in outcome.detail


def test_nothing_is_left_running_even_what_left_its_process_group(bench):
    bench.run('detached', [sys.executable, '-c', DETACHED.format('61.' + UNIQUE, 'pass')], 20.0)
    assert not sleeping('61.' + UNIQUE)
    assert 'left behind, and killed' in (bench.results / 'log/detached.log').read_text()


BURN = """
import subprocess, sys, time
while time.process_time() < 0.3: pass
if sys.argv[1:]: subprocess.run([sys.executable, '-c', sys.argv[1]])
"""


def test_the_processor_time_is_that_of_the_command_and_of_all_that_it_waits_for(bench):
    alone = bench.run('alone', [sys.executable, '-c', BURN], 20.0)
    two = bench.run('two', [sys.executable, '-c', BURN, BURN], 20.0)
    idle = bench.run('idle', ['sleep', '0.5'], 20.0)
    assert alone.processor_s > 0.25 and two.processor_s > alone.processor_s + 0.2
    assert idle.seconds >= 0.5 and idle.processor_s < 0.2
    hung = bench.run('hung', [sys.executable, '-c', BURN + 'time.sleep(60)'], 3.0)
    assert not hung.ok and hung.processor_s > 0.1


def test_three_compute_three_wait_and_at_most_four_compute_at_the_end():
    names = ['ruff', 'rostest/a', 'unit/x', 'mypy', 'unit/y', 'rostest/b', 'upstream/rostest/c']
    queues = schedule.Queues(names)
    first, second, *_, last = schedule.WORKERS
    taken = [queues.take(each) for each in schedule.WORKERS]
    assert taken == ['mypy', 'rostest/a', 'ruff', 'unit/x', 'rostest/b', names[-1]]
    assert [queues.take(each) for each in (last, second, last)] == ['', 'unit/y', '']
    queues = schedule.Queues(names[:2])
    assert [queues.take(first) for _ in range(3)] == ['ruff', 'rostest/a', '']


def test_benchmarks_of_the_walls_time_run_alone_at_the_end():
    there = benchmark_checks(ROOT)
    assert set(schedule.BESIDE_OTHERS) <= set(there)
    (beside, jobs), (alone, one) = schedule.rows_of({**there, 'rostest/a': None, 'unit/x': None})
    assert set(beside) == {'rostest/a', 'unit/x', *schedule.BESIDE_OTHERS} and jobs == 6
    assert set(alone) == set(there) - set(beside) and one == 1
    queues = schedule.Queues(list(alone))
    assert sorted(iter(lambda: queues.take(schedule.WORKERS[0]), '')) == sorted(alone)
    assert [list(row) for row, _ in schedule.rows_of({'unit/x': None})] == [['unit/x']]


SHARE = """
import os, pathlib, time
end = time.monotonic() + 20.0
while time.monotonic() < end and os.getpriority(os.PRIO_PROCESS, 0) != {0}: time.sleep(0.01)
session = pathlib.Path('/proc/self/autogroup')
while time.monotonic() < end and session.exists():
    if 'nice {0}' in session.read_text(): break
    time.sleep(0.01)
print(time.monotonic() < end)
"""


def test_what_computes_gives_way_and_a_rostest_does_not(bench, monkeypatch):
    nice = min(19, os.getpriority(os.PRIO_PROCESS, 0) + processes.NICE)
    command = [sys.executable, '-c', SHARE.format(nice)]
    bench.run('giving', command, 30.0, gives_way=True)
    assert (bench.results / 'log/giving.log').read_text() == 'True\n'
    given = {}

    def run(name, *_, gives_way=False, **__):
        given[name] = gives_way
        return Outcome(name, passed=1)

    monkeypatch.setattr(bench, 'run', run)
    (bench.root / 'test/rostest').mkdir(parents=True)
    (bench.root / 'test/rostest/one.test').touch()
    for check in (
        *lint_checks(ROOT).values(),
        *pytest_checks(ROOT, 'unit').values(),
        *rostest_checks(bench.root).values(),
    ):
        check(bench)
    assert [name for name, gives_way in given.items() if not gives_way] == ['rostest/one']


def test_the_longest_begin_and_each_runs_once():
    names = ['a', *reversed(schedule.LONGEST)]
    queues = schedule.Queues(names)
    taken = list(iter(lambda: queues.take([schedule.COMPUTES, schedule.WAITS]), ''))
    assert sorted(taken) == sorted(names) and taken[0] == schedule.LONGEST[0]
    assert [name for name in taken if name in schedule.LONGEST][-1] == schedule.LONGEST[-1]


def test_the_longest_are_checks_that_there_are():
    there = {
        **lint_checks(ROOT),
        **pytest_checks(ROOT, 'unit'),
        **pytest_checks(ROOT, 'package'),
        **rostest_checks(ROOT),
        **benchmark_checks(ROOT),
    }
    assert schedule.LONGEST and set(schedule.LONGEST) <= set(there)


def test_checks_run_side_by_side_and_all_are_told(bench, capsys):
    barrier = threading.Barrier(3, timeout=20.0)

    def check(name):
        def run(_):
            barrier.wait()
            return Outcome(name, passed=1)

        return run

    checks_of = {name: check(name) for name in ('unit/x', 'rostest/a', 'rostest/b')}
    outcomes = schedule.run_side_by_side(checks_of, bench, 3)
    assert {each.name for each in outcomes} == set(checks_of)
    shown = capsys.readouterr().out
    assert all(name in shown for name in checks_of)


def test_an_interrupt_ends_what_runs_and_starts_nothing_more(bench):
    command = [sys.executable, '-c', DETACHED.format('62.' + UNIQUE, 'time.sleep(60)')]
    outcomes = []
    thread = threading.Thread(target=lambda: outcomes.append(bench.run('long', command, 60.0)))
    thread.start()
    assert wait_for(lambda: sleeping('62.' + UNIQUE))
    bench.runner.stop()
    thread.join(20.0)
    assert not thread.is_alive() and not sleeping('62.' + UNIQUE)
    assert outcomes[0].failed == 1
    assert 'interrupted' in bench.run('late', ['true'], 5.0).detail


def test_a_mark_that_nobody_carries_kills_nobody():
    assert kill_marked('nobody') == []


def test_every_rostest_is_run():
    assert len(rostest_checks(ROOT)) == len(list((ROOT / 'test/rostest').glob('*.test'))) > 0


@pytest.mark.parametrize(
    'path', sorted((ROOT / 'test/rostest').glob('*.test')), ids=lambda path: path.stem
)
def test_a_rostest_that_hangs_is_ended_by_rostest_which_tells_the_case(path):
    tests = list(ElementTree.parse(str(path)).getroot().iter('test'))
    limits_s = [float(test.get('time-limit', 60.0)) for test in tests]
    assert sum(limits_s) + 60.0 <= checks.MAX_ROSTEST_S, (
        'no time is left for roslaunch to start and end its nodes'
    )


@pytest.fixture
def checkout(tmp_path):
    for name in ('smach', 'smach_ros'):
        package = tmp_path / name / 'src' / name
        package.mkdir(parents=True)
        (package / '__init__.py').write_text('')
    return tmp_path


def test_upstream_comes_before_ours(checkout, monkeypatch):
    monkeypatch.setenv('PYTHONPATH', '/ours')
    env = upstream.environment(checkout)
    assert env['PYTHONPATH'].split(os.pathsep) == [
        str(checkout / 'smach/src'),
        str(checkout / 'smach_ros/src'),
        '/ours',
    ]
    assert env['SMACH_UPSTREAM'] == str(checkout / 'smach/src')


def test_a_folder_that_is_no_checkout_is_told_before_anything_runs(tmp_path):
    with pytest.raises(upstream.UpstreamError, match='smach/__init__.py is missing: give a check'):
        upstream_checks(ROOT, tmp_path)
    refused = subprocess.run(
        [sys.executable, str(ROOT / 'test/harness'), '--upstream', str(tmp_path)],
        stderr=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    assert refused.returncode == 2 and b'__init__.py is missing' in refused.stderr


def test_each_name_of_a_test_on_upstream_is_that_of_a_test(checkout):
    names = set(upstream_checks(ROOT, checkout))
    for folder in upstream.UNIT_TESTS:
        assert list((ROOT / 'test/unit' / folder).glob('**/test_*.py')), folder
    for pattern in upstream.ROSTESTS:
        assert list((ROOT / 'test/rostest').glob(pattern + '.test')), pattern
    assert {'upstream/unit/oracle', 'upstream/rostest/oracle_library'} < names


def test_the_summary_says_what_upstream_gave_or_that_it_was_not_run():
    ours = Outcome('unit/oracle', passed=5)
    assert on_upstream([ours]) == 'upstream: not run'
    found = [
        ours,
        Outcome('upstream/unit/oracle', passed=3, skipped=1),
        Outcome('upstream/unit/smach', failed=2, passed=1),
        Outcome('upstream/rostest/none'),
    ]
    assert on_upstream(found) == 'upstream: 4 passed, 3 failed, 1 skipped'


# a benchmark that passes or not as the file `left` says, one letter a run
HELD = """
import sys
assert sys.argv[1:] == ['--check']
left = open('left').read()
open('left', 'w').write(left[1:])
sys.exit('too slow' if left[0] == 'n' else 0)
"""
ATTEMPTS = pytest.mark.parametrize(
    'left, ok, attempts', [('y', True, 1), ('ny', True, 2), ('nn', False, 2)]
)


def assert_told(outcome, capsys, attempts):
    """Check how the attempts of a check are shown and counted; returns what is shown."""
    show(outcome)
    shown = capsys.readouterr().out
    word = 'passed' if outcome.ok else 'failed'
    assert ('{} at the second attempt'.format(word) in shown) is (attempts == 2)
    how = '{} ({})'.format(outcome.name, 'passed then' if outcome.ok else 'failed again')
    counted = second_attempts([Outcome('other', passed=1), outcome])
    assert counted == 'second attempts: ' + ('0' if attempts == 1 else '1: ' + how)
    return shown


@ATTEMPTS
def test_a_rostest_has_a_second_attempt_that_everybody_sees(
    bench, monkeypatch, capsys, left, ok, attempts
):
    runs = list(left)

    def run(path, *_):
        passed = runs.pop(0) == 'y'
        (bench.results / path.stem).mkdir()  # with the logs of the nodes
        return Outcome(
            path.stem,
            passed=int(passed),
            failed=int(not passed),
            detail='' if passed else '1 is not 2',
        )

    monkeypatch.setattr(checks, '_run_rostest', run)
    (bench.root / 'test/rostest').mkdir(parents=True)
    (bench.root / 'test/rostest/one.test').touch()
    outcome = rostest_checks(bench.root)['rostest/one'](bench)
    assert outcome.ok is ok and not runs
    assert (
        sorted(path.name for path in bench.results.glob('one*')) == ['one', 'one.first'][:attempts]
    )
    assert ('1 is not 2' in assert_told(outcome, capsys, attempts)) is ('n' in left)


@ATTEMPTS
def test_a_benchmark_has_a_second_attempt_that_everybody_sees(bench, capsys, left, ok, attempts):
    (bench.root / 'benchmarks').mkdir()
    (bench.root / 'benchmarks/held.py').write_text(HELD)
    (bench.root / 'left').write_text(left)
    outcome = benchmark_checks(bench.root)['benchmarks/held'](bench)
    assert outcome.ok is ok and (bench.root / 'left').read_text() == ''
    assert ('too slow' in assert_told(outcome, capsys, attempts)) is ('n' in left)
    logs = sorted(path.name for path in (bench.results / 'log').iterdir())
    assert logs == ['benchmarks_held.first.log', 'benchmarks_held.log'][-attempts:]


def test_that_no_second_attempt_was_needed_is_said_too():
    assert second_attempts([Outcome('one', passed=1)]) == 'second attempts: 0'


def test_an_interrupt_is_no_reason_for_a_second_attempt(bench, monkeypatch):
    runs = []
    monkeypatch.setattr(
        checks,
        '_run_rostest',
        lambda path, *_: runs.append(path) or Outcome(path.stem, failed=1, detail='interrupted'),
    )
    (bench.root / 'test/rostest').mkdir(parents=True)
    (bench.root / 'test/rostest/one.test').touch()
    bench.runner.stop()
    assert rostest_checks(bench.root)['rostest/one'](bench).failed == 1
    assert len(runs) == 1


def test_benchmarks_without_limits_are_not_run(tmp_path):
    (tmp_path / 'benchmarks').mkdir()
    (tmp_path / 'benchmarks/free.py').write_text('print(1)')
    (tmp_path / 'benchmarks/held.py').write_text("parser.add_argument('--check')")
    assert list(benchmark_checks(tmp_path)) == ['benchmarks/held']


def test_the_last_line_is_the_sum_and_the_one_above_it_counts_second_attempts(tmp_path):
    result = subprocess.run(
        [sys.executable, str(ROOT / 'test/harness'), 'bench', 'no such benchmark'],
        stdout=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    assert result.returncode == 1
    assert result.stdout.decode().splitlines()[-2:] == ['second attempts: 0', '0 passed, 1 failed']
