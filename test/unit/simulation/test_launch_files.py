"""The launch files of the simulated PR2: each piece apart, and the world's pace where people
answer.
"""

import functools

import pytest
from roslaunch.config import load_config_default
from roslaunch.substitution_args import resolve_args

from smach_oracle.simulation.node.settings import read_settings

PIECES = {
    'pr2_world',
    'pr2_perception',
    'pr2_manipulation',
    'perception_interface',
    'manipulation_interface',
    'scripted_operator',
}


@functools.lru_cache(maxsize=None)
def launched(name, *arguments):
    """What roslaunch would start. Tests read it only."""
    return load_config_default(
        [(resolve_args('$(find smach_oracle)/launch/{}.launch'.format(name)), list(arguments))],
        11311,
        verbose=False,
    )


def nodes(config):
    return {node.type for node in config.nodes}


def test_the_whole_robot_is_made_of_pieces_that_can_be_launched_apart():
    assert nodes(launched('pr2')) == PIECES
    for piece in PIECES:
        assert nodes(launched(piece)) == {piece}


@pytest.mark.parametrize('task', ['pick_and_place', 'drink_retrieval'])
@pytest.mark.parametrize(
    'arguments, factor, lock_step',
    [
        ((), 0, True),
        (('scripted_operator:=false',), 1, False),
        (('scripted_operator:=false', 'real_time_factor:=0'), 0, True),
        (('real_time_factor:=2',), 2, False),
    ],
)
def test_where_people_answer_the_world_keeps_the_walls_time_unless_told_otherwise(
    task, arguments, factor, lock_step
):
    config = launched(task, *arguments)
    assert config.params['/pr2_world/real_time_factor'].value == factor
    assert config.params['/pr2_world/task'].value == task
    assert config.params['/manipulation_interface/lock_step'].value is lock_step
    assert ('scripted_operator' in nodes(config)) == ('scripted_operator:=false' not in arguments)


@pytest.mark.parametrize('factor', [0, 1])
def test_the_rates_that_are_launched_are_those_of_the_node_unless_told_otherwise(factor):
    rates = ['camera_rate', 'state_rate']
    config = launched('pr2_world', 'real_time_factor:={}'.format(factor))
    node = read_settings(lambda name, usual: factor if name == '~real_time_factor' else usual)
    assert [config.params['/pr2_world/' + rate].value for rate in rates] == [
        getattr(node, rate) for rate in rates
    ]
    assert launched('pr2_world', 'camera_rate:=7').params['/pr2_world/camera_rate'].value == 7


@pytest.mark.parametrize('task', ['pick_and_place', 'drink_retrieval'])
def test_the_truth_is_offered_to_nobody_unless_one_asks_the_world_for_it(task):
    config = launched(task)
    assert config.params['/pr2_world/reveal'].value is False
    assert not any(name.endswith('reveal') and param.value for name, param in config.params.items())
    assert launched(task, 'reveal:=true').params['/pr2_world/reveal'].value is False
    assert launched('pr2', 'reveal:=true').params['/pr2_world/reveal'].value is True
    assert read_settings(lambda name, usual: usual).reveal is False


@pytest.mark.parametrize('factor, service', [(0, 'world/pass_time'), (1, 'none')])
def test_the_operators_time_passes_in_the_world_or_by_the_clock_of_a_paced_one(factor, service):
    config = launched('pr2', 'real_time_factor:={}'.format(factor))
    assert config.params['/scripted_operator/pass_time'].value == service


@pytest.mark.parametrize('task', ['pick_and_place', 'drink_retrieval'])
def test_a_film_hears_the_machine_of_its_task_and_gives_signs_of_life(task):
    config = launched(task, 'film:=/tmp')
    machine = next(node for node in config.nodes if node.type == 'oracle_run')
    events = config.params['/pr2_world/film_events'].value
    assert '/' + events == '/{}/oracle/events'.format(machine.name)
    # images take half a second of wall time or more, and there are five in a simulated second
    often = config.params['/actionlib_status_frequency'].value
    assert often > launched(task).params['/actionlib_status_frequency'].value
    assert launched('pr2').params['/pr2_world/film_events'].value == 'none'
