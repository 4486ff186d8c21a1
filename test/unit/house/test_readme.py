"""What the README and the documentation claim is true: commands, options, files, types, and the
example runs.
"""

import os
import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest
from house import ON_PATH, ROOT, shown

README = (ROOT / 'README.md').read_text(encoding='utf-8')
DOCUMENTS = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md'] + sorted((ROOT / 'doc').glob('**/*.md'))
OURS = {'scripts', 'rosrun', 'roslaunch'}


def blocks(language):
    return re.findall(r'^```{}\n(.*?)^```'.format(language), README, re.MULTILINE | re.DOTALL)


def command_lines():
    for block in blocks('bash'):
        for line in block.splitlines():
            words = shlex.split(line, comments=True)
            if words:
                yield ['rosrun', 'smach_oracle', *words] if words[0] in ON_PATH else words


def run_python(*arguments):
    """Run Python as a user of the package does, built or from its sources; return the output."""
    path = [os.environ.get('SMACH_UPSTREAM'), os.environ.get('PYTHONPATH'), str(ROOT / 'src')]
    env = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, path)))
    command = [sys.executable] + [str(argument) for argument in arguments]
    result = subprocess.run(
        command, env=env, timeout=60, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    assert result.returncode == 0, result.stdout.decode()
    return result.stdout.decode()


@pytest.mark.parametrize('words', command_lines(), ids=' '.join)
def test_a_command_of_the_readme_is_there(words):
    if words[0] == 'rosrun':
        assert words[1] == 'smach_oracle'
        command = ROOT / 'scripts' / words[2]
        assert command.read_text().startswith('#!/usr/bin/env python3')
    else:
        command = ROOT / (words[1] if words[0] == 'source' else words[0])
        if words[0] == 'roslaunch':
            command = ROOT / 'launch' / words[2]
    assert command.is_file()
    assert words[0] in ('source', 'roslaunch') or os.access(str(command), os.X_OK)


def test_every_option_in_the_readme_is_one_that_its_command_knows():
    for words in command_lines():
        if words[0] != 'rosrun':
            continue
        # what follows a script belongs to the script
        own = words[
            3 : next(
                (index for index, word in enumerate(words) if word.endswith('.py')), len(words)
            )
        ]
        options = [word for word in own if word.startswith('--')]
        known = run_python(ROOT / 'scripts' / words[2], '--help') if options else ''
        assert all(option in known for option in options), (words[2], options)


def test_every_launch_argument_in_the_readme_is_one_that_the_file_takes():
    for words in command_lines():
        if words[0] == 'roslaunch':
            arguments = ElementTree.parse(str(ROOT / 'launch' / words[2])).getroot().findall('arg')
            given = {word.split(':=')[0] for word in words[3:]}
            assert given <= {
                argument.get('name')
                for argument in arguments
                if argument.get('default') is not None
            }


def test_every_command_named_in_the_text_is_there():
    names = set(re.findall(r'`([a-z]+_[a-z_]+)`', README))
    prefixes = r'(expert|scripted|bag|oracle|run|pr2|perception|manipulation)_'
    commands = {name for name in names if re.match(prefixes, name)}
    assert commands and all(
        (ROOT / 'scripts' / name).is_file() for name in commands - {'oracle_run.launch'}
    ), commands


def test_the_examples_run(tmp_path):
    six_lines, example = blocks('python')
    script = tmp_path / 'example.py'
    script.write_text(example)
    run_python(script)
    assert len([line for line in six_lines.splitlines() if line]) <= 6
    unwrapped = example[: example.index('OracleContainer.wrap(')].replace(
        'from smach_oracle import OracleContainer\n', ''
    )
    (tmp_path / 'my_robot.py').write_text(unwrapped + 'make_machine = lambda: sm\n')
    script.write_text(six_lines)
    assert run_python(script).splitlines()[-1] == 'succeeded'


def test_every_type_in_the_table_of_the_ros_interface_is_there():
    rows = re.findall(r'^\| `~[^|]*\| (action|topic|service) `(\w+)`', README, re.MULTILINE)
    folders = {'action': 'action/{}.action', 'topic': 'msg/{}.msg', 'service': 'srv/{}.srv'}
    assert len(rows) >= 5
    assert all((ROOT / folders[kind].format(name)).is_file() for kind, name in rows)


@pytest.mark.parametrize('path', DOCUMENTS, ids=shown)
def test_every_file_that_a_document_links_to_is_there(path):
    text = re.sub(
        r'^```.*?^```', '', path.read_text(encoding='utf-8'), flags=re.MULTILINE | re.DOTALL
    )
    links = [
        link.split('#')[0] for link in re.findall(r'\]\(([^)\s]+)\)', text) if '://' not in link
    ]
    assert not [link for link in links if link and not (path.parent / link).exists()]


def test_every_folder_and_file_named_in_the_readme_is_there():
    named = re.findall(r'`((?:src|scripts|launch|doc|test|benchmarks)(?:/[\w./]+)?)[` ]', README)
    named += re.findall(r'`(requirements[\w.-]*)`', README)
    assert len(named) > 10
    assert not [name for name in named if not (ROOT / name).exists()]


def test_every_folder_of_the_checkout_is_among_the_rooms():
    listed = subprocess.run(
        ['git', 'ls-files'], cwd=str(ROOT), stdout=subprocess.PIPE, check=False
    ).stdout.decode()
    folders = {name.split('/')[0] for name in listed.splitlines() if '/' in name}
    if not folders:
        pytest.skip('no git checkout')
    rooms = README[README.index('## Rooms') :]
    assert not [
        name for name in sorted(folders) if not re.search(r'`{}[/`]'.format(re.escape(name)), rooms)
    ]


def test_every_document_is_in_an_index():
    listed = set()
    for folder in (ROOT / 'doc', ROOT / 'doc/inside'):
        index = (folder / 'index.md').read_text(encoding='utf-8')
        listed |= {(folder / link).resolve() for link in re.findall(r'\]\(([\w./-]+)\)', index)}
    assert set((ROOT / 'doc').glob('**/*.md')) - {ROOT / 'doc/index.md'} <= listed
