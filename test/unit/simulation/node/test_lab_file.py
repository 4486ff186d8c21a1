"""The world's node and a lab that goes on: its file, and what a trial's truth says about it."""

import json

import pytest

from smach_oracle.simulation.node.lab import read_lab
from smach_oracle.simulation.node.settings import WorldSettings
from smach_oracle.simulation.physics.judge import TrialVerdict
from smach_oracle.simulation.physics.world import World


def settings(tmp_path, content):
    path = tmp_path / 'lab.json'
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return WorldSettings(lab=str(path), benign=True)


def test_a_lab_that_is_read_anew_goes_on_as_the_one_that_was_kept(tmp_path):
    kept = read_lab(settings(tmp_path, {'seed': 300, 'slot_h': 0.1, 'left': None}))
    world = World(kept.scene(300), 2)
    told = kept.leave(world, TrialVerdict(True, ''), 36.0)
    world.close()
    assert told['hour'] == 0.0 and told['left']['ended'] == pytest.approx(0.01)
    again = read_lab(
        settings(
            tmp_path, json.loads(json.dumps({'seed': 300, 'slot_h': 0.1, 'left': told['left']}))
        )
    )
    assert (
        again.scene(301)
        == kept.scene(301)
        != read_lab(settings(tmp_path, {'seed': 300, 'slot_h': 0.1, 'left': None})).scene(301)
    )


@pytest.mark.parametrize(
    'content',
    [
        '',
        '[]',
        {'seed': 1},
        {'seed': -1, 'slot_h': 1, 'left': None},
        {'seed': 1, 'slot_h': 0, 'left': None},
        {'seed': 1, 'slot_h': 1, 'left': {'things': []}},
    ],
)
def test_a_file_that_is_none_is_refused_with_its_name(tmp_path, content):
    with pytest.raises(ValueError, match='lab.json'):
        read_lab(settings(tmp_path, content))


def test_a_seed_before_the_run_is_refused(tmp_path):
    lab = read_lab(settings(tmp_path, {'seed': 300, 'slot_h': 0.1, 'left': None}))
    with pytest.raises(ValueError, match='300 or more'):
        lab.scene(299)
