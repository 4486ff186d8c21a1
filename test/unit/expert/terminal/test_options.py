"""What an expert can type, and what it means."""

import pytest
import rospy
from expert_fixtures import make_question

from smach_oracle.expert.terminal.options import choose, options
from smach_oracle.msg import ExpertDecision
from smach_oracle.oracle.asking.question import LevelOutcome, OutcomeChoice
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.oracle.records.events import FailureKind
from smach_oracle.ros.expert.answer_rules import check_decision
from smach_oracle.ros.expert.question_messages import to_goal

GOAL = to_goal(make_question(), '/robot', rospy.Time(1))


def test_every_answer_has_a_key():
    assert [(option.key, option.words) for option in options(GOAL)] == [
        ('1', 'goto DETECT'),
        ('2', 'goto PICK'),
        ('3', 'goto PLACE'),
        ('s1', 'supersede succeeded'),
        ('s2', 'supersede aborted'),
        ('g', 'give_up'),
        ('g1', 'give_up succeeded'),
        ('g2', 'give_up aborted'),
        ('i1', 'interface assist'),
    ]


def test_a_state_that_still_runs_may_be_waited_for():
    still = to_goal(make_question(failure_kind=FailureKind.STILL_RUNNING), '/robot', rospy.Time(1))
    assert [option.words for option in options(still)[:3]] == [
        'goto DETECT',
        'wait on',
        'goto PLACE',
    ]
    for typed in ('2', 'wait on', 'PICK'):
        decision = choose(typed, options(still)).decision()
        assert (decision.kind, decision.state) == (ExpertDecision.GOTO, 'PICK')


def test_outcomes_with_which_the_machine_goes_on_come_first():
    outcomes = (OutcomeChoice('aborted', 'aborted'), OutcomeChoice('succeeded', 'PLACE'))
    goal = to_goal(make_question(supersede_outcomes=outcomes), '/robot', rospy.Time(1))
    assert [option.words for option in options(goal) if option.key[0] == 's'] == [
        'supersede succeeded',
        'supersede aborted',
    ]


def test_every_answer_on_offer_fits_its_question():
    for option in options(GOAL):
        decision = option.decision()
        decision.by = 'ann'
        if option.blocked:
            with pytest.raises(AnswerError, match='PLACE cannot be entered now'):
                check_decision(GOAL, decision)
        else:
            check_decision(GOAL, decision)


@pytest.mark.parametrize(
    'typed, kind, name',
    [
        ('1', ExpertDecision.GOTO, 'DETECT'),
        ('DETECT', ExpertDecision.GOTO, 'DETECT'),
        ('goto  PICK', ExpertDecision.GOTO, 'PICK'),
        ('S2', ExpertDecision.SUPERSEDE, 'aborted'),
        ('supersede succeeded', ExpertDecision.SUPERSEDE, 'succeeded'),
        ('g', ExpertDecision.GIVE_UP, ''),
        ('give_up aborted', ExpertDecision.GIVE_UP, 'aborted'),
        ('i', ExpertDecision.INTERFACE, 'assist'),
        (' assist ', ExpertDecision.INTERFACE, 'assist'),
    ],
)
def test_an_answer_is_typed_by_key_by_words_or_by_a_name_of_its_own(typed, kind, name):
    option = choose(typed, options(GOAL))
    assert (option.kind, option.name) == (kind, name)


@pytest.mark.parametrize(
    'typed, text',
    [
        ('9', "'9' is no answer here; allowed: 1, 2, s1, s2, g, g1, g2, i1"),
        ('', 'is no answer here'),
        ('s', 'could mean supersede aborted .s2., supersede succeeded .s1.'),
        ('succeeded', 'could mean give_up succeeded .g1., supersede succeeded .s1.'),
        ('3', 'PLACE cannot be entered now: still running after an overrun'),
    ],
)
def test_what_means_nothing_or_too_much_is_told(typed, text):
    with pytest.raises(AnswerError, match=text):
        choose(typed, options(GOAL))


def test_states_and_ends_of_other_containers_are_named_by_their_paths():
    choice = make_question().choices[0]
    asked = to_goal(
        make_question(
            choices=tuple(
                choice._replace(state=state, container=container)
                for state, container in (('GRASP', ''), ('GRASP', 'TASK/PICK'), ('LOOK', 'TASK'))
            ),
            give_up_outcomes=('aborted',),
            give_up_above=(LevelOutcome('TASK', 'aborted'),),
        ),
        '/robot',
        rospy.Time(1),
    )
    found = options(asked)
    assert [option.words for option in found if option.key in ('1', '2', '3', 'g2')] == [
        'goto GRASP',
        'goto TASK/PICK/GRASP',
        'goto TASK/LOOK',
        'give_up TASK/aborted',
    ]
    for typed, container, state in (
        ('GRASP', '', 'GRASP'),
        ('LOOK', 'TASK', 'LOOK'),
        ('TASK/PICK/GRASP', 'TASK/PICK', 'GRASP'),
    ):
        decision = choose(typed, found).decision()
        assert (decision.container, decision.state) == (container, state)
    assert choose('g2', found).decision().container == 'TASK'
