"""What accepting a marked object hands over: a template that cannot be used is refused by its
place.
"""

import pytest

from smach_oracle.interfaces.perception.output_templates import templates_from
from smach_oracle.oracle.errors import SettingsError


@pytest.mark.parametrize('ingredient', ['objekt', ['object'], {'object': 1}, 5])
def test_what_no_marking_gives_is_named(ingredient):
    with pytest.raises(SettingsError, match='states.DETECT.outputs.drink: .* one of object, '):
        templates_from({'DETECT': {'outputs': {'drink': ingredient}}})


def test_a_template_is_taken_as_it_is():
    assert templates_from({'DETECT': {'outputs': {'drink': 'object'}}}) == {
        'DETECT': ('succeeded', {'drink': 'object'})
    }
