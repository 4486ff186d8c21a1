"""The start of the commands in scripts/."""

import io
import os
import sys
from contextlib import contextmanager
from importlib import import_module
from typing import Iterator, NoReturn, TextIO

from smach_oracle import __version__
from smach_oracle.documentation import page_of

HELP = (['-h'], ['--help'])
VERSION_HELP = """
without any other option:
  --version             print the version and exit
"""
LACKING = 2  # exit code where a package is missing
NO_READER = 141  # exit code where nobody reads the output any more, as a shell gives it for SIGPIPE
# rooms whose commands print a result. The others have nodes, which go on without a reader of
# their log
PRINTING = ('analysis.', 'experiment.', 'store.', 'ros.disk.', 'simulation.rehearsal.')


class _Printed(io.TextIOWrapper):
    """Standard output or error of a command that prints.

    Where it is a pipe whose reader has gone (`| head`), the process ends without a word.
    """

    def __init__(self, stream: TextIO) -> None:
        super().__init__(
            stream.buffer,
            stream.encoding,
            stream.errors,
            line_buffering=stream.isatty() or stream is sys.stderr,
        )

    def write(self, text: str) -> int:
        """Write as usual.

        :raises SystemExit: where nobody reads it any more.
        """
        try:
            return super().write(text)
        except BrokenPipeError:
            self._end()

    def flush(self) -> None:
        """Flush as usual.

        :raises SystemExit: where nobody reads it any more.
        """
        try:
            super().flush()
        except BrokenPipeError:
            self._end()

    def _end(self) -> NoReturn:
        # what is left in the buffer is written at the end of the process
        os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
        raise SystemExit(NO_READER)


def _watched(stream: TextIO) -> TextIO:
    """The stream in `_Printed`, unless a program has replaced it by one of its own."""
    return _Printed(stream) if isinstance(stream, io.TextIOWrapper) else stream


def run(module: str) -> None:
    """Run `main` of a module, named relative to smach_oracle.

    The process ends with the code that it returns. `--version` alone prints the version. Below its
    --help are a line about that and the page that has more.

    Where a package is missing that the module imports, one line says which, and what installs it.
    """
    if sys.argv[1:] == ['--version']:
        told = '{} of smach_oracle {}\n'.format(os.path.basename(sys.argv[0]), __version__)
        sys.stdout.write(told)
        return
    if module.startswith(PRINTING) or sys.argv[1:2] in HELP:
        sys.stdout, sys.stderr = _watched(sys.stdout), _watched(sys.stderr)
    try:
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
            code = main()
    finally:
        if isinstance(sys.stdout, _Printed):
            sys.stdout.flush()
    if code:
        sys.exit(code)


@contextmanager
def _more_below_the_help() -> Iterator[None]:
    """Say below what --help prints how to see the version, and which page has more.

    A script's own --help has no such lines.
    """
    try:
        yield
    except SystemExit as end:
        page = page_of(os.path.basename(sys.argv[0])) if sys.argv[1:2] in HELP else None
        if page is not None and not end.code:
            sys.stdout.write(VERSION_HELP + '\nMore: {}\n'.format(page))
        raise
