"""State graphs: what dot is told, what is read back, how the page is told."""

import shutil
import threading

import pytest

from smach_oracle.analysis.graphs.container_graph import (
    MOST_DRAWN,
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


def lay_out(graph, **options):
    """Wait for the layout of one graph."""
    layouts, done = LayoutWorker(**options), threading.Event()
    found = layouts.find(graph, done.set)
    return found or (done.wait(30.0) and layouts.find(graph, done.set))


def test_the_oracle_is_told_by_its_edges_not_by_its_name():
    assert find_oracle(STATES + ['META'], edges(oracle='META')) == 'META'
    assert find_oracle(STATES, edges(oracle='')) == ''
    assert structure().states == tuple(STATES)
    assert all('ORACLE' not in edge for edge in structure().edges)


def test_no_text_of_a_robot_gets_to_dot():
    evil = ['a"];b[label="', 'x\n}digraph{', '<b>', '\\N']
    graph = make_structure('T', evil, [GraphEdge(evil[0], '"]; shape=x', evil[1])], ['"out"'])
    text = dot_text(graph)
    assert not any(part in text for part in ('<b>', '\\N', '};', 'shape=x', 'out', 'digraph{'))
    if shutil.which('dot'):
        assert len(lay_out(graph).nodes) == 5


@pytest.mark.skipif(not shutil.which('dot'), reason='Graphviz is not installed')
def test_a_graph_is_laid_out_once_and_drawn_from_top_to_bottom():
    data = drawing(structure(), lay_out(structure()), nested=['PICK'])
    assert data['drawn'] and data['oracle'] == 'ORACLE'
    heights = [state['at'][1] for state in data['states']]
    assert heights == sorted(heights) and heights[-1] < min(
        outcome['at'][1] for outcome in data['outcomes']
    )
    assert [state['nested'] for state in data['states']] == [False, True, False]
    assert all(len(edge['points']) >= 10 and edge['label'] for edge in data['edges'])
    assert all(0 <= state['at'][0] <= data['size'][0] for state in data['states'])


def sixty_states():
    """All of them can fail, be preempted and be done again."""
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
    return make_structure('TASK', states, made, OUTCOMES + ['preempted'])


@pytest.mark.skipif(not shutil.which('dot'), reason='Graphviz is not installed')
def test_many_ways_to_preempted_are_one_number_and_all_others_are_drawn():
    large = sixty_states()
    data = drawing(large, lay_out(large), nested=[])
    assert data['drawn'] and all(state['at'] for state in data['states'])
    assert data['bundled'] == {'preempted': 60}
    drawn = [edge for edge in data['edges'] if edge['points']]
    assert all(edge['label'] for edge in drawn)
    assert {edge['to'] for edge in data['edges'] if not edge['points']} == {'preempted'}
    assert len(drawn) == len(data['edges']) - 60


def test_a_few_ways_to_preempted_are_drawn():
    states = ['A', 'B']
    made = [GraphEdge(state, 'preempted', 'preempted') for state in states]
    graph = make_structure('TASK', states, made, ['preempted'])
    assert not graph.bundled and graph.drawn_edges() == set(made)


@pytest.mark.parametrize('command', ['no_such_dot', 'true', 'false'])
def test_without_a_working_dot_there_is_a_list(command):
    layouts, done = LayoutWorker(command), threading.Event()
    assert layouts.find(structure(), done.set) is None
    if shutil.which(command):
        assert done.wait(30.0)
    data = drawing(structure(), layouts.find(structure(), done.set), [])
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
    assert lay_out(structure(), command='yes', limit_s=0.1) is None


def test_a_layout_that_took_too_long_has_more_time_the_next_time(tmp_path):
    """It takes half a second, and has 0.2, 0.4 and 0.8 s. Another one does not wait for it."""
    command = tmp_path / 'slow_dot'
    command.write_text('#!/bin/sh\nsleep 0.5\nexec dot "$@"\n')
    command.chmod(0o755)
    if shutil.which('dot'):
        assert lay_out(structure(), command=str(command), limit_s=0.2) is not None


def test_a_large_graph_is_not_laid_out():
    labels = ['S{}'.format(number) for number in range(MOST_DRAWN + 1)]
    layouts = LayoutWorker('false')
    assert layouts.find(make_structure('T', labels, [], []), pytest.fail) is None
    assert layouts.wait(make_structure('T', labels, [], []), 30.0) is None
    assert not layouts._asked


@pytest.mark.parametrize(
    'text', ['', '{}', '[]', '{"bb": "0,0,1"}', '{"bb": "0,0,1,1", "objects": [{"name": "a"}]}']
)
def test_what_is_no_layout_is_refused(text):
    with pytest.raises(ValueError):
        read_layout(text)


def test_a_transition_s_share_is_of_all_that_left_its_state():
    assert shares([('A', 'ok', 'B', 3), ('A', 'failure', 'ORACLE', 1), ('C', 'ok', 'D', 0)]) == [
        ('A', 'ok', 'B', 3, 0.75),
        ('A', 'failure', 'ORACLE', 1, 0.25),
    ]


def test_a_thousand_states_are_told_and_a_flood_is_refused():
    many = ['S{}'.format(number) for number in range(1000)]
    found = make_structure('T', many + ['ORACLE'], edges(many), OUTCOMES)
    assert len(found.states) == len(found.edges) == 1000 and found.oracle == 'ORACLE'
    flood = ['S{}'.format(number) for number in range(5000)]
    refused = make_structure('T', flood, edges(flood, ''), [])
    assert not refused.states and refused.refused == 5000
    assert drawing(refused, None, [])['refused'] == 5000
