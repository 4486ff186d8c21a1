"""What machines are called that were given no name."""

import threading

import pytest

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.ros import machine_names
from smach_oracle.ros.container import OracleContainer
from smach_oracle.ros.machine_names import MachineNames


def machine(*labels, name=''):
    sm = smach.StateMachine(outcomes=['done'])
    with sm:
        for label in labels:
            smach.StateMachine.add(label, smach.CBState(lambda userdata: 'done', outcomes=['done']))
    return OracleContainer.wrap(sm, name=name)


@pytest.fixture
def node(monkeypatch):
    """Be this node."""

    def be(name):
        monkeypatch.setattr(machine_names.rospy.core, 'is_initialized', lambda: True)
        monkeypatch.setattr(machine_names.rospy, 'get_name', lambda: name)
        return MachineNames()

    return be


def named(names, sm):
    with names.running(sm):
        pass
    return oracle_of(sm).path


@pytest.mark.parametrize(
    'name, expected',
    [
        ('/task_executive', 'task_executive'),
        ('/robot1/arm/task_executive', 'task_executive'),
        ('/task_4711_1795323273041', 'task'),
        ('/robot_12', 'robot_12'),
    ],
)
def test_a_machine_is_called_as_its_node_is_in_every_run(node, name, expected):
    assert named(node(name), machine('A')) == expected


def test_each_machine_has_a_name_of_its_own_and_keeps_it(node):
    names = node('/task')
    first, second = machine('A'), machine('B')
    assert [named(names, sm) for sm in (first, second, first, second)] == [
        'task',
        'task_2',
        'task',
        'task_2',
    ]


def test_machines_of_one_structure_share_a_name_unless_they_run_at_once(node):
    names = node('/task')
    left, right = machine('A'), machine('A')
    assert named(names, machine('A')) == named(names, machine('A')) == 'task'
    with names.running(left):
        assert named(names, right) == 'task_2'
    assert [oracle_of(sm).name for sm in (left, right)] == ['task', 'task_2']
    assert named(names, machine('A')) == 'task'


@pytest.mark.parametrize('is_told_before', [False, True])
def test_machines_that_shared_a_name_are_told_apart_once_they_run_at_once(node, is_told_before):
    names = node('/task')
    left, right, own = machine('A'), machine('A'), machine('A', name='task')
    for each in (left, right):
        if is_told_before:  # as oracle_run does
            OracleContainer.wrap(each, name=names.name_of(each))
        assert named(names, each) == 'task'
    with names.running(left), names.running(left):
        assert oracle_of(left).name == 'task'
        assert named(names, right) == 'task_2'
        assert named(names, own) == 'task', 'its program has named it'


def test_machines_in_threads_at_once_are_told_apart(node):
    names = node('/task')
    begun = threading.Barrier(5)

    def run(sm):
        with names.running(sm):
            begun.wait(10.0)

    machines = [machine('A') for _ in range(5)]
    threads = [threading.Thread(target=run, args=(sm,)) for sm in machines]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10.0)
    assert {oracle_of(sm).name for sm in machines} == {
        'task',
        'task_2',
        'task_3',
        'task_4',
        'task_5',
    }


def test_a_given_name_stays_and_is_given_to_no_other(node):
    names = node('/task')
    given = machine('A', name='task')
    with names.running(given):
        assert named(names, machine('B')) == 'task_2'
    assert oracle_of(given).name == 'task'
    OracleContainer.wrap(given, name='OTHER')
    assert named(names, given) == 'OTHER'


def test_a_name_for_the_first_machine_goes_over_that_of_the_node(node):
    names = node('/task')
    names.given = 'PICK_AND_PLACE'
    assert [named(names, machine('A')), named(names, machine('B'))] == [
        'PICK_AND_PLACE',
        'PICK_AND_PLACE_2',
    ]


def test_the_name_that_the_launch_file_gives_every_script_says_less_than_the_script(node):
    names = node('/oracle_run')
    assert named(names, machine('A')) == 'oracle_run'
    names.script = 'TASK'
    assert named(names, machine('B')) == 'TASK'


def test_without_a_node_a_machine_is_called_as_ever_and_by_its_node_once_there_is_one(node):
    sm = machine('A')
    assert named(MachineNames(), sm) == 'SM_ROOT'
    assert named(node('/task'), sm) == 'task'
