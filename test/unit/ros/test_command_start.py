"""What all commands have in common: the version, and an output that nobody reads any more."""

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from catkin_pkg.changelog import get_changelog_from_path
from resumed_trial import record_resumed_trial

from smach_oracle import __version__, commands
from smach_oracle.analysis.compare_command.dispatch import SUBCOMMANDS

ROOT = Path(__file__).resolve().parents[3]
COMMANDS = sorted(
    path.name
    for path in (ROOT / 'scripts').iterdir()
    if b'python3' in path.read_bytes().split(b'\n')[0]
)
BAGS = 'test/data/v0_1/trials'
LOADED = """
import runpy, sys
sys.argv = {0!r}
try:
    runpy.run_path(sys.argv[0], run_name='__main__')
except SystemExit as end:
    assert not end.code
sys.stderr.write(' '.join(sys.modules))
"""
ROWS = 'doc/trials/fourth/drink_retrieval_persistence_0/results.csv'


def run(line, **more):
    return subprocess.run(
        ['bash', '-c', line],
        cwd=str(ROOT),
        timeout=60,
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
        **more,
    )


def test_the_manifest_the_package_and_the_change_log_name_one_version():
    manifest = ElementTree.parse(str(ROOT / 'package.xml')).getroot()
    assert manifest.findtext('version') == __version__
    sections = re.findall(
        r'^(\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)\n-+$',
        (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8'),
        re.MULTILINE,
    )
    assert sections[0][0] == __version__
    assert sections == sorted(sections, reverse=True)


def test_setup_py_takes_the_version_of_the_manifest():
    told = run('/usr/bin/env python3 setup.py --version 2>/dev/null')
    assert told.stdout.split()[-1] == __version__


@pytest.mark.parametrize('command', COMMANDS)
def test_a_command_tells_the_version_without_ros(command):
    told = run(
        '{} -S scripts/{} --version'.format(sys.executable, command),
        env={'PYTHONPATH': str(ROOT / 'src'), 'PATH': os.environ['PATH']},
    )
    assert (told.stdout, told.stderr) == (
        '{} of smach_oracle {}\n'.format(command, __version__),
        '',
    )
    assert told.returncode == 0


@pytest.mark.parametrize(
    'line',
    [
        'bag_statistics ' + BAGS,
        'bag_statistics --help',
        'compare what_if ' + BAGS,
        'compare --help',
        'learn --help',
        'oracle_disk --keep-gb 1 ' + BAGS,
        'run_trials --plan --protocol all',
        'oracle_run --help',
    ],
)
@pytest.mark.parametrize('what_of_it', ['| true', '2>&1 | true'])
def test_a_command_whose_reader_has_gone_ends_without_a_word(line, what_of_it):
    # the reader has gone before anything is written
    told = run(
        '(sleep 0.3; exec {} scripts/{}) {}; echo "${{PIPESTATUS[0]}}"'.format(
            sys.executable, line, what_of_it
        )
    )
    assert told.stderr == ''
    assert told.stdout == '{}\n'.format(commands.NO_READER)


PRINTS = [
    'bag_statistics ' + BAGS,
    'compare what_if ' + BAGS,
    'compare variants ' + ROWS,
    'learn {bags}',
    'learn --help',
    'oracle_run --version',
    'oracle_run --check examples/fetch_task.py',
]


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Bags with ways to learn from."""
    return record_resumed_trial(tmp_path_factory.mktemp('ways'))


@pytest.mark.parametrize('line', PRINTS)
def test_a_command_whose_output_cannot_be_written_says_so_in_one_line(line, bags):
    told = run('{} scripts/{} > /dev/full'.format(sys.executable, line.format(bags=bags)))
    name = re.match(r'compare \w+|\w+', line).group()
    assert told.stderr == '{}: output: No space left on device\n'.format(name)
    assert told.returncode == commands.NOT_WRITTEN


@pytest.mark.parametrize('line', PRINTS)
@pytest.mark.parametrize('closed', ['>&-', '2>&-', '>&- 2>&-'])
def test_a_command_without_an_output_does_its_work(line, bags, closed):
    whole = '{} scripts/{}'.format(sys.executable, line.format(bags=bags))
    there, told = run(whole), run('{} {}'.format(whole, closed))
    assert told.stdout == ('' if closed.startswith('>') else there.stdout)
    assert told.stderr == ('' if '2>' in closed else there.stderr)
    assert told.returncode == there.returncode


@pytest.mark.parametrize(
    'line', ['bag_statistics {0} --html {0}/a.html', 'oracle_disk --keep-gb 1 {0}']
)
def test_a_letter_that_the_encoding_lacks_ends_no_command(line, tmp_path):
    folder = tmp_path / 'K\xfcche'
    shutil.copytree(str(ROOT / BAGS), str(folder))
    (folder / 'broken.bag').write_text('?')
    told = run(
        '{} scripts/{} 2>&1'.format(sys.executable, line.format(folder)),
        env=dict(os.environ, PYTHONIOENCODING='ascii'),
    )
    assert 'K\\xfcche' in told.stdout and 'Traceback' not in told.stdout
    assert told.returncode == ('disk' not in line)


@pytest.mark.parametrize('line', ['compare variants none.csv', 'compare figures none --output out'])
def test_a_file_that_is_not_there_is_named_in_plain_words(line):
    told = run('{} scripts/{}'.format(sys.executable, line))
    assert told.stderr.startswith('{} {}: {}: '.format(*line.split()[:3])), told.stderr
    assert 'Errno' not in told.stderr and told.returncode == 2


@pytest.mark.parametrize('subcommand', sorted(SUBCOMMANDS))
def test_a_subcommand_tells_the_version_too(subcommand):
    told = run('{} scripts/compare {} --version'.format(sys.executable, subcommand))
    assert told.stdout == 'compare {} of smach_oracle {}\n'.format(subcommand, __version__)
    assert told.returncode == 0


def loaded_for(*words):
    """The modules that a command has loaded at its end."""
    told = run(
        '{} -c "$CODE"'.format(sys.executable),
        env=dict(os.environ, CODE=LOADED.format(['scripts/' + words[0], *words[1:]])),
    )
    assert told.returncode == 0, told.stderr
    return set(told.stderr.split())


def test_the_help_of_compare_loads_no_subcommand():
    loaded = loaded_for('compare', '--help')
    assert 'smach_oracle.analysis.compare_command.dispatch' in loaded
    assert not loaded & {'smach_oracle.analysis.' + each.module for each in SUBCOMMANDS.values()}
    assert 'smach_oracle.analysis.bag_events' not in loaded


@pytest.mark.parametrize('subcommand', sorted(SUBCOMMANDS))
def test_the_help_of_a_subcommand_loads_no_package_for_bags_or_figures(subcommand):
    loaded = loaded_for('compare', subcommand, '--help')
    assert 'smach_oracle.analysis.' + SUBCOMMANDS[subcommand].module in loaded
    assert not loaded & {'rosbags', 'matplotlib', 'numpy'}


@pytest.mark.parametrize('command', ['oracle_run', 'expert_console'])
def test_the_help_loads_neither_ros_nor_smach(command):
    loaded = loaded_for(command, '--help')
    assert 'smach_oracle.commands' in loaded
    assert not loaded & {'rospy', 'smach', 'numpy', 'tornado', 'smach_oracle.msg'}


@pytest.mark.parametrize(
    'old, new, options',
    [
        ('compare_oracles', 'compare oracles --wide', BAGS),
        ('what_if', 'compare what_if --wide', BAGS + ' --memory 2'),
        ('same_trials', 'compare same_trials', 2 * ' test/data/v0_1/experiment'),
        ('compare_variants', 'compare variants', ROWS),
        ('compare_variants', 'compare variants', 'none.csv'),
        ('draw_results', 'compare figures', 'none out'),
        ('what_if', 'compare what_if --wide', '--no-such-option'),
    ],
)
def test_an_older_name_does_the_same_and_names_the_new_one(old, new, options):
    ours = run('{} scripts/{} {}'.format(sys.executable, new, options))
    theirs = run('{} scripts/{} {}'.format(sys.executable, old, options))
    assert (theirs.returncode, theirs.stdout) == (ours.returncode, ours.stdout)
    first, *errors = theirs.stderr.splitlines(True)
    word = ' '.join(new.split()[:2])
    assert first == '{0}: is now `{1}`: rosrun smach_oracle {1}\n'.format(old, word)
    # a usage is folded by the length of the name
    assert ''.join(errors).replace(old, word).split() == ours.stderr.split()


def test_every_older_name_is_of_a_subcommand_that_is_there():
    calls = [
        re.search(
            r"run_renamed\('([\w.]+)', 'compare (\w+)'", (ROOT / 'scripts' / name).read_text()
        )
        for name in COMMANDS
    ]
    found = {each.group(2): each.group(1) for each in calls if each}
    assert found == {name: 'analysis.' + each.module for name, each in SUBCOMMANDS.items()}


def test_catkins_own_tools_read_the_change_log():
    changes = get_changelog_from_path(str(ROOT))
    versions = [version for version, _, _ in changes.foreach_version()]
    assert versions[-1] == __version__ and changes.get_content_of_version(__version__)
