"""The use cases' scripts, and the launch file that runs any script: what is missing is told in one
line.
"""

import pytest
import rospy
from roslaunch.config import load_config_default
from roslaunch.substitution_args import resolve_args

from smach_oracle.ros.oracle_run.options import parse
from smach_oracle.tasks import drink_retrieval, inspection, pick_and_place


@pytest.mark.parametrize('task', [pick_and_place, drink_retrieval, inspection])
def test_without_a_world_a_task_names_the_launch_file_that_has_one(task, monkeypatch):
    def never_comes(name, limit_s):
        raise rospy.ROSException('timeout exceeded while waiting for service')

    monkeypatch.setattr(rospy, 'init_node', lambda name: None)
    monkeypatch.setattr(rospy, 'wait_for_service', never_comes)
    monkeypatch.setattr(task, 'make_machine', lambda: None)
    with pytest.raises(SystemExit) as caught:
        task.main(['task'])
    name = task.__name__.split('.')[-1]
    text = caught.value.code
    assert isinstance(text, str), 'printed by Python, with exit code 1'
    assert (
        text.startswith(name + ': no world here') and name + '.launch' in text and '\n' not in text
    )


def arguments_of(*given):
    """The command line of the node that the launch file starts."""
    path = resolve_args('$(find smach_oracle)/launch/oracle_run.launch')
    (node,) = load_config_default([(path, list(given))], 11311, verbose=False).nodes
    return [word.strip('"') for word in node.args.split()]


def test_the_launch_file_without_a_script_asks_which(capsys):
    for given in ((), ('args:=5 --speed 2',)):
        with pytest.raises(SystemExit) as caught:
            parse(arguments_of(*given))
        assert caught.value.code == 2 and 'no script is given' in capsys.readouterr().err


def test_the_launch_file_runs_the_script_that_it_is_given(tmp_path):
    script = tmp_path / 'task.py'
    script.write_text('')
    run = parse(arguments_of('script:={}'.format(script), 'args:=--speed 2'))
    assert (run.script, run.script_args) == (str(script), ['--speed', '2'])
