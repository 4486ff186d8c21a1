"""Borders of services, actions and topics: messages with fields of any value."""

import json
from typing import Any, Callable, List
from unittest import mock

import genpy
from expert_fixtures import make_question
from hypothesis import strategies as st

from smach_common.introspection.plain_pickle import RefusedDataError, decode_userdata
from smach_msgs.msg import (
    SmachContainerInitialStatusCmd,
    SmachContainerStatus,
    SmachContainerStructure,
)
from smach_oracle.expert.console.feeds.told_trials import told_trials
from smach_oracle.expert.console.feeds.views import event_of
from smach_oracle.expert.console.robots.followed_robot import FollowedRobot
from smach_oracle.expert.console.trials.trial_log import TrialLog
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.interfaces.interface_goal import FinishServices, InterfaceGoal
from smach_oracle.msg import (
    ControlStatus,
    ExpertDecision,
    ExpertQueryGoal,
    ExpertQueryResult,
    NodeTrials,
    OracleEvent,
    OracleRates,
    SharedAutonomyGoal,
    SharedAutonomyResult,
    UserdataItem,
)
from smach_oracle.oracle.asking.question import AnswerKind
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.ros.expert import client, server
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.ros.hand import hand_server
from smach_oracle.ros.userdata_codec import UserdataCodecError, decode
from smach_oracle.srv import (
    AnswerQueryRequest,
    ClaimQueryRequest,
    CommandMachineRequest,
    FinishInterfaceRequest,
    GiveUpInterfaceRequest,
    SendMachineRequest,
    SetAutonomyRequest,
    SetBreakpointRequest,
)

from .border import BOTH, REFUSED, TAKEN, Border, refused
from .fake_ros import FakeHandle, fake_ros
from .json_texts import json_texts, no_number, pickles
from .kitchen_machine import kitchen_at_hand
from .values import message, words

_ids = words('q1', 'q2', '')
_people = words('eva', 'ann', '')
_item = message(
    UserdataItem,
    {
        'key': words('grasped', 'object'),
        'encoding': st.sampled_from((1, 2, 3, 4)),
        'type': words('', 'geometry_msgs/Point', 'std_msgs/String'),
        'md5sum': words('', '4a842b65f413084dc2b10fb484ea7f17', '992ce8a1687cec8c8bd883ec73ca41d1'),
        'value': st.one_of(json_texts.map(str.encode), st.binary(max_size=24)),
    },
)
_items = st.lists(_item, max_size=2)
_decisions = message(
    ExpertDecision,
    {
        'kind': st.sampled_from((1, 2, 3, 4)),
        'state': words('DETECT', 'PICK', 'PLACE'),
        'outcome': words('succeeded', 'aborted', ''),
        'interface': words('assist'),
        'container': words('', 'PICK_AND_PLACE'),
        'outputs': st.one_of(st.just([]), _items),
        'by': _people,
    },
)
_deadlines = st.sampled_from((0.0, 5.0, 1e308))


def _told(reply: Any) -> str:
    """The end by a service's answer, which has `ok` and `message`."""
    return TAKEN if reply.ok else refused(reply.message)


def _questions() -> Any:
    """A question server with the question q1 open."""
    made = server.ExpertQueryServer('~expert_query')
    made._action.on_goal(FakeHandle(to_goal(make_question(), '/robot', genpy.Time(1))))
    return made


def _with_questions(work: Callable[[Any, Any], str]) -> str:
    with fake_ros() as offered:
        made = _questions()
        try:
            return work(made, offered)
        finally:
            made.stop()


def _take_query(goal: ExpertQueryGoal) -> str:
    def work(made: Any, offered: Any) -> str:
        handle = FakeHandle(goal)
        made._action.on_goal(handle)
        assert handle.accepted or handle.end == 'rejected'
        made._action.on_cancel(handle)
        return TAKEN if handle.accepted else refused(handle.text)

    return _with_questions(work)


