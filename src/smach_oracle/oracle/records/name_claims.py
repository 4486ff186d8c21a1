"""The names that machines of running programs use in a rates file.

A machine claims its name by a lock on one byte of the file's folder. It leaves no file behind, and
ends with the machine or its process.
"""
import contextlib
import fcntl
import hashlib
import os
import struct
import threading
import weakref
from typing import Dict, Set, Tuple

from smach_oracle.forking import in_child, let_go_of

# of Linux: locks of an open file, which the process does not lose as it closes the folder elsewhere
_F_OFD_GETLK, _F_OFD_SETLK = 36, 37
_LOCK = struct.Struct('hhqqi4x')  # struct flock: kind, origin, start, length, process
Key = Tuple[str, str]  # path of the file, name

_guard = threading.RLock()  # a machine may go at any time
_descriptors: Dict[Key, int] = {}
_owners: Dict[Key, Set[int]] = {}


def claim(path: str, name: str, owner: object) -> None:
    """Claim a name in a rates file, as long as its owner lives.

    On a file system without such locks nothing is claimed.
    """
    key = os.path.realpath(path), name
    with _guard:
        owners = _owners.setdefault(key, set())
        if id(owner) in owners:
            return
        owners.add(id(owner))
        weakref.finalize(owner, _forget, key, id(owner)).atexit = False
        with contextlib.suppress(OSError):
            if key not in _descriptors:
                descriptor = os.open(os.path.dirname(key[0]), os.O_RDONLY | os.O_CLOEXEC)
                _descriptors[key] = descriptor
                _ask(descriptor, _F_OFD_SETLK, fcntl.F_RDLCK, key)


def is_claimed(path: str, name: str, if_unknown: bool = True) -> bool:
    """Whether a running program uses a name. `if_unknown`: on a file system without locks."""
    key = os.path.realpath(path), name
    try:
        descriptor = os.open(os.path.dirname(key[0]), os.O_RDONLY | os.O_CLOEXEC)
        try:
            return _ask(descriptor, _F_OFD_GETLK, fcntl.F_WRLCK, key) != fcntl.F_UNLCK
        finally:
            os.close(descriptor)
    except OSError:
        return if_unknown


def _ask(descriptor: int, command: int, kind: int, key: Key) -> int:
    """Set or look at the lock of a name, and return the kind that is there."""
    text = '{}/{}'.format(os.path.basename(key[0]), key[1]).encode('utf-8', 'replace')
    place = int.from_bytes(hashlib.blake2b(text, digest_size=7).digest(), 'big')
    told = fcntl.fcntl(descriptor, command, _LOCK.pack(kind, os.SEEK_SET, place, 1, 0))
    return int(_LOCK.unpack(told)[0])


def _forget(key: Key, owner: int) -> None:
    with _guard:
        owners = _owners.get(key, set())
        owners.discard(owner)
        if not owners:
            _owners.pop(key, None)
            descriptor = _descriptors.pop(key, None)
            if descriptor is not None:
                with contextlib.suppress(OSError):  # a child may have the folder open, too
                    _ask(descriptor, _F_OFD_SETLK, fcntl.F_UNLCK, key)
                os.close(descriptor)


def _leave_to_parent() -> None:
    global _guard
    _guard = threading.RLock()  # another thread may have had it
    for descriptor in _descriptors.values():
        let_go_of(descriptor)
    _descriptors.clear()
    _owners.clear()


in_child(_leave_to_parent)
