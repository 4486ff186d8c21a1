"""The package builds alone and in catkin workspaces, installs, runs where it was installed, and
yields to upstream.
"""

import re

import pytest
from workspace import (
    PYTHON,
    copy_sources,
    fake_upstream,
    leave_few_actions,
    leave_one_of_each,
    run,
)

NAMES = ('smach', 'smach_ros', 'smach_msgs', 'control_msgs')
WHERE = (
    'python3 -c "import smach_oracle.oracle, smach, smach_ros, smach_msgs, control_msgs; '
    'print(smach.__file__, smach_ros.__file__, smach_msgs.__file__, control_msgs.__file__)"'
)
MESSAGES = (
    'from smach_oracle.msg import SeenThing, SharedAutonomyAction; '
    'from smach_oracle.srv import Recognise'
)
SCRIPT = """
import smach


class Flaky(smach.State):
    runs = 0

    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'])

    def execute(self, userdata):
        Flaky.runs += 1
        return 'aborted' if Flaky.runs == 1 else 'succeeded'


machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
with machine:
    smach.StateMachine.add('FLAKY', Flaky())
print('ended in', machine.execute())
"""


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    """An install space, built alone in a build folder beside its sources, which are gone by now."""
    top = tmp_path_factory.mktemp('alone')
    leave_few_actions(copy_sources(top / 'smach_oracle'))
    (top / 'out').mkdir()
    run(
        # not `make` first: each of the two would look at every target
        'cmake ../smach_oracle {} -DCMAKE_INSTALL_PREFIX="$PWD/../installed"; '
        'make -j2 install'.format(PYTHON),
        top / 'out',
    )
    (top / 'smach_oracle').rename(top / 'moved_away')
    (top / 'out').rename(top / 'out_moved_away')
    return top


def in_installed(installed, command):
    return run(command, installed, str(installed / 'installed/setup.bash'))


def test_the_install_space_runs_without_its_sources(installed):
    assert in_installed(installed, WHERE).count(str(installed / 'installed')) == len(NAMES)


def test_installed_messages_are_found_by_rosmsg(installed):
    assert 'local_data' in in_installed(installed, 'rosmsg show smach_msgs/SmachContainerStatus')
    assert 'seq' in in_installed(installed, 'rosmsg show smach_oracle/OracleEvent')
    assert 'max_effort' in in_installed(
        installed, 'rosmsg show control_msgs/GripperCommandActionGoal'
    )


def test_every_message_service_and_action_is_installed(installed):
    (target,) = (installed / 'installed/lib').glob('python3*/*-packages/smach_oracle')
    share = installed / 'installed/share/smach_oracle'
    modules = {'msg': 'msg/_{}.py', 'srv': 'srv/_{}.py', 'action': 'msg/_{}Action.py'}
    for kind, module in modules.items():
        written = sorted((installed / 'moved_away' / kind).iterdir())
        assert written
        for path in written:
            assert (share / kind / path.name).is_file()
            assert (target / module.format(path.stem)).is_file()


def test_every_command_is_installed_for_rosrun(installed):
    commands = {
        path.name
        for path in (installed / 'moved_away/scripts').iterdir()
        if path.read_text().startswith('#!/usr/bin/env python3')
    }
    assert commands == {path.name for path in (installed / 'installed/lib/smach_oracle').iterdir()}


def test_the_commands_for_users_are_on_the_path(installed):
    where = in_installed(installed, 'command -v oracle_run; oracle_run --version').splitlines()
    assert where[0] == str(installed / 'installed/bin/oracle_run')
    assert where[1].startswith('oracle_run of smach_oracle ')


def test_help_points_to_a_page_that_is_installed_with_all_that_it_links_to(installed):
    share = installed / 'installed/share/smach_oracle'
    shown = in_installed(installed, 'rosrun smach_oracle oracle_disk --help')
    assert shown.splitlines()[-1] == 'More: {}'.format(share / 'doc/recording.md')
    for page in (share / 'doc').rglob('*.md'):
        text = re.sub(
            r'^```.*?^```', '', page.read_text(encoding='utf-8'), flags=re.MULTILINE | re.DOTALL
        )
        links = [
            link.split('#')[0] for link in re.findall(r'\]\(([^)\s]+)\)', text) if '://' not in link
        ]
        assert not [link for link in links if not (page.parent / link).exists()], page


def test_an_unmodified_script_recovers_under_the_installed_oracle(installed):
    (installed / 'flaky.py').write_text(SCRIPT)
    # without a master, as before the robot is switched on, is not what oracle_run is for: start one
    # on a free port
    command = """
        free_port='from smach_oracle.experiment.launching import free_port; print(free_port())'
        port=$(python3 -c "$free_port")
        export ROS_MASTER_URI=http://localhost:$port ROS_HOSTNAME=localhost ROS_LOG_DIR="$PWD/log"
        roscore -p $port >/dev/null 2>&1 & core=$!; trap 'kill -INT $core; wait $core || true' EXIT
        until rosnode list >/dev/null 2>&1; do sleep 0.2; done
        timeout 60 rosrun smach_oracle oracle_run flaky.py"""
    assert 'ended in succeeded' in in_installed(installed, command)


