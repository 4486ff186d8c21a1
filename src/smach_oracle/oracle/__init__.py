"""The executive. Imports smach and the standard library only; its pure parts do not even import smach.

Pure: errors, events, question, naming, failure_rate, history, policy, precondition_spec, config, config_values,
state_record, packages, paths. `OracleContainer` is imported when it is first asked for, so that the pure parts need no
smach.
"""
from typing import Any

_LAZY = {'OracleContainer': 'container', 'Settings': 'config', 'FailureRate': 'failure_rate',
         'ExponentialFailureRate': 'failure_rate', 'FailureClass': 'failure_rate'}
__all__ = sorted(_LAZY)


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError('module {!r} has no attribute {!r}'.format(__name__, name))
    from importlib import import_module
    return getattr(import_module('{}.{}'.format(__name__, _LAZY[name])), name)
