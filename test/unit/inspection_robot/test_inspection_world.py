"""The second robot's world: what is drawn from a seed, how the base moves, how people walk."""

import math

import numpy as np
import pytest

from smach_oracle.inspection_robot.rays import clearance, ranges, to_circle, to_walls
from smach_oracle.inspection_robot.site import PANELS, ROBOT_RADIUS, START, WALLS, before_panel
from smach_oracle.inspection_robot.world.base import MAX_SPEED, WetPatch, WheeledBase
from smach_oracle.inspection_robot.world.causes import AT_PANEL_S, CHANCE, draw
from smach_oracle.inspection_robot.world.contacts import Contacts
from smach_oracle.inspection_robot.world.hall_log import in_words
from smach_oracle.inspection_robot.world.inspection_world import BEAMS, InspectionWorld
from smach_oracle.inspection_robot.world.people import (
    KEEPS_AWAY,
    WAITS_S,
    WALKS_AROUND,
    Errand,
    Walker,
)

DT_S = 0.05


def driven(base, v, w, for_s):
    """The base after a command that is repeated for so long."""
    for _ in range(int(round(for_s / DT_S))):
        base.command(v, w)
        base.step(DT_S)
    return base


def test_rays_end_at_walls_and_at_people():
    box = np.array([(2.0, -1.0, 2.0, 1.0)])
    angles = np.array([0.0, math.pi / 2, math.pi])
    assert to_walls((0.0, 0.0), angles, box) == pytest.approx([2.0, np.inf, np.inf])
    assert to_circle((0.0, 0.0), angles, (0.0, 3.0, 0.5)) == pytest.approx([np.inf, 2.5, np.inf])
    assert ranges((0.0, 0.0), angles, box, [(1.0, 0.0, 0.25)]) == pytest.approx(
        [0.75, np.inf, np.inf]
    )


def test_the_clearance_is_that_to_the_nearest_wall():
    assert clearance(5.0, 1.5, WALLS) == pytest.approx(1.5)
    assert clearance(3.2, 4.4, WALLS) == pytest.approx(0.3)


def test_on_a_dry_floor_the_wheels_say_where_the_robot_is():
    base = driven(WheeledBase((5.0, 1.0, math.pi / 2)), 0.5, 0.0, 3.0)
    assert base.pose[:2] == pytest.approx((5.0, 1.0 + base.odometry[0]))
    assert 1.0 < base.odometry[0] < 1.5


def test_a_wet_floor_turns_the_robot_and_the_wheels_do_not_know():
    wet = WetPatch(5.0, 2.0, 0.6, 0.6)
    base = driven(WheeledBase((5.0, 1.0, math.pi / 2), wet), 0.8, 0.0, 3.0)
    assert base.odometry[2] == 0.0
    assert 0.2 < base.pose[2] - math.pi / 2 < 0.6 * 1.2


def test_on_a_wet_floor_the_robot_slides_on_when_its_wheels_stand():
    base = driven(WheeledBase((5.0, 1.0, math.pi / 2), WetPatch(5.0, 2.0, 2.0, 0.0)), 0.8, 0.0, 3.0)
    driven(base, 0.0, 0.0, 0.8)
    assert base.wheels.v == 0.0 and base.twist.v > 0.2


def test_the_base_stops_without_commands_and_without_power():
    base = driven(WheeledBase(START), 0.5, 0.0, 1.0)
    for _ in range(40):
        base.step(DT_S)
    assert base.wheels.v == 0.0
    base.powered = False
    assert driven(base, 0.5, 0.0, 1.0).wheels.v == 0.0


def test_commands_that_are_too_fast_are_cut():
    assert driven(WheeledBase((1.0, 1.0, 0.0)), 9.0, 0.0, 1.0).wheels.v == MAX_SPEED


