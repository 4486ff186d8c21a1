"""The robot of collision checks is loaded once and lent again; an answer shows nothing of that."""

from functools import partial

import numpy as np
import pybullet
import pytest
from arms import REST, clutter, model
from forked import in_a_fork

from smach_oracle.pr2.planning import collision, collision_body
from smach_oracle.pr2.planning.collision import CollisionWorld
from smach_oracle.pr2.planning.collision_body import KEPT, BodyPool, CollisionBody


@pytest.fixture
def loads(monkeypatch):
    """A new pool; the arms for which a robot has been loaded."""
    made = []
    load = CollisionBody.__init__

    def counted(self, of, arm):
        made.append(arm)
        load(self, of, arm)

    monkeypatch.setattr(collision_body.CollisionBody, '__init__', counted)
    monkeypatch.setattr(collision, '_POOL', BodyPool())
    yield made
    for _, _, body in collision._POOL._idle:
        body.close()


def answers(seed, arm='right'):
    """What a walk through clutter with something in the hand touches, to the last bit."""
    found = []
    generator = np.random.default_rng(seed)
    with CollisionWorld(model(), arm, REST) as space:
        for name, box in sorted(clutter(seed).items()):
            space.add_box(name, box)
        space.attach([0.03, 0.03, 0.06], np.eye(4))
        lower, upper = np.maximum(space.chain.lower, -3), np.minimum(space.chain.upper, 3)
        q = generator.uniform(lower, upper)
        for _ in range(150):
            q = np.clip(q + generator.normal(0.0, 0.1, 7), lower, upper)
            free = space.is_free(q)
            touching = sorted(
                (point[3], point[4], point[8])
                for point in pybullet.getContactPoints(physicsClientId=space._client)
            )
            found.append((free, touching))
    return found


def test_a_robot_that_was_lent_before_answers_as_a_new_one(loads, monkeypatch):
    new = answers(1)
    assert {free for free, _ in new} == {True, False}
    answers(2)
    answers(3)
    assert answers(1) == new
    assert loads == ['right']
    monkeypatch.setattr(collision, '_POOL', BodyPool())
    assert answers(1) == new and loads == ['right', 'right']


def touches(q):
    """What the right arm touches of the robot itself at these joint positions."""
    with CollisionWorld(model(), 'right', REST) as space:
        return touched(space, q)


def touched(space, q):
    space.is_free(q)
    points = pybullet.getContactPoints(physicsClientId=space._client)
    return sorted((point[3], point[4], point[8]) for point in points)


def test_contacts_of_before_are_forgotten(loads, monkeypatch):
    generator = np.random.default_rng(0)
    with CollisionWorld(model(), 'right', REST) as space:
        drawn = [space.chain.random(generator, 1)[0] for _ in range(300)]
        inside = [q for q in drawn if not space.is_free(q)]
    assert len(inside) > 30
    monkeypatch.setattr(collision, '_POOL', BodyPool())
    with CollisionWorld(model(), 'right', REST) as space:  # a robot that nobody had before
        new = [in_a_fork(partial(touched, space, q + 0.005)) for q in inside]
    for q, as_new in zip(inside, new):
        touches(q)
        assert touches(q + 0.005) == as_new
    monkeypatch.setattr(CollisionBody, 'clean', lambda self: None)
    kept = []
    for q in inside:
        touches(q)
        kept.append(touches(q + 0.005))
    assert kept != new, 'PyBullet keeps none: there is no need to clean'


def test_side_by_side_each_has_a_client_of_its_own(loads):
    with CollisionWorld(model(), 'right', REST) as one, CollisionWorld(
        model(), 'right', REST
    ) as other:
        assert one._client != other._client
        one.add_box('thing', next(iter(clutter(1).values())))
        assert other.names() == []
    assert loads == ['right', 'right']


def test_an_arm_or_a_description_of_another_is_not_lent(loads):
    other = model()._replace(allowed=frozenset())
    for described, arm in ((model(), 'right'), (model(), 'left'), (other, 'left')):
        with CollisionWorld(described, arm, REST):
            pass
    assert loads == ['right', 'left', 'left']
    with CollisionWorld(other, 'left', REST), CollisionWorld(model(), 'left', REST):
        assert len(loads) == 3
    assert len(collision._POOL._idle) == KEPT
