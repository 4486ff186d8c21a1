"""A conversation at the terminal, typed key by key into a pipe, with a front end that plays the
rest of the world.
"""

import io
import json
import math
import time
from functools import partial

import pytest
import rospy
from expert_fixtures import make_question
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput
from rich.console import Console
from typist import CTRL_C, CTRL_D, CTRL_U, ENTER, typist
from waiting import stays

from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.expert.terminal import terminal
from smach_oracle.expert.terminal.precondition_status import PreconditionStatusListener
from smach_oracle.expert.terminal.prompts import PromptInterrupted, Prompts
from smach_oracle.expert.terminal.terminal import Terminal
from smach_oracle.msg import (
    ExpertDecision,
    OpenQuery,
    OracleEvent,
    PreconditionCheck,
    PreconditionChecks,
)
from smach_oracle.oracle.settings.interfaces import InterfaceOffer
from smach_oracle.ros.expert.open_questions import OpenQuestions
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.srv import AnswerQueryResponse, ClaimQueryResponse

ASKS, WAITING = '/robot asks about PICK_AND_PLACE', 'No open questions; waiting.'


class FakeFrontEnd:
    """Questions that a test opens and settles; what is asked of it is kept."""

    def __init__(self, *goals):
        self.expert = 'ann'
        self.servers = ['/robot/expert_query']
        self.listed = [
            ListedQuestion(
                '/robot/expert_query', goal, OpenQuery.PENDING, '', time.monotonic(), math.inf
            )
            for goal in goals
        ]
        self.settled = {}
        self.decisions = []
        self.refusals = []
        self.claims = []
        self.released = []
        self.stopped = False
        self.alive = True
        self.unreachable = 0  # that many calls of `claim` fail

    def questions(self):
        return [each for each in self.listed if each.key not in self.settled] if self.alive else []

    def find(self, key):
        return next((each for each in self.questions() if each.key == key), None)

    def wait_for_change(self, version, timeout_s):
        time.sleep(min(timeout_s, 0.01))  # nobody reports changes here, and the caller looks again
        return version

    def connected(self, server):
        return self.alive

    def hold(self, holder):
        self.listed = [
            each._replace(holder=holder, status=OpenQuery.CLAIMED) for each in self.listed
        ]

    def claim(self, listed, take_over=False):
        self.claims.append((listed.goal.query_id, take_over))
        if self.unreachable:
            self.unreachable -= 1
            raise ServerGoneError('unable to contact master')
        if listed.key in self.settled:
            return ClaimQueryResponse(False, self.settled[listed.key], '')
        holder = self.find(listed.key).holder
        if holder not in ('', self.expert) and not take_over:
            return ClaimQueryResponse(False, '{} works on this question'.format(holder), holder)
        self.hold(self.expert)
        return ClaimQueryResponse(True, '', self.expert)

    def release(self, listed):
        self.released.append(listed.goal.query_id)

    def answer(self, listed, decision):
        if self.refusals:
            return AnswerQueryResponse(False, self.refusals.pop(0), ExpertDecision())
        self.decisions.append(decision)
        self.settled[listed.key] = 'ann was first'
        return AnswerQueryResponse(True, '', decision)

    def stop(self):
        self.stopped = True


class FakeSteps:
    """What the robot does next, as a test wants it."""

    events = [
        OracleEvent(kind=OracleEvent.JUMP, target='DETECT'),
        OracleEvent(kind=OracleEvent.STATE_START, state='DETECT'),
    ]

    def __init__(self, robot, trial_id):
        self.robot = robot

    def forget(self):
        pass

    def follow(self):
        return iter(self.events)

    def stop(self):
        pass


