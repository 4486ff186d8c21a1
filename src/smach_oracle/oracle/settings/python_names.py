"""Objects that settings name by 'python:module:attribute', and what is wrong with such a name."""

from typing import Any, Callable

from smach_common.foreign import error_text

from ..errors import SettingsError

PYTHON = 'python:'
Resolver = Callable[[str], Any]
_ALLOWED = "'python:module:attribute', which names a {} of a module that can be imported"


def named_object(key: str, given: str, wanted: str, resolver: Resolver) -> Any:
    """Return the object that `given` names.

    `wanted`: what it should be, in a word or two. `resolver`: imports it. It raises ImportError or
    ValueError with a text for people. Any other exception comes from the module.

    :raises SettingsError: naming `key`, the name, what is wrong with it and what is allowed.
    """
    try:
        return resolver(given)
    except SettingsError:
        raise
    except (ImportError, ValueError) as err:
        why = str(err)
    except Exception as err:
        why = 'importing it raised {}'.format(error_text(err))
    raise SettingsError(
        key, given, _ALLOWED.format(wanted), problem='cannot be found: {}'.format(why)
    )
