"""The parameters of the simulated PR2's perception and manipulation: a wrong one is named."""

import pytest
import rospy

from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.pr2.nodes.perception_node import kitchen_at, snapshot_service


@pytest.fixture
def parameter(monkeypatch):
    """Set the one parameter that there is."""

    def give(value):
        monkeypatch.setattr(rospy, 'get_param', lambda name, default: value)

    return give


@pytest.mark.parametrize(
    'value',
    [
        ['fridge.yaml'],
        5,
        True,
        {'widht': 1.0},
        {5: 1, 'widht': 2},
        {'drinks_shelf': float('inf')},
        'nowhere.yaml',
    ],
)
def test_a_kitchen_that_is_none_is_refused_by_its_name(parameter, value):
    parameter(value)
    with pytest.raises(ValueError, match='kitchen: '):
        kitchen_at('~kitchen')


def test_a_kitchen_may_lie_in_the_home_folder(parameter, tmp_path, monkeypatch):
    monkeypatch.setenv('HOME', str(tmp_path))
    (tmp_path / 'map.yaml').write_text('height: 1.6\n')
    parameter('~/map.yaml')
    assert kitchen_at('~kitchen') == Kitchen(height=1.6)


@pytest.mark.parametrize('value', [5, '', ['world/snapshot'], 'no service'])
def test_a_snapshot_service_that_is_none_is_refused_by_its_name(parameter, value):
    parameter(value)
    with pytest.raises(ValueError, match='snapshot: '):
        snapshot_service()


@pytest.mark.parametrize('value', ['none', '/robot/world/snapshot'])
def test_the_name_of_a_service_or_none_will_do(parameter, value):
    parameter(value)
    assert snapshot_service() == value
