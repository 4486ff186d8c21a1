"""What an expert sees of a question, at the width of a terminal."""

import io
import math

import pytest
import rospy
from expert_fixtures import make_question
from rich.console import Console

from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.expert.terminal import render
from smach_oracle.expert.terminal.text import duration, rate_bar, rate_colour
from smach_oracle.msg import OpenQuery
from smach_oracle.oracle.asking.question import OutcomeChoice, StateChoice
from smach_oracle.oracle.records.events import FailureKind
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.ros.expert.question_messages import to_goal

EVIL = '\x1b[31m[bold]x[/bold]\x07\u202e[/]'


def goal(**changes):
    return to_goal(make_question(**changes), '/robot', rospy.Time(1))


def shown(renderable, width=100, colours=False):
    console = Console(
        file=io.StringIO(),
        width=width,
        force_terminal=colours,
        color_system='truecolor' if colours else None,
    )
    console.print(renderable)
    return console.file.getvalue()


def test_what_would_come_again_is_shown_with_the_choice():
    text = shown(
        render.question(
            goal(
                choices=(
                    StateChoice(
                        'DETECT',
                        0.5,
                        1,
                        0,
                        (),
                        (),
                        repeats=('POUR', 'ARM/CUT'),
                        runs_again=('LEFT', 'RIGHT'),
                    ),
                )
            ),
            1.0,
        )
    )
    assert 'repeats: POUR, ARM/CUT' in text
    assert 'runs again: LEFT, RIGHT' in text


@pytest.mark.parametrize('width', [80, 140])
def test_the_whole_question_is_there_and_fits_the_terminal(width):
    text = shown(
        render.question(goal(deadline_s=30.0, userdata={'object': 'mug', 'image': object()}), 12.0),
        width,
    )
    for part in (
        '/robot asks about PICK_AND_PLACE',
        'PICK ended with aborted, which would end PICK_AND_PLACE',
        'no grasp found',
        '80% HIGH · continuous · 2 recoveries so far',
        'asked 12 s ago',
        'asked because the failure rate of PICK is HIGH',
        'tried: revisit PICK',
        'unanswered: PICK_AND_PLACE ends with aborted',
        'DETECT✓ → PICK✗ aborted',
        'missing: grasp',
        'blocked: still running',
        's1  succeeded  → PLACE',
        'with output userdata: grasped',
        'g   end as the failure would have ended PICK_AND_PLACE',
        'g1  succeeded',
        'i1  assist  do it by hand',
        'object  "mug"',
        'image   (object, not sent)',
    ):
        assert part in text, part
    assert all(len(line.rstrip('\n')) <= width for line in text.splitlines())


def test_a_state_that_still_runs_may_be_waited_for():
    text = shown(
        render.question(
            goal(
                failure_kind=FailureKind.STILL_RUNNING,
                outcome='',
                text='PICK still runs after 62 s',
                interfaces=(),
            ),
            1.0,
        )
    )
    for part in (
        'PICK still runs',
        'PICK still runs after 62 s',
        '2   wait on (PICK runs on)',
        'PICK is preempted by every answer but to wait on',
        '1   DETECT',
        'end as a failure would have ended PICK_AND_PLACE',
    ):
        assert part in text, part
    assert 'asked because' not in text


def test_what_is_not_there_takes_no_room():
    text = shown(
        render.question(
            goal(history=(), interfaces=(), supersede_outcomes=(), userdata={}, tried=())
        )
    )
    for heading in ('History', 'interfaces', 'Supersede', 'Userdata', 'tried', 'unanswered'):
        assert heading not in text


@pytest.mark.parametrize(
    'kind, outcome, text',
    [
        (FailureKind.FAILING_OUTCOME, 'failed', 'PICK ended with the failing outcome failed'),
        (FailureKind.EXCEPTION, '', 'PICK raised an exception'),
        (
            FailureKind.UNREGISTERED_OUTCOME,
            '',
            'PICK returned nothing, which is not one of its outcomes',
        ),
        (FailureKind.TIME_LIMIT, '', 'PICK ran over its time limit'),
    ],
)
def test_every_kind_of_failure_has_its_words(kind, outcome, text):
    assert text in shown(render.question(goal(failure_kind=kind, outcome=outcome)))


