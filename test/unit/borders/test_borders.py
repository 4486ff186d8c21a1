"""Whatever comes in over a border is taken, or refused with a text that says what was wrong."""

import time

import pytest
from borders import border as module
from borders.border import REFUSED, TAKEN, Border, Hangs, refused, try_border
from borders.table import BORDERS
from hypothesis import strategies as st

EXAMPLES = 200


@pytest.mark.parametrize('name', sorted(BORDERS))
def test_it_is_taken_or_refused_with_a_reason(name):
    ends = try_border(BORDERS[name], EXAMPLES)
    assert set(BORDERS[name].ends) <= set(ends), 'there was something to see'


def test_what_comes_past_a_border_is_found():
    def take(number):
        return {}[number] if number > 100 else TAKEN

    with pytest.raises(KeyError):
        try_border(Border('none', st.integers(0, 1000), take), EXAMPLES)


def test_a_refusal_without_a_reason_is_found():
    with pytest.raises(AssertionError, match='without a reason'):
        try_border(Border('none', st.integers(), lambda number: refused('')), EXAMPLES)


def test_what_hangs_is_found(monkeypatch):
    monkeypatch.setattr(module, 'LONGEST_S', 0.05)

    def take(number):
        until_s = time.monotonic() + 60
        while number > 100 and time.monotonic() < until_s:
            pass
        return REFUSED

    with pytest.raises(Hangs):
        try_border(Border('none', st.integers(0, 1000), take), EXAMPLES)
