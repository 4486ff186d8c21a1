"""The command oracle_state: look at the store of stopped machines, and change what is in it."""

import argparse
import getpass
import socket
import sys
import time
from typing import List, Optional

from .errors import StoreError
from .holding import MachineLock
from .rows import StoredTrial
from .stopped_trial import (
    DAMAGE,
    StoppedTrial,
    chosen_trial,
    in_words,
    innermost,
    trial_to_change,
)
from .store_file import StoreFile

WRONG = 2  # exit code
IN_DOUBT = (
    '. The latest moments may be lost, and whole trials. So each machine asks a person '
    'before it moves, and repeats no state by itself that has `on_retry`'
)


def main(arguments: Optional[List[str]] = None) -> int:
    """Run the command, and return its exit code."""
    given = _parser().parse_args(arguments)
    try:
        given.work(given)
    except StoreError as err:
        sys.stderr.write('oracle_state: {}\n'.format(err))
        return WRONG
    except DAMAGE as err:
        sys.stderr.write('oracle_state: {}: is damaged: {!r}\n'.format(given.path, err))
        return WRONG
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='oracle_state',
        description='Look at the stored state of machines whose program has '
        'stopped, and change it before it goes on. Nothing is changed while a program holds the '
        'machine.',
    )
    parser.add_argument(
        'path', metavar='STORE', help='the store, as the setting `checkpoint` names it'
    )
    parser.set_defaults(work=_list)
    works = parser.add_subparsers(metavar='WHAT')
    works.add_parser('list', help='all trials (default)').set_defaults(work=_list)
    show = _add(works, 'show', _show, 'where the machine stood, and its userdata')
    show.add_argument('--at', type=int, metavar='NUMBER', help='an earlier moment')
    _add(works, 'moments', _moments, 'the moments of a trial, with their numbers')
    _add(works, 'log', _log, 'what was changed by hand, when and by whom')
    edit = _add(works, 'edit', _edit, 'give a userdata key another value')
    edit.add_argument('assignment', metavar='KEY=JSON', help='such as count=3 or name=\'"cup"\'')
    edit.add_argument('--container', metavar='PATH', help='by default the top machine')
    go_to = _add(works, 'goto', _go_to, 'let it go on at another state')
    go_to.add_argument(
        'label', metavar='LABEL', help='of a state, or its path below the top machine'
    )
    go_to.add_argument(
        '--repeat',
        metavar='STATE',
        action='append',
        default=[],
        help='let it repeat this state once, whatever its on_retry says (repeatable)',
    )
    _add(works, 'drop', _drop, 'end the trial: it is never resumed')
    works.add_parser(
        'accept', help='go on with what can be read of a store that has lost some of it'
    ).set_defaults(work=_accept)
    return parser


def _add(
    works: 'argparse._SubParsersAction[argparse.ArgumentParser]',
    name: str,
    work: object,
    about: str,
) -> argparse.ArgumentParser:
    parser = works.add_parser(name, help=about, description=about)
    parser.add_argument(
        '--trial', type=int, metavar='NUMBER', help='by default the latest one that has not ended'
    )
    parser.set_defaults(work=work)
    return parser


def _list(given: argparse.Namespace) -> None:
    store = StoreFile(given.path, read_only=True)
    trials = store.trials()
    if not trials:
        sys.stdout.write('no trial is stored\n')
    for trial in trials:
        sys.stdout.write(
            '{:>5}  {:<20} {}  {:>6} moments  {}\n'.format(
                trial.number,
                trial.machine,
                _when(trial.begun),
                trial.moments,
                _how_it_is(store, trial),
            )
        )


def _how_it_is(store: StoreFile, trial: StoredTrial) -> str:
    if trial.ended is not None:
        return 'ended: ' + trial.outcome
    if MachineLock(store.path, trial.machine).is_held_elsewhere():
        return 'runs'
    stopped = StoppedTrial(store, trial)
    standing = stopped.places()
    if not standing:
        return 'stopped before it began'
    how = (
        'kept, as nobody answered'
        if stopped.is_kept()
        else 'not stored to its end, last'
        if stopped.is_broken()
        else 'stopped'
    )
    return '{}: {}'.format(how, ', '.join(map(in_words, innermost(standing))))


