"""Who holds a machine of a store: a lock of the operating system, which ends with its process."""
import fcntl
import hashlib
import os
from typing import Optional

from .errors import StoreError


class Held(StoreError):
    """Another process holds the machine."""


class MachineLock:
    """The lock of one machine of a store."""

    def __init__(self, path: str, machine: str) -> None:
        """`path`: of the store; `machine`: name of the top machine."""
        self._path, self._machine = path, machine
        digest = hashlib.blake2b(machine.encode('utf-8', 'replace'), digest_size=6).hexdigest()
        self._file = '{}-lock-{}'.format(os.path.abspath(path), digest)
        self._descriptor: Optional[int] = None

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
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            holder = os.read(descriptor, 100).decode('ascii', 'replace').strip() or 'unknown'
            os.close(descriptor)
            raise Held('{}: machine {} is held by process {}'.format(
                self._path, self._machine, holder)) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, '{}\n'.format(os.getpid()).encode('ascii'), 0)
        self._descriptor = descriptor

    def release(self) -> None:
        """Let go of it."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def is_held_elsewhere(self) -> bool:
        """Whether another process holds it now."""
        if self._descriptor is not None:
            return False
        try:
            self.take()
        except Held:
            return True
        self.release()
        return False
