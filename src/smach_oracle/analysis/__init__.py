"""From bags of trials to tables, figures, and rows for a notebook.

Needs rosbags and, for figures, matplotlib, neither ROS nor SMACH. `read` is the way in for your own
scripts: doc/notebook.md.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .recorded.trial_set import TrialSet, read

__all__ = ['TrialSet', 'read']


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError('module {!r} has no attribute {!r}'.format(__name__, name))
    from .recorded import trial_set  # what reads bags takes a while

    return getattr(trial_set, name)