def test_walls_and_people_stop_the_base_and_it_comes_away_from_them():
    base = driven(WheeledBase((1.0, 1.2, math.pi)), 0.8, 0.0, 3.0)
    assert base.bumped and base.pose[0] == pytest.approx(0.25, abs=0.05)
    assert driven(base, -0.5, 0.0, 1.0).pose[0] > 0.4
    base = WheeledBase((2.0, 1.2, math.pi))
    for _ in range(60):
        base.command(0.5, 0.0)
        base.step(DT_S, [(1.0, 1.2, 0.22)])
    assert base.bumped and base.pose[0] == pytest.approx(1.0 + 0.22 + ROBOT_RADIUS, abs=0.05)


def test_a_person_goes_there_stands_and_comes_back():
    walker = Walker(Errand(1.0, ((0.0, 0.0), (2.2, 0.0), (0.0, 0.0)), (0.0, 3.0, 0.0)))
    way = []
    for _ in range(int(9.0 / DT_S)):
        walker.step(DT_S, (9.0, 9.0))
        way.append(walker.x)
    times = np.arange(len(way)) * DT_S
    assert np.interp(0.9, times, way) == 0.0
    assert way[int(4.0 / DT_S)] == 2.2 and way[-1] == 0.0


def test_a_person_lets_the_robot_pass_then_walks_around_it():
    walker = Walker(Errand(0.0, ((0.0, 0.05), (4.0, 0.0)), (0.0, 0.0)))
    gaps = []
    for _ in range(int(12.0 / DT_S)):
        walker.step(DT_S, (2.0, 0.0))
        gaps.append(math.hypot(walker.x - 2.0, walker.y))
    assert min(gaps) >= WALKS_AROUND
    waited = np.isclose(gaps, KEEPS_AWAY, atol=0.06).sum() * DT_S
    assert waited > 1.9 and (walker.x, walker.y) == (4.0, 0.0)


def test_a_seed_is_a_world_and_each_cause_comes_by_its_chance():
    assert draw(7) == draw(7) != draw(8)
    drawn = [draw(seed).causes for seed in range(1000, 1600)]
    for kind, chance in CHANCE.items():
        assert np.mean([kind in causes for causes in drawn]) == pytest.approx(chance, abs=0.08)


def test_causes_can_be_named_and_are_those_of_the_seed():
    scene = draw(7, only=['wet_floor', 'glare'])
    assert scene.causes == ('wet_floor', 'glare')
    assert scene.wet and scene.glare and scene.sag is None and len(scene.errands) == 1
    assert draw(7, only=['glare']).glare == scene.glare
    assert draw(7, only=[]).readings == draw(7).readings
    with pytest.raises(ValueError, match='wet_floor'):
        draw(7, only=['rain'])


@pytest.mark.parametrize('seed', range(6))
def test_who_looks_at_a_panel_stands_before_it_when_the_robot_comes(seed):
    world = InspectionWorld(draw(seed, only=['person_at_the_panel']))
    gaps = {}
    while world.time_s < 33.0:
        world.step(DT_S)
        for panel in PANELS:
            if abs(world.time_s - AT_PANEL_S[panel.number]) < 0.5 * DT_S:
                gaps[panel.number] = min(
                    math.hypot(x - panel.x, y - panel.y) for x, y, _ in world.people
                )
    assert sum(gap < 0.5 for gap in gaps.values()) == 1, gaps


def test_a_low_battery_takes_the_power_for_a_while():
    world = InspectionWorld(draw(3, only=['low_battery']))
    powered = []
    while world.time_s < 60.0:
        world.step(DT_S)
        powered.append(world.base.powered)
    sag = world.scene.sag
    assert powered[0] and powered[-1]
    assert powered.count(False) * DT_S == pytest.approx(sag.ends_s - sag.begins_s, abs=2 * DT_S)


