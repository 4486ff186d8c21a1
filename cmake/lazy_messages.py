"""Rewrite the `__init__.py` that genpy wrote beside generated classes: each is imported on demand.

`python3 lazy_messages.py FOLDER...`, for the folders `msg` and `srv` of a package. With genpy's own
file the first message that a program imports brings in all of the package's, more than half of
which belong to the simulated robots.
"""

import pprint
import sys
from pathlib import Path

TEXT = """\
# Written by cmake/lazy_messages.py of smach_oracle: a class is imported when it is first asked for.
from importlib import import_module

_MODULES = {modules}
__all__ = list(_MODULES)


def __getattr__(name):
    if name not in _MODULES:
        raise AttributeError('module {{!r}} has no attribute {{!r}}'.format(__name__, name))
    found = getattr(import_module('.' + _MODULES[name], __name__), name)
    return globals().setdefault(name, found)


def __dir__():
    return sorted({{*globals(), *__all__}})
"""
# what a generated module holds beside the class of its own name
BESIDE = {'msg': ('',), 'srv': ('', 'Request', 'Response')}


def text_for(folder: Path) -> str:
    """Return the `__init__.py` of a folder of generated modules."""
    found = sorted(path.stem for path in folder.glob('_[!_]*.py'))
    modules = {name[1:] + end: name for name in found for end in BESIDE[folder.name]}
    return TEXT.format(modules=pprint.pformat(modules))


def rewrite(folder: Path) -> None:
    """Write it, unless it is there."""
    target, text = folder / '__init__.py', text_for(folder)
    if target.read_text(encoding='utf-8') != text:
        target.write_text(text, encoding='utf-8')


if __name__ == '__main__':
    for each in sys.argv[1:]:
        rewrite(Path(each))
