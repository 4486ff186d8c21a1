"""What the page is told of questions; what values that people type become."""

import json
import math

import pytest
from expert_fixtures import make_question
from geometry_msgs.msg import PointStamped

from smach_oracle.expert.console.answering.question_commands import OutputError, items
from smach_oracle.expert.console.answering.question_sections import QuestionSections
from smach_oracle.expert.console.answering.question_view import question_view
from smach_oracle.expert.console.commands.checks import TypedOutput
from smach_oracle.expert.console.trials.recovery_statistics import RecoveryCounts
from smach_oracle.expert.console.trials.trial_log import TrialLog
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.msg import OpenQuery
from smach_oracle.oracle.asking.question import OutcomeChoice, StateChoice
from smach_oracle.oracle.records.events import FailureKind
from smach_oracle.oracle.settings.failure_rule import FailureRule
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.ros.userdata_codec import decode_all

BY_NAME = FailureRule()


def goal(**changes):
    import rospy

    return to_goal(make_question(**changes), '/robot', rospy.Time(1))


def view(rule=BY_NAME, **changes):
    listed = ListedQuestion(
        '/robot/expert_query', goal(**changes), OpenQuery.CLAIMED, 'ann', 10.0, math.inf
    )
    return question_view(
        listed,
        1000.0,
        lambda target: RecoveryCounts(2, 3) if target == 'DETECT' else RecoveryCounts(0, 0),
        rule,
    )


def test_a_question_is_told_whole():
    shown = json.loads(json.dumps(view(), allow_nan=False))
    assert shown.keys() == view().keys()
    assert (
        shown['key'],
        shown['state'],
        shown['asked'],
        shown['deadline'],
        shown['holder'],
        shown['status'],
    ) == ('/robot/expert_query q1', 'PICK', 1010.0, None, 'ann', 'claimed')
    detect, pick, place = shown['choices']
    assert detect['helped'] == [2, 3] and pick['missing'] == ['grasp'] and place['blocked']
    assert pick['preconditions'] == ['MOVE_ARMS_ASIDE', 'view_is_clear']
    assert shown['supersede'][0] == {
        'outcome': 'succeeded',
        'target': 'PLACE',
        'meaning': 'success',
    }
    assert shown['outputs'] == ['grasped']
    assert shown['interfaces'] == [{'name': 'assist', 'description': 'do it by hand'}]


@pytest.mark.parametrize(
    'rule, failed_with, meanings',
    [
        (BY_NAME, '', {'succeeded': 'success', 'aborted': 'failure', 'parked': 'other end'}),
        (BY_NAME, 'parked', {'parked': 'failure'}),
        (FailureRule(('parked',)), '', {'aborted': 'success', 'parked': 'failure'}),
    ],
)
def test_each_outcome_says_what_it_means_by_the_rule_of_its_robot(rule, failed_with, meanings):
    names = ('aborted', 'parked', 'succeeded')
    shown = view(
        rule,
        supersede_outcomes=tuple(OutcomeChoice(name, 'PLACE') for name in names),
        outcome=failed_with,
        failure_kind=FailureKind.FAILING_OUTCOME if failed_with else FailureKind.EXCEPTION,
    )
    told = {each['outcome']: each['meaning'] for each in shown['supersede']}
    assert {outcome: told[outcome] for outcome in meanings} == meanings


def test_a_question_says_what_would_come_again_and_that_nothing_failed():
    choices = (
        StateChoice('POUR', 0.9, 1, 1, (), (), repeats=('POUR', 'ARM/CUT'), runs_again=('LEFT',)),
    )
    held_back = view(failure_kind=FailureKind.HELD_BACK, choices=choices)
    assert held_back['choices'][0]['repeats'] == ['POUR', 'ARM/CUT']
    assert held_back['choices'][0]['runs_again'] == ['LEFT']
    assert (held_back['stands'], held_back['what']) == ('is held back', 'was not executed')
    assert view()['stands'] == 'failed' and view()['choices'][0]['repeats'] == []


