"""How the commands in scripts/ start."""
import os
import sys
from contextlib import contextmanager
from importlib import import_module
from typing import Iterator

from smach_oracle.documentation import page_of

HELP = (['-h'], ['--help'])
LACKING = 2  # exit code where a package is missing


def run(module: str) -> None:
    """Run `main` of a module, named relative to smach_oracle.

    The process ends with the code that it returns. Below its --help is the page that has more.

    Where a package is missing that the module imports, one line says which, and what installs it.
    """
    try:
        main = import_module('smach_oracle.' + module).main
    except ImportError as err:
        from smach_oracle.packages import lacking
        told = lacking(err)
        if not told:
            raise
        sys.stderr.write('{}: {}\n'.format(os.path.basename(sys.argv[0]), told))
        sys.exit(LACKING)
    with _page_below_the_help():
        code = main()
    if code:
        sys.exit(code)


@contextmanager
def _page_below_the_help() -> Iterator[None]:
    """Say below what --help prints which page has more. A script's own --help has no such line."""
    try:
        yield
    except SystemExit as end:
        page = page_of(os.path.basename(sys.argv[0])) if sys.argv[1:2] in HELP else None
        if page is not None and not end.code:
            sys.stdout.write('\nMore: {}\n'.format(page))
        raise