def _take_claim(request: ClaimQueryRequest) -> str:
    return _with_questions(
        lambda made, offered: _told(offered.call('~expert_query/claim', request))
    )


def _take_answer(request: AnswerQueryRequest) -> str:
    return _with_questions(
        lambda made, offered: _told(offered.call('~expert_query/answer', request))
    )


def _take_result(result: ExpertQueryResult) -> str:
    event = mock.Mock(result=result, status=3)
    with fake_ros():
        try:
            answer = client._answer_of(event)
        except AnswerError as err:
            return refused(err)
    if answer is None:
        assert result.status != ExpertQueryResult.ANSWERED
        return REFUSED
    assert isinstance(answer.kind, AnswerKind)
    return TAKEN


def _take_handed_over(result: SharedAutonomyResult) -> str:
    with fake_ros():
        try:
            client._to_supersede(result)
        except AnswerError as err:
            return refused(err)
    return TAKEN


# -- an operator's hand


def _hand(service: str) -> Callable[[Any], str]:
    def take(request: Any) -> str:
        with kitchen_at_hand() as (offered, _):
            return _told(offered.call('~oracle/' + service, request))

    return take


_paths = words('', 'task', 'task/KITCHEN', '/task/', 'other')
_states = words('A', 'LOOK', 'KITCHEN/LOOK', 'ORACLE')
_HAND = {
    **{
        name: message(CommandMachineRequest, {'path': _paths, 'by': _people})
        for name in hand_server.TREE_COMMANDS + hand_server.PLACE_COMMANDS
    },
    'go_to': message(SendMachineRequest, {'path': _paths, 'state': _states, 'by': _people}),
    'breakpoint': message(
        SetBreakpointRequest,
        {'path': _paths, 'pattern': words('A', '*', 'KITCHEN/*'), 'by': _people},
    ),
    'autonomy': message(
        SetAutonomyRequest,
        {
            'path': _paths,
            'pattern': words('A', '*'),
            'level': words('run', 'announce', 'confirm'),
            'by': _people,
        },
    ),
}


# -- interfaces

_goals = message(
    SharedAutonomyGoal,
    {
        'query_id': _ids,
        'state': words('PICK', ''),
        'outcomes': st.lists(words('succeeded'), max_size=2),
        'output_keys': st.lists(words('grasped'), max_size=2),
    },
)


def _with_interface(goal: SharedAutonomyGoal, work: Callable[[Any, Any], str]) -> str:
    with fake_ros() as offered:
        made = InterfaceGoal('hand', lambda goal: None, lambda: None)
        FinishServices(made, lambda outcome, given: {'grasped': 'mug'})
        handle = FakeHandle(goal)
        made._action.on_goal(handle)
        return work(handle, offered)


def _take_goal(goal: SharedAutonomyGoal) -> str:
    return _with_interface(
        goal, lambda handle, offered: TAKEN if handle.accepted else refused(handle.text)
    )


_PICK = SharedAutonomyGoal(
    query_id='q1',
    state='PICK',
    outcomes=['succeeded', 'aborted'],
    output_keys=['grasped', 'object'],
)


def _take_finish(request: Any) -> str:
    def work(handle: Any, offered: Any) -> str:
        name = '~finish' if isinstance(request, FinishInterfaceRequest) else '~give_up'
        end = _told(offered.call(name, request))
        assert (end == TAKEN) == bool(handle.end), 'a goal that is refused stays open'
        return end

    return _with_interface(_PICK, work)


# -- topics

_events = message(
    OracleEvent,
    {
        'kind': st.integers(0, 40),
        'trial_id': words('t'),
        'seq': st.integers(0, 9),
        'path': words('task'),
        'state': words('A'),
        'data': json_texts,
    },
)


def _take_events(events: List[OracleEvent]) -> str:
    log, robot = TrialLog(), FollowedRobot('/robot')
    for event in events:
        log.add('/robot', event_of(event))
        robot.on_event(event)
        _shown([json.loads(each) for each in log.events(event.trial_id, 0)])
    _shown(log.overview())
    return _written(robot)


