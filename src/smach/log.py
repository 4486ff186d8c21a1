"""The four loggers of SMACH: plain prints until somebody hands in better ones.

Code that logs says ``smach.loginfo(...)`` at the moment of logging, so that :func:`set_loggers`
reaches every module.
"""

import sys
from typing import Callable

import smach

__all__ = ['set_loggers', 'loginfo', 'logwarn', 'logerr', 'logdebug']

Logger = Callable[[str], object]


def _write(text: str) -> None:
    """Write a whole line at once. Where standard output is closed (`>&-`), nothing is written."""
    if sys.stdout is not None:
        sys.stdout.write(text)


def loginfo(msg: object) -> None:
    """Log an info message to standard output, by default."""
    _write('[  INFO ] : %s\n' % (msg,))


def logwarn(msg: object) -> None:
    """Log a warning to standard output, by default."""
    _write('[  WARN ] : %s\n' % (msg,))


def logdebug(msg: object) -> None:
    """Log a debug message to standard output, by default."""
    _write('[ DEBUG ] : %s\n' % (msg,))


def logerr(msg: object) -> None:
    """Log an error to standard output, by default."""
    _write('[ ERROR ] : %s\n' % (msg,))


def set_loggers(info: Logger, warn: Logger, debug: Logger, error: Logger) -> None:
    """Replace all four loggers. Each is called with one finished text per message."""
    vars(smach).update(loginfo=info, logwarn=warn, logdebug=debug, logerr=error)