def test_the_test_kit_and_its_examples_are_installed(installed):
    examples = installed / 'installed/share/smach_oracle/examples'
    assert (examples / 'fetch_task_rostest.py').stat().st_mode & 0o111
    passed = in_installed(installed, 'python3 -m pytest -q -p no:cacheprovider {}'.format(examples))
    assert '6 passed' in passed
    where = in_installed(
        installed, 'python3 -c "import smach_oracle.testing as kit; print(kit.__file__)"'
    )
    assert str(installed / 'installed') in where


def test_launch_files_and_settings_are_installed(installed):
    files = in_installed(installed, 'roslaunch --files smach_oracle pick_and_place.launch')
    assert str(installed / 'installed') in files
    for name in ('pick_and_place.py', 'pick_and_place.yaml', 'inspection.py', 'inspection.yaml'):
        assert (installed / 'installed/share/smach_oracle/src/smach_oracle/tasks' / name).exists()


@pytest.mark.parametrize(
    'folder, fewest',
    [('expert/console/static', 41), ('analysis/reporting/templates', 4)],
)
def test_files_of_pages_are_all_installed(installed, folder, fewest):
    place = 'smach_oracle/' + folder
    sources = installed / 'moved_away/src' / place
    (target,) = (installed / 'installed/lib').glob('python3*/*-packages/' + place)
    names = {path.relative_to(sources) for path in sources.rglob('*') if path.is_file()}
    assert names == {path.relative_to(target) for path in target.rglob('*') if path.is_file()}
    assert len(names) >= fewest


def test_no_file_of_ours_is_where_upstreams_belongs(installed):
    prefix = installed / 'installed'
    assert not [
        path
        for name in NAMES
        for path in prefix.rglob(name)
        if 'share/smach_oracle/stand_ins' not in str(path)
    ]
    assert (prefix / 'share/smach_oracle/stand_ins/smach_msgs/share/smach_msgs/msg').is_dir()


def test_upstream_may_come_after_the_installation_and_go_again(installed, tmp_path):
    setup = str(installed / 'installed/setup.bash')
    later = tmp_path / 'later'
    for name in NAMES:
        (later / name).mkdir(parents=True)
        (later / name / '__init__.py').write_text('')
    assert run(WHERE, tmp_path, setup).count('stand_ins') == len(NAMES)
    come = 'export PYTHONPATH="$PYTHONPATH:{}"; source "{}"; '.format(later, setup)
    names = 'import smach, smach_ros, smach_msgs, control_msgs; print(smach.__file__)'
    told = run(
        come + 'python3 -c "{}"; echo $PYTHONPATH $ROS_PACKAGE_PATH'.format(names), tmp_path, setup
    )
    assert str(later / 'smach') in told and 'stand_ins' not in told


def test_a_catkin_workspace_uses_upstream_where_it_has_it(tmp_path):
    leave_one_of_each(copy_sources(tmp_path / 'src/smach_oracle'))
    for name in NAMES:
        fake_upstream(tmp_path / 'src', name)
    run('catkin_make {}'.format(PYTHON), tmp_path)
    where = run(WHERE, tmp_path, str(tmp_path / 'devel/setup.bash'))
    assert where.count('devel') + where.count(str(tmp_path / 'src')) >= len(NAMES)
    assert 'stand_ins' not in where
    check = (
        'import smach_oracle, smach, smach_ros, smach_msgs; ' + MESSAGES + '; '
        'print(smach.upstream, smach_ros.upstream)'
    )
    assert 'True True' in run(
        'python3 -c "{}"'.format(check), tmp_path, str(tmp_path / 'devel/setup.bash')
    )


def test_an_isolated_workspace_takes_of_ours_what_it_lacks(tmp_path):
    leave_one_of_each(copy_sources(tmp_path / 'src/smach_oracle'))
    fake_upstream(tmp_path / 'src', 'smach')
    run('catkin_make_isolated --cmake-args {}'.format(PYTHON), tmp_path)
    check = (
        'import smach_oracle, smach, control_msgs; ' + MESSAGES + '; '
        'print(smach.upstream, control_msgs.__file__)'
    )
    told = run(
        'python3 -c "{}"'.format(check), tmp_path, str(tmp_path / 'devel_isolated/setup.bash')
    )
    assert 'True' in told and 'stand_ins/control_msgs' in told


def test_what_release_0_1_staged_among_upstreams_is_taken_away(tmp_path):
    sources = copy_sources(tmp_path / 'smach_oracle')
    build = sources / 'build'
    old = build / 'devel/lib/python3/dist-packages/smach'
    old.mkdir(parents=True)
    (old / '__init__.py').write_text('# Written by CMake. Relays from the devel space')
    (old / '.smach_oracle_stand_in').write_text('')
    run('cmake .. {}'.format(PYTHON), build)
    assert not old.exists()
