"""The command line of oracle_run: what is ours, what is the script's."""

import pytest

from smach_oracle.ros.oracle_run import options, script_runner
from smach_oracle.ros.oracle_run.options import (
    OLDER_WITH_VALUE,
    OPTIONS_WITH_VALUE,
    make_parser,
    parse,
    split,
)


@pytest.fixture
def script(tmp_path, monkeypatch):
    path = tmp_path / 'task.py'
    path.write_text('pass\n')
    monkeypatch.chdir(tmp_path)
    return 'task.py'


def test_what_follows_the_script_is_the_scripts(script):
    line = split(['--policy', 'prose', 'task.py', '--config', 'mine', '--', '-x', 'other.py'])
    assert line == (['--policy', 'prose'], 'task.py', ['--config', 'mine', '--', '-x', 'other.py'])


def test_remappings_pass_through_wherever_they_stand():
    line = split(['__name:=robot', '--no-nested', 'a:=b', 'task.py', 'x', '_rate:=5'])
    assert line == (['--no-nested'], 'task.py', ['x', '_rate:=5', '__name:=robot', 'a:=b'])


def test_a_script_whose_name_begins_with_a_dash_can_be_named():
    assert split(['--no-nested', '--', '-task.py', '-x']) == (['--no-nested'], '-task.py', ['-x'])


def test_every_option_that_takes_a_value_is_known_to_the_splitter():
    takes_value = {
        name
        for action in make_parser()._actions
        for name in action.option_strings
        if action.nargs not in (0, '?') and name.startswith('--')
    }
    assert takes_value == {*OPTIONS_WITH_VALUE, *OLDER_WITH_VALUE}


def test_options_become_settings_and_options_of_the_process(script, tmp_path):
    run = parse(
        [
            '--policy=algorithm1',
            '--rates-file',
            'rates.json',
            '--no-nested',
            '--without-oracle',
            '--record',
            'bags',
            '--record-topic',
            '/tf',
            '--record-topic',
            '/camera',
            '--config',
            'o.yaml',
            script,
            '--n',
            '3',
        ]
    )
    assert run.overrides == {
        'policy': 'algorithm1',
        'rates_file': str(tmp_path / 'rates.json'),
        'tree': {'nested': False},
    }
    assert (run.record, run.record_topics) == (str(tmp_path / 'bags'), ('/tf', '/camera'))
    assert (run.recover, run.config, run.script_args) == (False, 'o.yaml', ['--n', '3'])


@pytest.mark.parametrize(
    'args, message',
    [
        (['--polcy', 'prose', 'task.py'], 'unrecognized arguments: --polcy'),
        (['--policy', 'best', 'task.py'], "invalid choice: 'best'"),
        (['--conf', 'x.yaml', 'task.py'], 'unrecognized arguments: --conf'),
        (['--record'], 'expected one argument'),
        (['no_such.py'], 'no_such.py: no such file'),
        (['--no-nested'], 'no script is given'),
        (['__name:=x'], 'no script is given'),
        (['--config', 'o.yaml', 'none', '--speed', '2'], 'with script:=FILE under roslaunch'),
    ],
)
def test_a_wrong_command_line_is_told_clearly(script, capsys, args, message):
    with pytest.raises(SystemExit) as caught:
        parse(args)
    assert caught.value.code == script_runner.USAGE_ERROR
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    'text, parts',
    [
        ('polcy: prose\n', ['o.yaml line 1', 'polcy', 'one of the keys']),
        (
            'states:\n  PICK:\n    memory: 0\n',
            ['o.yaml line 3', 'states.PICK.memory', '0', 'from 1'],
        ),
        ('memory: [\n', ['oracle_run: o.yaml line 2: not valid YAML: expected the node content']),
        (
            'memory: 3\nmemory: 4\n',
            [
                'oracle_run: o.yaml line 2: memory: given a second time (first in '
                'line 1); allowed: each key once'
            ],
        ),
        ('high_from: 0.2\n', ['o.yaml line 1', 'high_from', '0.2', 'at least']),
        (
            'states: {PICK: {preconditions: ["python:os"]}}\n',
            ['o.yaml line 1', 'python:os', 'module:attribute'],
        ),
    ],
)
def test_a_mistake_in_the_file_is_told_before_the_script_starts(
    script, tmp_path, capsys, text, parts
):
    (tmp_path / 'o.yaml').write_text(text)
    (tmp_path / 'task.py').write_text('raise AssertionError("started")\n')
    with pytest.raises(SystemExit) as caught:
        script_runner.main(['--config', 'o.yaml', script])
    error = capsys.readouterr().err
    assert caught.value.code == 2
    assert all(part in error for part in parts), error
    assert 'Traceback' not in error


def test_a_folder_that_cannot_be_written_is_told_before_the_script_starts(script, capsys):
    with pytest.raises(SystemExit) as caught:
        script_runner.main(['--record', '/proc/no_bags_here', script])
    assert caught.value.code == 2
    assert capsys.readouterr().err == (
        'oracle_run: --record /proc/no_bags_here: no bags can be '
        'written there (No such file or directory)\n'
    )


def test_a_script_that_cannot_be_read_is_told_before_it_starts(script, monkeypatch, capsys):
    def refuse(name, *args):
        raise PermissionError(13, 'Permission denied', name)

    monkeypatch.setattr(options, 'open', refuse, raising=False)
    with pytest.raises(SystemExit) as caught:
        script_runner.main([script])
    assert caught.value.code == 2
    assert 'task.py: Permission denied' in capsys.readouterr().err


@pytest.mark.parametrize(
    'given, words',
    [
        ('nowhere/rates.json', ['there is no folder', 'nowhere']),
        ('.', ['it is a folder']),
    ],
)
@pytest.mark.parametrize('in_file', [True, False])
def test_a_file_of_rates_that_cannot_be_written_is_told_before_the_script_starts(
    script, tmp_path, capsys, given, words, in_file
):
    (tmp_path / 'task.py').write_text('raise AssertionError("started")\n')
    (tmp_path / 'o.yaml').write_text('memory: 5\nrates_file: {}\n'.format(given))
    with pytest.raises(SystemExit) as caught:
        script_runner.main(
            (['--config', 'o.yaml'] if in_file else ['--rates-file', given]) + [script]
        )
    error = capsys.readouterr().err
    assert caught.value.code == 2
    assert all(
        word in error for word in words + ['o.yaml line 2' if in_file else 'command line']
    ), error


def test_every_path_may_begin_with_the_home_folder(script, tmp_path, monkeypatch):
    monkeypatch.setenv('HOME', str(tmp_path))
    (tmp_path / 'o.yaml').write_text('rates_file: ~/rates.json\n')
    run = parse(['--config', '~/o.yaml', '--record', '~/bags', '~/task.py', '~/as it is'])
    assert (run.script, run.script_args) == (str(tmp_path / 'task.py'), ['~/as it is'])
    assert run.record == str(tmp_path / 'bags')
    settings = script_runner.read_settings(script_runner.load(run))
    assert settings.rates_file == str(tmp_path / 'rates.json')
    assert parse(['--rates-file', '~/r.json', script]).overrides['rates_file'] == str(
        tmp_path / 'r.json'
    )
    script_runner.check(run)


def test_help_names_every_option(capsys):
    with pytest.raises(SystemExit) as caught:
        parse(['--help'])
    text = capsys.readouterr().out
    assert caught.value.code == 0
    assert all(
        option in text
        for option in OPTIONS_WITH_VALUE + ('--no-nested', '--without-oracle', 'SCRIPT')
    )
