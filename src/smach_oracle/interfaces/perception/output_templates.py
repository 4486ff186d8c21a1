"""The outputs that a marked object gives, by state: keys, each with a part of the marking."""

from typing import Dict, Mapping, NamedTuple

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks

# the parts of a marking that a template may name
OUTPUT_PARTS = {
    'object': 'pose of the marked object',
    'size': 'extents of the marked object',
    'objects': 'poses of all objects on its surface, the marked one first',
    'sizes': 'their extents',
    'surface': 'pose of the surface it stands on',
    'cloud': 'points of the marked object',
}
OF_THE_SCENE = ('objects', 'sizes', 'surface')


class StateTemplate(NamedTuple):
    """The template of the outputs of one state."""

    outcome: str  # the one that comes with outputs: its success
    outputs: Dict[str, str]  # output key: one of OUTPUT_PARTS


def templates_from(settings: object) -> Dict[str, StateTemplate]:
    """Return templates by state, from a dictionary.

    An example is {'DETECT_DRINK': {'outputs': {'drink': 'object'}}}.

    :raises SettingsError: naming the setting, its value and what is allowed.
    """
    if not isinstance(settings, Mapping) or not settings:
        raise SettingsError('states', settings, 'a dictionary with one state or more')
    return {
        state: _template('states.{}'.format(state), value)
        for state, value in checks.mapping('states', settings).items()
    }


def _template(where: str, value: object) -> StateTemplate:
    if not isinstance(value, Mapping):
        raise SettingsError(
            where, value, 'a dictionary with outputs and, where it is not succeeded, outcome'
        )
    unknown = sorted(set(map(str, value)) - {'outcome', 'outputs'})
    if unknown:
        raise SettingsError(
            '{}.{}'.format(where, unknown[0]), value[unknown[0]], 'only outcome and outputs'
        )
    outcome, outputs = value.get('outcome', 'succeeded'), value.get('outputs')
    if not isinstance(outcome, str) or not outcome:
        raise checks.no_name(where + '.outcome', outcome, 'the name of an outcome')
    if not isinstance(outputs, Mapping) or not outputs:
        raise SettingsError(
            where + '.outputs',
            outputs,
            'a dictionary from output keys to ' + ', '.join(OUTPUT_PARTS),
        )
    for key, part in outputs.items():
        if not isinstance(part, str) or part not in OUTPUT_PARTS:
            raise SettingsError(
                '{}.outputs.{}'.format(where, key), part, 'one of ' + ', '.join(OUTPUT_PARTS)
            )
    return StateTemplate(outcome, {str(key): str(part) for key, part in outputs.items()})