def _show(given: argparse.Namespace) -> None:
    store = StoreFile(given.path, read_only=True)
    trial = chosen_trial(store, given.trial)
    if given.at is not None:
        trial = _trial_of(store, given.at, trial if given.trial is not None else None)
    stopped = StoppedTrial(store, trial, given.at)
    _say(
        'trial {} of {}, begun {}: {}'.format(
            trial.number, trial.machine, _when(trial.begun), _how_it_is(store, trial)
        )
    )
    _say('\nWhere it stood')
    for standing in stopped.places():
        _say('  ' + in_words(standing))
    for path, number in stopped.items():
        _say('  {} was at item {}'.format(path, number))
    for path, question in stopped.questions():
        _say('  question {} about {} was open'.format(question, path))
    for path, count in stopped.recoveries():
        _say('  {} was recovered from {} time{}'.format(path, count, '' if count == 1 else 's'))
    _say('\nUserdata')
    for path, key, text in stopped.userdata():
        _say('  {} {} = {}'.format(path, key, text))


def _trial_of(store: StoreFile, moment: int, wanted: Optional[StoredTrial]) -> StoredTrial:
    """Return the trial of a moment.

    :raises StoreError: where there is no such moment, or it is not of the trial that is wanted.
    """
    trial = store.trial_of(moment)
    if trial is None or (wanted is not None and wanted.number != trial.number):
        raise StoreError(
            '{}: there is no moment {}{}; `moments` lists them'.format(
                store.path, moment, '' if wanted is None else ' of trial {}'.format(wanted.number)
            )
        )
    return trial


def _moments(given: argparse.Namespace) -> None:
    store = StoreFile(given.path, read_only=True)
    for moment in store.moments(chosen_trial(store, given.trial).number):
        _say(
            '{:>7}  {}  {:<18} {}{}'.format(
                moment.number,
                _when(moment.at),
                moment.kind.lower(),
                '/'.join(filter(None, (moment.path, moment.label))),
                '' if moment.after is None else '  (goes on from {})'.format(moment.after),
            )
        )


def _log(given: argparse.Namespace) -> None:
    for line in StoreFile(given.path, read_only=True).log():
        _say('{}  {:<20} {}'.format(_when(line.at), line.who, line.what))


def _edit(given: argparse.Namespace) -> None:
    key, equals, text = given.assignment.partition('=')
    if not equals or not key.strip():
        raise StoreError('{!r}: KEY=JSON is wanted, such as count=3'.format(given.assignment))
    key = key.strip()
    with trial_to_change(given.path, given.trial) as stopped:
        path = given.container or stopped.trial.machine
        keys = stopped.keys(path)
        stopped.edit(key, text, path, _user_name())
        is_under_way = stopped.is_under_way(path)
    _say(
        '{} is changed'.format(key)
        if key in keys
        else '{} is new: {} had {}'.format(key, path, ', '.join(keys) or 'no key')
    )
    if not is_under_way:
        _say(
            '{} is not under way: as it begins, its input keys get the values of {}'.format(
                path, path.rpartition('/')[0]
            )
        )


def _go_to(given: argparse.Namespace) -> None:
    with trial_to_change(given.path, given.trial) as stopped:
        stopped.go_to(given.label, _user_name(), given.repeat)
        asked = [each for each in stopped.guarded() if each not in given.repeat]
    _say(
        'it will go on at {}{}'.format(
            given.label,
            '; a person is asked before it repeats ' + ', '.join(asked) if asked else '',
        )
    )


def _drop(given: argparse.Namespace) -> None:
    with trial_to_change(given.path, given.trial) as stopped:
        stopped.drop(_user_name())
    _say('trial {} is dropped'.format(stopped.trial.number))


def _accept(given: argparse.Namespace) -> None:
    store = StoreFile(given.path, accept_by=_user_name())
    try:
        trials = store.trials()
    finally:
        store.close()
    _say(
        '{} is accepted as it is, with {} trial{}{}'.format(
            given.path,
            len(trials),
            '' if len(trials) == 1 else 's',
            IN_DOUBT if store.was_damaged else '',
        )
    )


def _user_name() -> str:
    try:
        name = getpass.getuser()
    except (KeyError, OSError):  # a user without a name, as in some containers
        name = 'unknown'
    return '{}@{}'.format(name, socket.gethostname())


def _when(at: float) -> str:
    return time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(at))


def _say(text: str) -> None:
    sys.stdout.write(text + '\n')
