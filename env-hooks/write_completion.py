"""Write 60.completion.bash, from the parsers of the commands: what Tab offers behind `rosrun
smach_oracle COMMAND`.

Run it in the environment of scripts/ros_env when an option has changed.
"""
import json
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Dict, List, Tuple

HERE = Path(__file__).resolve().parent
SCRIPTS = HERE.parent / 'scripts'
TARGET = HERE / '60.completion.bash'
# runs a command up to its parser, and prints what that knows
ASK = '''
import argparse, json, runpy, sys

def known(parser):
    found = {'options': {}, 'works': {}}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found['works'] = {name: known(below) for name, below in action.choices.items()}
        elif action.help != argparse.SUPPRESS:
            for name in action.option_strings:
                found['options'][name] = [str(each) for each in action.choices or ()]
    return found

def told(parser, *args, **kwargs):
    print(json.dumps(known(parser)))
    raise SystemExit(0)

argparse.ArgumentParser.parse_args = argparse.ArgumentParser.parse_known_args = told
sys.argv[:] = [sys.argv[1], 'x']
runpy.run_path(sys.argv[0], run_name='__main__')
'''
FUNCTIONS = '''
# behind COMMAND: its options, what one of them takes, or files
_smach_oracle_behind() {
  local key=$1 current=${COMP_WORDS[COMP_CWORD]} words
  words=$(_smach_oracle_words "$key ${COMP_WORDS[COMP_CWORD - 1]}")
  [[ -n $words ]] || words=$(_smach_oracle_words "$key")
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}

_smach_oracle_direct() {
  local word key=${1##*/}
  for word in "${COMP_WORDS[@]:1:COMP_CWORD - 1}"; do
    [[ -z $(_smach_oracle_words "$key $word") || $word == -* ]] || key="$key $word"
  done
  _smach_oracle_behind "$key"
}

_smach_oracle_rosrun() {
  local current=${COMP_WORDS[COMP_CWORD]} word key=${COMP_WORDS[2]-}
  if [[ ${COMP_WORDS[1]-} == smach_oracle ]] && ((COMP_CWORD > 2)); then
    for word in "${COMP_WORDS[@]:3:COMP_CWORD - 3}"; do
      [[ -z $(_smach_oracle_words "$key $word") || $word == -* ]] || key="$key $word"
    done
    _smach_oracle_behind "$key"
  elif declare -F "$_smach_oracle_others" >/dev/null; then
    "$_smach_oracle_others" "$@"
  elif ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W smach_oracle -- "$current")
  elif [[ ${COMP_WORDS[1]-} == smach_oracle ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$_smach_oracle_commands" -- "$current")
  fi
}

# rosbash's, where it has been sourced before
_smach_oracle_before=$(complete -p rosrun 2>/dev/null | sed -n 's/.* -F \\([^ ]*\\).*/\\1/p')
[[ $_smach_oracle_before == _smach_oracle_rosrun ]] ||
  _smach_oracle_others=${_smach_oracle_before:-_smach_oracle_nobody}
unset _smach_oracle_before
complete -o default -F _smach_oracle_rosrun rosrun
# shellcheck disable=SC2086  # a list of words
complete -o default -F _smach_oracle_direct $_smach_oracle_commands
'''


def ask(script: Path) -> Dict[str, Any]:
    """The options and works that a command's parser knows."""
    told = subprocess.run([sys.executable, '-c', ASK, str(script)], stdout=subprocess.PIPE,
                          check=True, timeout=120).stdout
    found: Dict[str, Any] = json.loads(told.decode().splitlines()[-1])
    return found


def lines_of(key: str, known: Dict[str, Any]) -> List[Tuple[str, str]]:
    """What may follow a command, one of its works, or one of its options."""
    more = [] if ' ' in key else ['--version']
    lines = [(key, ' '.join(sorted([*known['options'], *known['works'], *more])))]
    lines += [('{} {}'.format(key, option), ' '.join(choices))
              for option, choices in sorted(known['options'].items()) if choices]
    for name, below in sorted(known['works'].items()):
        lines += lines_of('{} {}'.format(key, name), below)
    return lines


def folded(words: str) -> str:
    """The words in lines of at most 80 characters."""
    return '\n'.join(textwrap.wrap(words, 80, break_long_words=False, break_on_hyphens=False))


def text() -> str:
    """The whole file."""
    scripts = [path for path in sorted(SCRIPTS.iterdir())
               if path.is_file() and path.read_bytes().startswith(b'#!/usr/bin/env python3')]
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(ask, scripts))
    cases = [line for script, known in zip(scripts, found)
             for line in lines_of(script.name, known)]
    table = ''.join("    '{}')\n      echo '{}' ;;\n".format(key, folded(words))
                    for key, words in cases)
    return ('# Tab completion of the commands of smach_oracle. Written by write_completion.py.\n'
            "_smach_oracle_commands='{}'\n\n_smach_oracle_words() {{\n  case $1 in\n{}  esac\n}}\n"
            .format(folded(' '.join(script.name for script in scripts)), table) + FUNCTIONS)


if __name__ == '__main__':
    TARGET.write_text(text(), 'utf-8')
