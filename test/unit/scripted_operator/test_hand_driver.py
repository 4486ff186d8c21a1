"""Driving a hand by velocities: no hand, however odd, keeps the driver forever."""

import numpy as np
import pytest

from smach_oracle.geometry.transforms import transform
from smach_oracle.scripted_operator.hand_driver import HandDriver, StuckError


class Hand:
    """Moves as told, in one period; `sway`: m by which it swings to and fro besides."""

    arm = 'right'
    period = 1 / 30

    def __init__(self, sway=0.0):
        self.at = np.zeros(3)
        self.moves = 0
        self._sway = sway

    def tool(self):
        return transform(self.at + [0.0, self._sway * (self.moves % 2), 0.0])

    def move(self, twist, turn_freely=False):
        self.moves += 1
        self.at = self.at + twist[:3] * self.period
        return ''


def test_a_hand_that_obeys_comes_to_its_place_and_stays_there():
    hand = Hand()
    HandDriver(hand).come_to(np.array([0.3, 0.0, 0.1]))
    assert hand.at == pytest.approx([0.3, 0.0, 0.1], abs=0.01) and hand.moves < 200


def test_a_hand_that_sways_on_is_taken_as_it_is_or_given_up():
    hand = Hand(sway=0.02)
    HandDriver(hand).come_to(np.array([0.3, 0.0, 0.1]))
    assert hand.moves <= 900
    with pytest.raises(StuckError, match='cm away'):
        HandDriver(Hand(sway=0.2)).come_to(np.array([0.3, 0.0, 0.1]))
