"""Carries out what people say to questions: claims, which it keeps alive as long as their browsers are there, and
answers. Called from several threads; a call may take as long as a robot's service does (5 s at most)."""
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import genpy
import roslib.message
import rospy

from smach_oracle.msg import ExpertDecision, ExpertQueryGoal, UserdataItem
from smach_oracle.srv import ClaimQueryRequest

from ...oracle.errors import OracleError
from ...ros.userdata_codec import encode
from ..followed_server import Listed, ServerGoneError
from ..front_end import LEASE_S, FrontEnd
from .audit import Audit, Person
from .checks import Output
from .commands import KINDS, Command

_RENEW_PERIOD_S = LEASE_S / 3.0
_MOST_MISSED = 12  # rounds in which a question was not open: it is over, and no server that is being restarted
_KIND = dict(zip(KINDS, (ExpertDecision.GOTO, ExpertDecision.SUPERSEDE, ExpertDecision.GIVE_UP,
                         ExpertDecision.INTERFACE)))
_ACTION = {'claim': ClaimQueryRequest.CLAIM, 'take_over': ClaimQueryRequest.TAKE_OVER,
           'release': ClaimQueryRequest.RELEASE}
_NAMED = {'goto': 'state', 'supersede': 'outcome', 'give_up': 'outcome', 'interface': 'interface'}


class Reply(NamedTuple):
    """What came of a command, for the page."""

    ok: bool
    message: str = ''
    data: Any = None  # plain; None where there is nothing more to tell


Worker = Callable[[Command, Person, Listed], Reply]  # may raise ServerGoneError


class BadOutput(OracleError):
    """An output that cannot be sent; the text names it and says why."""


class Desk:
    """Works on the open questions of a front end, for several people at once."""

    def __init__(self, front_end: FrontEnd, audit: Audit, others: Mapping[str, Worker]) -> None:
        """`others`: who carries out further commands about questions, by the commands' names."""
        self._front_end = front_end
        self._others = others
        self._audit = audit
        self._lock = threading.Lock()
        self._held: Dict[Tuple[str, str], Set[int]] = {}  # question, expert -> browsers that show it
        self._missed: 'Counter[Tuple[str, str]]' = Counter()
        self._renewers = ThreadPoolExecutor(8, 'renew')  # one robot that hangs must not cost the others' claims
        threading.Thread(target=self._keep_claims, name='keep claims', daemon=True).start()

    def carry_out(self, command: Command, person: Person, browser: int) -> Reply:
        """Do one of claim, take_over, release, answer and the others' commands, and tell the audit."""
        listed = self._front_end.find(command.arguments['question'])
        reply = self._try(command, person, browser, listed)
        arguments = {name: value for name, value in command.arguments.items() if name != 'question'}
        self._audit.tell(person, command.name, reply.ok, reply.message, arguments, listed)
        return reply

    def leave(self, browser: int) -> None:
        """A browser is gone: its claims are renewed no longer, and run out unless it comes back."""
        with self._lock:
            for key in [key for key, browsers in self._held.items() if browser in browsers]:
                self._let_go(key, browser)

    def _try(self, command: Command, person: Person, browser: int, listed: Optional[Listed]) -> Reply:
        if listed is None:
            return Reply(False, 'This question is open no longer.')
        try:
            if command.name in self._others:
                return self._others[command.name](command, person, listed)
            if command.name == 'answer':
                return self._answer(command, person, listed)
            return self._claim(command.name, person, browser, listed)
        except (ServerGoneError, BadOutput) as err:
            return Reply(False, str(err))

    def _claim(self, name: str, person: Person, browser: int, listed: Listed) -> Reply:
        key = (listed.key, person.expert)
        with self._lock:
            if name == 'release' and not self._let_go(key, browser):
                return Reply(True, '')  # another browser of the same person shows it
        response = self._front_end.server(listed).claim(listed.goal.query_id, person.expert, _ACTION[name], LEASE_S)
        if response.ok and name != 'release':
            with self._lock:
                self._held.setdefault(key, set()).add(browser)
        return Reply(response.ok, response.message)

    def _let_go(self, key: Tuple[str, str], browser: int) -> bool:
        """Whether nobody is left who shows the question under this name; with the lock held."""
        browsers = self._held.get(key, set())
        browsers.discard(browser)
        if browsers:
            return False
        self._held.pop(key, None)
        return True

    def _answer(self, command: Command, person: Person, listed: Listed) -> Reply:
        said = command.arguments
        decision = ExpertDecision(kind=_KIND[said['kind']], by=person.expert, why=said['why'])
        setattr(decision, _NAMED[said['kind']], said['name'])
        decision.outputs = items(said['outputs'], listed.goal)
        response = self._front_end.server(listed).answer(listed.goal.query_id, decision)
        if response.ok:
            with self._lock:
                self._held.pop((listed.key, person.expert), None)
        return Reply(response.ok, response.message)

    def _keep_claims(self) -> None:
        stopped = threading.Event()
        rospy.on_shutdown(stopped.set)
        while not stopped.wait(_RENEW_PERIOD_S):
            self.renew()

    def renew(self) -> None:
        """Renew all claims that somebody still shows, once."""
        with self._lock:
            held = list(self._held)
        for key in set(self._missed) - set(held):
            del self._missed[key]
        list(self._renewers.map(self._renew, held))

    def _renew(self, key: Tuple[str, str]) -> None:
        """Renew a claim; forget it where it is lost or its question closed, keep trying where only the way is."""
        listed = self._front_end.find(key[0])
        if listed is None:  # closed, or its server is being restarted: whoever shows it claims again
            self._missed[key] += 1
            if self._missed[key] > _MOST_MISSED:
                self._forget(key)
            return
        self._missed.pop(key, None)
        try:
            response = self._front_end.server(listed).claim(listed.goal.query_id, key[1], ClaimQueryRequest.RENEW,
                                                            LEASE_S)
        except ServerGoneError as err:
            rospy.logdebug('A claim was not renewed: %s', err)
            return
        if not response.ok:
            self._forget(key)

    def _forget(self, key: Tuple[str, str]) -> None:
        with self._lock:
            self._held.pop(key, None)


