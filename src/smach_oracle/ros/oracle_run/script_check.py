"""`oracle_run --check`, second half: the script runs up to its machines, which are not executed."""

import faulthandler
import os
import signal
import sys
import threading
import time
from typing import Any, List, NoReturn, Optional, Sequence

import rospy

import smach
from smach_oracle.oracle.errors import SettingsError

from ..shutdown import ShutdownGuard
from . import check_stubs
from .check_report import wrapped
from .check_signals import SignalWatch
from .checked_names import CheckedNames
from .machine_check import MachineCheck, intercept
from .machine_faults import MachineFaultError, refused_while_built
from .options import parse
from .refusal import USAGE_ERROR, Refusal
from .script_runner import (
    MachineWrapper,
    give_names,
    load,
    read_settings,
    run_script,
    tell,
)

LIMIT_S = 30.0  # for the script to reach a machine, or a further one
# a script that has executed its machines, and waits: for one in another thread
QUIET_S = 2.0
# exit codes
NO_MACHINE = 1
SIGNALLED = 128  # and the number of the signal


def check_script(args: Sequence[str], notes: Sequence[str]) -> NoReturn:
    """Check the script of a command line, and end the process.

    :param notes: what is to be told first.
    """
    invocation = parse(args)
    give_names(invocation)
    watch = _ScriptWatch(_report_stream())
    watch.tell(
        wrapped(
            'Checking {}: no machine is executed, and no robot is reached.'.format(
                invocation.script
            ),
            0,
        )
    )
    for note in notes:
        watch.note(note)
    watch.tell([''])
    refusal = Refusal(ShutdownGuard(_nothing, lambda timeout_s: None), tell)
    wrapper = MachineWrapper(invocation, refusal, lambda machine, is_first: watch.names.complain)
    check = MachineCheck(
        wrapper.wrap,
        lambda: read_settings(load(invocation)),
        watch.tell,
        watch.names,
        wrapper.why_left,
    )

    def reached(container: smach.Container) -> Any:
        try:
            outcome = check(container)
        except (SettingsError, MachineFaultError) as err:
            watch.refuse(err)
        except StopIteration as err:
            watch.end('The check ends here: {}.'.format(err))
        watch.reached(check.machines, check.warnings)
        return outcome

    check_stubs.install(watch.note, watch.spin)
    intercept(reached)
    _intercept_action_servers(reached)
    watch.begin()
    why = _run(invocation.script, invocation.script_args, watch)
    watch.wait_for_threads()
    watch.end(why)


def _nothing() -> None:
    """There is nothing to preempt."""


def _report_stream() -> Any:
    """Return the report's stream: stdout, while what the script prints there goes to stderr."""
    report = os.fdopen(os.dup(1), 'w')
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return report


def _run(script: str, args: Sequence[str], watch: '_ScriptWatch') -> str:
    """Run the script, and return what is to be said of its end."""
    try:
        run_script(script, args)
    except SystemExit as end:
        return 'The script has ended by SystemExit({!r}).'.format(end.code) if end.code else ''
    except BaseException:
        watch.end_if_signalled()
        sys.excepthook(*sys.exc_info())
        why_refused = refused_while_built(*sys.exc_info())
        if why_refused is not None:
            watch.refuse(why_refused)
        if watch.machines:
            return (
                'The script has ended in the error above: with the machines not executed, that '
                'may be no mistake of its own.'
            )
        return 'The script has ended in the error above.'
    return ''


def _intercept_action_servers(reached: Any) -> None:
    """A machine behind an action server is checked when the server would start."""
    import smach_ros

    def run_server(self: Any) -> None:
        reached(self.wrapped_container)

    setattr(smach_ros.ActionServerWrapper, 'run_server', run_server)


