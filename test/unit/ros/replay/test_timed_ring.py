"""A ring of a stream stays within its seconds and bytes, whatever comes."""

import random

import pytest

from smach_oracle.ros.replay.timed_ring import TimedRing


@pytest.mark.parametrize('seed', range(5))
def test_a_ring_stays_within_seconds_and_bytes(seed):
    chance = random.Random(seed)
    ring, now_s, put = TimedRing(30.0, 1000), 0.0, []
    for number in range(3000):
        now_s += chance.choice([0.0, 0.1, 1.0, 20.0])
        size = chance.choice([1, 90, 400, 1000, 1001])
        if ring.put(now_s, size, (now_s, size, number)):
            put.append((now_s, size, number))
        else:
            assert size > 1000
        kept = ring.items()
        assert ring.bytes == sum(size for _, size, _ in kept) <= 1000
        assert kept == put[len(put) - len(kept) :], 'the newest, oldest first'
        assert all(now_s - 30.0 <= came_s for came_s, _, _ in kept)


def test_what_is_older_than_a_ring_holds_is_forgotten_though_nothing_comes():
    ring = TimedRing(30.0, 1000)
    ring.put(1.0, 10, 'old')
    ring.put(20.0, 10, 'new')
    ring.forget_before(40.0)
    assert (ring.items(), ring.bytes) == (['new'], 10)


def test_a_clock_that_jumps_back_begins_a_ring_again():
    ring = TimedRing(30.0, 1000)
    ring.put(500.0, 10, 'of before')
    ring.put(2.0, 10, 'after')
    assert (ring.items(), ring.bytes) == (['after'], 10)
