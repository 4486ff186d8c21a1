"""Run an unmodified SMACH script under an oracle: `oracle_run SCRIPT`.

All state machines of the script are wrapped. It runs as `python3 SCRIPT` would run it: __main__,
__file__, sys.argv, sys.path[0], exit code and tracebacks are its own.
"""

import atexit
import os
import sys
import types
from contextlib import contextmanager
from functools import partial
from importlib.machinery import SourceFileLoader
from typing import Callable, Iterator, Optional, Sequence

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.errors import LabelError, SettingsError
from smach_oracle.oracle.settings.names import UnfitKind, UnfitName
from smach_oracle.oracle.settings.paths import check_writable
from smach_oracle.oracle.settings.settings import GROUPS, Settings

from .. import attachment, shutdown
from ..loaded_settings import LoadedSettings, load_settings, resolve_python
from ..machine_names import machine_names
from ..reading.known_names import Complaint, NameJudge
from .options import Invocation, parse
from .precondition_labels import sorted_preconditions
from .python_names import check_python_name
from .refusal import USAGE_ERROR, Refusal


def check(invocation: Invocation) -> None:
    """Find mistakes before the robot moves.

    :raises SettingsError: in the settings file or the command line. The file of the rates, or the
        folder for the bags, cannot be written.
    """
    # a check goes on in a process of its own, which reads them again
    tells = not invocation.only_check
    loaded = load_settings(invocation.config, None, invocation.overrides, tells)
    with _located(loaded):
        settings = Settings.from_dict(loaded, partial(_check_name, invocation.script))
        if settings.rates_file:
            check_writable('rates_file', settings.rates_file, replaced=True)
        if settings.checkpoint:
            check_writable(GROUPS.key_of('checkpoint'), settings.checkpoint, replaced=True)
    if invocation.record and not invocation.only_check:
        from ..recorder import prepare_folder

        try:
            prepare_folder(invocation.record)
        except OSError as err:
            raise SettingsError(
                '--record',
                invocation.record,
                'a folder for bags',
                (
                    '--record {}: no bags can be written there ({})'.format(
                        invocation.record, err.strerror or err
                    )
                ),
            ) from err


def _check_name(script: str, name: str) -> Callable[[smach.UserData], bool]:
    check_python_name(script, name)
    return _never_called


def _never_called(userdata: smach.UserData) -> bool:
    """Stands for a precondition of the script's own while the settings are checked."""
    raise NotImplementedError


def load(invocation: Invocation) -> LoadedSettings:
    """Return what is set for the machines of this invocation, not checked yet.

    :raises SettingsError: where the file cannot be read.
    """
    return load_settings(
        invocation.config, overrides=invocation.overrides, folder=invocation.folder
    )


def read_settings(loaded: LoadedSettings) -> Settings:
    """Return settings with all names of Python objects resolved.

    :raises SettingsError: naming key, value and what is allowed.
    """
    return Settings.from_dict(loaded, resolve_python)


@contextmanager
def _located(loaded: LoadedSettings) -> Iterator[None]:
    """Let errors name where the setting was given."""
    try:
        yield
    except SettingsError as err:
        raise loaded.located(err) from err


Decide = Callable[[UnfitName], None]


