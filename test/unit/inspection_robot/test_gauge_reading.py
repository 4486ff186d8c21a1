"""The gauge is read from what the camera sees, and every reason why not is told."""

import math

import numpy as np
import pytest

from smach_oracle.inspection_robot.robot.reading import ReadingError, read
from smach_oracle.inspection_robot.site import PANELS, before_panel
from smach_oracle.inspection_robot.world.base import Twist
from smach_oracle.inspection_robot.world.causes import draw
from smach_oracle.inspection_robot.world.inspection_world import InspectionWorld


def seen(pose, only=(), seed=3, time_s=1.0, twist=None):
    """What the camera sees from a pose, once so much time has passed."""
    world = InspectionWorld(draw(seed, only=list(only)))
    while world.time_s < time_s:
        world.step(0.05)
    world.base.pose = pose
    world.base.twist = twist or Twist()
    return world.image()


def around(panel, angle, distance=1.5):
    """A pose that looks at a panel's middle from the side."""
    yaw = panel.facing + angle
    return (panel.x + distance * math.cos(yaw), panel.y + distance * math.sin(yaw), yaw + math.pi)


@pytest.mark.parametrize('seed', range(8))
@pytest.mark.parametrize('panel', PANELS, ids=lambda panel: str(panel.number))
def test_from_where_the_robot_stands_a_gauge_is_read(panel, seed):
    found = read(seen(before_panel(panel, 1.5, 0.1), seed=seed))
    assert found.number == panel.number
    assert found.bar == pytest.approx(draw(seed).readings[panel.number], abs=0.15)


@pytest.mark.parametrize(
    'pose, twist, why',
    [
        (before_panel(PANELS[0], 4.0), None, 'too far off'),
        (around(PANELS[0], math.radians(55)), None, 'at a slant'),
        (before_panel(PANELS[0], 1.5, 1.0), None, 'as a whole'),
        (before_panel(PANELS[0], 1.5), Twist(0.0, 0.7), 'blurred'),
        ((5.0, 3.5, math.pi / 2), None, 'as a whole'),
    ],
)
def test_why_it_cannot_be_read_is_told(pose, twist, why):
    with pytest.raises(ReadingError, match=why):
        read(seen(pose, twist=twist))


def test_a_person_before_the_panel_hides_it():
    world = InspectionWorld(draw(0, only=['person_at_the_panel']))
    x, y = world.scene.errands[1].places[1]
    panel = min(PANELS, key=lambda each: math.hypot(each.x - x, each.y - y))
    when = world.scene.errands[1].begins_s + 5.0
    with pytest.raises(ReadingError, match='as a whole'):
        read(seen(before_panel(panel, 1.5), ['person_at_the_panel'], seed=0, time_s=when))
    assert read(seen(before_panel(panel, 1.5), seed=0)).number == panel.number


def test_light_hides_a_panel_for_who_stands_in_it_while_it_lasts():
    glare = draw(0, only=['glare']).glare
    panel = next(each for each in PANELS if each.number == glare.panel)
    with pytest.raises(ReadingError, match='light'):
        read(seen(before_panel(panel, 1.5), ['glare'], 0, glare.begins_s + 1.0))
    assert read(seen(before_panel(panel, 1.5), ['glare'], 0, glare.ends_s + 1.0))
    aside = around(panel, -math.copysign(math.radians(43), glare.angle))
    assert read(seen(aside, ['glare'], 0, glare.begins_s + 1.0)).number == panel.number


def test_the_reading_stays_true_at_a_slant():
    true = draw(3).readings[1]
    for degrees in (-35, -20, 20, 35):
        assert read(seen(around(PANELS[0], math.radians(degrees)))).bar == pytest.approx(
            true, abs=0.2
        )


def test_noise_alone_shows_no_panel():
    rng = np.random.default_rng(0)
    with pytest.raises(ReadingError):
        read(rng.integers(0, 255, (300, 400, 3)).astype(np.uint8))