def test_the_scan_shows_walls_and_people():
    world = InspectionWorld(draw(3, only=[]))
    world.base.pose = (5.0, 1.5, -math.pi / 2)
    ahead = int(np.argmin(np.abs(BEAMS)))
    assert world.scan()[ahead] == pytest.approx(1.5, abs=0.05)


def test_the_goal_is_every_panel_reported_and_right():
    world = InspectionWorld(draw(3))
    world.reported = dict(world.scene.readings)
    assert world.shortcomings() == []
    world.reported[2] += 0.7
    del world.reported[3]
    assert [text.split(' was ')[0] for text in world.shortcomings()] == ['panel 2', 'panel 3']


def test_one_stands_straight_before_a_panel():
    x, y, yaw = before_panel(PANELS[2], 1.5)
    assert (x, y, abs(yaw)) == pytest.approx((8.5, 4.8, 0.0), abs=1e-9)


def stepped(world, until_s):
    while world.time_s < until_s:
        world.step(DT_S)
    return world


def test_the_hall_logs_when_each_cause_came_and_was_gone():
    scene = draw(3, only=list(CHANCE))
    log = {each['kind']: each for each in stepped(InspectionWorld(scene), 90.0).log.record()}
    assert list(log) == list(CHANCE)
    assert {kind for kind in log if log[kind]['lasting']} == {'wet_floor'}
    assert (log['wet_floor']['began_s'], log['wet_floor']['ended_s']) == (0.0, None)
    for kind, begins_s, ends_s in (
        ('glare', scene.glare.begins_s, scene.glare.ends_s),
        ('low_battery', *scene.sag),
    ):
        assert log[kind]['began_s'] == pytest.approx(begins_s, abs=2 * DT_S)
        assert log[kind]['ended_s'] == pytest.approx(ends_s, abs=2 * DT_S)
    for kind in ('person_in_the_way', 'person_at_the_panel'):
        (errand,) = [each for each in scene.errands if each.cause == kind]
        stood_s = log[kind]['ended_s'] - log[kind]['began_s']
        assert log[kind]['began_s'] > errand.begins_s
        assert errand.stands_s[1] - 0.1 <= stood_s <= errand.stands_s[1] + WAITS_S + 1.0


def test_a_cause_that_has_not_come_yet_has_no_times():
    log = stepped(InspectionWorld(draw(3, only=['low_battery'])), 1.0).log.record()
    assert [(each['began_s'], each['ended_s']) for each in log] == [(None, None)]
    assert 'voltage' in log[0]['text']
    with pytest.raises(ValueError, match='rain'):
        in_words('rain', draw(3, only=[]))


def test_each_contact_with_a_wall_counts_once_until_the_robot_has_come_away():
    world = InspectionWorld(draw(3, only=[]))
    world.base.pose = (1.0, 1.2, math.pi)

    def drive(v, for_s):
        for _ in range(int(for_s / DT_S)):
            world.base.command(v, 0.0)
            world.step(DT_S)

    drive(0.8, 3.0)
    assert world.contacts.things == ['wall']
    drive(0.0, 1.0)
    drive(0.3, 1.0)  # it still stands there
    assert world.contacts.things == ['wall']
    drive(-0.5, 1.0)
    drive(0.8, 2.0)
    assert world.contacts.things == ['wall', 'wall']


def test_a_person_whom_the_robot_drives_against_is_named():
    contacts, base = Contacts(), WheeledBase((2.0, 1.2, math.pi))
    people = [(9.0, 5.0, 0.22), (1.0, 1.2, 0.22)]
    for _ in range(60):
        base.command(0.5, 0.0)
        base.step(DT_S, people)
        contacts.look(base, people)
    assert contacts.things == ['person 2']


def test_a_wrong_reading_names_its_panel_and_a_missing_one_does_not():
    world = InspectionWorld(draw(3))
    true = world.scene.readings
    world.reported = {1: true[1] + 0.7, 2: true[2] + 0.3}
    assert world.wrong_readings() == ['panel 1']
