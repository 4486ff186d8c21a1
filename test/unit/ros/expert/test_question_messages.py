"""A question gets onto the wire, whatever the robot's state has said and whatever its userdata
holds.
"""

import enum
import io

import genpy
import pytest
from expert_fixtures import make_question

from smach_oracle.msg import ExpertDecision, ExpertQueryGoal, SharedAutonomyGoal, UserdataItem
from smach_oracle.oracle.asking.question import OutcomeChoice
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.oracle.settings.interfaces import InterfaceOffer
from smach_oracle.ros.expert.question_messages import to_answer, to_goal, to_interface_goal

HALF = 'no file caf\udce9.png'  # as Python names a file whose name is no UTF-8
NOW = genpy.Time(1)


def over_the_wire(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return type(message)().deserialize(buffer.getvalue())


def test_a_text_that_utf_8_cannot_say_is_written_out():
    question = make_question(
        text=HALF,
        tried=(HALF,),
        history=(Visit('PICK', HALF, VisitResult.FAILURE),),
        userdata={HALF: 1},
    )
    goal = over_the_wire(to_goal(question, 'robot', NOW))
    written = 'no file caf\\udce9.png'
    assert isinstance(goal, ExpertQueryGoal)
    assert (goal.text, goal.tried, goal.history[0].outcome, goal.userdata[0].key) == (
        written,
        [written],
        written,
        written,
    )


def test_outcomes_that_are_no_text_are_sent_as_their_text():
    question = make_question(
        outcome=False,
        history=(Visit('PICK', 2, VisitResult.FAILURE),),
        supersede_outcomes=(OutcomeChoice(True, 1),),
        give_up_outcomes=(0, None),
    )
    goal = over_the_wire(to_goal(question, 'robot', NOW))
    choice = goal.supersede_outcomes[0]
    assert (goal.outcome, goal.history[0].outcome) == ('False', '2')
    assert (choice.outcome, choice.target) == ('True', '1')
    assert goal.give_up_outcomes == ['0', 'None']
    wanted = over_the_wire(to_interface_goal(InterfaceOffer('assist', '/assist'), question))
    assert wanted.outcomes == ['True']


class WordLabel(str, enum.Enum):
    PICK = 'pick'


def test_a_label_that_is_a_member_of_an_enum_is_sent_as_its_value():
    question = make_question(
        failed_state=WordLabel.PICK, history=(Visit(WordLabel.PICK, 'ok', VisitResult.SUCCESS),)
    )
    goal = over_the_wire(to_goal(question, 'robot', NOW))
    assert (goal.failed_state, goal.history[0].state) == ('pick', 'pick')


def test_other_languages_arrive_as_they_are():
    assert (
        over_the_wire(to_goal(make_question(text='Tür klemmt: 門 ✗'), 'robot', NOW)).text
        == 'Tür klemmt: 門 ✗'
    )


def test_a_userdata_key_that_is_no_string_is_named_and_keeps_nothing_else_back():
    question = make_question(userdata={5: 'five', 'a': 1}, input_userdata={5: 'five', HALF: 1})
    items = {
        item.key: item.encoding for item in over_the_wire(to_goal(question, 'robot', NOW)).userdata
    }
    assert items == {'5': UserdataItem.UNSENT, 'a': UserdataItem.JSON}
    goal = over_the_wire(to_interface_goal(InterfaceOffer('assist', '/assist'), question))
    assert isinstance(goal, SharedAutonomyGoal) and len(goal.userdata) == 2


@pytest.mark.parametrize(
    'item, missing',
    [
        (UserdataItem('object', UserdataItem.ROS_MESSAGE, '', '', b''), 'type of its ROS message'),
        (UserdataItem('object', UserdataItem.ROS_MESSAGE, 'std_msgs/Empty', '', b''), 'md5'),
        (UserdataItem('object', UserdataItem.JSON, '', '', b'1e999'), '1e999'),
    ],
)
def test_the_robot_refuses_outputs_that_it_cannot_read_and_says_what_is_missing(item, missing):
    decision = ExpertDecision(
        kind=ExpertDecision.SUPERSEDE, outcome='done', outputs=[item], by='ann'
    )
    with pytest.raises(AnswerError, match='answer of ann cannot be used.*object.*' + missing):
        to_answer(decision)
