"""The hold on a machine of a store: a lock of the operating system, which ends with its process."""

import fcntl
import glob
import hashlib
import os
import time
from typing import Optional

from smach_oracle.forking import in_child, let_go_of, unlock

from .errors import StoreError

_LOCK = '-lock-'
TAKE_S = 0.2  # who only looks whether it is held has it for less than this


class Held(StoreError):
    """Another process holds the machine."""


class MachineLock:
    """The lock of one machine of a store."""

    def __init__(self, path: str, machine: str) -> None:
        """`path`: of the store. `machine`: name of the top machine."""
        self._path, self._machine = path, machine
        digest = hashlib.blake2b(machine.encode('utf-8', 'replace'), digest_size=6).hexdigest()
        # a link leads to the store that it names, and to its lock
        self._file = os.path.realpath(path) + _LOCK + digest
        self._descriptor: Optional[int] = None
        in_child(self._let_go)

    def take(self) -> None:
        """Take the lock.

        :raises Held: where another process, or another machine of this one, holds it.
        :raises StoreError: where the file cannot be written.
        """
        if self._descriptor is not None:
            return
        try:
            descriptor = os.open(self._file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as err:
            raise StoreError('{}: cannot be locked: {}'.format(self._path, err)) from err
        if not _locked(descriptor, fcntl.LOCK_EX, TAKE_S):
            holder = _holder(descriptor)
            os.close(descriptor)
            raise Held(
                '{}: machine {} is held by process {}'.format(self._path, self._machine, holder)
            )
        self._descriptor = descriptor
        try:
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, '{}\n'.format(os.getpid()).encode('ascii'), 0)
        except OSError:  # such as a full disk: it is held, and the others cannot read by whom
            pass

    def release(self) -> None:
        """Let go of it."""
        if self._descriptor is not None:
            _close(self._descriptor)
            self._descriptor = None

    def _let_go(self) -> None:
        # a child that outlives its parent would hold the machine
        if self._descriptor is not None:
            let_go_of(self._descriptor)

    def is_held_elsewhere(self) -> bool:
        """Whether another process holds it now. It makes and changes no file.

        :raises StoreError: where the file cannot be read.
        """
        if self._descriptor is not None:
            return False
        try:
            descriptor = os.open(self._file, os.O_RDONLY | os.O_CLOEXEC)
        except FileNotFoundError:
            return False
        except OSError as err:
            raise StoreError('{}: its lock cannot be read: {}'.format(self._path, err)) from err
        try:
            return not _locked(descriptor, fcntl.LOCK_SH)
        finally:
            _close(descriptor)


def check_nobody_holds(where: str, path: str) -> None:
    """Check that no process holds a machine of a store.

    `where`: its own file, no link. `path`: as the user has named it.

    :raises Held: where one does.
    :raises StoreError: where a lock cannot be read.
    """
    for name in glob.glob(glob.escape(where) + _LOCK + '*'):
        try:
            descriptor = os.open(name, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as err:
            raise StoreError('{}: its lock cannot be read: {}'.format(path, err)) from err
        try:
            if not _locked(descriptor, fcntl.LOCK_SH, TAKE_S):
                raise Held(
                    '{}: a machine of it is held by process {}'.format(path, _holder(descriptor))
                )
        finally:
            _close(descriptor)


def _holder(descriptor: int) -> str:
    return os.read(descriptor, 100).decode('ascii', 'replace').strip() or 'unknown'


def _close(descriptor: int) -> None:
    unlock(descriptor)
    os.close(descriptor)


def _locked(descriptor: int, kind: int, wait_s: float = 0.0) -> bool:
    """Lock a file if that can be done in time, and return whether it is locked."""
    until_s = time.monotonic() + wait_s
    while True:
        try:
            fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
            return True
        except OSError:
            if time.monotonic() >= until_s:
                return False
        time.sleep(0.01)
