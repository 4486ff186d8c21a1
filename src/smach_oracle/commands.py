"""How the commands in scripts/ start."""
import os
import sys
from importlib import import_module

LACKING = 2  # exit code where a package is missing


def run(module: str) -> None:
    """Run `main` of a module, named relative to smach_oracle.

    The process ends with the code that it returns.

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
    code = main()
    if code:
        sys.exit(code)
