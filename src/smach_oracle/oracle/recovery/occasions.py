"""Why the oracle is entered, as data: one constructor for each case.

Which phases of a recovery do anything, what is counted and what is told follows from it alone.
"""

import enum
from typing import NamedTuple, Optional

import smach

from ..asking.question import Answer
from ..decision.policy import FailureContext
from ..machine.resumed import Unfinished
from ..records.events import FailureKind
from .failure import Failure, in_words
from .verdict import Departure


class FirstStep(enum.Enum):
    """What a recovery begins with."""

    DECIDE = 'decide'  # as a policy does
    ASK = 'ask'  # a person, since nobody else is to decide: `why`
    OBEY = 'obey'  # what was answered, or decided below, already
    ENTER_AGAIN = 'enter again'  # once the robot is well
    WAIT_AND_DECIDE = 'wait and decide'  # likewise


class Superseding(enum.Enum):
    """The effect on the counts where an expert says what a visit has ended with."""

    TAKES_BACK = 'takes back'  # the failure that was counted
    COUNTS = 'counts'  # as a visit, which it was not before
    RECORDS = 'records'  # in the history, where it is counted already


class Occasion(NamedTuple):
    """One reason to enter the oracle, after a visit of a state."""

    failure: Failure  # of that state, or what stands for one
    context: FailureContext
    outcome: str  # with what the state has ended, '' where it has not
    what: str  # the same in a word, for the log
    first_step: FirstStep = FirstStep.DECIDE
    superseding: Superseding = Superseding.TAKES_BACK
    continuous: bool = False
    why: str = ''  # a person is asked, or the robot is not well, '' where a preempt came meanwhile
    keeps: bool = False  # without an answer the trial is kept for the next start
    answer: Optional[Answer] = None  # given while the state still ran
    departure: Optional[Departure] = None  # of a container below, which was left for this one
    visits_since: int = 0  # since the state has failed


def failed(failure: Failure, context: FailureContext, continuous: bool = False) -> Occasion:
    """A state has failed, or overran, or was held back since it is not to be repeated."""
    return Occasion(
        failure,
        context,
        failure.outcome,
        failure.outcome or failure.kind.name.lower(),
        superseding=Superseding.TAKES_BACK if failure.is_counted else Superseding.COUNTS,
        continuous=continuous,
    )


def announced(
    failure: Failure, context: FailureContext, continuous: bool, by: str, visits_since: int
) -> Occasion:
    """A state has failed before, and its author's way was kept. `by`: an outcome reports it."""
    occasion = failed(failure, context, continuous)
    return occasion._replace(outcome=by, what=by, visits_since=visits_since)


def interrupted(
    failure: Failure, context: FailureContext, before: Unfinished, continuous: bool = False
) -> Occasion:
    """A visit was begun before the program was stopped. `before`: how it stood."""
    occasion = failed(failure, context, continuous)
    if not before.asks:
        return occasion
    if failure.is_held_back:
        return occasion._replace(keeps=True)
    return occasion._replace(
        first_step=FirstStep.ASK, why=before.asks, keeps=before.keeps, continuous=False
    )


def ended_by_answer(
    failure: Failure, context: FailureContext, answer: Answer, outcome: str
) -> Occasion:
    """A state was ended by an answer while it still ran. `failure`: as if it had failed."""
    return Occasion(
        failure,
        context,
        outcome,
        outcome or 'taken_out',
        FirstStep.OBEY,
        Superseding.RECORDS,
        answer=answer,
    )


def arrived(
    failure: Failure,
    context: FailureContext,
    departure: Departure,
    outcome: str,
    is_own: bool,
) -> Occasion:
    """A state was left for this level. `failure`: if it has to be asked about.

    `is_own`: the decision was made on this level, as if the state had failed.
    """
    return Occasion(
        failure,
        context,
        outcome,
        outcome or 'left',
        FirstStep.OBEY,
        Superseding.TAKES_BACK if is_own else Superseding.RECORDS,
        departure=departure,
    )


def unwell(failure: Failure, context: FailureContext, why: str) -> Occasion:
    """A state has failed while the robot was not well. The visit counts nowhere.

    `why`: the robot is not well, or '' where a preempt or a shutdown is under way.
    """
    return failed(failure, context)._replace(
        first_step=FirstStep.ENTER_AGAIN, superseding=Superseding.COUNTS, why=why
    )


def often_unwell(failure: Failure, context: FailureContext, continuous: bool, why: str) -> Occasion:
    """A state has failed while the robot was not well, too often not to be counted."""
    return failed(failure, context, continuous)._replace(
        first_step=FirstStep.WAIT_AND_DECIDE, why=why
    )


def still_running(failure: Failure) -> Occasion:
    """A state runs on, for much longer than ever before. A person is asked meanwhile."""
    context = FailureContext(failure.state, '', False, False, None, None)
    return Occasion(failure, context, '', '', FirstStep.ASK)


def log_occasion(occasion: Occasion, place: str) -> None:
    """Log why the oracle is entered. `place`: path of the state."""
    if occasion.first_step is FirstStep.OBEY:  # it is no failure
        return
    failure = occasion.failure
    words = failure.details or in_words(failure)
    if occasion.first_step is FirstStep.ENTER_AGAIN:
        # what the wait says in the log is one sentence for all who wait
        smach.loginfo('{} failed, which is not counted: {}'.format(place, words))
    elif failure.is_held_back:  # what was in doubt, or had not begun, has not failed
        smach.logwarn('{} {}'.format(place, failure.text))
    elif failure.kind is FailureKind.INTERRUPTED:
        smach.logwarn('{}: {}'.format(place, failure.text))
    else:
        smach.logwarn('{} failed: {}'.format(place, words))
