"""The terminal front end: shows open questions, one at a time, and takes an expert's answers."""

import json
import math
import sys
import time
from typing import Callable, List, Optional, Sequence, Set

import rospy
from rich.console import Console
from rich.text import Text

from smach_common.node_end import end_quietly
from smach_oracle.msg import ExpertDecision, OpenQuery
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.ros.expert.open_questions import is_unknown
from smach_oracle.ros.master_watch import start_master_watch
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.ros.userdata_codec import encode

from ..followed_server import ListedQuestion
from ..front_end import FrontEnd, wait_for_question
from ..repeating import repeat
from ..stop_calls import LOOK_UP_PERIOD_S
from ..wording import clean, next_step_words
from . import render
from .interface_dialog import InterfaceDialog
from .next_steps import NextSteps
from .operator_commands import OPERATOR_WORDS, OperatorCommands
from .options import AnswerOption, choose, options
from .precondition_status import PreconditionStatusListener
from .prompts import Choice, JsonValidator, LeaveQuestion, PromptInterrupted, Prompts, QuitTerminal
from .running_interface import RunningInterface
from .start import parse, wait_for_master
from .text import duration

_COMMANDS: List[Choice] = [
    ('l', 'leave it to others, back to the list'),
    ('t', 'take it over from who holds it'),
    ('p', 'show how the preconditions stand now'),
    ('r', 'show the question again'),
    ('q', 'quit'),
]
_FIRST_LIST_S = 1.0
IDLE_S = 300.0  # without a key: who has left the terminal must keep no question from others
_RETURN_S = 20.0  # how long a server may take to come back, and its robots to ask it again


