"""The commands in the documentation: each is there, knows its options, and takes its launch
arguments.
"""

import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from functools import lru_cache

import pytest
from house import ROOT

PAGES = sorted((ROOT / 'doc').rglob('*.md'))
# on lines of their own, also continued ones, or within a line of text
COMMAND = re.compile(
    r'^ *(ros(?:run|launch) smach_oracle (?:.*\\\n)*.*)$|`(ros(?:run|launch) smach_oracle [^`]+)`',
    re.MULTILINE,
)
SCRIPT = re.compile(r'SCRIPT|.*\.py')


def commands():
    """Each command as words, without the brackets around what may be left out."""
    for page in PAGES:
        for own_line, in_text in COMMAND.findall(page.read_text(encoding='utf-8')):
            text = (own_line or in_text).replace('\\\n', ' ')
            yield shlex.split(re.sub(r'[\[\]]|\.\.\.', ' ', text), comments=True)


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
    given = {word for word in own if word.startswith('--')}
    subcommand = rest[:1] if command == 'compare' else []
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