class FakeFrontEnd:
    servers = ()
    connected = None

    def __init__(self):
        self.asked = {}

    def questions(self):
        return sorted(
            (
                ListedQuestion(
                    '/robot/expert_query',
                    goal(query_id=name),
                    OpenQuery.PENDING,
                    '',
                    asked_s,
                    math.inf,
                )
                for name, asked_s in self.asked.items()
            ),
            key=lambda listed: listed.asked_s,
        )


def test_questions_of_one_second_keep_their_places_though_each_list_tells_their_ages_anew():
    front_end, sections = FakeFrontEnd(), PageSections()
    board = QuestionSections(front_end, TrialLog())
    for front_end.asked in (
        {'q1': 10.0, 'q2': 10.1},
        {'q1': 10.2, 'q2': 10.1},
        {'q1': 10.2, 'q2': 9.9, 'q3': 9.0},
    ):
        board.write_sections(sections)
        shown = [
            view['key'].split()[1] for view in json.loads(dict(sections.since(0)[1])['questions'])
        ]
        assert [key for key in shown if key != 'q3'] == ['q1', 'q2']
    assert shown == ['q3', 'q1', 'q2']


def test_a_question_that_an_interface_has_opened_anew_is_as_old_as_before():
    front_end, sections = FakeFrontEnd(), PageSections()
    board = QuestionSections(front_end, TrialLog())
    ages = []
    for front_end.asked in ({'q1': 10.0}, {}, {'q1': 55.0}):
        board.write_sections(sections)
        ages += [view['asked'] for view in sections.get('questions')]
    assert len(ages) == 2 and ages[0] == ages[1]


def test_userdata_is_shown_by_kind():
    point = PointStamped()
    point.header.frame_id = 'base_link'
    shown = {
        item['key']: item
        for item in view(
            userdata={
                'plain': {'a': 1},
                'point': point,
                'points': [point, point],
                'image': object(),
            }
        )['userdata']
    }
    assert shown['plain']['value'] == '{"a": 1}' and shown['image']['note'] == 'not sent'
    assert 'frame_id: "base_link"' in shown['point']['value']
    assert shown['points']['type'] == 'geometry_msgs/PointStamped[]'


def test_markup_and_odd_numbers_are_data_like_any_other():
    choice = StateChoice('DETECT', math.inf, 1, 2, (), (), tried=3, helped_s=math.nan)
    shown = view(text='<script>alert(1)</script>', rate=math.nan, choices=(choice,))
    assert shown['text'] == '<script>alert(1)</script>' and shown['rate'] is None
    assert json.dumps(shown, allow_nan=False)
    assert len(view(text='x' * 100000)['text']) < 10000


def test_typed_values_become_userdata_messages_among_them():
    asked = goal(userdata={'point': PointStamped(), 'points': [PointStamped()]})
    decoded = decode_all(
        items(
            [
                TypedOutput('a', [1, None], ''),
                TypedOutput('b', {'point': {'x': 1.5}}, 'geometry_msgs/PointStamped'),
                TypedOutput('c', [{}, {}], 'geometry_msgs/PointStamped[]'),
            ],
            asked,
        )
    )
    assert decoded['a'] == [1, None] and decoded['b'].point.x == 1.5 and len(decoded['c']) == 2


@pytest.mark.parametrize(
    'value, kind',
    [
        ({}, 'std_msgs/String'),
        ({}, 'os/path'),
        ({'nothing': 1}, 'geometry_msgs/PointStamped'),
        (5, 'geometry_msgs/PointStamped'),
        ({'point': {'x': 'text'}}, 'geometry_msgs/PointStamped'),
        ([], 'geometry_msgs/PointStamped[]'),
        ({}, 'geometry_msgs/PointStamped[]'),
    ],
)
def test_a_value_that_fits_no_message_of_the_question_is_refused(value, kind):
    with pytest.raises(OutputError, match='output a'):
        items(
            [TypedOutput('a', value, kind)],
            goal(userdata={'point': PointStamped(), 'points': [PointStamped()]}),
        )
