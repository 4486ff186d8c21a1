"""The same seed gives the same trial: to the last bit, with the failure that its cause leads to, in
any company.
"""

from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.drink_retrieval import DrinkRetrievalRehearsal
from smach_oracle.simulation.rehearsal.pick_and_place import PickAndPlaceRehearsal, rehearse
from smach_oracle.simulation.scenes import kitchen_scene, tabletop_scene


def course(world, scene, task):
    """How a trial ended, except for the wall's time, and where everything is then."""
    done = rehearse(scene, world, task)
    return (
        done._replace(wall_s={}, sim_s=round(done.sim_s, 6)),
        sorted(world.joints().items()),
        [world.body_pose(name).tobytes() for name in world.body_names],
    )


def seed_with(draw, kind):
    """The first seed of which this is the only cause to fail."""
    return next(
        seed for seed in range(1000) if [cause.kind for cause in draw(seed).causes] == [kind]
    )


def test_the_same_seed_gives_the_same_trial_also_after_another_one():
    trials = [
        (draw(seed_with(draw, kind)), task)
        for task, draw, kind in (
            (PickAndPlaceRehearsal, tabletop_scene.draw, 'object_moved'),
            (DrinkRetrievalRehearsal, kitchen_scene.draw, 'glare'),
        )
    ]
    found = []
    for order in (trials, trials[::-1]):  # each is the first in its world, and follows the other
        world = World(binning=2)
        found.append([course(world, *trial) for trial in order])
        world.close()
    (pick, look_again), (look, pick_again) = found
    assert (pick[0].failed, look[0].failed) == ('PICK', 'DETECT_DRINK')
    assert pick[0].reason and look[0].reason
    assert pick == pick_again != look == look_again
