"""Write 60.completion_words.bash, from the parsers of the commands: what Tab offers behind `rosrun
smach_oracle COMMAND`.

Run it in the environment of scripts/ros_env when an option has changed.
"""

import argparse
import importlib
import json
import os
import runpy
import signal
import sys
import textwrap
import traceback
from pathlib import Path
from typing import Any, Dict, List, Tuple

HERE = Path(__file__).resolve().parent
SCRIPTS = HERE.parent / 'scripts'
TARGET = HERE / '60.completion_words.bash'
# most of the time of a command up to its parser, where each has to import them
IMPORTED_FIRST = ('rospy', 'numpy', 'yaml', 'smach', 'smach_oracle')


def known_to(parser: argparse.ArgumentParser) -> Dict[str, Any]:
    """The options and works that a parser knows."""
    found: Dict[str, Any] = {'options': {}, 'works': {}}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found['works'] = {name: known_to(below) for name, below in action.choices.items()}
        elif action.help != argparse.SUPPRESS:
            for name in action.option_strings:
                found['options'][name] = [str(each) for each in action.choices or ()]
    return found


def run_up_to_parser(tell: int, command: List[str]) -> None:
    """In a child: run a command up to its parser, and write what that knows."""

    def told(parser: argparse.ArgumentParser, *_: Any, **__: Any) -> None:
        os.write(tell, json.dumps(known_to(parser)).encode())
        os._exit(0)

    parser = argparse.ArgumentParser
    setattr(parser, 'parse_args', told)
    setattr(parser, 'parse_known_args', told)
    sys.argv[:] = [*command, 'x']
    sys.path[0] = os.path.dirname(command[0])
    runpy.run_path(command[0], run_name='__main__')


def ask(script: Path, *work: str) -> Dict[str, Any]:
    """The options and works that the parser of a command, or of one of its works, knows."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        signal.alarm(120)  # one that waits for something before its parser is ended
        try:
            run_up_to_parser(writing, [str(script), *work])
        except BaseException:
            traceback.print_exc()
        os._exit(1)  # it has come to no parser
    os.close(writing)
    with os.fdopen(reading, 'rb') as stream:
        told = stream.read()
    if os.waitpid(child, 0)[1]:
        raise RuntimeError('{} comes to no parser'.format(script))
    found: Dict[str, Any] = json.loads(told.decode())
    for name, below in found['works'].items():
        if not below['options']:  # the command loads no work before it is named
            found['works'][name] = ask(script, *work, name)
    return found


def lines_of(key: str, known: Dict[str, Any]) -> List[Tuple[str, str]]:
    """Return the words that may follow a command, one of its works, or one of its options."""
    more = [] if ' ' in key else ['--version']
    lines = [(key, ' '.join(sorted([*known['options'], *known['works'], *more])))]
    lines += [
        ('{} {}'.format(key, option), ' '.join(choices))
        for option, choices in sorted(known['options'].items())
        if choices
    ]
    for name, below in sorted(known['works'].items()):
        lines += lines_of('{} {}'.format(key, name), below)
    return lines


def folded(words: str) -> str:
    """The words in lines of at most 80 characters."""
    return '\n'.join(textwrap.wrap(words, 80, break_long_words=False, break_on_hyphens=False))


def _is_offered(script: bytes) -> bool:
    """Whether it is a command, by its present name."""
    return script.startswith(b'#!/usr/bin/env python3') and b'run_renamed(' not in script


def text() -> str:
    """The whole file."""
    scripts = [
        path
        for path in sorted(SCRIPTS.iterdir())
        if path.is_file() and _is_offered(path.read_bytes())
    ]
    for name in IMPORTED_FIRST:
        importlib.import_module(name)
    found = [ask(script) for script in scripts]
    cases = [line for script, known in zip(scripts, found) for line in lines_of(script.name, known)]
    table = ''.join(
        "    '{}')\n      echo '{}' ;;\n".format(key, folded(words)) for key, words in cases
    )
    return (
        '# The words of 61.completion. Written by write_completion.py.\n'
        "_smach_oracle_commands='{}'\n\n"
        '_smach_oracle_words() {{\n  case $1 in\n{}  esac\n}}\n'.format(
            folded(' '.join(script.name for script in scripts)), table
        )
    )


if __name__ == '__main__':
    TARGET.write_text(text(), 'utf-8')