def _take_trials(told: NodeTrials) -> str:
    log = TrialLog()
    log.take_told('/robot', told_trials(told))
    _shown(log.overview())
    return TAKEN


def _shown(*views: Any) -> None:
    for each in views:
        json.dumps(each, allow_nan=False)


def _written(robot: FollowedRobot) -> str:
    sections = PageSections()
    robot.write_sections(sections, mock.Mock(find=lambda *_: None))
    for _, text in sections.since(0)[1]:
        json.loads(text, parse_constant=no_number)
    return TAKEN


def _robot(handler: str) -> Callable[[Any], str]:
    def take(given: Any) -> str:
        robot = FollowedRobot('/robot')
        getattr(robot, handler)(given)
        return _written(robot)

    return take


def _take_wish(command: SmachContainerInitialStatusCmd) -> str:
    try:
        found = decode_userdata(command.local_data)
    except RefusedDataError as err:
        return refused(err, 'local_data')
    assert isinstance(found, dict)
    return TAKEN


def _take_item(item: UserdataItem) -> str:
    try:
        decode(item)
    except UserdataCodecError as err:
        return refused(err, repr(item.key))
    return TAKEN


BORDERS = [
    Border(
        'action ExpertQuery: goal',
        message(
            ExpertQueryGoal,
            {
                'query_id': words('q2', 'q3', ''),
                'deadline': _deadlines,
                'interface': words('', 'assist'),
            },
        ),
        _take_query,
    ),
    Border(
        'action ExpertQuery: result',
        message(
            ExpertQueryResult,
            {'status': st.just(ExpertQueryResult.ANSWERED), 'decision': _decisions},
        ),
        _take_result,
    ),
    Border(
        'service ClaimQuery',
        message(
            ClaimQueryRequest,
            {
                'action': st.sampled_from((1, 2, 3, 4)),
                'query_id': _ids,
                'expert': _people,
                'lease': _deadlines,
            },
        ),
        _take_claim,
    ),
    Border(
        'service AnswerQuery',
        message(AnswerQueryRequest, {'query_id': _ids, 'decision': _decisions}),
        _take_answer,
    ),
    *[
        Border(
            'service ' + name,
            given,
            _hand(name),
            (  # the machine does not run
                (REFUSED,) if name in hand_server.PLACE_COMMANDS else BOTH
            ),
        )
        for name, given in sorted(_HAND.items())
    ],
    Border('action SharedAutonomy: goal', _goals, _take_goal),
    Border(
        'action SharedAutonomy: result',
        message(SharedAutonomyResult, {'outputs': _items}),
        _take_handed_over,
    ),
    Border(
        'service FinishInterface',
        message(
            FinishInterfaceRequest,
            {'query_id': _ids, 'outcome': words('succeeded'), 'outputs': _items},
        ),
        _take_finish,
    ),
    Border(
        'service GiveUpInterface', message(GiveUpInterfaceRequest, {'query_id': _ids}), _take_finish
    ),
    Border(
        'topic OracleEvent, console',
        st.lists(_events, min_size=1, max_size=4),
        _take_events,
        (TAKEN,),
    ),
    Border('topic OracleRates, console', message(OracleRates), _robot('on_rates'), (TAKEN,)),
    Border('topic NodeTrials, console', message(NodeTrials), _take_trials, (TAKEN,)),
    Border('topic ControlStatus, console', message(ControlStatus), _robot('on_control'), (TAKEN,)),
    Border(
        'topic SmachContainerStructure',
        message(SmachContainerStructure),
        _robot('on_structure'),
        (TAKEN,),
    ),
    Border(
        'topic SmachContainerStatus', message(SmachContainerStatus), _robot('on_status'), (TAKEN,)
    ),
    Border(
        'topic SmachContainerInitialStatusCmd',
        message(SmachContainerInitialStatusCmd, {'local_data': pickles}),
        _take_wish,
    ),
    Border('message UserdataItem', _item, _take_item),
]
