"""doc/options.md has every option of every command, and one name has one meaning."""

import re
import subprocess
import sys
from collections import Counter

import pytest
from house import ROOT

PAGE, OLDER = (ROOT / 'doc/options.md').read_text(encoding='utf-8').split('\n## Older names\n')
ROW = re.compile(
    r'^\| `(--[a-z-]+)[^`|]*(?:\\\|[^`|]*)*` \| ((?:`[a-z_0-9 ]+`(?:, )?)+) \| (.+) \|$'
)
WORDS = re.compile(r"^    '([^']+)'\)\n      echo '([^']*)'", re.MULTILINE)
EVERYWHERE = {'--help', '--version'}


def rows(text):
    """Option, commands and the last cell of each row."""
    found = [ROW.match(line) for line in text.splitlines() if line.startswith('| `-')]
    assert all(found), text
    return [(row[1], set(re.findall('`([^`]+)`', row[2])), row[3]) for row in found]


def known():
    """The commands that know each option, as Tab offers them: test_completion holds that file."""
    words = (ROOT / 'env-hooks/60.completion_words.bash').read_text(encoding='utf-8')
    found = {}
    for command, offered in WORDS.findall(words):
        if ' -' in command:  # what may follow an option
            continue
        for option in offered.split():
            if option.startswith('--') and option not in EVERYWHERE:
                found.setdefault(option, set()).add(command)
    return found


def test_each_option_stands_once_with_the_commands_that_have_it():
    table = rows(PAGE)
    assert not [name for name, count in Counter(row[0] for row in table).items() if count > 1]
    assert {option: commands for option, commands, _ in table} == known()
    assert len(table) > 50


def test_no_two_options_have_one_meaning():
    meanings = [meaning for _, _, meaning in rows(PAGE)]
    assert len(set(meanings)) == len(meanings)


@pytest.mark.parametrize('option, commands, new', rows(OLDER), ids=lambda each: str(each))
def test_an_older_name_is_hidden_and_still_known(option, commands, new):
    (command,) = commands
    value = {'--arms': 'both'}.get(option, 'out')
    told = subprocess.run(
        [sys.executable, str(ROOT / 'scripts' / command), option, value, '--no-such-option'],
        timeout=60,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
        check=False,
    )
    assert '{} is now called {}'.format(option, new.strip('`')) in told.stderr
    assert command not in known().get(option, ()) and command in known()[new.strip('`')]
