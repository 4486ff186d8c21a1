"""The answers that an expert may give to a question, and how they are typed. Pure."""

from typing import List, NamedTuple

from smach_oracle.msg import ExpertDecision, ExpertQueryGoal, StateChoice
from smach_oracle.oracle.asking.question import names
from smach_oracle.oracle.errors import AnswerError

from ..wording import still_runs


class AnswerOption(NamedTuple):
    """One possible answer."""

    key: str  # 1, 2, ...: go to; s1, ...: supersede; g, g1, ...: give up; i1, ...: interface
    words: str  # the same in words, e.g. 'goto PICK'
    kind: int  # as in ExpertDecision.msg
    name: str  # of the state, outcome or interface, or '' for giving up as the failure would have
    blocked: str = ''  # why it cannot be chosen now
    container: str = ''  # of the state, or the one that ends. '': that of the failed state

    def decision(self) -> ExpertDecision:
        """Return a decision without outputs or reason."""
        field = {ExpertDecision.GOTO: 'state', ExpertDecision.INTERFACE: 'interface'}.get(
            self.kind, 'outcome'
        )
        return ExpertDecision(kind=self.kind, container=self.container, **{field: self.name})


def options(goal: ExpertQueryGoal) -> List[AnswerOption]:
    """Return all possible answers, in the order in which they are shown."""
    found = [
        AnswerOption(
            str(number),
            _goto_words(goal, choice),
            ExpertDecision.GOTO,
            choice.state,
            choice.blocked,
            choice.container,
        )
        for number, choice in enumerate(goal.choices, 1)
    ]
    states = {choice.state for choice in goal.choices if not choice.container}
    # first those with which the machine goes on: s1 is then seldom the failure itself
    outcomes = sorted(goal.supersede_outcomes, key=lambda choice: choice.target not in states)
    found += [
        AnswerOption(
            's{}'.format(number),
            'supersede ' + choice.outcome,
            ExpertDecision.SUPERSEDE,
            choice.outcome,
        )
        for number, choice in enumerate(outcomes, 1)
    ]
    found.append(AnswerOption('g', 'give_up', ExpertDecision.GIVE_UP, ''))
    found += [
        AnswerOption('g{}'.format(number), 'give_up ' + outcome, ExpertDecision.GIVE_UP, outcome)
        for number, outcome in enumerate(goal.give_up_outcomes, 1)
    ]
    found += [
        AnswerOption(
            'g{}'.format(number),
            'give_up {}/{}'.format(each.container, each.outcome),
            ExpertDecision.GIVE_UP,
            each.outcome,
            container=each.container,
        )
        for number, each in enumerate(goal.give_up_above, 1 + len(goal.give_up_outcomes))
    ]
    found += [
        AnswerOption(
            'i{}'.format(number), 'interface ' + offer.name, ExpertDecision.INTERFACE, offer.name
        )
        for number, offer in enumerate(goal.interfaces, 1)
    ]
    return found


def is_wait_on(goal: ExpertQueryGoal, choice: StateChoice) -> bool:
    """Whether to go to a state means to let it run on."""
    return still_runs(goal) and (choice.container, choice.state) == ('', goal.failed_state)


def path_of(choice: StateChoice) -> str:
    """Return a state's label, behind its path where it is in another container."""
    return '{}/{}'.format(choice.container, choice.state) if choice.container else choice.state


def _goto_words(goal: ExpertQueryGoal, choice: StateChoice) -> str:
    return 'wait on' if is_wait_on(goal, choice) else 'goto ' + path_of(choice)


def choose(text: str, available: List[AnswerOption]) -> AnswerOption:
    """Return the option that was typed.

    By its key, its words, a name that only one has, or `s`, `i` where there is one of them.

    :raises AnswerError: where there is none, several, or it is blocked. The text says what is
        allowed.
    """
    typed = ' '.join(text.split())
    matching = _matching(typed, available)
    if not matching:
        raise AnswerError(
            '{!r} is no answer here; allowed: {}'.format(
                typed, ', '.join(option.key for option in available if not option.blocked)
            )
        )
    if len(matching) > 1:
        raise AnswerError(
            '{!r} could mean {}'.format(
                typed, names(['{} ({})'.format(option.words, option.key) for option in matching])
            )
        )
    if matching[0].blocked:
        raise AnswerError(
            '{} cannot be entered now: {}'.format(matching[0].name, matching[0].blocked)
        )
    return matching[0]


def _matching(typed: str, available: List[AnswerOption]) -> List[AnswerOption]:
    for fits in (
        lambda option: option.key == typed.lower(),
        lambda option: option.words == typed,
        lambda option: typed != '' and option.name == typed and not option.container,
        lambda option: (
            typed != '' and typed in (option.name, '{}/{}'.format(option.container, option.name))
        ),
        lambda option: typed.lower() in ('s', 'i') and option.key[0] == typed.lower(),
    ):
        matching = [option for option in available if fits(option)]
        if matching:
            return matching
    return []