class MachineWrapper:
    """Wraps the script's machines.

    `judge`: decides about names in the settings that a machine does not have. It is given the
    machine, and whether it is the first one.
    """

    def __init__(
        self,
        invocation: Invocation,
        refusal: Refusal,
        judge: Callable[[smach.StateMachine, bool], Decide] = NameJudge,
    ) -> None:
        self._invocation = invocation
        self._refusal = refusal
        self._judge = judge
        self._is_first = True

    def __call__(self, machine: smach.StateMachine) -> None:
        """Swap the machine's class.

        :raises SystemExit: where the settings do not fit the machine, which is told.
        """
        with self._refusal.of_errors():
            self.wrap(machine)

    def why_left(self, machine: smach.StateMachine) -> str:
        """Say that options are not in force for a machine that its program has wrapped, or ''."""
        options = self._invocation.of_wrapping
        if not options:
            return ''
        return (
            '{}: {} not in force here, since the program wraps this machine itself, and gives it '
            'its settings there'
        ).format(
            oracle_of(machine).path,
            '{} {}'.format(' and '.join(options), 'is' if len(options) == 1 else 'are'),
        )

    def wrap(self, machine: smach.StateMachine) -> None:
        """Swap the machine's class, unless it cannot have an oracle. That is warned of.

        :raises SettingsError: where the settings do not fit the machine.
        """
        from ..container import OracleContainer

        loaded = load(self._invocation)
        with _located(loaded):
            settings = read_settings(loaded)
            if not settings.checkpoint and self._invocation.resumes:
                raise SettingsError(
                    GROUPS.key_of('checkpoint'), '', 'a file, where a machine is to be resumed'
                )
            complain = Complaint(self._judge(machine, self._is_first), loaded.located)
            if self._invocation.recover:
                for problem in sorted_preconditions(machine, settings).misplaced:
                    complain(UnfitName(problem, str(problem.value), UnfitKind.MISPLACED))
            try:
                OracleContainer.wrap(
                    machine,
                    settings=settings,
                    nested=settings.nested,
                    name=machine_names().name_of(machine),
                    strict=complain,
                    recover=self._invocation.recover,
                )
            except LabelError as err:
                smach.logwarn('{}. It runs without an oracle'.format(err))
                return
            self._is_first = False


def give_names(invocation: Invocation) -> None:
    """Name the machines of this process as the command line says."""
    machine_names().given, machine_names().script = invocation.name, named_after(invocation.script)


def named_after(script: str) -> str:
    """Return a machine's name for a script: PICK_AND_PLACE for pick_and_place.py."""
    return os.path.splitext(os.path.basename(script))[0].upper().replace(' ', '_')


def run_script(script: str, script_args: Sequence[str]) -> None:
    """Execute a file as `python3 script script_args...` would.

    Returns or raises as the script does.
    """
    with open(script, 'rb') as source:
        text = source.read()
    file_name = os.path.abspath(script) if sys.version_info >= (3, 9) else script
    module = types.ModuleType('__main__')
    module.__dict__.update(
        __file__=file_name,
        __builtins__=__builtins__,
        __cached__=None,
        __annotations__={},
        __loader__=SourceFileLoader('__main__', file_name),
    )
    # It stays there: threads and exit handlers of the script may pickle its classes after its last
    # line.
    sys.modules['__main__'] = module
    sys.argv[:] = [script] + list(script_args)
    sys.path[0] = os.path.dirname(os.path.realpath(script))
    _show_only_frames_of(file_name)
    exec(compile(text, file_name, 'exec'), module.__dict__)


def _show_only_frames_of(file_name: str) -> None:
    """Make tracebacks begin in the script, as they do when it runs by itself."""
    show = sys.excepthook

    def excepthook(kind: type, error: BaseException, trace: Optional[types.TracebackType]) -> None:
        shutdown.hide_from(trace)
        inside = trace
        while inside is not None and inside.tb_frame.f_code.co_filename != file_name:
            inside = inside.tb_next
        if inside is None and isinstance(error, SyntaxError):
            show(kind, error.with_traceback(None), None)
        else:
            show(kind, error.with_traceback(inside or trace), inside or trace)

    sys.excepthook = excepthook


def tell(err: object) -> None:
    """Say what is wrong, in a line for each thing."""
    for line in str(err).splitlines():
        print('oracle_run: {}'.format(line), file=sys.stderr, flush=True)


def main(args: Optional[Sequence[str]] = None) -> None:
    """Entry point."""
    words = sys.argv[1:] if args is None else list(args)
    invocation = parse(words)
    try:
        check(invocation)
    except SettingsError as err:
        tell(err)
        sys.exit(USAGE_ERROR)
    if invocation.only_check:
        from .check_process import start

        start(words)
    from .interception import Interception

    attachment.configure(attachment.RecordingOptions(invocation.record, invocation.record_topics))
    give_names(invocation)
    attachments = attachment.attachments()
    guard = shutdown.ShutdownGuard(
        attachments.preempt, attachments.close, after_preempt_s=attachments.after_preempt_s
    )
    guard.install()
    atexit.register(attachments.close, 1.0)
    refusal = Refusal(guard, tell)
    attachments.refusing, attachments.guard = refusal.of_errors, guard
    wrapper = MachineWrapper(invocation, refusal)
    Interception(wrapper, wrapper.why_left).install()
    with refusal.decides_exit_code():
        run_script(invocation.script, invocation.script_args)
