"""The seeded faults: repeatable, and each ended by its own cure alone."""
from typing import Any, List, Mapping

import pytest

from smach_oracle.oracle.errors import ConfigError
from smach_oracle.simulation.fault_model import (CHAIN, CURES, EXPERT, NEEDS, PRECONDITIONS, STEP_BACK, TRANSIENT,
                                                 Fault, FaultSettings, FaultyWorld, draw_faults, strikes)

ALWAYS = {'fault_probability': 1.0}


def run_up_to(world: FaultyWorld, state: str) -> List[str]:
    """Run the chain before `state`; the reasons of what failed."""
    return [reason for reason in map(world.attempt, CHAIN[:CHAIN.index(state)]) if reason]


def test_a_world_without_faults_lets_the_whole_chain_work() -> None:
    world = FaultyWorld()
    assert [world.attempt(state) for state in CHAIN] == [''] * len(CHAIN)


def test_nothing_can_be_placed_that_was_not_picked() -> None:
    assert FaultyWorld().attempt('PLACE') == 'nothing in the gripper'


def test_a_transient_fault_fails_as_often_as_its_strength_and_then_works() -> None:
    world = FaultyWorld([Fault('POINT_HEAD', TRANSIENT, 2, 'stalled')])
    assert [world.attempt('POINT_HEAD') for _ in range(4)] == ['stalled', 'stalled', '', '']


@pytest.mark.parametrize('state', strikes(PRECONDITIONS))
def test_a_fault_cured_by_preconditions_needs_all_of_them_after_it_has_shown(state: str) -> None:
    world = FaultyWorld([Fault(state, PRECONDITIONS, 0, 'stale')])
    assert run_up_to(world, state) == []
    assert world.attempt(state) == 'stale'
    for need in NEEDS[state]:
        assert world.attempt(state) == 'stale'
        assert world.attempt(need) == ''
    assert world.attempt(state) == ''


@pytest.mark.parametrize('state', strikes(STEP_BACK))
def test_a_fault_cured_by_stepping_back_outlives_retries_and_preconditions(state: str) -> None:
    world = FaultyWorld([Fault(state, STEP_BACK, 0, 'wrong')])
    assert run_up_to(world, state) == []
    assert world.attempt(state) == 'wrong'
    for need in NEEDS.get(state, ()):
        world.attempt(need)
    assert world.attempt(state) == 'wrong'
    assert world.attempt(CHAIN[CHAIN.index(state) - 1]) == ''
    assert world.attempt(state) == ''


@pytest.mark.parametrize('state', CHAIN)
def test_an_experts_fault_ends_by_assistance_alone(state: str) -> None:
    world = FaultyWorld([Fault(state, EXPERT, 0, 'stuck')])
    run_up_to(world, state)
    assert world.attempt(state) == 'stuck'
    run_up_to(world, state)
    assert world.attempt(state) == 'stuck'
    world.assist(state)
    run_up_to(world, state)
    assert world.attempt(state) == ''


def test_what_the_expert_picked_can_be_placed() -> None:
    world = FaultyWorld([Fault('PICK', EXPERT, 0, 'stuck')])
    world.assist('PICK')
    assert world.attempt('PLACE') == ''


def test_a_failed_action_cures_nothing() -> None:
    world = FaultyWorld([Fault('MOVE_ARMS_ASIDE', TRANSIENT, 2, 'late'),
                         Fault('DETECT_TABLETOP', PRECONDITIONS, 0, 'blocked')])
    world.attempt('MOVE_ARMS_ASIDE')
    assert world.attempt('DETECT_TABLETOP') == 'blocked'
    assert world.attempt('MOVE_ARMS_ASIDE') == 'late'
    assert world.attempt('DETECT_TABLETOP') == 'blocked'
    assert world.attempt('MOVE_ARMS_ASIDE') == ''
    assert world.attempt('DETECT_TABLETOP') == ''


def test_the_same_seed_draws_the_same_faults() -> None:
    settings = FaultSettings(ALWAYS)
    first = [draw_faults(seed, settings) for seed in range(200)]
    assert first == [draw_faults(seed, settings) for seed in range(200)]
    assert len({tuple(faults) for faults in first}) > 20


def test_every_cure_and_every_state_is_drawn_and_only_where_it_can_strike() -> None:
    drawn = [fault for seed in range(2000) for fault in draw_faults(seed, FaultSettings(ALWAYS))]
    assert {fault.cure for fault in drawn} == set(CURES)
    assert {fault.state for fault in drawn} == set(CHAIN)
    assert all(fault.state in strikes(fault.cure) for fault in drawn)
    assert all((fault.strength > 0) == (fault.cure == TRANSIENT) for fault in drawn)


def test_about_as_many_trials_are_faulty_as_the_probability_says() -> None:
    faulty = sum(bool(draw_faults(seed, FaultSettings({'fault_probability': 0.3}))) for seed in range(4000))
    assert 0.27 < faulty / 4000.0 < 0.33  # four standard deviations


@pytest.mark.parametrize('settings, key', [
    ({'fault_probability': 1.5}, 'fault_probability'),
    ({'fault_probability': True}, 'fault_probability'),
    ({'transient_attempts': 0}, 'transient_attempts'),
    ({'cure_weights': {'luck': 1.0}}, 'cure_weights'),
    ({'cure_weights': {TRANSIENT: -1.0}}, 'cure_weights.transient'),
    ({'state_weights': {'PICK': 0.0}}, 'state_weights'),
    ({'faults': 1}, 'faults'),
    ('hello', 'faults'),
])
def test_a_bad_setting_is_named_with_what_is_allowed(settings: Mapping[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        FaultSettings(settings)
    assert caught.value.key == key
    assert 'allowed' in str(caught.value)
