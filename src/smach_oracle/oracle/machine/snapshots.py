"""Userdata as it was: snapshots, and their restore."""

import copy
import pickle
from typing import Any, Callable, Dict, Iterable, Mapping, Optional

from smach_oracle.foreign import ends_program, error_text

NOT_COPIED = 'userdata key {!r} cannot be deep-copied, a reference is kept: {}'


def take_snapshot(
    data: Mapping[str, Any], deep_copy_keys: Iterable[str], warn: Callable[[str, str], None]
) -> Dict[str, Any]:
    """Return the userdata as it is now.

    It holds references. `deep_copy_keys` are copied through and through. `warn` takes each key that
    cannot be, with the reason.
    """
    snapshot = dict(data)
    for key in deep_copy_keys:
        if key in snapshot:
            try:
                snapshot[key] = copy.deepcopy(snapshot[key])
            except BaseException as err:
                # whatever a user's object raises: a reference is better than a dead machine
                if ends_program(err):
                    raise
                warn(key, error_text(err))
    return snapshot


def restore(
    data: Dict[str, Any],
    snapshot: Mapping[str, Any],
    keep: Iterable[str],
    deep_copy_keys: Iterable[str],
) -> None:
    """Make `data` in place what it was at `snapshot`, except the keys in `keep`.

    In place, because scripts hold on to the dictionary. Deep copies are handed out as copies, so
    that the snapshot itself stays what it was.
    """
    kept = set(keep)
    deep = set(deep_copy_keys)
    for key, value in snapshot.items():
        if key not in kept:
            data[key] = copied(value) if key in deep else value
    for key in list(data):
        if key not in snapshot and key not in kept:
            del data[key]


def copied(value: object) -> object:
    try:
        return copy.deepcopy(value)
    except BaseException as err:  # it could not be copied at entry either, and that was said then
        if ends_program(err):
            raise
        return value


def fingerprint(value: object) -> Optional[bytes]:
    """Return bytes that differ where the value differs, or None where that cannot be told."""
    try:
        return pickle.dumps(value)  # written to compare, never loaded
    except BaseException as err:  # unpicklable: only an assignment can be told
        if ends_program(err):
            raise
        return None
