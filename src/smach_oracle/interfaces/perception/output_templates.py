"""What accepting a marked object hands over, per state: its output keys, and what of the marking goes there."""
from typing import Any, Dict, Mapping, NamedTuple

from ..oracle.errors import ConfigError

# what a template may name, and what becomes of it
INGREDIENTS = {
    'object': 'pose of the marked object',
    'size': 'extents of the marked object',
    'objects': 'poses of all objects on its surface, the marked one first',
    'sizes': 'their extents',
    'surface': 'pose of the surface it stands on',
    'cloud': 'points of the marked object',
}
OF_THE_SCENE = ('objects', 'sizes', 'surface')


class StateTemplate(NamedTuple):
    """Of one state."""

    outcome: str  # the one that comes with outputs: its success
    outputs: Dict[str, str]  # output key: ingredient


def templates_from(settings: Any) -> Dict[str, StateTemplate]:
    """By state, from a dictionary such as {'DETECT_DRINK': {'outputs': {'drink': 'object'}}}.

    :raises ConfigError: naming the setting, its value and what is allowed.
    """
    if not isinstance(settings, Mapping) or not settings:
        raise ConfigError('states', settings, 'a dictionary with one state or more')
    return {str(state): _template('states.{}'.format(state), value) for state, value in settings.items()}


def _template(where: str, value: Any) -> StateTemplate:
    if not isinstance(value, Mapping):
        raise ConfigError(where, value, 'a dictionary with outputs and, where it is not succeeded, outcome')
    unknown = sorted(set(map(str, value)) - {'outcome', 'outputs'})
    if unknown:
        raise ConfigError('{}.{}'.format(where, unknown[0]), value[unknown[0]], 'only outcome and outputs')
    outcome, outputs = value.get('outcome', 'succeeded'), value.get('outputs')
    if not isinstance(outcome, str) or not outcome:
        raise ConfigError(where + '.outcome', outcome, 'the name of an outcome')
    if not isinstance(outputs, Mapping) or not outputs:
        raise ConfigError(where + '.outputs', outputs, 'a dictionary from output keys to ' + ', '.join(INGREDIENTS))
    for key, ingredient in outputs.items():
        if not isinstance(ingredient, str) or ingredient not in INGREDIENTS:
            raise ConfigError('{}.outputs.{}'.format(where, key), ingredient, 'one of ' + ', '.join(INGREDIENTS))
    return StateTemplate(outcome, {str(key): str(ingredient) for key, ingredient in outputs.items()})