class FakeStatusListener(PreconditionStatusListener):
    """The robot has looked once at this question."""

    def __init__(self, robot, query_id):
        super().__init__('', query_id)
        looked = [
            PreconditionCheck(
                'PICK', 'view_is_clear', PreconditionCheck.DOES_NOT_HOLD, '\x1b[31mdark', 1.0
            ),
            PreconditionCheck(
                'PICK', 'DETECT', PreconditionCheck.UNKNOWN, 'only running it would tell', -1.0
            ),
            PreconditionCheck('PLACE', 'free', PreconditionCheck.HOLDS, 'yes', 65.0),
        ]
        self.take(PreconditionChecks(query_id='another', checks=[]))
        if query_id == 'q1':
            self.take(PreconditionChecks(query_id=query_id, checks=looked))


def goal(query_id='q1', **changes):
    return to_goal(make_question(query_id, **changes), '/robot', rospy.Time(1))


def converse(front_end, typed, *script, steps=FakeSteps):
    """Type all that into a terminal; what it has shown when it ends."""
    console = Console(file=io.StringIO(), width=100)
    with typist(console.file.getvalue, typed, script) as keys:
        Terminal(
            front_end,
            console,
            Prompts(keys, DummyOutput()),
            steps,
            preconditions=FakeStatusListener,
        ).run()
    return console.file.getvalue()


def test_how_the_preconditions_stand_now_is_told_on_request():
    shown = converse(FakeFrontEnd(goal()), 'p' + ENTER + 'q' + ENTER)
    assert '✗ view_is_clear of PICK does not hold (1 s ago): ' in shown
    assert '\x1b[31mdark' not in shown
    assert '? DETECT of PICK unknown: only running it would tell' in shown
    assert '✓ free of PLACE holds (1:05' in shown
    assert 'The robot does not publish their status.' in converse(
        FakeFrontEnd(goal('q2')), 'p' + ENTER + 'q' + ENTER
    )


def test_an_answer_by_number_is_sent_with_its_reason_and_what_followed_is_told():
    front_end = FakeFrontEnd(goal())
    shown = converse(front_end, '1' + ENTER + 'seen on the camera' + ENTER + 'q' + ENTER)
    (decision,) = front_end.decisions
    assert (decision.kind, decision.state, decision.why) == (
        ExpertDecision.GOTO,
        'DETECT',
        'seen on the camera',
    )
    assert front_end.claims[0] == ('q1', False) and front_end.stopped
    for part in (
        ASKS,
        '✓ The robot has your answer.',
        'The machine goes to DETECT.',
        'DETECT runs.',
        WAITING,
    ):
        assert part in shown


def test_superseding_asks_for_the_output_userdata_as_json():
    front_end = FakeFrontEnd(goal(output_keys=('grasped', 'grip', 'unused')))
    converse(front_end, ENTER.join(['s1', '{"name": "mug"}', '0.02', '', '', 'q', '']))
    (decision,) = front_end.decisions
    assert (decision.kind, decision.outcome) == (ExpertDecision.SUPERSEDE, 'succeeded')
    assert {item.key: json.loads(bytes(item.value)) for item in decision.outputs} == {
        'grasped': {'name': 'mug'},
        'grip': 0.02,
    }


def test_what_cannot_be_understood_or_is_refused_is_told_and_asked_again():
    front_end = FakeFrontEnd(goal())
    front_end.refusals = ['PICK_AND_PLACE has no state']
    shown = converse(front_end, ENTER.join(['x', 'PLACE', '1', '', 'g', 'enough', 'q', '']))
    assert "'x' is no answer here" in shown
    assert 'PLACE cannot be entered now' in shown
    assert 'Refused: PICK_AND_PLACE has no state' in shown
    assert [(decision.kind, decision.why) for decision in front_end.decisions] == [
        (ExpertDecision.GIVE_UP, 'enough')
    ]


@pytest.mark.parametrize('key', [CTRL_C, CTRL_D])
def test_leaving_the_program_gives_the_claim_back(key):
    front_end = FakeFrontEnd(goal())
    assert 'Good-bye' in converse(front_end, key)
    assert front_end.released == ['q1'] and front_end.stopped and not front_end.decisions


