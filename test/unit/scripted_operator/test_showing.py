"""How the scripted operator marks a thing: rectangles about it, a look at what came of them,
strokes, giving up.
"""

import numpy as np
import pytest

from smach_oracle.scripted_operator.seen_scene import SeenThing
from smach_oracle.scripted_operator.showing import MarkedResult, looks_wrong, rectangle, show

IMAGE = (640, 480)
REGION = (300, 200, 40, 60)
LOOKS = []  # at another image


def outline(dx=0, grown=0):
    left, top, width, height = REGION
    mask = np.zeros((IMAGE[1], IMAGE[0]), bool)
    mask[top - grown : top + height + grown, left + dx - grown : left + dx + width + grown] = True
    return mask


def thing():
    return SeenThing('can', True, True, REGION, outline(), None)


def marked(ok=True, message='', **where):
    return MarkedResult(ok, message, outline(**where) if ok else None)


def showing(seen=True):
    """What `show` is told beside the interface."""
    return thing(), np.random.default_rng(1), lambda: LOOKS.append(1) or (thing() if seen else None)


def test_rectangles_are_drawn_by_hand_about_the_thing_and_stay_in_the_image():
    generator = np.random.default_rng(1)
    drawn = [rectangle((300, 200, 40, 60), IMAGE, generator) for _ in range(50)]
    assert len(set(drawn)) > 40, 'no two alike'
    assert (
        np.mean([x <= 300 and y <= 200 and x + w >= 340 and y + h >= 260 for x, y, w, h in drawn])
        > 0.9
    )
    at_the_edge = [rectangle((600, 440, 40, 40), IMAGE, generator) for _ in range(50)]
    assert all(
        x >= 0 and y >= 0 and x + w <= 640 and y + h <= 480 and w > 0 and h > 0
        for x, y, w, h in at_the_edge
    )


def test_a_good_mask_is_accepted_at_once():
    calls = []
    assert show(lambda *drawn: calls.append(drawn) or marked(), *showing()) == ''
    assert len(calls) == 1 and not calls[0][1]


def test_a_bad_mask_is_mended_with_strokes():
    def segment(_region, strokes):
        return marked() if strokes else marked(dx=60)

    calls = []
    LOOKS.clear()
    assert show(lambda *drawn: calls.append(drawn) or segment(*drawn), *showing()) == ''
    assert [bool(strokes) for _, strokes in calls] == [False, True]
    assert len(LOOKS) == 1, 'the second try is on another image'
    assert {line.foreground for line in calls[1][1]} == {True, False}


@pytest.mark.parametrize(
    'wrong, says',
    [
        ({'dx': 60}, 'shares 0%'),
        ({'grown': 20}, 'shares 30%'),
        ({'ok': False, 'message': 'no depth'}, 'no depth'),
    ],
)
def test_what_stays_wrong_is_given_up_with_its_reason(wrong, says):
    assert says in show(lambda *_: marked(**wrong), *showing())


def test_what_is_not_seen_any_more_is_not_marked_again():
    assert 'nothing of it' in show(lambda *_: marked(dx=60), *showing(seen=False))


def test_an_eye_lets_pass_what_a_person_would():
    assert looks_wrong(marked(dx=5), thing()) == '' and looks_wrong(marked(grown=3), thing()) == ''