class _ScriptWatch:
    """Says what there is to say, and ends the process."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self._lock = threading.RLock()
        self._notes: List[str] = []
        self._signals = SignalWatch()
        self._idle = False  # nothing but threads can reach a further machine
        self._latest = time.monotonic()
        self.machines = self.warnings = 0
        self.names = CheckedNames()

    def tell(self, lines: Sequence[str]) -> None:
        """Print lines of the report. Where that cannot be done, the process ends as others do."""
        with self._lock:
            try:
                for line in lines:
                    self._stream.write(line + '\n')
                self._stream.flush()
            except BrokenPipeError:
                self._leave(SIGNALLED + signal.SIGPIPE)
            except OSError as err:
                tell('output: {}'.format(err.strerror))
                self._leave(USAGE_ERROR)

    def note(self, text: str) -> None:
        """Say something once."""
        with self._lock:
            if text not in self._notes:
                self._notes.append(text)
                self.tell(wrapped('- ' + text, 0, 2))

    def begin(self) -> None:
        """Watch the time from now on, also where the script hangs in C code."""
        self.reached(0)
        threading.Thread(target=self._watch, name='check_limit', daemon=True).start()

    def reached(self, machines: int, warnings: int = 0) -> None:
        """A machine has been checked. So many machines and warnings are there now."""
        self.machines, self.warnings = machines, warnings
        self._latest = time.monotonic()
        faulthandler.dump_traceback_later(LIMIT_S + 5.0, exit=True)

    def spin(self) -> None:
        """Stand in place of `rospy.spin`."""
        self._idle = True
        while not rospy.is_shutdown():
            time.sleep(0.05)
        self._idle = False

    def wait_for_threads(self) -> None:
        """Wait for threads that would keep the process alive."""
        self._idle = True
        for thread in threading.enumerate():
            if not thread.daemon and thread is not threading.current_thread():
                thread.join()

    def end(self, why: str = '') -> NoReturn:
        """End the process, with the code that says whether a machine was reached."""
        self.end_if_signalled()
        with self._lock:
            if why:
                self.tell(wrapped(why, 0))
            mistakes = self.names.mistakes()
            if mistakes:
                self._say_refused(mistakes)
            for doubt in self.names.doubts():
                self.warnings += 1
                self.tell(wrapped('Warning: {}'.format(doubt), 0, 4))
            self.tell(wrapped(_summary(self.machines, self.warnings), 0))
            self._leave(0 if self.machines else NO_MACHINE)

    def end_if_signalled(self) -> None:
        """End the process as a shell expects it where SIGINT or SIGTERM came."""
        number = self._signals.heard()
        if number is not None:
            with self._lock:
                self.tell(['The check was ended by {}.'.format(number.name)])
                self._leave(SIGNALLED + number)

    def refuse(self, err: Exception) -> NoReturn:
        """End the process with an error in the settings, or in a machine."""
        with self._lock:
            self._say_refused([*self.names.mistakes(), err])

    def _say_refused(self, mistakes: Sequence[Exception]) -> NoReturn:
        for mistake in mistakes:
            tell(mistake)
        self._leave(USAGE_ERROR)

    def _leave(self, code: int) -> NoReturn:
        sys.stderr.flush()
        os._exit(code)  # the script's threads, and its exit handlers, must not go on

    def _watch(self) -> None:
        main = threading.main_thread().ident or 0
        while True:
            time.sleep(0.05)
            self.end_if_signalled()
            waited_s = time.monotonic() - self._latest
            waits = self._idle or rospy.core.is_shutdown_requested()
            if waits and self.machines and waited_s > QUIET_S:
                self.end()
            if waited_s > LIMIT_S:
                self.end(
                    'The script has not reached a{} machine in {:g} s; it is at {}.'.format(
                        ' further' if self.machines else '', LIMIT_S, _place(main)
                    )
                )


def _place(thread_id: int) -> str:
    """Return where the script is, as FILE:LINE."""
    frame: Optional[Any] = sys._current_frames().get(thread_id)
    script = str(getattr(sys.modules['__main__'], '__file__', ''))
    place = '{}:{}'.format(frame.f_code.co_filename, frame.f_lineno) if frame else 'its end'
    while frame is not None:
        if frame.f_code.co_filename == script:
            return '{}:{}'.format(script, frame.f_lineno)
        frame = frame.f_back
    return place


def _summary(machines: int, warnings: int) -> str:
    if not machines:
        return 'The script has executed no machine: nothing could be checked.'
    return '{}: no error in the settings for {} machine{}.'.format(
        '{} warning{}'.format(warnings, 's' * (warnings > 1)) if warnings else 'All is well',
        machines,
        's' * (machines > 1),
    )
