"""A failure that a later state reports, where the program is stopped meanwhile."""

from killed_machines import Noted
from killed_trees import ENDS
from left_stores import Left

import smach


class FailsOnce(Noted):
    """Fails where it has not ended before, in whatever process."""

    def execute(self, userdata):
        self._failures = 0 if self._diary.count('ends')[self._name] else 1
        return super().execute(userdata)


def reporting(diary, points):
    """WORK fails, and REPORT, to which its author leads, ends in `aborted`."""
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        machine.add('LOOK', Noted('LOOK', diary, points), {'succeeded': 'WORK'})
        machine.add(
            'WORK',
            FailsOnce('WORK', diary, points),
            {'succeeded': 'succeeded', 'aborted': 'REPORT'},
        )
        machine.add('REPORT', Noted('REPORT', diary, points), {**ENDS, 'succeeded': 'aborted'})
    return machine


def test_killed_anywhere_the_failed_state_is_recovered_from(tmp_path):
    told_once = 0
    left = Left(reporting)
    for point in left.points(3):
        killed = left.killed_at(point, tmp_path / 'killed')
        before = killed.diary
        has_told = before.count('ends')['REPORT'] == before.count('begins')['WORK'] == 1
        told = killed.run()
        assert told.get('outcome') == 'succeeded', (point, told)
        failures = {state: failed for _, state, _, failed in told['rates']}
        assert failures['REPORT'] == 0, point
        assert failures['WORK'] <= 1, point
        begun = killed.diary.count('begins')
        assert begun['WORK'] <= 3 and begun['REPORT'] <= 2, (point, begun)
        told_once += has_told and begun['REPORT'] == 1
    assert told_once >= 3, 'at the transition to the oracle, its decision and its jump'


def test_after_a_crash_it_is_recovered_from_by_a_policy_that_learns_as_well(tmp_path):
    left = Left(reporting, policy='learned')
    told = left.killed_at(left.first_in('REPORT'), tmp_path / 'killed').run()
    assert told.get('outcome') == 'succeeded', told
