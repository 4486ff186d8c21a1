"""Questions and answers of the executive to and from their messages."""

from typing import Optional

import genpy
import rospy

from smach_oracle.msg import (
    ExpertDecision,
    ExpertQueryGoal,
    InterfaceOffer,
    LevelOutcome,
    OutcomeChoice,
    SharedAutonomyGoal,
    StateChoice,
    UserdataItem,
    VisitedState,
)
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Question
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.oracle.settings.interfaces import InterfaceOffer as Offer

from ..sendable_text import sendable_text
from ..userdata_codec import SUMMARY_BYTES, UserdataCodecError, decode_all, encode_all


def to_goal(question: Question, robot: str, asked: Optional[rospy.Time] = None) -> ExpertQueryGoal:
    """Return the question as an ExpertQuery goal.

    Userdata values beyond a few kilobytes are left UNSENT.
    """
    return _sendable(
        ExpertQueryGoal(
            query_id=question.question_id,
            trial_id=question.trial_id,
            asked=asked or rospy.Time.now(),
            robot=robot,
            container_path=question.container_path,
            failed_state=question.failed_state,
            failure_kind=int(question.failure_kind),
            outcome=question.outcome,
            text=question.text,
            failure_class=int(question.failure_class),
            rate=question.rate,
            continuous=question.continuous,
            recoveries=question.recoveries,
            reason=question.reason,
            tried=list(question.tried),
            history=[
                VisitedState(visit.state, visit.outcome, int(visit.result))
                for visit in question.history
            ],
            choices=[
                StateChoice(
                    choice.state,
                    choice.predicted_success,
                    int(choice.failure_class),
                    choice.visits,
                    list(choice.missing_keys),
                    list(choice.preconditions),
                    choice.blocked,
                    list(choice.repeats),
                    choice.container,
                    list(choice.runs_again),
                    choice.helped,
                    choice.tried,
                    choice.helped_s,
                    choice.recommended,
                )
                for choice in question.choices
            ],
            supersede_outcomes=[
                OutcomeChoice(choice.outcome, choice.target)
                for choice in question.supersede_outcomes
            ],
            output_keys=list(question.output_keys),
            give_up_outcomes=list(question.give_up_outcomes),
            give_up_above=[
                LevelOutcome(each.container, each.outcome) for each in question.give_up_above
            ],
            interfaces=[
                InterfaceOffer(offer.name, offer.action, offer.description)
                for offer in question.interfaces
            ],
            userdata=encode_all(question.userdata, SUMMARY_BYTES),
            deadline=question.deadline_s,
            fallback=question.fallback,
        )
    )


def to_answer(decision: ExpertDecision) -> Answer:
    """Return the decision as the executive takes it.

    :raises AnswerError: if its kind is unknown or its outputs cannot be decoded here.
    """
    try:
        kind = AnswerKind(decision.kind)
        outputs = decode_all(decision.outputs)
    except ValueError as err:  # UserdataCodecError is one
        raise AnswerError(
            'the answer of {} cannot be used: {}'.format(decision.by or 'nobody', err)
        ) from err
    return Answer(
        kind,
        decision.state,
        decision.outcome,
        decision.interface,
        outputs or None,
        decision.by,
        decision.why,
        decision.container,
    )


def to_decision(answer: Answer) -> ExpertDecision:
    """Return the answer as a message.

    :raises UserdataCodecError: if an output fits neither JSON nor a ROS message.
    """
    outputs = encode_all(answer.outputs or {})
    unsent = [item.key for item in outputs if item.encoding == UserdataItem.UNSENT]
    if unsent:
        raise UserdataCodecError(
            'outputs {} are neither plain data nor ROS messages'.format(', '.join(unsent))
        )
    return _sendable(
        ExpertDecision(
            int(answer.kind),
            answer.state,
            answer.outcome,
            answer.interface,
            outputs,
            answer.container,
            answer.by,
            answer.why,
        )
    )


def to_interface_goal(offer: Offer, question: Question) -> SharedAutonomyGoal:
    """Return the goal for a shared-autonomy interface. Here the userdata goes whole."""
    return _sendable(
        SharedAutonomyGoal(
            query_id=question.question_id,
            container_path=question.container_path,
            state=question.failed_state,
            interface=offer.name,
            userdata=encode_all(question.input_userdata),
            outcomes=[choice.outcome for choice in question.supersede_outcomes],
            output_keys=list(question.output_keys),
        )
    )


def _sendable(message: genpy.Message) -> genpy.Message:
    """The message, with every text in it such that rospy can send it. Outcomes need not be text."""
    for field, kind in zip(message.__slots__, message._slot_types):
        setattr(message, field, _sendable_field(getattr(message, field), kind))
    return message


def _sendable_field(value: object, kind: str) -> object:
    if isinstance(value, list):
        return [_sendable_field(item, kind.partition('[')[0]) for item in value]
    if kind == 'string':
        return sendable_text(value)
    return _sendable(value) if isinstance(value, genpy.Message) else value
