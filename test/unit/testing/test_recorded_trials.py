"""A trial that is in several bags is one trial, with the assertions of a bench."""

import shutil

from resumed_trial import record_resumed_trial

from smach_oracle.testing.recorded import recorded_trials


def test_a_trial_that_went_on_in_another_bag_is_one_trial(tmp_path):
    (trial,) = recorded_trials(str(record_resumed_trial(tmp_path)))
    trial.assert_ended_with('succeeded').assert_recovered('GRASP').assert_recovered('PLACE')
    trial.assert_visited(['GRASP', 'GRASP', 'CARRY', 'CARRY', 'PLACE', 'PLACE'], exactly=True)
    assert [event.seq for event in trial.events] == sorted(event.seq for event in trial.events)


def test_a_bag_that_is_there_twice_adds_nothing(tmp_path):
    bags = record_resumed_trial(tmp_path)
    (before,) = recorded_trials(str(bags))
    for bag in sorted(bags.glob('*.bag')):
        shutil.copy(str(bag), str(bags / 'copy of {}'.format(bag.name)))
    (trial,) = recorded_trials(str(bags))
    assert str(trial) == str(before) and len(trial.events) == len(before.events)
