"""The start of the commands in scripts/."""

import io
import os
import sys
from contextlib import contextmanager
from importlib import import_module
from typing import Iterator, List, NoReturn, Optional, TextIO, Tuple

from smach_oracle import __version__
from smach_oracle.documentation import PAGES, page_of

HELP, VERSION = (['-h'], ['--help']), ['--version']
VERSION_HELP = """
without any other option:
  --version             print the version and exit
"""
LACKING = 2  # exit code where a package is missing
NOT_WRITTEN = 2  # exit code where the output cannot be written, such as to a full disk
NO_READER = 141  # exit code where nobody reads the output any more, as a shell gives it for SIGPIPE
# rooms whose commands print a result. The others have nodes, which go on without a reader of
# their log
PRINTING = ('analysis.', 'experiment.', 'store.', 'ros.disk.', 'simulation.rehearsal.')


class _Printed(io.TextIOWrapper):
    """Standard output or error of a command that prints.

    Where it is a pipe whose reader has gone (`| head`), the process ends without a word. Where it
    cannot be written for another reason, the process ends with one line. A letter that the encoding
    lacks is written as `\\xfc`.
    """

    def __init__(self, stream: TextIO) -> None:
        super().__init__(
            stream.buffer,
            stream.encoding,
            'backslashreplace' if stream.errors == 'strict' else stream.errors,
            line_buffering=stream.isatty() or stream is sys.stderr,
        )

    def write(self, text: str) -> int:
        """Write as usual.

        :raises SystemExit: where it cannot be written.
        """
        try:
            return super().write(text)
        except OSError as err:
            self._end(err)

    def flush(self) -> None:
        """Flush as usual.

        :raises SystemExit: where it cannot be written.
        """
        try:
            super().flush()
        except OSError as err:
            self._end(err)

    def _end(self, err: OSError) -> NoReturn:
        # what is left in the buffer is written at the end of the process
        os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
        if isinstance(err, BrokenPipeError):
            raise SystemExit(NO_READER)
        if self is not sys.stderr:
            sys.stderr.write('{}: output: {}\n'.format(_named()[0], err.strerror))
        raise SystemExit(NOT_WRITTEN)


def _watched(stream: Optional[TextIO]) -> TextIO:
    """The stream in `_Printed`, unless a program has replaced it by one of its own.

    Where it was closed (`>&-`), there is none, and nothing is printed.
    """
    if stream is None:
        return open(os.devnull, 'w', encoding='utf-8')
    wrap = isinstance(stream, io.TextIOWrapper) and not isinstance(stream, _Printed)
    return _Printed(stream) if wrap else stream


def run_renamed(module: str, new: str, *options: str) -> None:
    """Run a command by its older name: as `run`, after a line on standard error.

    :param new: its new name, with the subcommand.
    :param options: in front of those that were given.
    """
    old = os.path.basename(sys.argv[0])
    if _asked(VERSION) is None:
        sys.stderr = _watched(sys.stderr)
        sys.stderr.write('{0}: is now `{1}`: rosrun smach_oracle {1}\n'.format(old, new))
    run(module, [*options, *sys.argv[1:]], old)


def run(module: str, *arguments: object, options: str = '') -> None:
    """Run `main` of a module, named relative to smach_oracle.

    The process ends with the code that it returns. `--version` alone, or behind a subcommand,
    prints the version. Below its --help are a line about that and the page that has more.

    Where a package is missing that the module imports, one line says which, and what installs it.

    :param arguments: of its `main`.
    :param options: a module whose `make_parser` makes the parser of the options. --help needs that
        one alone.
    """
    asked = _asked(VERSION)
    if asked is not None or module.startswith(PRINTING) or sys.argv[1:2] in HELP:
        sys.stdout, sys.stderr = _watched(sys.stdout), _watched(sys.stderr)
    if asked is not None:
        sys.stdout.write('{} of smach_oracle {}\n'.format(asked, __version__))
        sys.stdout.flush()
        return
    only_help = options and _asked(*HELP) is not None
    try:
        if only_help:
            main = import_module('smach_oracle.' + options).make_parser().parse_args
        else:
            main = import_module('smach_oracle.' + module).main
    except ImportError as err:
        from smach_oracle.packages import lacking

        told = lacking(err)
        if not told:
            raise
        sys.stderr.write('{}: {}\n'.format(os.path.basename(sys.argv[0]), told))
        sys.exit(LACKING)
    try:
        with _more_below_the_help():
            code = main(*([['--help']] if only_help else arguments))
    finally:
        if isinstance(sys.stdout, _Printed):
            sys.stdout.flush()
    if code:
        sys.exit(code)


def _asked(*options: List[str]) -> Optional[str]:
    """Return the command, with its subcommand, where such an option stands right behind it.

    None: it does not. Nothing else may follow `--version`.
    """
    command, rest = _named()
    told = rest if VERSION in options else rest[:1]
    return command if told in options else None


def _named() -> Tuple[str, List[str]]:
    """Return the command, with its subcommand, and what stands behind it."""
    command, rest = os.path.basename(sys.argv[0]), sys.argv[1:]
    subcommand = ' '.join([command, *rest[:1]])
    return (subcommand, rest[1:]) if subcommand in PAGES else (command, rest)


@contextmanager
def _more_below_the_help() -> Iterator[None]:
    """Say below what --help prints how to see the version, and which page has more.

    A script's own --help has no such lines.
    """
    try:
        yield
    except SystemExit as end:
        asked = _asked(*HELP)
        page = None if asked is None else page_of(asked)
        if page is not None and not end.code:
            sys.stdout.write(VERSION_HELP + '\nMore: {}\n'.format(page))
        raise
