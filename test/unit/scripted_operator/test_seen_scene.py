"""What the scripted operator makes of an image, against the world: places, heights, surfaces."""

import numpy as np
import pytest
from direct_hand import DirectWatcher

from smach_oracle.scripted_operator.clearing import free_spot, gap_between, in_the_way, on_place
from smach_oracle.scripted_operator.seen_scene import Outline, seen_scene
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.tabletop_scene import TABLE_TOP, draw

LOOK = np.array([0.65, 0.0, 0.75])


@pytest.fixture(scope='module', name='world')
def make_world():
    world = World()
    yield world
    world.close()


@pytest.mark.parametrize('seed', (2, 3, 5))
def test_things_are_seen_about_where_they_stand(world, seed):
    world.reset(draw(seed, benign=True))
    scene = DirectWatcher(world).look_at(LOOK)
    assert scene.wanted().name == 'object_0' and len(scene.things) >= 2
    missed = [
        np.linalg.norm(thing.box.centre - world.body_pose(thing.name)[:3, 3])
        for thing in scene.things
    ]
    assert 0.0005 < max(missed) < 0.03
    for thing in scene.things:
        assert thing.stands
        assert scene.heights()[thing.name] == pytest.approx(
            world.body(thing.name).size[2], abs=0.02
        )
    assert scene.surface_at(LOOK) == pytest.approx(TABLE_TOP, abs=0.01)


def test_where_the_depth_is_lost_a_person_still_tells_about_where_a_thing_stands(world):
    world.reset(draw(2, benign=True))
    whole = DirectWatcher(world).look_at(LOOK)
    thing = whole.wanted()
    depth = whole.image.depth.copy()
    depth[thing.mask] = np.nan
    blind = seen_scene(whole.image._replace(depth=depth), [outline_of(thing)])
    guessed = blind.wanted().box.centre
    assert np.hypot(*(guessed - world.body_pose('object_0')[:3, 3])[:2]) < 0.05
    nothing = seen_scene(
        whole.image._replace(depth=np.full_like(depth, np.nan)), [outline_of(thing)]
    )
    assert nothing.wanted() is not None and nothing.wanted().box is None


def outline_of(thing):
    return Outline(thing.name, thing.wanted, thing.movable, thing.mask)


def test_what_stands_close_or_on_the_place_is_in_the_way_and_there_is_room_elsewhere(world):
    scene = draw(4, benign=True)
    things = {body.name: body for body in scene.bodies}
    target = things['object_0']
    table = target.position[2] - target.size[2] / 2
    close = things['object_2']._replace(
        shape='cylinder',
        size=(0.03, 0.03, 0.12),
        position=(target.position[0] + 0.055, target.position[1] + 0.045, table + 0.06),
    )
    world.reset(
        scene._replace(
            bodies=tuple(close if body.name == close.name else body for body in scene.bodies)
        )
    )
    seen = DirectWatcher(world).look_at(LOOK)
    assert in_the_way(seen, seen.wanted()).name == 'object_2'
    assert gap_between(seen.wanted(), seen.named('object_2')) < 0.025
    assert on_place(seen, np.array(close.position)).name == 'object_2'
    assert on_place(seen, np.array([0.6, -0.35, 0.8])) is None
    spot = free_spot(seen, 'left', [], 'object_2')
    assert spot is not None
    assert all(
        np.hypot(spot[0] - body.position[0], spot[1] - body.position[1]) > 0.1
        for body in scene.bodies
        if body.mass > 0 and body.name != 'object_2'
    )


def test_an_arm_before_a_thing_is_seen_as_one(world):
    scene = next(
        each
        for each in map(draw, range(400))
        if [cause.kind for cause in each.causes] == ['arm_in_view']
    )
    world.reset(scene)
    watcher = DirectWatcher(world)
    world.step(200)  # the arm is pushed there once the head has turned
    free = watcher.look()
    watcher.look_at(LOOK)
    world.step(200)
    over = watcher.look()
    assert free.wanted() is None or not free.covered(free.wanted())
    assert over.wanted() is None or over.covered(over.wanted())
