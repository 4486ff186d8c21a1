"""Goals that run: how many are kept."""

from smach_oracle.oracle.records.running_goals import MOST, RunningGoals


def test_the_oldest_goals_are_forgotten_where_there_are_too_many():
    goals = RunningGoals()
    for number in range(MOST + 2):
        goals.begin(str(number), '/arm')
    assert list(goals.running()) == [str(number) for number in range(2, MOST + 2)]
    goals.end(str(MOST))
    assert len(goals.running()) == MOST - 1
