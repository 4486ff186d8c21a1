"""The executive. It imports smach and the standard library, its pure parts not even smach.

From the top down, each package above all that follow it: `prospects`, which lists what the oracle
may do; `operator_hand`, for operators; `container`, the public face; `execution`, `checkpoint`,
`branches`, `recovery`, `machine`, `control`, `asking`, `records`, `settings`, `decision`, `scope`.
Pure are `decision`, `settings`, all of `records` except the rates file, the question of `asking`,
`errors` and `number_checks`.

`OracleContainer` is imported when it is first asked for, so that the pure parts need no smach.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .asking.question import Answer, AnswerKind, Expert, Question
    from smach_oracle.store.codecs import register_codec
    from .container import OracleContainer
    from .errors import CheckpointError
    from .decision.failure_rate import ExponentialFailureRate, FailureClass, FailureRate
    from .execution.wrapping import unwrap
    from .machine.oracle import oracle_of
    from .operator_hand import OperatorHand
    from .settings.settings import Settings

_LAZY = {
    'OracleContainer': 'container',
    'oracle_of': 'machine.oracle',
    'Settings': 'settings.settings',
    'FailureRate': 'decision.failure_rate',
    'ExponentialFailureRate': 'decision.failure_rate',
    'FailureClass': 'decision.failure_rate',
    'Answer': 'asking.question',
    'AnswerKind': 'asking.question',
    'Expert': 'asking.question',
    'Question': 'asking.question',
    'OperatorHand': 'operator_hand',
    'register_codec': '.store.codecs',
    'unwrap': 'execution.wrapping',
    'CheckpointError': 'errors',
}
__all__ = [
    'Answer',
    'AnswerKind',
    'CheckpointError',
    'Expert',
    'ExponentialFailureRate',
    'FailureClass',
    'FailureRate',
    'OperatorHand',
    'OracleContainer',
    'Question',
    'Settings',
    'oracle_of',
    'register_codec',
    'unwrap',
]


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError('module {!r} has no attribute {!r}'.format(__name__, name))
    from importlib import import_module

    return getattr(import_module('.' + _LAZY[name], __name__), name)
