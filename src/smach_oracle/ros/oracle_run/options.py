"""The command line of `oracle_run`. It loads neither ROS nor SMACH, so that --help is quick."""

import argparse
import os
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.renamed_option import RenamedOption

USAGE = 'oracle_run [options] SCRIPT [arguments of the script]'
NONE = 'none'  # what a launch file gives for a script that nobody has named
OPTIONS_WITH_VALUE = (
    '--config',
    '--machine-name',
    '--policy',
    '--rates-file',
    '--record',
    '--record-topic',
    '--checkpoint',
    '--from',
    '--resume-map',
    '--repeat',
)
OLDER_WITH_VALUE = ('--name',)
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
            if word in OPTIONS_WITH_VALUE + OLDER_WITH_VALUE and rest:
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
        '--machine-name',
        metavar='NAME',
        default='',
        help="name of the first machine (default: the node's)",
    )
    parser.add_argument(
        '--name',
        dest='machine_name',
        default=argparse.SUPPRESS,
        action=RenamedOption,
        help=argparse.SUPPRESS,
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
        metavar='STORE',
        help='keep in this file where the machines stand, to go on from there after a crash',
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
    record: str = ''  # the folder for the bags
    record_topics: Tuple[str, ...] = ()
    name: str = ''
    only_check: bool = False
    folder: str = ''  # where the process began, which the script may leave
    of_wrapping: Sequence[str] = ()  # the options that a machine gets when it is wrapped

    @property
    def resumes(self) -> bool:
        """Whether a stored trial is to go on."""
        return 'on_resume' in self.overrides.get('checkpoint', {})


def parse(args: Sequence[str]) -> Invocation:
    """Understand the command line.

    It ends the process with a message and code 2 where it is wrong.
    """
    line = split(args)
    parser = make_parser()
    given = parser.parse_args(line.options)
    if '/' in given.machine_name:
        parser.error('--machine-name {}: a name without / is wanted'.format(given.machine_name))
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
    stored = _stored(given)
    if stored:
        overrides['checkpoint'] = stored
    if given.no_nested:
        overrides['tree'] = {'nested': False}
    record = os.path.abspath(path_of(given.record)) if given.record else ''
    return Invocation(
        script,
        line.script_args,
        given.config,
        overrides,
        not given.without_oracle,
        record,
        tuple(given.record_topic),
        given.machine_name,
        given.check,
        os.getcwd() if given.config else '',
        [each for each in _OPTIONS_OF_WRAPPING if each in _names_of(line.options)],
    )


def _names_of(options: Sequence[str]) -> List[str]:
    return [word.split('=')[0] for word in options]


def _stored(given: argparse.Namespace) -> Dict[str, Any]:
    """Return the settings of the group `checkpoint`."""
    found: Dict[str, Any] = {}
    if given.checkpoint:
        found['file'] = os.path.abspath(path_of(given.checkpoint))
    if given.resume or given.moment is not None:
        found['on_resume'] = given.resume or 'recover'
    if given.moment is not None:
        found['from'] = given.moment
    if given.resume_map:
        found['map'] = dict(given.resume_map)
    if given.repeat:
        found['repeat'] = given.repeat
    return found


def _why_not_readable(script: str) -> str:
    if not os.path.isfile(script):
        return 'no such file'
    try:
        open(script, 'rb').close()
    except OSError as err:
        return err.strerror or str(err)
    return ''