def test_what_a_robot_sends_cannot_steer_the_terminal():
    evil = goal(
        container_path=EVIL,
        failed_state=EVIL,
        outcome=EVIL,
        text=EVIL + '\n' + EVIL,
        reason=EVIL,
        tried=(EVIL,),
        history=(Visit(EVIL, EVIL, VisitResult.FAILURE),),
        output_keys=(EVIL,),
        fallback=EVIL,
        choices=(StateChoice(EVIL, 0.5, 1, 0, (EVIL,), (EVIL,), EVIL),),
        deadline_s=1.0,
        supersede_outcomes=(OutcomeChoice(EVIL, EVIL),),
        give_up_outcomes=(EVIL,),
        userdata={EVIL: EVIL},
    )
    evil.robot = EVIL
    listed = ListedQuestion('/s', evil, OpenQuery.CLAIMED, EVIL, 0.0, math.inf)
    for text in (shown(render.question(evil), 400), shown(render.overview([listed], 1.0), 400)):
        assert '\x1b' not in text and '\x07' not in text and '\u202e' not in text
        assert '[bold]x[/bold]' in text, 'markup is shown, not obeyed'


def test_head_and_tail_of_a_long_traceback_and_the_end_of_a_long_history_are_shown():
    visits = tuple(Visit('S{}'.format(number), 'ok', VisitResult.SUCCESS) for number in range(30))
    text = shown(
        render.question(
            goal(text='\n'.join('line {}.'.format(number) for number in range(50)), history=visits)
        )
    )
    assert 'line 0.' in text and 'line 2.' in text and 'line 3.' not in text
    assert 'line 49.' in text and 'line 41.' in text and 'line 40.' not in text
    assert '… → S18✓' in text and 'S17' not in text


def test_rates_go_from_green_to_red_without_a_step():
    channels = [
        (int(rate_colour(rate)[1:3], 16), int(rate_colour(rate)[3:5], 16))
        for rate in (0.0, 0.25, 0.5, 0.75, 1.0)
    ]
    (red_at_0, green_at_0), (red_at_1, green_at_1) = channels[0], channels[-1]
    assert green_at_0 > 150 > 50 > red_at_0 and red_at_1 > 150 > 50 > green_at_1
    assert [red for red, _ in channels] == sorted(red for red, _ in channels)
    assert [green for _, green in channels] == sorted(
        (green for _, green in channels), reverse=True
    )
    assert len({rate_colour(number / 50.0) for number in range(51)}) == 51


def test_colours_reach_the_terminal():
    text = shown(render.question(goal()), colours=True)
    red, green = (int(rate_colour(0.8)[1:3], 16), int(rate_colour(0.8)[3:5], 16))
    assert '38;2;{};{}'.format(red, green) in text


@pytest.mark.parametrize(
    'rate, text', [(0.0, '░░░░   0%'), (0.5, '██░░  50%'), (1.0, '████ 100%'), (1.7, '████ 170%')]
)
def test_a_bar_is_as_long_as_its_rate(rate, text):
    assert rate_bar(rate, 4).plain == text


def test_the_list_of_questions_shows_who_works_on_what_and_the_time_left():
    other = goal()
    other.interface = 'assist'
    text = shown(
        render.overview(
            [
                ListedQuestion('/s', goal(), OpenQuery.CLAIMED, 'bob', 10.0, 160.0),
                ListedQuestion('/s', other, OpenQuery.INTERFACE_RUNNING, '', 10.0, math.inf),
            ],
            55.0,
        )
    )
    first, second = text.strip().splitlines()[-2:]
    for part in ('1', '/robot', 'PICK_AND_PLACE/PICK', '80%', '45 s', '1:45 min', 'bob'):
        assert part in first
    assert 'interface assist' in second


def test_numbers_that_are_none_end_no_terminal():
    choice = StateChoice('DETECT', math.nan, 1, 2, (), (), helped=1, tried=0, helped_s=math.inf)
    text = shown(render.question(goal(rate=math.nan, choices=(choice,)), math.inf))
    assert 'asked ? ago' in text and 'nan%' in text


@pytest.mark.parametrize(
    'seconds, text', [(-3, '0 s'), (59.9, '59 s'), (125, '2:05 min'), (5400, '1:30 h')]
)
def test_durations_are_read_by_people(seconds, text):
    assert duration(seconds) == text
