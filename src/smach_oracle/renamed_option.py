"""Options under their older names."""

import argparse
import sys
from typing import Optional


class RenamedOption(argparse.Action):
    """An option under its older name, which still works but warns on standard error.

    Its `dest` is that of the option, whose name it is with - for _. Its help is argparse.SUPPRESS.
    """

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: Optional[str] = None,
    ) -> None:
        """Warn, and take the value."""
        new = '--' + self.dest.replace('_', '-')
        sys.stderr.write('{}: {} is now called {}\n'.format(parser.prog, option_string, new))
        setattr(namespace, self.dest, values)
