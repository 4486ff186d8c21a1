"""Hears the signals of this process, also while its main thread sits in a C call."""

import os
import signal
import socket
import struct
import threading
from typing import Iterator, List

from smach_oracle.forking import in_child

_CREDENTIALS = struct.Struct('3i')  # process, user, group
_MOST = 64  # signals read at once


class SignalEar:
    """Reads the numbers of signals, which Python's C-level handler writes to a socket.

    A child inherits the socket, and may get a signal before it has let go of it. The kernel says
    which process has written, so that the signals of others are dropped.

    A script may ask for the numbers, too, as asyncio does. It gets what it asks for, by the same
    functions, and takes nothing away from the ear.
    """

    def __init__(self) -> None:
        """Listen from now on. It has to be made in the main thread."""
        self._receiver, self._sender = socket.socketpair()
        self._receiver.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self._sender.setblocking(False)
        self._set_wakeup_fd = signal.set_wakeup_fd
        self._asking = threading.RLock()
        self._asked_by_script = self._set_wakeup_fd(
            self._sender.fileno(), warn_on_full_buffer=False
        )
        setattr(signal, 'set_wakeup_fd', self._set_for_script)
        in_child(self._let_go)

    def wait(self) -> List[int]:
        """Wait for signals of this process, and return their numbers."""
        return list(self._read(0))

    def heard(self) -> List[int]:
        """Return the numbers of those that came since the last call."""
        try:
            return list(self._read(socket.MSG_DONTWAIT))
        except BlockingIOError:
            return []

    def _read(self, flags: int) -> Iterator[int]:
        numbers, credentials, _, _ = self._receiver.recvmsg(
            _MOST, socket.CMSG_SPACE(_CREDENTIALS.size), flags
        )
        if not any(
            _CREDENTIALS.unpack(data)[0] == os.getpid()
            for _, kind, data in credentials
            if kind == socket.SCM_CREDENTIALS
        ):
            return
        with self._asking:
            if self._asked_by_script != -1:
                try:
                    os.write(self._asked_by_script, numbers)
                except OSError:  # full, or closed by the script
                    pass
        yield from numbers

    def _set_for_script(self, fd: int, *, warn_on_full_buffer: bool = True) -> int:
        """Do for a script what `signal.set_wakeup_fd` does.

        :raises ValueError: outside the main thread, or where writing to it may wait.
        :raises OSError: where it is not open.
        """
        if threading.current_thread() is not threading.main_thread():
            raise ValueError('set_wakeup_fd only works in main thread')
        if fd != -1:
            os.fstat(fd)
            if os.get_blocking(fd):
                raise ValueError('the fd {} must be in non-blocking mode'.format(fd))
        with self._asking:
            before, self._asked_by_script = self._asked_by_script, fd
        return before

    def _let_go(self) -> None:
        setattr(signal, 'set_wakeup_fd', self._set_wakeup_fd)
        self._set_wakeup_fd(-1)
        self._receiver.close()
        self._sender.close()
