"""The extra kinds of causes of the hall: a slack tyre, and steam."""

import collections
import hashlib
import math

import numpy as np
import pytest

from smach_oracle.inspection_robot.robot.reading import ReadingError, read
from smach_oracle.inspection_robot.robot.steering import is_blocked
from smach_oracle.inspection_robot.site import PANELS, before_panel
from smach_oracle.inspection_robot.world.base import WheeledBase
from smach_oracle.inspection_robot.world.causes import draw
from smach_oracle.inspection_robot.world.extra_causes import (
    EXTRA,
    SLACK_TYRE,
    STEAM,
    VEER,
    Plume,
)
from smach_oracle.inspection_robot.world.inspection_world import BEAMS, InspectionWorld

DT_S = 0.05
# of the usual scenes of the seeds 0 to 199, from before there were extra kinds
USUAL = '66d03956734178e2'


def rounded(value):
    """Whatever machine draws it, the last digits aside."""
    if isinstance(value, float):
        return '{:.6f}'.format(value + 0.0)
    if isinstance(value, dict):
        return sorted((key, rounded(each)) for key, each in value.items())
    return [rounded(each) for each in value] if isinstance(value, (tuple, list)) else value


def digest_of(scenes):
    told = [
        rounded(
            (
                *scene[:3],
                [each[:3] for each in scene.errands],
                (scene.wet, scene.glare, scene.sag),
            )
        )
        for scene in scenes
    ]
    return hashlib.sha256(repr(told).encode()).hexdigest()[:16]


def test_the_usual_halls_are_as_they_were():
    scenes = [draw(seed) for seed in range(200)]
    assert digest_of(scenes) == USUAL
    assert all((scene.veer, scene.plume) == (0.0, None) for scene in scenes)
    assert not {kind for scene in scenes for kind in scene.causes} & set(EXTRA)


def test_each_trial_has_one_extra_kind_and_none_of_the_usual_ones():
    scenes = [draw(seed, extra=True) for seed in range(400)]
    counts = collections.Counter(scene.causes for scene in scenes)
    assert set(counts) == {(SLACK_TYRE,), (STEAM,)}
    assert counts[(STEAM,)] / 400 == pytest.approx(0.5, abs=0.06)
    for scene in scenes:
        alone = scene._replace(causes=(), veer=0.0, plume=None)
        assert alone == draw(scene.seed, ()) and scene == draw(scene.seed, extra=True)
        if scene.plume is None:
            assert VEER[0] <= abs(scene.veer) <= VEER[1]
        else:
            assert scene.veer == 0.0
            assert 6.0 <= scene.plume.ends_s - scene.plume.begins_s <= 20.0
    with pytest.raises(ValueError, match='no other causes'):
        draw(1, ['glare'], extra=True)


def test_a_slack_tyre_turns_the_robot_and_the_wheels_do_not_know():
    base = WheeledBase((5.0, 1.0, math.pi / 2), veer=0.05)
    for _ in range(60):
        base.command(0.6, 0.0)
        base.step(DT_S)
    assert base.odometry[2] == 0.0
    assert base.pose[2] - math.pi / 2 == pytest.approx(0.05 * base.odometry[0], rel=0.05)


def in_steam(begins_s=0.0, ends_s=10.0):
    """A robot before the first panel, and a plume between the two."""
    x, y, _ = before_panel(PANELS[0], 0.5)
    scene = draw(101, ())._replace(plume=Plume(x, y, 0.5, begins_s, ends_s), causes=(STEAM,))
    world = InspectionWorld(scene)
    world.base.pose = before_panel(PANELS[0], 1.5)
    return world


def readable(world):
    try:
        return read(world.image()).number == 1
    except ReadingError:
        return False


def test_steam_hides_a_panel_and_throws_the_scanners_light_back():
    world = in_steam(1.0, 3.0)
    seen = []
    for _ in range(80):
        world.step(DT_S)
        if round(world.time_s / DT_S) % 10 == 5:
            blocked = is_blocked(world.scan(), BEAMS, 0.75)
            seen.append((round(world.time_s, 2), readable(world), blocked))
    assert [moment for moment, clear, _ in seen if not clear] == [1.25, 1.75, 2.25, 2.75]
    assert [moment for moment, _, blocked in seen if blocked] == [1.25, 1.75, 2.25, 2.75]


def test_a_part_of_the_scanners_light_goes_through_steam():
    world = in_steam()
    world.step(DT_S)
    middle = np.abs(BEAMS) < 0.3
    scans = np.array([world.scan()[middle] for _ in range(40)])
    assert 0.4 < (scans < 1.3).mean() < 0.8
    assert (scans > 1.4).any()


def test_a_picture_without_steam_is_as_it_was():
    usual, other = InspectionWorld(draw(101, ())), in_steam(5.0, 6.0)
    usual.base.pose = other.base.pose
    assert (usual.image() == other.image()).all() and (usual.scan() == other.scan()).all()


def log_after(world, seconds):
    for _ in range(round(seconds / DT_S)):
        world.step(DT_S)
    (cause,) = world.log.record()
    return cause


def test_the_halls_log_tells_when_steam_came_and_was_gone_and_that_a_tyre_stays_slack():
    steam = log_after(in_steam(1.0, 3.0), 4.0)
    assert (steam['kind'], steam['lasting']) == (STEAM, False) and 'steam' in steam['text']
    assert steam['began_s'] == pytest.approx(1.0, abs=0.06)
    assert steam['ended_s'] == pytest.approx(3.0, abs=0.06)
    scene = next(each for each in (draw(seed, extra=True) for seed in range(20)) if each.veer)
    tyre = log_after(InspectionWorld(scene), 4.0)
    assert (tyre['kind'], tyre['lasting'], tyre['ended_s']) == (SLACK_TYRE, True, None)
    assert tyre['began_s'] == pytest.approx(0.0, abs=0.06) and 'rad a m' in tyre['text']
