"""Carries out commands about questions: claims, answers, and those of their interfaces.

Claims are kept alive as long as the pages are there that show the questions. Called from several
threads. A call takes as long as a robot's service does, 5 s at most.
"""

from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Union

import genpy
import roslib.message

from smach_oracle.msg import ExpertDecision, ExpertQueryGoal, UserdataItem
from smach_oracle.oracle.errors import OracleError
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.ros.userdata_codec import encode
from smach_oracle.srv import ClaimQueryRequest

from ...claims import LEASE_S, Claim, ClaimKeeper
from ...followed_server import ListedQuestion
from ...front_end import FrontEnd
from ..commands.checks import TypedOutput
from ..commands.commands import KINDS, CommandReply, PageCommand
from ..web.audit import Audit, Person
from ..web.settings import DEFAULT_IDLE_S
from .session_claims import SessionClaims

_KIND = dict(
    zip(
        KINDS,
        (
            ExpertDecision.GOTO,
            ExpertDecision.SUPERSEDE,
            ExpertDecision.GIVE_UP,
            ExpertDecision.INTERFACE,
        ),
    )
)
_ACTION = {
    'claim': ClaimQueryRequest.CLAIM,
    'take_over': ClaimQueryRequest.TAKE_OVER,
    'release': ClaimQueryRequest.RELEASE,
}
_FIELD = {'goto': 'state', 'supersede': 'outcome', 'give_up': 'outcome', 'interface': 'interface'}


# may raise ServerGoneError
CommandWorker = Callable[[PageCommand, Person, ListedQuestion], CommandReply]
# why a command is refused before anything is done for it, or '' where it is not
Refusal = Callable[[PageCommand, ListedQuestion], str]


class OutputError(OracleError):
    """An output that cannot be sent. The text names it and says why."""


class QuestionCommands:
    """Works on the open questions of a front end, for several people at once."""

    def __init__(
        self,
        front_end: FrontEnd,
        audit: Audit,
        others: Mapping[str, CommandWorker],
        refusal: Refusal = lambda command, listed: '',
        idle_s: float = DEFAULT_IDLE_S,
    ) -> None:
        """
        :param others: further commands about questions, by name.
        :param refusal: says of each command whether it is too late for it.
        :param idle_s: a holder who presses nothing for so long (s) is idle. 0: nobody ever is.
        """
        self._refusal = refusal
        self._front_end = front_end
        self._others = others
        self._audit = audit
        self.sessions = SessionClaims(idle_s)
        self.claims = ClaimKeeper(front_end)  # held by the pages that show the questions

    def carry_out(self, command: PageCommand, person: Person, page: int) -> CommandReply:
        """Do one of claim, take_over, release, answer and the others, and record it."""
        listed = self._front_end.find(command.arguments['question'])
        reply = self._try(command, person, page, listed)
        arguments = {name: value for name, value in command.arguments.items() if name != 'question'}
        self._audit.record(person, command.name, reply.ok, reply.message, arguments, listed)
        return reply

    def note_press(self, command: PageCommand, person: Person) -> None:
        """Note that the holder of a question is at work. It is not recorded: it comes often."""
        listed = self._front_end.find(command.arguments['question'])
        if listed is not None:
            self.sessions.note_press(person, listed)

    def leave(self, page: int) -> None:
        """A page is gone: its claims are renewed no longer, and run out unless it comes back."""
        self.claims.leave_all(page)

    def _try(
        self, command: PageCommand, person: Person, page: int, listed: Optional[ListedQuestion]
    ) -> CommandReply:
        if listed is None:
            return CommandReply(False, 'This question is open no longer.')
        refused = self._refusal(command, listed) or self.sessions.refusal(command, person, listed)
        if refused:
            return CommandReply(False, refused)
        try:
            if command.name in self._others:
                return self._others[command.name](command, person, listed)
            if command.name == 'answer':
                return self._answer(command, person, listed)
            return self._claim(command.name, person, page, listed)
        except (ServerGoneError, OutputError) as err:
            return CommandReply(False, str(err))

    def _claim(self, name: str, person: Person, page: int, listed: ListedQuestion) -> CommandReply:
        claim = Claim(listed.key, person.expert)
        if name == 'release':
            if not self.sessions.holds(person, listed):
                return CommandReply(True, '')  # it is not this browser's to give back
            if not self.claims.leave(claim, page):
                return CommandReply(True, '')  # another page of the same browser shows it
        response = self._front_end.server(listed).claim(
            listed.goal.query_id, person.expert, _ACTION[name], LEASE_S
        )
        if response.ok and name == 'release':
            self.sessions.give_back(person, listed)
        elif response.ok:
            if not self.sessions.holds(person, listed):
                self.claims.drop(claim)  # another browser of the same name has renewed it
            self.sessions.take(person, listed)
            self.claims.keep(listed, person.expert, page)
        return CommandReply(response.ok, response.message)

    def _answer(self, command: PageCommand, person: Person, listed: ListedQuestion) -> CommandReply:
        arguments = command.arguments
        decision = ExpertDecision(
            kind=_KIND[arguments['kind']],
            by=person.expert,
            why=arguments['why'],
            container=arguments['container'],
        )
        setattr(decision, _FIELD[arguments['kind']], arguments['name'])
        decision.outputs = items(arguments['outputs'], listed.goal)
        response = self._front_end.server(listed).answer(listed.goal.query_id, decision)
        if response.ok:
            self.claims.drop(Claim(listed.key, person.expert))
        return CommandReply(response.ok, response.message)


def items(outputs: Sequence[TypedOutput], goal: ExpertQueryGoal) -> List[UserdataItem]:
    """Typed values as userdata.

    :raises OutputError: for a message type that does not occur in the question, or a value that
        does not fit it.
    """
    known = {
        item.type + ('[]' if item.encoding == UserdataItem.ROS_MESSAGES else '')
        for item in goal.userdata
        if item.encoding in (UserdataItem.ROS_MESSAGE, UserdataItem.ROS_MESSAGES)
    }
    found = []
    for output in outputs:
        if output.type and output.type not in known:
            raise OutputError(
                'output {}: {} is not a message type of this question'.format(
                    output.key, output.type
                )
            )
        found.append(encode(output.key, _message(output) if output.type else output.value))
        if found[-1].encoding == UserdataItem.UNSENT:
            raise OutputError('output {}: this value cannot be sent'.format(output.key))
    return found


def _message(output: TypedOutput) -> Union[genpy.Message, List[genpy.Message]]:
    many = output.type.endswith('[]')
    message_class = roslib.message.get_message_class(output.type[:-2] if many else output.type)
    if message_class is None:
        raise OutputError('output {}: {} is not installed here'.format(output.key, output.type))
    values = output.value if many else [output.value]
    if (
        not isinstance(values, list)
        or not values
        or not all(isinstance(value, dict) for value in values)
    ):
        raise OutputError(
            'output {}: {} is written as {}'.format(
                output.key, output.type, 'a list of JSON objects' if many else 'a JSON object'
            )
        )
    return (
        [_filled(output, message_class(), value) for value in values]
        if many
        else _filled(output, message_class(), values[0])
    )


def _filled(output: TypedOutput, message: genpy.Message, value: Dict[str, Any]) -> genpy.Message:
    try:
        genpy.message.fill_message_args(message, [value])
    except (genpy.MessageException, ValueError, TypeError, AttributeError) as err:
        raise OutputError('output {}: {}'.format(output.key, err)) from err
    return message
