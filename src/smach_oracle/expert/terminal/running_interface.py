"""Follows an interface that runs for a question: its output, its status, its end."""

import math
from typing import List, Optional

import rosgraph
import rosgraph.names
import rospy

from smach_oracle.msg import TeleopState
from smach_oracle.ros.master_watch import timed_master
from smach_oracle.ros.service_calls import call_service
from smach_oracle.srv import (
    FinishInterface,
    FinishInterfaceRequest,
    GiveUpInterface,
    GiveUpInterfaceRequest,
)

from ..followed_server import ListedQuestion
from ..interface_outputs import InterfaceOutputs
from ..wording import clean


class RunningInterface:
    """Listens from before it is started, so that nothing it prints is missed."""

    def __init__(self, listed: ListedQuestion, name: str) -> None:
        """`name`: under which the interface is offered for the question."""
        goal = listed.goal
        offer = next(each for each in goal.interfaces if each.name == name)
        self._query_id = goal.query_id
        self._action = rosgraph.names.resolve_name(offer.action, goal.robot)
        self._state: Optional[TeleopState] = None
        self._state_subscriber: Optional[rospy.Subscriber] = None
        self._outputs = InterfaceOutputs(goal.query_id)
        self._outputs.follow([goal.robot])

    def finish(self, outcome: str, text: str) -> str:
        """Supersede the state with an outcome.

        :returns: why that cannot be, or ''.
        :raises ServerGoneError: where the interface does not answer.
        """
        answer = call_service(
            self._action + '/finish',
            FinishInterface,
            FinishInterfaceRequest(outcome=outcome, text=text, query_id=self._query_id),
        )
        return '' if answer.ok else str(answer.message)

    def give_up(self, text: str) -> str:
        """End it without a result.

        :returns: why that cannot be, or ''.
        :raises ServerGoneError: where the interface does not answer.
        """
        answer = call_service(
            self._action + '/give_up', GiveUpInterface, GiveUpInterfaceRequest(text, self._query_id)
        )
        return '' if answer.ok else str(answer.message)

    def lines(self) -> List[str]:
        """Return the last lines that it has printed, and what became of its start."""
        output = self._outputs.newest(self._query_id)
        return [] if output is None else [output.text] + list(output.lines)

    def status_line(self) -> str:
        """Return its status in one line.

        It shows the hand that it moves, else the last line that it printed.
        """
        state = self._state
        if state is not None:
            motion = state.limit or ('moves' if state.moving else 'stands')
            near = (
                ''
                if math.isinf(state.clearance)
                else ', {:.0f} cm clear'.format(100 * state.clearance)
            )
            return '{} hand {}{}{}'.format(
                clean(state.arm),
                clean(motion),
                near,
                ', driven by ' + clean(state.operator) if state.operator else '',
            )
        lines = [line for line in self.lines() if line.strip()]
        return clean(lines[-1]) if lines else ''

    def follow_hand(self) -> None:
        """Follow the state of a hand, as soon as there is one. It asks the master."""
        if self._state_subscriber is not None:
            return
        try:
            types = dict(timed_master().getTopicTypes())
        except (OSError, rosgraph.MasterException):
            return
        if types.get(self._action + '/state') == TeleopState._type:
            self._state_subscriber = rospy.Subscriber(
                self._action + '/state', TeleopState, self._on_state, queue_size=2
            )

    def stop(self) -> None:
        """Listen no longer."""
        self._outputs.stop()
        if self._state_subscriber is not None:
            self._state_subscriber.unregister()

    def _on_state(self, state: TeleopState) -> None:
        self._state = state
