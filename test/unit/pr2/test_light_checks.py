"""A light in the camera is waited for, not forever; the fingers tell whether a hand may hold."""

import collections

import pytest

from smach_oracle.pr2 import checks
from smach_oracle.pr2.robot import FINGER_JOINTS, RobotError


class FakeCamera:
    """Is dazzled for its first few images; or gives none."""

    def __init__(self, dazzled_for, broken=False):
        self.left, self.broken, self.looks = dazzled_for, broken, 0

    def see(self, base, camera):
        self.looks += 1
        if self.broken:
            raise RobotError('no message on /head_camera/rgb/image_raw within 10 s')
        self.left -= 1
        return self.left >= 0


class FakeTime:
    """Adds up what is spent."""

    def __init__(self):
        self.spent = collections.Counter()

    def spend(self, seconds, what):
        self.spent[what] += seconds


@pytest.fixture(name='eyes')
def _eyes(monkeypatch):
    def have(*given, **more):
        made = checks._Eyes(FakeCamera(*given, **more), FakeTime(), True)
        monkeypatch.setattr(checks, '_eyes', lambda: made)
        return made

    monkeypatch.setattr(checks, 'dazzled', bool)
    monkeypatch.setattr(checks.rospy, 'is_shutdown', lambda: False)
    return have


def test_a_camera_that_is_dazzled_is_waited_for_until_it_sees(eyes):
    made = eyes(3)
    assert not checks.no_light_in_the_camera(None)
    assert checks.wait_for_light(None)
    assert made.time.spent == {'waiting': 2 * checks.AGAIN_S} and made.senses.looks == 4
    assert checks.no_light_in_the_camera(None)


def test_a_light_that_stays_is_waited_for_only_so_long(eyes):
    made = eyes(10**6)
    assert checks.wait_for_light(None)
    assert made.time.spent['waiting'] == checks.LIGHT_MOVES_S


@pytest.mark.parametrize('gap, holds', [(0.0, False), (0.01, False), (0.05, True), (0.09, False)])
def test_fingers_that_something_keeps_apart_may_hold_it(eyes, gap, holds):
    made = eyes(0)
    made.senses.joints = lambda: dict.fromkeys(FINGER_JOINTS['right'], gap / 2)
    assert checks.right_hand_may_hold(None) == holds
    made.senses.joints = lambda: made.senses.see('', '')
    made.senses.broken = True
    assert not checks.right_hand_may_hold(None)


def test_without_an_image_nothing_is_waited_for(eyes):
    made = eyes(0, broken=True)
    assert checks.no_light_in_the_camera(None) and checks.wait_for_light(None)
    assert not made.time.spent
