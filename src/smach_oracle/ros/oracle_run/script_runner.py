"""Run an unmodified SMACH script under an oracle: `rosrun smach_oracle oracle_run SCRIPT`.

All state machines of the script are wrapped. It runs as `python3 SCRIPT` would run it: __main__,
__file__, sys.argv, sys.path[0], exit code and tracebacks are its own.
"""

import argparse
import atexit
import os
import sys
import types
from contextlib import contextmanager
from functools import partial
from importlib.machinery import SourceFileLoader
from typing import (
    Any,
    Callable,
    Dict,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
)

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.names import UnfitKind, UnfitName
from smach_oracle.oracle.settings.paths import check_writable, path_of
from smach_oracle.oracle.settings.settings import Settings

from .. import attachment, shutdown
from ..loaded_settings import LoadedSettings, load_settings, resolve_python
from ..machine_names import machine_names
from ..reading.known_names import Complaint, NameJudge
from .precondition_labels import sorted_preconditions
from .python_names import check_python_name
from .refusal import USAGE_ERROR, Refusal

USAGE = 'oracle_run [options] SCRIPT [arguments of the script]'
NONE = 'none'  # what a launch file gives for a script that nobody has named
OPTIONS_WITH_VALUE = (
    '--config',
    '--name',
    '--policy',
    '--rates-file',
    '--record',
    '--record-topic',
    '--checkpoint',
    '--from',
    '--resume-map',
    '--repeat',
)
# those that a machine gets when `oracle_run` wraps it
_OPTIONS_OF_WRAPPING = (
    '--config',
    '--policy',
    '--rates-file',
    '--no-nested',
    '--without-oracle',
    '--checkpoint',
    '--resume',
    '--from',
    '--resume-map',
    '--repeat',
)


class CommandLine(NamedTuple):
    """The parts of `oracle_run OPTIONS SCRIPT SCRIPT_ARGS`. ROS remappings may stand anywhere."""

    options: List[str]
    script: Optional[str]
    script_args: List[str]


