"""A lock on a folder, which leaves no file behind and ends with its process."""

import contextlib
import errno
import fcntl
import os
import time
from typing import Iterator

from smach_oracle.forking import unlock

WAIT_S = 2.0  # who holds it writes one small file
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EBADF, errno.EINVAL)  # such as on some networks


@contextlib.contextmanager
def folder_lock(folder: str) -> Iterator[None]:
    """Hold the lock of a folder, against other threads and processes.

    On a file system that has no locks the body runs without one.

    :raises OSError: where there is no such folder, or another holds the lock for too long.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        _lock(descriptor, folder, time.monotonic() + WAIT_S)
        yield
    finally:
        unlock(descriptor)
        os.close(descriptor)


def _lock(descriptor: int, folder: str, until_s: float) -> None:
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError as err:
            if err.errno in _NO_LOCKS:
                return
            if err.errno not in (errno.EWOULDBLOCK, errno.EACCES, errno.EINTR):
                raise
            if time.monotonic() > until_s:
                raise OSError(
                    errno.EAGAIN, 'another program holds the lock of the folder', folder
                ) from None
        time.sleep(0.005)
