"""Says of a store that it is damaged where what it holds cannot be understood."""

import contextlib
from typing import Iterator

from smach_oracle.store.errors import StoreDamaged, StoreError

from ..errors import OracleError


@contextlib.contextmanager
def understood(path: str) -> Iterator[None]:
    """Have what the facts of a store drive the body to raise be the damage of the store at `path`.

    :raises StoreDamaged: in place of it.
    """
    try:
        yield
    except OracleError:
        raise
    except StoreError as err:
        if path in str(err):
            raise
        raise StoreDamaged('{}: {}'.format(path, err)) from err
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as err:
        raise StoreDamaged(
            '{0}: is damaged, and its trial cannot go on: {1!r}. `oracle_state {0} '
            'drop` ends the trial, and a new one can begin'.format(path, err)
        ) from err
