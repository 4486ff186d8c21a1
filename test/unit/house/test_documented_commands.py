"""The commands in the documentation: each is there, knows its options, and takes its launch
arguments.
"""

import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from pathlib import Path

import pytest
from house import ON_PATH, ROOT

PAGES = sorted((ROOT / 'doc').rglob('*.md'))
OURS = r'(?:ros(?:run|launch) smach_oracle|{})'.format('|'.join(ON_PATH))
# on lines of their own, also continued ones, or within a line of text
COMMAND = re.compile(
    r'^(?:\$ | *)({0} (?:.*\\\n)*.*)$|`({0} [^`]+)`'.format(OURS),
    re.MULTILINE,
)
# how many words stand before the options of a subcommand
BEFORE_OPTIONS = {'compare': 1, 'oracle_state': 2}
SCRIPT = re.compile(r'SCRIPT|.*\.py')


def commands():
    """Each command as words, without the brackets around what may be left out."""
    for page in PAGES:
        for own_line, in_text in COMMAND.findall(page.read_text(encoding='utf-8')):
            text = (own_line or in_text).replace('\\\n', ' ')
            words = shlex.split(re.sub(r'[\[\]]|\.\.\.', ' ', text), comments=True)
            yield ['rosrun', 'smach_oracle', *words] if words[0] in ON_PATH else words


COMMANDS = list(commands())
RUN = [words for words in COMMANDS if words[0] == 'rosrun']
LAUNCHED = [words for words in COMMANDS if words[0] == 'roslaunch']


@lru_cache(maxsize=None)
def options_of(command, *subcommand):
    """What a command says of its options."""
    told = subprocess.run(
        [sys.executable, str(ROOT / 'scripts' / command), *subcommand, '--help'],
        timeout=60,
        check=True,
        stdout=subprocess.PIPE,
    ).stdout.decode()
    return set(re.findall(r'--[a-z][a-z-]*', told))


def test_there_are_commands_of_both_kinds():
    assert len(RUN) > 10 and len(LAUNCHED) > 10


@pytest.mark.parametrize('words', RUN, ids=' '.join)
def test_what_is_run_is_there_and_knows_the_options(words):
    command, rest = words[2], words[3:]
    assert (ROOT / 'scripts' / command).is_file()
    scripts = [
        place
        for place, word in enumerate(rest)
        if command == 'oracle_run' and SCRIPT.fullmatch(word)
    ]
    own = rest[: scripts[0]] if scripts else rest
    given = {word.split('=')[0] for word in own if word.startswith('--')}
    subcommand = rest[: BEFORE_OPTIONS.get(command, 0)]
    assert not given or given <= options_of(command, *subcommand)
    behind = {word for word in rest[len(own) :] if word.startswith('--')}
    assert not behind or not behind & options_of(command, *subcommand), (
        "options behind the script are the script's own"
    )


@pytest.mark.parametrize('words', LAUNCHED, ids=' '.join)
def test_what_is_launched_is_there_and_takes_the_arguments(words):
    arguments = ElementTree.parse(str(ROOT / 'launch' / words[2])).getroot().findall('arg')
    given = {word.split(':=')[0] for word in words[3:] if ':=' in word}
    assert given <= {
        argument.get('name') for argument in arguments if argument.get('value') is None
    }


def test_the_commands_for_users_are_on_the_path():
    page = (ROOT / 'doc/commands.md').read_text(encoding='utf-8')
    listed = re.findall(r'^\| `(\w+)` \|', page, re.MULTILINE)
    # ImageMagick has a `compare`
    assert set(ON_PATH) == set(listed) - {'compare'} and len(ON_PATH) > 10


@pytest.mark.parametrize('name', ON_PATH)
def test_a_command_on_the_path_hides_none_of_the_system(name):
    assert not [
        folder for folder in ('/usr/bin', '/bin', '/usr/sbin') if Path(folder, name).exists()
    ]


def test_no_page_has_rosrun_where_the_name_is_enough():
    assert not [
        (page.name, command)
        for page in [*PAGES, ROOT / 'README.md']
        for command in re.findall(r'rosrun smach_oracle (\w+)', page.read_text(encoding='utf-8'))
        if command in ON_PATH
    ]