def items(outputs: Sequence[Output], goal: ExpertQueryGoal) -> List[UserdataItem]:
    """Typed values as userdata.

    :raises BadOutput: for a message type that does not occur in the question, or a value that does not fit it.
    """
    known = {item.type + ('[]' if item.encoding == UserdataItem.ROS_MESSAGES else '') for item in goal.userdata
             if item.encoding in (UserdataItem.ROS_MESSAGE, UserdataItem.ROS_MESSAGES)}
    found = []
    for output in outputs:
        if output.type and output.type not in known:
            raise BadOutput('output {}: {} is none of the message types in this question'.format(
                output.key, output.type))
        found.append(encode(output.key, _message(output) if output.type else output.value))
        if found[-1].encoding == UserdataItem.UNSENT:
            raise BadOutput('output {}: this value cannot be sent'.format(output.key))
    return found


def _message(output: Output) -> Any:
    many = output.type.endswith('[]')
    message_class = roslib.message.get_message_class(output.type[:-2] if many else output.type)
    if message_class is None:
        raise BadOutput('output {}: {} is not installed here'.format(output.key, output.type))
    values = output.value if many else [output.value]
    if not isinstance(values, list) or not values or not all(isinstance(value, dict) for value in values):
        raise BadOutput('output {}: {} is written as {}'.format(
            output.key, output.type, 'a list of JSON objects' if many else 'a JSON object'))
    return [_filled(output, message_class(), value) for value in values] if many else _filled(
        output, message_class(), values[0])


def _filled(output: Output, message: Any, value: Dict[str, Any]) -> Any:
    try:
        genpy.message.fill_message_args(message, [value])
    except (genpy.MessageException, ValueError, TypeError, AttributeError) as err:
        raise BadOutput('output {}: {}'.format(output.key, err)) from err
    return message
