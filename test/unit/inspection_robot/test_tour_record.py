"""The second robot's lines of truth: what stands in them, and that the analysis reads them."""

import pytest

from smach_oracle.analysis.trial_rows import read_details
from smach_oracle.analysis.truth import read_truth
from smach_oracle.inspection_robot.nodes.tour_record import TimeUse, TourRecord, append_record
from smach_oracle.inspection_robot.world.causes import draw
from smach_oracle.inspection_robot.world.inspection_world import InspectionWorld


def passing(world, seconds):
    for _ in range(round(seconds / 0.05)):
        world.step(0.05)


@pytest.fixture
def world():
    return InspectionWorld(draw(3, only=['wet_floor', 'low_battery']))


def test_the_analysis_reads_a_line_as_that_of_another_world(world, tmp_path):
    record = TourRecord(world, 12.5)
    passing(world, 2.0)
    world.reported = dict(world.scene.readings)
    world.reported[2] += 0.7
    world.contacts.things.append('person 1')
    path = tmp_path / 'truth.jsonl'
    append_record(str(path), record.line(TimeUse()))
    truth, details = read_truth(str(path))[3], read_details(str(path))[3]
    assert (truth.task, truth.success, truth.wrong_object) == ('inspection', False, 'panel 2')
    assert truth.false_success and 'panel 2 was reported as' in truth.why
    assert truth.damage == (('driven_against', 'person 1'),) and details.damage == 1
    assert [kind for kind, _ in truth.causes] == ['wet_floor', 'low_battery']
    assert (truth.sim_s, details.lasting) == (2.0, 1)
    assert [tuple(cause) for cause in details.causes] == [
        ('wet_floor', True, 0.0, None),
        ('low_battery', False, None, None),
    ]
    assert details.clock.world_s(14.0) == 1.5 and details.wall_s is not None


def test_a_report_that_comes_after_the_end_counts_and_time_does_not(world):
    record = TourRecord(world, 0.0)
    passing(world, 1.0)
    record.end()
    passing(world, 5.0)
    world.reported = dict(world.scene.readings)
    line = record.line(TimeUse())
    assert (line['success'], line['sim_s'], line['wrong_object']) == (True, 1.0, '')


def test_the_time_of_the_expert_is_that_between_begin_and_end_or_the_end_of_the_trial(world):
    record = TourRecord(world, 0.0)
    record.passed(0.5, 'wait')
    record.charge('expert', True)
    passing(world, 2.0)
    record.charge('expert', True)  # it has begun already
    record.passed(1.0, 'expert')  # and this lies within
    passing(world, 1.0)
    record.charge('expert', False)
    record.charge('expert', False)
    passing(world, 1.0)
    record.charge('expert', True)
    passing(world, 1.5)
    assert record.line(TimeUse())['passed_s'] == {'expert': 4.5, 'wait': 0.5}


def test_the_time_of_a_thread_is_told_by_what_it_went_into():
    use = TimeUse()
    sum(range(10000))
    use.add('hall')
    use.add('idle')
    assert use.spent['hall'] > use.used['hall'] * 0.5 > 0 and set(use.used) == {'hall', 'idle'}
    use.restart()
    assert use.spent == {}
