"""The former place of `smach_oracle.oracle.asking.question`, kept as an alias."""

import warnings

from .asking.question import (
    Answer,
    AnswerKind,
    Expert,
    OutcomeChoice,
    Progress,
    Question,
    StateChoice,
)
from .records.visits import Visit, VisitResult
from .settings.interfaces import InterfaceOffer, InterfaceStart

__all__ = [
    'Answer',
    'AnswerKind',
    'Expert',
    'InterfaceOffer',
    'InterfaceStart',
    'OutcomeChoice',
    'Progress',
    'Question',
    'StateChoice',
    'Visit',
    'VisitResult',
]

warnings.warn(
    'smach_oracle.oracle.question has moved to smach_oracle.oracle.asking.question; '
    'smach_oracle.oracle has Answer, AnswerKind, Expert and Question too',
    FutureWarning,
    stacklevel=2,
)
