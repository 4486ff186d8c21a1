"""doc/draw_machines.py: its pictures show what a machine has, and what a trial did."""

import sys

import pytest
from house import ROOT

sys.path.insert(0, str(ROOT / 'doc'))
draw = pytest.importorskip('draw_machines')


def test_the_wrapped_machine_is_drawn_with_the_oracles_transitions():
    drawn = '\n'.join(draw.wrapping())
    for label in draw.LABELS:
        assert (
            'b_ORACLE -> b_{}'.format(label) in drawn or 'b_{} -> b_ORACLE'.format(label) in drawn
        )
        assert 'a_ORACLE' not in drawn
        assert 'a_{} -> a_failed'.format(label) in drawn


def test_the_drawn_trial_has_a_revisit_and_a_step_back_and_ends_well():
    events = draw.trial()
    decided = [event.outcome for event in events if event.kind == draw.EventKind.DECISION]
    assert decided == ['revisit', 'step_back']
    assert [event.state for event in events if event.kind == draw.EventKind.STATE_START] == [
        'LOOK',
        'PICK',
        'PICK',
        'LOOK',
        'PICK',
        'PLACE',
    ]


def test_the_pictures_are_there_and_name_what_they_show():
    for name in ('wrapped', 'recovery'):
        assert (ROOT / 'doc/images' / (name + '.svg')).read_text().startswith('<?xml')
    assert 'ORACLE' in (ROOT / 'doc/images/wrapped.svg').read_text()


def test_the_recording_moves_and_is_small():
    data = (ROOT / 'doc/images/recovery.gif').read_bytes()
    assert data.startswith(b'GIF89a') and data.count(b'\x00\x21\xf9\x04') >= 5, 'frames'
    assert len(data) < 1500000
