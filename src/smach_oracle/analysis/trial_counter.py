"""The counter of one trial, and the words of all tables about its counts (doc/statistics.md)."""

from typing import Protocol

from smach_oracle.trial_counter import (
    AUTONOMOUS_DECISIONS,
    TrialCounter,
    TrialEnding,
)

__all__ = [
    'AUTONOMOUS_DECISIONS',
    'EXPERT_ANSWERED',
    'PERSON_NEEDED',
    'TrialCounter',
    'TrialEnding',
    'ended_otherwise',
]

# the same words in every table and figure
EXPERT_ANSWERED = 'expert answered'  # a question at least: the paper's "expert interventions"
PERSON_NEEDED = 'person needed'  # a question was asked, or the trial did not truly succeed


class _Ended(Protocol):
    """A row about a trial, of whatever table."""

    @property
    def ending(self) -> object:
        """A TrialEnding, or the value of one."""


def ended_otherwise(trial: _Ended) -> bool:
    """Whether a trial has ended, and nothing says whether that is a success."""
    return trial.ending in (TrialEnding.OTHER, TrialEnding.OTHER.value)
