"""A setting, stated once: its default, its check and its text are one field of a dataclass. Pure.

    @dataclass(frozen=True)
    class Oven:
        heat: float = setting(180.0, number(0, 300, 'degrees from 0 to 300'), 'how hot it is')

    Oven(**checked(Oven, 'oven.', {'heat': 200}))

The text is a line of Markdown, if a page is made of the settings: doc/write_settings.py makes
launch/oracle.yaml and doc/settings.md of those of the executive.
"""

from dataclasses import field, fields
from typing import Any, Callable, Dict, Mapping, TypeVar

T = TypeVar('T')


def setting(
    default: T, check: Callable[..., Any], text: str = '', names_objects: bool = False
) -> T:
    """Return the field of a setting. `names_objects`: the check also takes what imports these."""
    facts = {'check': check, 'text': text, 'names_objects': names_objects}
    value: Any = {'default_factory': dict} if isinstance(default, dict) else {'default': default}
    made: T = field(metadata=facts, **value)
    return made


def settings_of(group: type) -> Dict[str, Mapping[str, Any]]:
    """Return what `setting` was told of each setting of a dataclass."""
    return {each.name: each.metadata for each in fields(group) if each.metadata}


def checked(
    group: type, prefix: str, given: Mapping[str, Any], resolver: Any = None
) -> Dict[str, Any]:
    """Return those of the settings of a dataclass that are given, checked.

    `prefix` stands before their names in errors. `resolver` imports the objects that they name.

    :raises SettingsError: naming key, value and what is allowed.
    """
    return {
        name: facts['check'](prefix + name, given[name], *[resolver] * facts['names_objects'])
        for name, facts in settings_of(group).items()
        if name in given
    }
