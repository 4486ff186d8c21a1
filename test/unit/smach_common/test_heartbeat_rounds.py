"""When each container is told of."""

import pytest

pytest.importorskip('rospy')
from smach_common.introspection.heartbeat_rounds import (
    GREETING_STEP_S,
    HEARTBEAT_S,
    LARGEST_PART,
    HeartbeatRounds,
)

SEVERAL = 5


def follow(rounds, until_s, begin_s=0.0):
    """What is due when, as (seconds, paths), asked as soon as `wait_s` has passed."""
    told, now_s = [], begin_s
    while now_s < until_s:
        paths = rounds.due(now_s)
        if paths:
            told.append((now_s, paths))
        now_s += rounds.wait_s(now_s)
    return told


@pytest.mark.parametrize('count', [1, 2, 19, 20, 21, 150, 500, 501, 1300])
def test_each_container_has_its_turn_once_in_two_seconds(count):
    paths = ['/{}'.format(number) for number in range(count)]
    told = follow(HeartbeatRounds(lambda: paths), SEVERAL * HEARTBEAT_S - 1e-6)
    turns = {path: [now_s for now_s, part in told if path in part] for path in paths}
    for path in paths:
        assert len(turns[path]) == SEVERAL
        gaps = [later - now for now, later in zip(turns[path], turns[path][1:])]
        assert gaps == pytest.approx([HEARTBEAT_S] * (SEVERAL - 1))


@pytest.mark.parametrize('count', [20, 500, 1300])
def test_a_viewer_that_keeps_fifty_messages_loses_none(count):
    told = follow(HeartbeatRounds(lambda: ['/x'] * count), HEARTBEAT_S - 1e-6)
    assert max(len(part) for _, part in told) <= LARGEST_PART
    assert 2 * LARGEST_PART <= 50
    if count == 20:
        assert max(len(part) for _, part in told) == 1


def test_a_newcomer_is_told_of_all_at_once_and_then_of_each_in_two_seconds():
    paths = ['/{}'.format(number) for number in range(2 * LARGEST_PART + 1)]
    rounds = HeartbeatRounds(lambda: paths)
    follow(rounds, 1.0)
    rounds.greet()
    assert rounds.wait_s(1.01) == 0.0
    told = follow(rounds, 1.01 + 3 * HEARTBEAT_S, begin_s=1.01)
    assert [len(part) for _, part in told[:3]] == [LARGEST_PART, LARGEST_PART, 1]
    assert [now_s for now_s, _ in told[:3]] == pytest.approx(
        [1.01, 1.01 + GREETING_STEP_S, 1.01 + 2 * GREETING_STEP_S]
    )
    assert [path for _, part in told[:3] for path in part] == paths
    for path in paths:
        turns = [now_s for now_s, part in told if path in part]
        gaps = [later - now for now, later in zip(turns, turns[1:])]
        assert gaps[0] < HEARTBEAT_S + 0.05
        assert gaps[1:] == pytest.approx([HEARTBEAT_S] * len(gaps[1:]))


def test_newcomers_who_come_and_go_keep_nobody_from_the_last_container():
    paths = ['/{}'.format(number) for number in range(4 * LARGEST_PART)]
    rounds = HeartbeatRounds(lambda: paths)
    told = []
    for step in range(8):
        rounds.greet()
        told += rounds.due(step * GREETING_STEP_S * 1.01)
    assert told == paths + paths


def test_where_nobody_is_to_be_told_it_looks_again_after_two_seconds():
    asked = []
    rounds = HeartbeatRounds(lambda: asked.append(1) or [])
    assert follow(rounds, 3 * HEARTBEAT_S - 1e-6) == []
    assert len(asked) == 3


def test_a_process_that_stood_still_does_not_make_up_for_it():
    rounds = HeartbeatRounds(lambda: ['/{}'.format(number) for number in range(40)])
    rounds.due(0.0)
    told = follow(rounds, 61.0, begin_s=60.0)
    assert len(told) <= 12, 'parts of two, ten a second'


def test_what_comes_and_goes_counts_from_the_next_round():
    paths = ['/A']
    rounds = HeartbeatRounds(lambda: paths)
    assert rounds.due(0.0) == ['/A']
    paths.append('/B')
    assert rounds.due(1.0) == []
    assert rounds.due(HEARTBEAT_S) + rounds.due(1.5 * HEARTBEAT_S) == ['/A', '/B']
