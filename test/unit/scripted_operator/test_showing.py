"""How the scripted operator marks a thing: rectangles about it, a look at what came of them,
strokes, giving up.
"""
import numpy as np
import pytest

from smach_oracle.geometry.transforms import transform
from smach_oracle.scripted_operator.showing import (
    MarkedResult,
    looks_wrong,
    rectangle,
    show,
    what_to_show,
)
from smach_oracle.scripted_operator.true_scene import TrueBody, TrueScene

IMAGE = (640, 480)
FRAMES = []  # that were asked for


def thing(name='can', x=0.6, region=(300, 200, 40, 60), visible=0.9, held=''):
    return TrueBody(name, transform([x, 0.1, 0.78]), (0.06, 0.06, 0.12), True, held, region,
                    visible)


def marked(seen, beside=0.0, larger=0.0, ok=True, message=''):
    return MarkedResult(ok, message, seen.centre + [beside, 0.0, 0.0], np.array(seen.size) + larger)


def scene(*things, goal=''):
    return TrueScene({each.name: each for each in things}, 1, goal)


def showing():
    """What `show` is told beside the interface."""
    return thing(), IMAGE, np.random.default_rng(1), lambda: FRAMES.append(1)


def test_the_nearest_thing_that_can_be_seen_is_shown():
    near, far = thing('near'), thing('far', x=0.8)
    assert what_to_show(scene(far, near)).name == 'near'
    assert what_to_show(scene(far, near._replace(visible=0.1))).name == 'far'
    assert what_to_show(scene(far, near._replace(held='left'))).name == 'far'
    assert what_to_show(scene(far, near, goal='far')).name == 'far'
    assert what_to_show(scene(near._replace(region=(0, 0, 0, 0)))) is None and what_to_show(
        scene()) is None


def test_rectangles_are_drawn_by_hand_about_the_thing_and_stay_in_the_image():
    generator = np.random.default_rng(1)
    drawn = [rectangle((300, 200, 40, 60), IMAGE, generator) for _ in range(50)]
    assert len(set(drawn)) > 40, 'no two alike'
    assert np.mean(
        [x <= 300 and y <= 200 and x + w >= 340 and y + h >= 260 for x, y, w, h in drawn]) > 0.9
    at_the_edge = [rectangle((600, 440, 40, 40), IMAGE, generator) for _ in range(50)]
    assert all(x >= 0 and y >= 0 and x + w <= 640 and y + h <= 480 and w > 0 and h > 0
               for x, y, w, h in at_the_edge)


def test_a_good_mask_is_accepted_at_once():
    calls = []
    assert show(lambda *drawn: calls.append(drawn) or marked(thing()), *showing()) == ''
    assert len(calls) == 1 and not calls[0][1]


def test_a_bad_mask_is_mended_with_strokes():
    def segment(_region, strokes):
        return marked(thing()) if strokes else marked(thing(), beside=0.06)
    calls = []
    FRAMES.clear()
    assert show(lambda *drawn: calls.append(drawn) or segment(*drawn), *showing()) == ''
    assert [bool(strokes) for _, strokes in calls] == [False, True]
    assert len(FRAMES) == 1, 'the second try is on another frame'
    assert {line.foreground for line in calls[1][1]} == {True, False}


@pytest.mark.parametrize('wrong, says', [({'beside': 0.05}, '5 cm beside'),
                                         ({'larger': 0.06}, '6 cm larger'),
                                         ({'ok': False, 'message': 'no depth'}, 'no depth')])
def test_what_stays_wrong_is_given_up_with_its_reason(wrong, says):
    assert says in show(lambda *_: marked(thing(), **wrong), *showing())


def test_an_eye_lets_pass_what_a_person_would():
    assert looks_wrong(marked(thing(), beside=0.015, larger=0.02), thing()) == ''
