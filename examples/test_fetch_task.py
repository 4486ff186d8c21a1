"""Tests of fetch_task.py with pytest. They need no ROS master: `python3 -m pytest examples`."""

from fetch_task import build_machine

from smach_oracle.testing import Bench, crash, expert, fail, goto, hang, soak, supersede


def test_nothing_goes_wrong():
    with Bench(build_machine()) as bench:
        bench.run().assert_no_failures().assert_visited(['DETECT', 'PICK', 'PLACE'], exactly=True)


def test_a_failed_grasp_is_tried_again():
    with Bench(build_machine(), [fail('PICK', visit=1, outcome='aborted')]) as bench:
        bench.run().assert_recovered('PICK').assert_failed('PICK', times=1).assert_not_asked()


def test_a_grasp_that_keeps_failing_is_put_to_the_expert():
    answers = expert(goto('DETECT', about='PICK'), supersede('succeeded', about='PICK'))
    with Bench(
        build_machine(), [fail('PICK')], expert=answers, settings={'max_recoveries': 0}
    ) as bench:
        trial = bench.run()
    trial.assert_asked_about('PICK', times=2).assert_jumped('PICK', to='DETECT')
    trial.assert_ended_with('succeeded')
    assert answers.left == 0


def test_an_exception_is_recovered_from():
    with Bench(build_machine(), [crash('DETECT', visit=1, error=OSError('no camera'))]) as bench:
        bench.run().assert_recovered('DETECT')


def test_an_arm_that_hangs_is_stopped_at_its_time_limit():
    with Bench(
        build_machine(),
        [hang('PICK', visit=1)],
        settings={'states': {'PICK': {'time_limit_s': 1.0}}},
    ) as bench:
        bench.run().assert_recovered('PICK')


def test_every_failure_can_recover():
    soak(build_machine, trials=100, seed=1).assert_every_failure_can_recover()
