"""A decision as a sentence for people: one for the log, the event, the terminal and the page. Pure.

"PICK failed (1 of its last 10): trying it again."
"""

from typing import NamedTuple, Optional, Sequence, Tuple

from .policy import Action


class DecisionFacts(NamedTuple):
    """A decision, and the facts that led to it."""

    state: str  # the failed one
    recent: Tuple[int, int]  # failures among its latest results, and their number; 0, 0: not known
    rate: float  # 0 to 1
    continuous: bool
    action: Action
    target: str = ''  # of a revisit or a step back
    met: Sequence[str] = ()  # preconditions that were made to hold
    not_met: str = ''  # the one that could not
    spent: int = -1  # recoveries of this trial, where they are all spent, else -1
    blocked: str = ''  # why the policy's own choice is not possible
    not_failed: str = ''  # what is said of the state where it has not failed
    asked: str = ''  # who is asked, and how long: "an expert, 300 s"
    wait_s: float = 0.0  # waited before
    tried: str = ''  # what was done after its failure before, where it has not succeeded since


def decision_sentence(facts: DecisionFacts, cause: str) -> str:
    """Return the sentence, without a full stop. `cause`: that of the facts."""
    return '{}: {}'.format(cause, _does(facts))


def cause_of(facts: DecisionFacts) -> str:
    """Return what led to the decision, as the sentence begins."""
    blocked = '; ' + facts.blocked if facts.blocked else ''
    return _failed(facts) + _helped(facts) + blocked


def going_would_repeat(state: str, target: str, repeated: Sequence[str]) -> str:
    """Return the clause for a decision that would repeat states which are not to be repeated.

    :param state: the failed one.
    """
    if state in repeated and target == state:
        return 'it is not repeated by itself'
    return '{} would repeat {}'.format(
        'trying it again' if target == state else 'going back to ' + target, ', '.join(repeated)
    )


def still_running_sentence(state: str, ran_s: float, longest_s: Optional[float]) -> str:
    """Return what a person is told of a state that takes much longer than ever before.

    `longest_s`: of its visits that have ended. None means not known.
    """
    return '{} still runs after {}. It has no time limit, so it is not abandoned.'.format(
        state, ran_in_words(ran_s, longest_s)
    )


def ran_in_words(ran_s: float, longest_s: Optional[float]) -> str:
    """Return how long a state has run, and how long it took before."""
    before = (
        'how long it took before is not known'
        if longest_s is None
        else 'its longest so far was {}'.format(_seconds(longest_s))
    )
    return '{}; {}'.format(_seconds(ran_s), before)


def _seconds(seconds: float) -> str:
    if seconds < 0.1:
        return 'under 0.1 s'
    return ('{:.0f} s' if seconds >= 10 else '{:.2g} s').format(seconds)


def _failed(facts: DecisionFacts) -> str:
    if facts.not_failed:
        return '{} {}'.format(facts.state, facts.not_failed)
    if facts.spent == 0:
        return '{} failed ({}), and no recovery of it is allowed'.format(facts.state, _rate(facts))
    if facts.spent > 0:
        return '{} failed again after {} of this trial'.format(
            facts.state, '1 recovery' if facts.spent == 1 else '{} recoveries'.format(facts.spent)
        )
    failed = 'keeps failing' if facts.continuous else 'failed again' if facts.tried else 'failed'
    return '{} {}{} ({})'.format(
        facts.state, failed, ' after ' + facts.tried if facts.tried else '', _rate(facts)
    )


def _rate(facts: DecisionFacts) -> str:
    failures, results = facts.recent
    if not results:
        return 'failure rate {:.0f}%'.format(100 * facts.rate)
    if results == 1:
        return 'its first result'
    return '{} of its last {}'.format(failures, results)


def _helped(facts: DecisionFacts) -> str:
    if facts.not_met:
        return ', and {} did not help'.format(facts.not_met)
    if facts.met:
        one = len(facts.met) == 1
        return ', and its precondition{} {} hold{}'.format(
            '' if one else 's', ' and '.join(facts.met), 's' if one else ''
        )
    return ''


def _does(facts: DecisionFacts) -> str:
    if facts.action is Action.ASK:
        return 'asking {}'.format(facts.asked or 'an expert')
    if facts.action is Action.GIVE_UP:
        return 'giving up, and asking nobody'
    waiting = 'in {:g} s '.format(facts.wait_s) if facts.wait_s else ''
    return waiting + goes(facts)


def goes(facts: DecisionFacts) -> str:
    """Return where a decision leads that asks nobody."""
    if facts.action is Action.RESTART:
        return 'starting over from ' + facts.target
    return 'trying it again' if facts.target == facts.state else 'going back to ' + facts.target
