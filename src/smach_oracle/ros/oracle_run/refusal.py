"""Ends a script's process with exit code 2 where one of its machines cannot begin."""

import sys
import threading
from contextlib import contextmanager
from typing import Callable, Iterator

import rospy

from smach_oracle.oracle.errors import CheckpointError, OracleError, SettingsError

from ..shutdown import ShutdownGuard

USAGE_ERROR = 2  # exit code


class Refusal:
    """Once a machine is refused, no other one begins, and the process ends.

    The machine's thread is left by SystemExit. Where the script goes on anyway, or waits in
    another thread, the guard ends the process as it does on a signal.
    """

    def __init__(self, guard: ShutdownGuard, tell: Callable[[Exception], None]) -> None:
        self._guard = guard
        self._tell = tell
        self._refused = False
        self._lock = threading.Lock()

    @contextmanager
    def of_errors(self) -> Iterator[None]:
        """Refuse a machine where its settings do not fit, or its store cannot be used.

        Every machine after that is refused as well.

        :raises SystemExit: where it is refused.
        """
        if self._refused:
            raise SystemExit(USAGE_ERROR)
        try:
            yield
        except (SettingsError, CheckpointError) as err:
            self._refuse(err)
            raise SystemExit(USAGE_ERROR) from None

    @contextmanager
    def decides_exit_code(self) -> Iterator[None]:
        """End in exit code 2, whatever the script within makes of a refusal."""
        try:
            yield
        finally:
            if self._refused:
                sys.exit(USAGE_ERROR)

    def _refuse(self, err: OracleError) -> None:
        with self._lock:
            is_first, self._refused = not self._refused, True
        if not is_first:
            return
        self._tell(err)
        self._guard.arm(USAGE_ERROR)
        if threading.current_thread() is not threading.main_thread() and (
            rospy.core.is_initialized()
        ):
            # a hook of the script may wait for this very thread
            threading.Thread(
                target=rospy.signal_shutdown,
                args=('a machine cannot begin',),
                name='refusal',
                daemon=True,
            ).start()
