"""Tab behind the commands: what it offers is what their parsers know."""

import subprocess
import sys

import pytest
from house import ROOT

WORDS = ROOT / 'env-hooks/60.completion_words.bash'
FILE = ROOT / 'env-hooks/61.completion.bash'
ASK = """{before}
source "{words_file}"
source "{file}"
COMP_WORDS=({words})
COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
{function} {first}
printf '%s\\n' "${{COMPREPLY[@]}}"
complete -p rosrun"""
ROSBASH = 'theirs() { COMPREPLY=(theirs); }; complete -F theirs rosrun'


def offered(words, function='_smach_oracle_rosrun', before=':'):
    """What Tab offers for the last of the words."""
    script = ASK.format(
        before=before,
        words_file=WORDS,
        file=FILE,
        words=words,
        function=function,
        first=words.split()[0],
    )
    done = (
        subprocess.run(['bash', '-euc', script], stdout=subprocess.PIPE, check=True, timeout=30)
        .stdout.decode()
        .splitlines()
    )
    assert done[-1].endswith('-F _smach_oracle_rosrun rosrun')
    return [line for line in done[:-1] if line]


@pytest.mark.parametrize(
    'words, first',
    [
        ('rosrun sma', 'smach_oracle'),
        ('rosrun smach_oracle bag_st', 'bag_statistics'),
        ('rosrun smach_oracle bag_statistics --js', '--json'),
        ('rosrun smach_oracle bag_statistics bags --js', '--json'),
        ('rosrun smach_oracle bag_statistics --x-axis ti', 'time'),
        ('rosrun smach_oracle run_trials --task pick', 'pick_and_place'),
        ('rosrun smach_oracle compare wh', 'what_if'),
        ('rosrun smach_oracle compare what_if bags --js', '--json'),
        ('rosrun smach_oracle comp', 'compare'),
    ],
)
def test_one_word_is_offered(words, first):
    assert offered(words) == [first]


def test_a_command_by_its_path_is_completed_too():
    assert offered('scripts/learn --expl', '_smach_oracle_direct') == ['--explain']


def test_the_words_of_a_command_with_works_are_offered():
    works = offered("rosrun smach_oracle oracle_state ''")
    assert len([word for word in works if not word.startswith('-')]) > 2


def test_other_packages_are_completed_as_before():
    assert offered('rosrun turtlesim turtle', before=ROSBASH) == ['theirs']
    twice = '{}; source "{}"; source "{}"'.format(ROSBASH, WORDS, FILE)
    assert offered('rosrun turtlesim turtle', before=twice) == ['theirs']


def test_the_file_is_what_the_parsers_say_now():
    code = 'import write_completion; print(write_completion.text(), end="")'
    told = subprocess.run(
        [sys.executable, '-c', code],
        cwd=str(ROOT / 'env-hooks'),
        timeout=500,
        stdout=subprocess.PIPE,
        check=True,
    ).stdout.decode()
    assert WORDS.read_text(encoding='utf-8') == told[told.index('# The words') :], (
        'run env-hooks/write_completion.py'
    )