def test_ctrl_c_at_the_reason_sends_nothing_and_asks_again():
    front_end = FakeFrontEnd(goal())
    shown = converse(front_end, '1' + ENTER + 'no' + CTRL_C + 'q' + ENTER)
    assert 'Not sent.' in shown and not front_end.decisions


def test_ctrl_c_after_an_answer_does_not_call_it_unsent():
    class Interrupting(FakeSteps):
        def follow(self):
            raise KeyboardInterrupt

    front_end = FakeFrontEnd(goal())
    shown = converse(front_end, ENTER.join(['1', '', '']), steps=Interrupting)
    assert len(front_end.decisions) == 1
    assert 'Not sent.' not in shown and 'Good-bye' in shown


def test_a_question_that_cannot_be_claimed_yet_is_shown_once_and_claimed_later():
    front_end = FakeFrontEnd(goal())
    front_end.unreachable = 3
    shown = converse(
        front_end, '', (lambda: not front_end.unreachable, ENTER.join(['1', '', 'q', '']))
    )
    assert shown.count('unable to contact master') == 1
    assert shown.count('/robot asks about PICK_AND_PLACE') == 1
    assert front_end.unreachable == 0 and len(front_end.decisions) == 1


def test_a_question_settled_elsewhere_ends_the_typing():
    front_end = FakeFrontEnd(goal())

    def bob_answers():
        front_end.settled[front_end.listed[0].key] = 'bob was first: go to PICK'

    shown = converse(front_end, 'goto DET', (ASKS, bob_answers), (WAITING, CTRL_U + 'q' + ENTER))
    assert 'bob was first: go to PICK' in shown and not front_end.decisions
    assert 'No open questions; waiting.' in shown


def test_a_question_that_a_restarted_server_does_not_know_is_waited_for():
    front_end = FakeFrontEnd(goal())
    key = front_end.listed[0].key

    def server_restarts():
        front_end.settled[key] = OpenQuestions().claim(1, 'q1', 'ann').message
        front_end.claims.clear()

    def robot_asks_again():
        front_end.settled.clear()
        front_end.hold('')

    shown = converse(
        front_end,
        '',
        (ASKS, server_restarts),
        (lambda: len(front_end.claims) > 3, robot_asks_again),
        (ASKS, ENTER.join(['1', '', 'q', ''])),
    )
    assert 'there is no question' not in shown and len(front_end.decisions) == 1


def test_a_robot_that_dies_is_waited_for_only_so_long(monkeypatch):
    monkeypatch.setattr(terminal, '_RETURN_S', 0.2)
    front_end = FakeFrontEnd(goal())

    def robot_dies():
        front_end.alive = False

    shown = converse(front_end, '', (ASKS, robot_dies), (WAITING, 'q' + ENTER))
    assert '/robot/expert_query is gone.' in shown
    assert shown.index('is gone.') < shown.index('No open questions; waiting.')


def test_a_question_taken_over_by_another_is_told_and_can_be_taken_back():
    front_end = FakeFrontEnd(goal())
    taken = 'bob has taken this question over.'
    shown = converse(
        front_end,
        '',
        (ASKS, lambda: front_end.hold('bob')),
        (taken, ENTER.join(['1', 't', '1', '', 'q', ''])),
    )
    assert taken in shown
    assert 'bob works on this question; t takes it over.' in shown
    assert front_end.claims[-1] == ('q1', True) and len(front_end.decisions) == 1


def test_of_several_questions_one_is_picked_by_its_number():
    front_end = FakeFrontEnd(goal('q1'), goal('q2', failed_state='OPEN_FRIDGE'))
    shown = converse(front_end, ENTER.join(['7', '²', '2', '1', '', 'q', '']))
    assert "'7' is not one of 1 to 2" in shown and "'²' is not one of 1 to 2" in shown
    assert 'PICK_AND_PLACE/OPEN_FRIDGE' in shown
    assert front_end.claims[0] == ('q2', False)


