"""What observers are told, event by event, where the oracle is entered for each of its reasons.

The files in test/data/pinned hold it, the same for each engine.
"""

import pinned_scenes
import pytest
from pinned import FOLDER, held


@pytest.mark.parametrize('scene', pinned_scenes.SCENES, ids=lambda scene: scene.__name__)
def test_observers_are_told_the_same_as_ever(scene):
    assert scene() == held('events/' + scene.__name__)


def test_a_resumed_program_tells_the_same_as_ever(tmp_path):
    assert pinned_scenes.interrupted(tmp_path) == held('events/interrupted')


def test_each_file_has_its_scene():
    names = {scene.__name__ for scene in pinned_scenes.SCENES} | {'interrupted'}
    assert {path.stem for path in (FOLDER / 'events').iterdir()} == names
