"""What a browser may say to the console: a closed set, every bit of it checked."""

import json

import pytest

from smach_oracle.expert.console.commands.checks import TypedOutput
from smach_oracle.expert.console.commands.commands import (
    COMMANDS,
    MOST_BYTES,
    CommandError,
    needed_role,
    parse,
)


def text(**fields):
    return json.dumps(dict({'id': 1}, **fields))


STROKE = {'foreground': True, 'width': 5, 'points': [[3, 4]]}
MARK = {
    'do': 'mark',
    'question': 'q',
    'stamp': '12.000000034',
    'region': [[0, 0], [9, 0], [9, 9.5]],
    'strokes': [STROKE],
}
ANSWER = {'do': 'answer', 'question': 'q', 'kind': 'goto', 'name': 'PICK'}


def test_an_answer_is_taken_apart():
    command = parse(
        text(**ANSWER, outputs=[{'key': 'grasp', 'value': [1, {'a': None}]}], why='it slipped')
    )
    assert (command.number, command.name) == (1, 'answer')
    assert command.arguments == {
        'question': 'q',
        'kind': 'goto',
        'name': 'PICK',
        'container': '',
        'why': 'it slipped',
        'outputs': [TypedOutput('grasp', [1, {'a': None}], '')],
        'seen': None,
    }
    assert parse(text(**ANSWER, seen=12.5)).arguments['seen'] == 12.5


def test_a_mark_is_taken_apart():
    info = parse(text(**MARK)).arguments
    assert (info['stamp'].secs, info['stamp'].nsecs) == (12, 34)
    assert info['region'] == [(0.0, 0.0), (9.0, 0.0), (9.0, 9.5)]
    assert info['strokes'] == [(True, 5.0, [(3.0, 4.0)])]


def test_what_is_left_out_is_empty():
    assert parse(text(**ANSWER)).arguments['outputs'] == []


@pytest.mark.parametrize(
    'message',
    [
        '',
        'null',
        '[]',
        '{',
        '1',
        '"x"',
        b'{"id": 1}',
        '{"id": 1, "do": "claim", "question": NaN}',
        '{"id": 1, "do": "answer", "outputs": [1e999]}',
        '[' * 60000,
        'x' * (MOST_BYTES + 1),
        text(),
        text(do=None),
        text(do='publish'),
        text(do='__class__'),
        text(do=['claim']),
        text(do={'claim': 1}),
        text(do='claim'),
        text(do='claim', question=''),
        text(do='claim', question=5),
        text(do='claim', question='q', topic='/cmd_vel'),
        text(do='claim', question='q\u0000'),
        text(do='claim', question='q' * 1001),
        json.dumps({'do': 'claim', 'question': 'q'}),
        text(id=0, do='claim', question='q'),
        text(id=True, do='claim', question='q'),
        text(id=1.5, do='claim', question='q'),
        text(id=2**60, do='claim', question='q'),
        text(**dict(ANSWER, kind='shell')),
        text(**dict(ANSWER, kind=None)),
        text(**dict(ANSWER, kind=['goto'])),
        text(**dict(ANSWER, name=7)),
        text(**ANSWER, outputs={}),
        text(**ANSWER, outputs=[1]),
        text(**ANSWER, outputs=[{'key': 'a'}]),
        text(**ANSWER, outputs=[{'key': 'a', 'value': 1, 'pickle': 'x'}]),
        text(**ANSWER, outputs=[{'key': 'a', 'value': 1}] * 2),
        text(**ANSWER, outputs=[{'key': str(number), 'value': 1} for number in range(65)]),
        text(**ANSWER, outputs=[{'key': 'a', 'value': json.loads('[' * 40 + ']' * 40)}]),
        text(**ANSWER, outputs=[{'key': 'a', 'value': 1e999}]).replace('Infinity', '1e999'),
        text(**dict(MARK, stamp='now')),
        text(**dict(MARK, stamp='99999999999.000000000')),
        text(**dict(MARK, stamp=5)),
        text(**dict(MARK, region=[[0, 0], [1, 1]])),
        text(**dict(MARK, region=[[0, 0]] * 2001)),
        text(**dict(MARK, region=[[0, 0], [1, 1], [2, '3']])),
        text(**dict(MARK, region=[[0, 0], [1, 1], [2, 1e9]])),
        text(**dict(MARK, region=[[0, 0], [1, 1], [2, True]])),
        text(**dict(MARK, region=[[0, 0, 0]] * 3)),
        text(**dict(MARK, region={'x': 1})),
        text(**dict(MARK, strokes=None)),
        text(**dict(MARK, strokes=[STROKE] * 65)),
        text(**dict(MARK, strokes=[dict(STROKE, foreground=1)])),
        text(**dict(MARK, strokes=[dict(STROKE, width=0)])),
        text(**dict(MARK, strokes=[dict(STROKE, points=[])])),
        text(**dict(MARK, strokes=[dict(STROKE, topic='/x')])),
        text(**dict(MARK, service='/shutdown')),
        text(**dict(MARK, action='/perception_interface')),
        text(do='use_frame', question='q'),
        text(do='use_frame', question='q', frame='/camera'),
        text(do='hand_over', question='q'),
        text(do='hand_over', question='q', outcome=''),
        text(do='hand_over', question='q', outcome='done', outputs=[{'key': 'a'}]),
        text(do='give_up_interface'),
        text(do='give_up_interface', question='q', outputs=[]),
        text(do='drop_stored', down='robot.db#1'),
        text(do='drop_stored', moment=3),
        text(do='drop_stored', down='robot.db#1', moment=-1),
        text(do='drop_stored', down='robot.db#1', moment='3'),
        text(do='drop_stored', down='robot.db#1', moment=3, store='/etc/passwd'),
        text(do='goto_stored', down='robot.db#1', moment=3, label=''),
        text(do='goto_stored', down='robot.db#1', moment=3, label=['A']),
        text(do='edit_stored', down='robot.db#1', moment=3, container='TASK', key='', json='1'),
        text(do='edit_stored', down='robot.db#1', moment=3, container='TASK', key='cups', json=1),
        text(do='hello', xsrf='x', expert='\u202egro.live'),
        text(do='hello', xsrf='', expert='ann'),
        text(do='hello', xsrf='x', expert='a' * 61),
    ],
)
def test_anything_else_is_refused_with_a_reason(message):
    with pytest.raises(CommandError) as error:
        parse(message)
    assert 0 < len(str(error.value)) < 500