def test_who_has_left_the_terminal_keeps_no_question_from_others(monkeypatch):
    monkeypatch.setattr(terminal, 'IDLE_S', 1.0)
    front_end, untouched = FakeFrontEnd(goal()), []
    shown = converse(
        front_end,
        'r' + ENTER,
        ('the question is left to others', lambda: front_end.listed.clear()),
        (WAITING, lambda: front_end.listed.extend(FakeFrontEnd(goal('q2')).listed)),
        # the terminal has this one on its list, and takes it only from the one who comes back
        ('', lambda: untouched.append(stays(lambda: len(front_end.claims) == 1, 0.6))),
        ('', '1' + ENTER),
        (lambda: ('q2', False) in front_end.claims, 'q' + ENTER),
    )
    assert 'No key was pressed for 1 s: the question is left to others.' in shown
    assert front_end.claims == [('q1', False), ('q2', False)]
    assert untouched == [True] and front_end.released == ['q1', 'q2']


def test_a_question_left_to_others_is_offered_again_but_not_opened_by_itself():
    front_end = FakeFrontEnd(goal())
    shown = converse(front_end, ENTER.join(['l', 'q', '']))
    assert front_end.released == ['q1'] and not front_end.decisions
    assert 'PICK_AND_PLACE/PICK' in shown.split('answer')[-1]


def test_a_question_that_comes_while_waiting_is_shown_at_once(monkeypatch):
    monkeypatch.setattr(terminal, '_FIRST_LIST_S', 0.05)
    front_end = FakeFrontEnd()

    def arrives():
        front_end.listed = FakeFrontEnd(goal()).listed

    shown = converse(front_end, '', (WAITING, arrives), (ASKS, 'q' + ENTER))
    assert shown.index(WAITING) < shown.index(ASKS)


def test_a_robot_without_events_is_said_to_be_silent():
    class Silent(FakeSteps):
        events = []

    shown = converse(FakeFrontEnd(goal()), ENTER.join(['1', '', 'q', '']), steps=Silent)
    assert 'no events on /robot/oracle/events' in shown


def test_a_prompt_ends_when_what_it_asks_about_is_over():
    with create_pipe_input() as keys:
        with pytest.raises(PromptInterrupted, match='over'):
            Prompts(keys, DummyOutput()).ask('? ', lambda: 'bar', lambda: 'over')


class FakeInterface:
    """An interface that runs until it is finished or given up."""

    def __init__(self, front_end):
        self.front_end = front_end
        self.done = []

    def __call__(self, listed, name):
        self.front_end.running, self.name = listed, name
        return self

    def end(self, *what):
        self.done.append(what)
        self.front_end.running = None
        return ''

    def finish(self, outcome, text):
        return 'the gripper is empty' if text == 'too early' else self.end('finish', outcome, text)

    def give_up(self, text):
        return self.end('give up', text)

    def lines(self):
        return ['started', 'Now do the work of PICK']

    def status_line(self):
        return 'right hand stands'

    def follow_hand(self):
        pass

    def stop(self):
        self.done.append('stopped')


class WithAnInterface(FakeFrontEnd):
    """Its question's interface runs once it was chosen."""

    running = None
    seen_running = False

    def find(self, key):
        if self.running is not None and key in self.settled:
            self.seen_running = True
            return self.running._replace(status=OpenQuery.INTERFACE_RUNNING)
        return super().find(key)


def talk(typed, *script):
    front_end = WithAnInterface(goal(interfaces=(InterfaceOffer('assist', '/assist'),)))
    interface = FakeInterface(front_end)
    console = Console(file=io.StringIO(), width=100)
    with typist(
        console.file.getvalue,
        ENTER.join(typed),
        [
            (
                partial(awaited, front_end) if callable(awaited) else awaited,
                partial(then, front_end) if callable(then) else then,
            )
            for awaited, then in script
        ],
    ) as keys:
        Terminal(front_end, console, Prompts(keys, DummyOutput()), FakeSteps, interface).run()
    return front_end, interface, console.file.getvalue()