class Terminal:
    """A conversation with one expert. Claims are given back however it ends."""

    def __init__(
        self,
        front_end: FrontEnd,
        console: Console,
        prompts: Prompts,
        next_steps: Callable[[str, str], NextSteps] = NextSteps,
        interface: Callable[[ListedQuestion, str], RunningInterface] = RunningInterface,
        preconditions: Callable[
            [str, str], PreconditionStatusListener
        ] = PreconditionStatusListener,
        operator: Optional[OperatorCommands] = None,
    ) -> None:
        self._next_steps = next_steps
        self._interface = interface
        self._listen_to_preconditions = preconditions
        self._preconditions: Optional[PreconditionStatusListener] = None
        self._operator = operator or OperatorCommands(front_end.expert)
        self._front_end = front_end
        self._console = console
        self._prompts = prompts
        self._left_to_others: Set[str] = set()  # questions that the expert has left to others
        self._claimed = False
        self._missing_since_s = math.inf

    def run(self) -> None:
        """Serve the expert until they quit, by q, Ctrl-C or end of file."""
        try:
            wait_for_question(self._front_end, _FIRST_LIST_S)  # the first lists are on their way
            while not rospy.is_shutdown():
                self._work_on(self._pick())
        except (QuitTerminal, KeyboardInterrupt, EOFError):
            self._say('Claims are given back. Good-bye.', 'dim')
        finally:
            self._front_end.stop()

    def _pick(self) -> ListedQuestion:
        """The question to work on: the only new one, else the one whose number is typed.

        While nobody is at the terminal, none is opened by itself.
        """
        while True:
            waiting = self._waiting()
            fresh = [
                each
                for each in waiting
                if each.key not in self._left_to_others and each.status == OpenQuery.PENDING
            ]
            if len(waiting) == 1 and fresh and self._prompts.idle_s < IDLE_S:
                return fresh[0]
            try:
                if not waiting:
                    self._wait_for_questions()
                    continue
                picked = self._pick_from(waiting)
            except PromptInterrupted:
                continue  # the list has changed: show it again
            if picked is not None:
                return picked

    def _wait_for_questions(self) -> None:
        self._say('No open questions; waiting. (q quits)', 'dim')
        while True:
            line = self._prompts.ask(
                '',
                self._servers_line,
                lambda: 'a question' if self._waiting() else None,
                OPERATOR_WORDS,
            )
            _quit_on(line)
            self._operate(line)

    def _operate(self, line: str) -> bool:
        """Do what an operator commands. Return whether it was that."""
        told = self._operator.carry_out(line)
        for text, style in told or ():
            self._say(text, style)
        return told is not None

    def _pick_from(self, waiting: Sequence[ListedQuestion]) -> Optional[ListedQuestion]:
        self._console.print(render.overview(waiting, time.monotonic()))
        keys = [each.key for each in waiting]
        line = self._prompts.ask(
            'question [1-{}]: '.format(len(waiting)),
            self._servers_line,
            lambda: 'changed' if [each.key for each in self._waiting()] != keys else None,
            [
                (str(number), '{} {}'.format(each.goal.robot, each.goal.failed_state))
                for number, each in enumerate(waiting, 1)
            ]
            + [('q', 'quit')]
            + OPERATOR_WORDS,
        )
        _quit_on(line)
        if self._operate(line):
            return None
        if line.isdecimal() and 1 <= int(line) <= len(waiting):
            return waiting[int(line) - 1]
        self._say('{!r} is not one of 1 to {}, q'.format(line, len(waiting)), 'red')
        return None

    def _waiting(self) -> List[ListedQuestion]:
        return [
            each
            for each in self._front_end.questions()
            if each.status != OpenQuery.INTERFACE_RUNNING
        ]

    def _work_on(self, listed: ListedQuestion) -> None:
        """Claim, show and answer one question."""
        self._missing_since_s = math.inf
        steps = self._next_steps(listed.goal.robot, listed.goal.trial_id)
        self._preconditions = self._listen_to_preconditions(listed.goal.robot, listed.goal.query_id)
        try:
            self._claim_first(listed)
            self._console.rule(style='dim')
            self._console.print(render.question(listed.goal, time.monotonic() - listed.asked_s))
            while not self._answered(listed, steps):
                pass
        except LeaveQuestion:
            self._left_to_others.add(listed.key)
        except PromptInterrupted as reason:
            self._say('\n{}'.format(reason), 'bold yellow')
        finally:
            self._front_end.release(listed)
            steps.stop()
            self._preconditions.stop()

    def _claim_first(self, listed: ListedQuestion) -> None:
        """Claim it, if that can be done now.

        Otherwise it is claimed while the expert reads (`_why_to_stop`).
        """
        try:
            self._claim(listed)
        except ServerGoneError as err:
            self._claimed = False
            self._say(str(err), 'red')

    def _claim(self, listed: ListedQuestion, take_over: bool = False) -> None:
        response = self._front_end.claim(listed, take_over)
        self._claimed = response.ok
        if not response.ok and not response.holder:
            raise PromptInterrupted(response.message)
        if not response.ok:
            self._say('{}; t takes it over.'.format(response.message), 'yellow')

    def _answered(self, listed: ListedQuestion, steps: NextSteps) -> bool:
        """Ask for one line and act on it. Return whether that has settled the question."""
        available = options(listed.goal)
        line = self._ask(
            listed,
            '\nanswer: ',
            [(option.key, option.words) for option in available] + _COMMANDS + OPERATOR_WORDS,
        )
        try:
            if self._command(listed, line):
                return False
            decision = self._decide(listed, choose(line, available))
            return decision is not None and self._send(listed, decision, steps)
        except (AnswerError, ServerGoneError) as err:
            self._say(str(err), 'red')
        return False

    def _command(self, listed: ListedQuestion, line: str) -> bool:
        """Do what is no answer. Return whether it was that."""
        _quit_on(line)
        if line == 'l':
            raise LeaveQuestion
        if line == 't':
            self._claim(listed, take_over=True)
        elif line == 'p' and self._preconditions is not None:
            for text, style in self._preconditions.lines() or [
                ('  The robot does not publish their status.', 'dim')
            ]:
                self._say(text, style)
        elif line == 'r':
            self._console.print(render.question(listed.goal, time.monotonic() - listed.asked_s))
        return line in ('', 't', 'p', 'r') or self._operate(line)

    def _decide(self, listed: ListedQuestion, option: AnswerOption) -> Optional[ExpertDecision]:
        """The decision with its outputs and reason, or None where Ctrl-C went back."""
        self._say('→ {}'.format(option.words), 'bold')
        try:
            return self._complete(listed, option)
        except KeyboardInterrupt:
            self._say('Not sent.', 'dim')
            return None

    def _complete(self, listed: ListedQuestion, option: AnswerOption) -> ExpertDecision:
        decision = option.decision()
        if option.kind == ExpertDecision.SUPERSEDE:
            for key in listed.goal.output_keys:
                text = self._ask(
                    listed,
                    '  {} as JSON (empty: not set): '.format(clean(key)),
                    [],
                    JsonValidator(),
                )
                if text:
                    decision.outputs.append(encode(key, json.loads(text)))
        decision.why = self._ask(listed, '  reason (optional): ', [])
        return decision

    def _send(self, listed: ListedQuestion, decision: ExpertDecision, steps: NextSteps) -> bool:
        if decision.kind == ExpertDecision.INTERFACE:
            return self._send_interface(listed, decision, steps)
        return self._settle(listed, decision, steps)

    def _send_interface(
        self, listed: ListedQuestion, decision: ExpertDecision, steps: NextSteps
    ) -> bool:
        interface = self._interface(listed, decision.interface)
        try:
            settled = self._settle(listed, decision, steps)
            if settled:
                InterfaceDialog(interface, self._prompts, self._say, self._front_end.find).run(
                    listed
                )
                self._show_next_steps(listed, steps)
            return settled
        finally:
            interface.stop()

    def _settle(self, listed: ListedQuestion, decision: ExpertDecision, steps: NextSteps) -> bool:
        steps.forget()
        response = self._front_end.answer(listed, decision)
        if not response.ok:
            self._say('Refused: {}'.format(response.message), 'red')
            return False
        self._say('✓ The robot has your answer.', 'bold green')
        self._show_next_steps(listed, steps)
        return True

    def _show_next_steps(self, listed: ListedQuestion, steps: NextSteps) -> None:
        silent = True
        for event in steps.follow():
            silent = False
            self._say('  ' + next_step_words(event), 'green')
        if silent:
            self._say(
                '  What it does next is not known: no events on {}/oracle/events.'.format(
                    listed.goal.robot
                ),
                'dim',
            )

    def _ask(
        self,
        listed: ListedQuestion,
        message: str,
        choices: Sequence[Choice],
        validator: Optional[JsonValidator] = None,
    ) -> str:
        return self._prompts.ask(
            message,
            lambda: self._status_line(listed),
            lambda: self._why_to_stop(listed),
            choices,
            validator,
        )

    def _why_to_stop(self, listed: ListedQuestion) -> Optional[str]:
        """Return why to stop working on a question, or None as long as it is ours to answer."""
        if self._prompts.idle_s >= IDLE_S:
            self._left_to_others.add(listed.key)
            return 'No key was pressed for {}: the question is left to others.'.format(
                duration(IDLE_S)
            )
        if not self._front_end.connected(listed.server):
            return self._gone_for_good('{} is gone.'.format(listed.server))
        now = self._front_end.find(listed.key)
        try:
            if now is None:
                return self._why_gone(listed)
            self._missing_since_s = math.inf
            if self._claimed and now.holder not in ('', self._front_end.expert):
                self._claimed = False
                return '{} has taken this question over.'.format(clean(now.holder))
            if not now.holder:  # our claim is gone with a restarted server, or who held it has left
                self._claimed = self._front_end.claim(listed).ok
        except ServerGoneError:
            pass
        return None

    def _why_gone(self, listed: ListedQuestion) -> Optional[str]:
        """Return who settled the question, or None where it is still open.

        Where the server does not know the question, it was restarted. A living robot then asks
        it again.
        """
        response = self._front_end.claim(listed)
        if response.ok:
            return None
        if is_unknown(response.message):
            return self._gone_for_good(response.message)
        return response.message

    def _gone_for_good(self, why: str) -> Optional[str]:
        """The reason, once a server or its robot has had time to come back."""
        now_s = time.monotonic()
        self._missing_since_s = min(self._missing_since_s, now_s)
        return why if now_s - self._missing_since_s > _RETURN_S else None

    def _status_line(self, listed: ListedQuestion) -> str:
        now = self._front_end.find(listed.key) or listed
        parts = [
            self._front_end.expert,
            'no time limit'
            if now.deadline_s == math.inf
            else '{} left'.format(duration(now.deadline_s - time.monotonic())),
        ]
        if not self._front_end.connected(listed.server):
            parts.append('{} is gone; waiting for it'.format(listed.server))
        elif not self._claimed:
            parts.append('{} works on it'.format(now.holder or 'nobody'))
        others = len(self._waiting()) - 1
        if others > 0:
            parts.append('{} more'.format(others))
        parts.append('{} in {}'.format(listed.goal.failed_state, listed.goal.container_path))
        return ' · '.join(parts)

    def _servers_line(self) -> str:
        servers = [
            '{}{}'.format(name, '' if self._front_end.connected(name) else ' (gone)')
            for name in self._front_end.servers
        ]
        running = [
            'interface {} runs for {}'.format(each.goal.interface, each.goal.failed_state)
            for each in self._front_end.questions()
            if each.status == OpenQuery.INTERFACE_RUNNING
        ]
        return ' · '.join(
            [self._front_end.expert, ', '.join(servers) or 'no server found yet'] + running
        )

    def _say(self, text: str, style: str) -> None:
        self._console.print(Text(clean(text, lines=True), style))


def _quit_on(line: str) -> None:
    if line == 'q':
        raise QuitTerminal


def main() -> None:
    """Entry point of `expert_terminal`."""
    options_given = parse(rospy.myargv(sys.argv)[1:])
    console = Console()
    try:
        wait_for_master(console)
        # a name of its own each. Ctrl-C is ours. The log stays off the screen (its file has it)
        rospy.init_node(
            'expert_terminal', anonymous=True, disable_signals=True, log_level=rospy.FATAL
        )
    except KeyboardInterrupt:
        return
    start_master_watch()
    end_quietly()
    operator = OperatorCommands(options_given.name)
    repeat(operator.look_up, LOOK_UP_PERIOD_S)
    Terminal(
        FrontEnd(options_given.name, options_given.server), console, Prompts(), operator=operator
    ).run()
    rospy.signal_shutdown('the expert has left')