def test_the_refusal_carries_the_number_so_that_the_page_knows_what_was_refused():
    with pytest.raises(CommandError) as error:
        parse(text(do='nothing'))
    assert error.value.number == 1


def test_halves_of_surrogate_pairs_do_not_get_to_the_wire():
    question = parse('{"id": 1, "do": "claim", "question": "\\ud800"}').arguments['question']
    assert question.encode('utf-8') == b'?'


def test_viewers_may_only_look_and_stop():
    assert {name for name in COMMANDS if needed_role(name) == 'viewer'} == {
        'hello',
        'watch',
        'look',
        'view',
        'leave_wheel',
        'stop_hand',
        'stop_machine',
        'pause_machine',
        'stop_robots',
        'pause_robots',
    }
    assert {needed_role(name) for name in COMMANDS} == {'viewer', 'operator', 'teleoperator'}
    assert {name for name in COMMANDS if needed_role(name) == 'teleoperator'} == {
        'take_wheel',
        'drive',
    }


def test_no_command_names_a_topic_a_service_or_a_type():
    fields = {field for spec in COMMANDS.values() for field in spec.checks}
    assert fields == {
        'xsrf',
        'expert',
        'trial',
        'at',
        'question',
        'kind',
        'name',
        'outputs',
        'why',
        'stamp',
        'region',
        'strokes',
        'frame',
        'outcome',
        'held',
        'linear',
        'angular',
        'gripper',
        'sent',
        'arm',
        'container',
        'seen',
        'robot',
        'robots',
        'path',
        'pattern',
        'remove',
        'down',
        'moment',
        'label',
        'key',
        'json',
        'text',
        'note',
    }


def test_robots_to_stop_are_a_list_of_names_and_none_means_all():
    assert parse(text(do='stop_robots', robots=[])).arguments == {'robots': []}
    assert parse(text(do='pause_robots', robots=['/a', '/b'])).arguments['robots'] == ['/a', '/b']
    for wrong in (None, '/a', {}, [''], [1], ['/a'] * 201, ['x' * 401], [['/a']]):
        with pytest.raises(CommandError):
            parse(text(do='stop_robots', robots=wrong))
