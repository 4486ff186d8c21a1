"""State graphs: what dot is told, what is read back, how the page is told."""

import shutil
import threading

import pytest

from smach_oracle.analysis.graphs.container_graph import (
    GraphEdge,
    dot_text,
    drawing,
    find_oracle,
    make_structure,
    read_layout,
    shares,
)
from smach_oracle.expert.console.graphs.layout_worker import LayoutWorker

STATES = ['DETECT', 'PICK', 'PLACE']
OUTCOMES = ['succeeded', 'aborted']


def edges(states=STATES, oracle='ORACLE'):
    own = [GraphEdge(one, 'succeeded', two) for one, two in zip(states, states[1:] + ['succeeded'])]
    meta = [GraphEdge(state, 'failure', oracle) for state in states] + [
        GraphEdge(oracle, target, target) for target in states + OUTCOMES
    ]
    return own + (meta if oracle else [])


def structure(states=STATES, oracle='ORACLE'):
    return make_structure(
        'TASK', states + ([oracle] if oracle else []), edges(states, oracle), OUTCOMES
    )


def lay_out(text, **options):
    """Wait for the layout of one graph."""
    layouts, done = LayoutWorker(**options), threading.Event()
    found = layouts.find(text, done.set)
    return found or (done.wait(30.0) and layouts.find(text, done.set))


def test_the_oracle_is_told_by_its_edges_not_by_its_name():
    assert find_oracle(STATES + ['META'], edges(oracle='META')) == 'META'
    assert find_oracle(STATES, edges(oracle='')) == ''
    assert structure().states == tuple(STATES)
    assert all('ORACLE' not in edge for edge in structure().edges)


def test_no_text_of_a_robot_gets_to_dot():
    evil = ['a"];b[label="', 'x\n}digraph{', '<b>', '\\N']
    text = dot_text(
        make_structure('T', evil, [GraphEdge(evil[0], '"]; shape=x', evil[1])], ['"out"'])
    )
    assert not any(part in text for part in ('<b>', '\\N', '};', 'shape=x', 'out', 'digraph{'))
    if shutil.which('dot'):
        assert len(lay_out(text).nodes) == 5


@pytest.mark.skipif(not shutil.which('dot'), reason='Graphviz is not installed')
def test_a_graph_is_laid_out_once_and_drawn_from_top_to_bottom():
    data = drawing(structure(), lay_out(dot_text(structure())), nested=['PICK'])
    assert data['drawn'] and data['oracle'] == 'ORACLE'
    heights = [state['at'][1] for state in data['states']]
    assert heights == sorted(heights) and heights[-1] < min(
        outcome['at'][1] for outcome in data['outcomes']
    )
    assert [state['nested'] for state in data['states']] == [False, True, False]
    assert all(len(edge['points']) >= 10 and edge['label'] for edge in data['edges'])
    assert all(0 <= state['at'][0] <= data['size'][0] for state in data['states'])


def test_sixty_states_that_all_can_fail_and_go_back_are_drawn_too_with_a_place_for_every_label():
    states = ['STATE_{}'.format(number) for number in range(60)]
    made = [
        GraphEdge(one, 'succeeded', two) for one, two in zip(states, states[1:] + ['succeeded'])
    ]
    made += [
        GraphEdge(state, outcome, outcome)
        for state in states
        for outcome in ('aborted', 'preempted')
    ]
    made += [
        GraphEdge(state, 'retry', states[(7 * number) % (number + 1)])
        for number, state in enumerate(states)
    ]
    large = make_structure('TASK', states, made, OUTCOMES + ['preempted'])
    data = drawing(large, lay_out(dot_text(large)), nested=[])
    assert data['drawn'] and all(state['at'] for state in data['states'])
    assert all(edge['points'] and edge['label'] for edge in data['edges'])


@pytest.mark.parametrize('command', ['no_such_dot', 'true', 'false'])
def test_without_a_working_dot_there_is_a_list(command):
    layouts, done = LayoutWorker(command), threading.Event()
    assert layouts.find(dot_text(structure()), done.set) is None
    if shutil.which(command):
        assert done.wait(30.0)
    data = drawing(structure(), layouts.find(dot_text(structure()), done.set), [])
    assert not data['drawn'] and data['states'][0] == {
        'label': 'DETECT',
        'nested': False,
        'at': None,
    }
    assert data['edges'][0] == {
        'from': 'DETECT',
        'outcome': 'succeeded',
        'to': 'PICK',
        'points': [],
        'label': None,
    }


def test_a_dot_that_hangs_is_given_up():
    assert lay_out('x', command='yes', limit_s=0.2) is None


@pytest.mark.parametrize(
    'text', ['', '{}', '[]', '{"bb": "0,0,1"}', '{"bb": "0,0,1,1", "objects": [{"name": "a"}]}']
)
def test_what_is_no_layout_is_refused(text):
    with pytest.raises(ValueError):
        read_layout(text)


def test_a_transition_s_share_is_of_all_that_left_its_state():
    assert shares([('A', 'ok', 'B', 3), ('A', 'failure', 'ORACLE', 1), ('C', 'ok', 'D', 0)]) == [
        ['A', 'ok', 'B', 3, 0.75],
        ['A', 'failure', 'ORACLE', 1, 0.25],
    ]


def test_a_flood_of_states_is_cut_off():
    many = ['S{}'.format(number) for number in range(2000)]
    assert len(make_structure('T', many, edges(many, ''), []).states) == 500