def split(args: Sequence[str]) -> CommandLine:
    """Separate our options from the script and its arguments.

    The first word that is neither an option, nor an option's value, nor a ROS remapping (`a:=b`),
    is the script. All that follows belongs to the script. So do remappings that stand before it.
    """
    options: List[str] = []
    remappings: List[str] = []
    rest = list(args)
    while rest:
        word = rest.pop(0)
        if not word.startswith('-') and ':=' in word:
            remappings.append(word)
        elif word == '--' and rest:
            return CommandLine(options, rest[0], rest[1:] + remappings)
        elif not word.startswith('-'):
            return CommandLine(options, word, rest + remappings)
        else:
            options.append(word)
            if word in OPTIONS_WITH_VALUE and rest:
                options.append(rest.pop(0))
    return CommandLine(options, None, remappings)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of our own options."""
    parser = argparse.ArgumentParser(
        prog='oracle_run',
        usage=USAGE,
        allow_abbrev=False,
        description='Run a SMACH script, as it is, with all its state machines under an oracle.',
        epilog='Options stand before SCRIPT; all that follows it belongs to the script. The '
        "parameter ~oracle of the script's node overrides the file; options override both.",
    )
    parser.add_argument('--config', metavar='FILE', help='settings of the oracle (YAML)')
    parser.add_argument('--policy', choices=sorted(POLICIES), help='how the oracle decides')
    parser.add_argument(
        '--rates-file', metavar='FILE', help='keep learned failure rates in this file across runs'
    )
    parser.add_argument(
        '--name', default='', help="name of the first machine (default: the node's)"
    )
    parser.add_argument('--no-nested', action='store_true', help='wrap the top-level machines only')
    parser.add_argument(
        '--without-oracle',
        action='store_true',
        help='recover nothing: publish and record only, and let every machine '
        'end as its author wrote it',
    )
    parser.add_argument(
        '--check',
        action='store_true',
        help='execute no machine: check the settings against the machines of the '
        'script, and list what the oracle may do in each state',
    )
    parser.add_argument('--record', metavar='FOLDER', help='write one bag per trial to this folder')
    parser.add_argument(
        '--record-topic',
        metavar='TOPIC',
        action='append',
        default=[],
        help='record this topic as well (repeatable)',
    )
    parser.add_argument(
        '--checkpoint',
        metavar='FILE',
        help='store in this file where the machines stand, to go on from there after a crash',
    )
    parser.add_argument(
        '--resume',
        metavar='HOW',
        nargs='?',
        const='recover',
        help='go on with the trial that was stopped; --resume=HOW: recover '
        '(default), ask, restart or state:LABEL',
    )
    parser.add_argument(
        '--from',
        metavar='NUMBER',
        type=int,
        dest='moment',
        help='go on from an earlier stored moment of that trial, by its number',
    )
    parser.add_argument(
        '--resume-map',
        metavar='OLD=NEW',
        action='append',
        default=[],
        type=_renamed,
        help='where the script has changed: the state that was OLD '
        'is NEW now, each a label or a path (repeatable)',
    )
    parser.add_argument(
        '--repeat',
        metavar='STATE',
        action='append',
        default=[],
        help='let the trial that goes on repeat this state once, whatever its '
        'on_retry says: a label or a path (repeatable)',
    )
    return parser


def _renamed(text: str) -> List[str]:
    """Return both names of a state.

    :raises argparse.ArgumentTypeError: where they are not there.
    """
    names = [name.strip() for name in text.split('=')]
    if len(names) != 2 or not all(names):
        raise argparse.ArgumentTypeError('{!r}: OLD=NEW is wanted'.format(text))
    return names


class Invocation(NamedTuple):
    """A command line that has been understood."""

    script: str
    script_args: List[str]
    config: Optional[str]
    overrides: Mapping[str, Any]
    recover: bool
    options: attachment.RecordingOptions
    name: str = ''
    only_check: bool = False
    of_wrapping: Sequence[str] = ()  # the options that a machine gets when it is wrapped


def parse(args: Sequence[str]) -> Invocation:
    """Understand the command line.

    It ends the process with a message and code 2 where it is wrong.
    """
    line = split(args)
    parser = make_parser()
    given = parser.parse_args(line.options)
    if '/' in given.name:
        parser.error('--name {}: a name without / is wanted'.format(given.name))
    if line.script is None or line.script == NONE:
        parser.error(
            'no script is given: name it after the options, or with script:=FILE under roslaunch'
        )
    script = path_of(line.script)
    why = _why_not_readable(script)
    if why:
        parser.error('{}: {}'.format(script, why))
    overrides: Dict[str, Any] = {}
    if given.policy:
        overrides['policy'] = given.policy
    if given.rates_file:
        overrides['rates_file'] = os.path.abspath(path_of(given.rates_file))
    overrides.update(_stored(given))
    if given.no_nested:
        overrides['nested'] = False
    record = os.path.abspath(path_of(given.record)) if given.record else ''
    return Invocation(
        script,
        line.script_args,
        given.config,
        overrides,
        not given.without_oracle,
        attachment.RecordingOptions(record, tuple(given.record_topic)),
        given.name,
        given.check,
        [each for each in _OPTIONS_OF_WRAPPING if each in _names_of(line.options)],
    )


def _names_of(options: Sequence[str]) -> List[str]:
    return [word.split('=')[0] for word in options]


def _stored(given: argparse.Namespace) -> Dict[str, Any]:
    """Return the settings about what is stored."""
    found: Dict[str, Any] = {}
    if given.checkpoint:
        found['checkpoint'] = os.path.abspath(path_of(given.checkpoint))
    if given.resume or given.moment is not None:
        found['on_resume'] = given.resume or 'recover'
    if given.moment is not None:
        found['resume_from'] = given.moment
    if given.resume_map:
        found['resume_map'] = dict(given.resume_map)
    if given.repeat:
        found['resume_repeat'] = given.repeat
    return found


def _why_not_readable(script: str) -> str:
    if not os.path.isfile(script):
        return 'no such file'
    try:
        open(script, 'rb').close()
    except OSError as err:
        return err.strerror or str(err)
    return ''


def check(invocation: Invocation) -> None:
    """Find mistakes before the robot moves.

    :raises SettingsError: in the settings file or the command line. The file of the rates, or the
        folder for the bags, cannot be written.
    """
    loaded = load_settings(invocation.config, None, invocation.overrides)
    with _located(loaded):
        settings = Settings.from_dict(loaded, partial(_check_name, invocation.script))
        if settings.rates_file:
            check_writable('rates_file', settings.rates_file, replaced=True)
        if settings.checkpoint:
            check_writable('checkpoint', settings.checkpoint, replaced=True)
    if invocation.options.record and not invocation.only_check:
        from ..recorder import prepare_folder

        try:
            prepare_folder(invocation.options.record)
        except OSError as err:
            raise SettingsError(
                '--record',
                invocation.options.record,
                'a folder for bags',
                (
                    '--record {}: no bags can be written there ({})'.format(
                        invocation.options.record, err.strerror or err
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
    return load_settings(invocation.config, overrides=invocation.overrides)


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
        """Swap the machine's class.

        :raises SettingsError: where the settings do not fit the machine.
        """
        from ..container import OracleContainer

        loaded = load(self._invocation)
        with _located(loaded):
            settings = read_settings(loaded)
            if not settings.checkpoint and 'on_resume' in self._invocation.overrides:
                raise SettingsError('checkpoint', '', 'a file, where a machine is to be resumed')
            complain = Complaint(self._judge(machine, self._is_first), loaded.located)
            if self._invocation.recover:
                for problem in sorted_preconditions(machine, settings).misplaced:
                    complain(UnfitName(problem, str(problem.value), UnfitKind.MISPLACED))
            OracleContainer.wrap(
                machine,
                settings=settings,
                nested=settings.nested,
                name=machine_names().name_of(machine),
                strict=complain,
                recover=self._invocation.recover,
            )
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


def tell(err: Exception) -> None:
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

    attachment.configure(invocation.options)
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
