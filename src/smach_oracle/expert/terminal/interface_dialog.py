"""The terminal's conversation while an interface runs that the expert has chosen."""

import time
from typing import Callable, List, Optional, Sequence

from smach_oracle.msg import OpenQuery
from smach_oracle.ros.service_calls import ServerGoneError

from ..followed_server import ListedQuestion
from ..wording import clean
from .prompts import Choice, PromptInterrupted, Prompts
from .running_interface import RunningInterface

STARTS_WITHIN_S = 5.0
SHOWN_LINES = 20


class InterfaceDialog:
    """Shows what the interface prints and how it stands, and ends it: finished or given up."""

    def __init__(
        self,
        interface: RunningInterface,
        prompts: Prompts,
        say: Callable[[str, str], None],
        find: Callable[[str], Optional[ListedQuestion]],
    ) -> None:
        """`find` returns an open question by its key."""
        self._interface = interface
        self._prompts = prompts
        self._say = say
        self._find = find
        self._begun_s = time.monotonic()
        self._seen_running = False

    def run(self, listed: ListedQuestion) -> None:
        """Talk until the interface has ended, or the expert leaves it to itself."""
        outcomes = [choice.outcome for choice in listed.goal.supersede_outcomes]
        choices: List[Choice] = [
            ('f{}'.format(number), 'finish with ' + outcome)
            for number, outcome in enumerate(outcomes, 1)
        ]
        choices += [
            ('g', 'give up: the oracle asks again'),
            ('o', 'show what it prints'),
            ('l', 'leave it to itself'),
        ]
        for key, meaning in choices:
            self._say('  {:3} {}'.format(key, clean(meaning)), 'cyan')
        try:
            while not self._done(self._ask('interface: ', listed, choices), listed, outcomes):
                pass
        except PromptInterrupted as reason:
            self._show_output()
            self._say(str(reason), 'bold yellow')

    def _done(self, line: str, listed: ListedQuestion, outcomes: List[str]) -> bool:
        number = line[1:] if line.startswith('f') else ''
        try:
            if line == 'l':
                return True
            if line == 'o':
                self._show_output()
            elif line == 'g':
                return self._ended(
                    self._interface.give_up(self._ask('  reason (optional): ', listed))
                )
            elif number.isdecimal() and 1 <= int(number) <= len(outcomes):
                return self._ended(
                    self._interface.finish(
                        outcomes[int(number) - 1],
                        self._ask('  for the record (optional): ', listed),
                    )
                )
            elif line:
                allowed = 'f1 to f{}, g, o, l'.format(len(outcomes))
                self._say('{!r} is not one of {}'.format(line, allowed), 'red')
        except ServerGoneError as err:
            self._say(str(err), 'red')
        except KeyboardInterrupt:
            self._say('Not sent.', 'dim')
        return False

    def _ended(self, why_not: str) -> bool:
        if why_not:
            self._say('Refused: {}'.format(why_not), 'red')
        else:
            self._say('✓ The interface has ended.', 'bold green')
        return not why_not

    def _ask(self, message: str, listed: ListedQuestion, choices: Sequence[Choice] = ()) -> str:
        return self._prompts.ask(
            message, self._interface.status_line, lambda: self._why_to_stop(listed), choices
        )

    def _why_to_stop(self, listed: ListedQuestion) -> Optional[str]:
        self._interface.follow_hand()
        now = self._find(listed.key)
        running = now is not None and now.status == OpenQuery.INTERFACE_RUNNING
        self._seen_running = self._seen_running or running
        if running or not self._seen_running and time.monotonic() - self._begun_s < STARTS_WITHIN_S:
            return None
        return 'The interface has ended.'

    def _show_output(self) -> None:
        lines = self._interface.lines()[-SHOWN_LINES:]
        self._say(
            '\n'.join('  | ' + line for line in lines) if lines else '  It has printed nothing.',
            'dim',
        )
