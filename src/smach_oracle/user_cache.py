"""The folder of this user in which the package keeps what it can make again."""

import os
from pathlib import Path


def cache_folder() -> Path:
    """Return it. It may not be there yet, and may be deleted at any time.

    Source: the XDG base directory specification (`$XDG_CACHE_HOME`).
    """
    root = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    return Path(root) / 'smach_oracle'
