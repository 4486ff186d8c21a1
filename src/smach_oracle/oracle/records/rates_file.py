"""Learned rates, kept from program to program in a JSON file.

A crash at any moment leaves the old file or the new one.

Format: {"format": "smach_oracle rates", "version": 1, "containers": {PATH: {STATE: estimator
snapshot}}}, with PATH relative to the top machine ('' itself), so that renaming the machine loses
nothing.
"""
import json
import os
import tempfile
from typing import Any, Dict, Iterable, Mapping, Protocol

import smach

FORMAT = 'smach_oracle rates'
VERSION = 1
DAMAGED = '.damaged'


class Learner(Protocol):
    """A container that learns rates."""

    @property
    def path(self) -> str:
        """Its path, for messages."""

    @property
    def relative_path(self) -> str:
        """Its path below the top machine, '' for that itself."""

    def learned_rates(self) -> Dict[str, Any]:
        """Return what was learned of each state, as plain data."""

    def learn(self, label: str, learned: Mapping[str, Any]) -> None:
        """Take over what was learned of a state.

        :raises ValueError: where it cannot be read.
        """


def learned_by(containers: Iterable[Learner]) -> Dict[str, Dict[str, Any]]:
    """Return what was learned, as the "containers" of a rates file."""
    learned: Dict[str, Dict[str, Any]] = {}
    for container in containers:  # the branches of a Concurrence have one path, each a state of it
        learned.setdefault(container.relative_path, {}).update(container.learned_rates())
    return learned


def write_rates(path: str, learners: Iterable[Learner]) -> None:
    """Write what was learned to `path`, atomically and durably.

    :raises OSError: where it cannot be written. The old file is
    then untouched.
    """
    write_learned(path, learned_by(learners))


def write_learned(path: str, containers: Mapping[str, Any]) -> None:
    """Write what `learned_by` returned, as `write_rates` does.

    :raises OSError: where it cannot be written. The old file is then untouched.
    """
    text = json.dumps({'format': FORMAT, 'version': VERSION, 'containers': containers}, indent=1,
                      sort_keys=True)
    folder = os.path.dirname(os.path.abspath(path))
    descriptor, temporary = tempfile.mkstemp(prefix=os.path.basename(path) + '.', suffix='.tmp',
                                             dir=folder)
    try:
        with os.fdopen(descriptor, 'w', encoding='utf-8') as stream:
            stream.write(text + '\n')
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        _remove(temporary)
        raise
    _sync_folder(folder)


def _remove(path: str) -> None:
    try:
        os.remove(path)
    except OSError:
        pass


def _sync_folder(folder: str) -> None:
    """Make the renaming durable, where the file system lets folders be synced."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(descriptor)
    except OSError:
        pass
    finally:
        os.close(descriptor)


def read_rates(path: str, learners: Iterable[Learner]) -> None:
    """Take over the rates in `path`.

    A file that is not there is no matter. One that cannot be read is warned of. A damaged one is
    set aside as PATH.damaged and warned of, and the states start from their priors.
    """
    try:
        with open(path, encoding='utf-8') as stream:
            containers = _checked(json.load(stream))
    except FileNotFoundError:
        return
    except OSError as err:
        smach.logwarn('Rates file {} cannot be read, starting from the priors: {}'.format(
            path, err))
        return
    except (ValueError, RecursionError) as err:
        smach.logwarn('Rates file {} is damaged ({}), {}; starting from the priors'.format(
            path, err, _set_aside(path)))
        return
    for learner in learners:
        _hand_over(path, learner, containers.get(learner.relative_path, {}))


def _checked(content: Any) -> Dict[str, Dict[str, Any]]:
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise ValueError('it is no file of {}'.format(FORMAT))
    if content.get('version') != VERSION:
        raise ValueError('it has version {!r}, known is {}'.format(content.get('version'), VERSION))
    containers = content.get('containers')
    if not isinstance(containers, dict) or not all(
            isinstance(states, dict) for states in containers.values()):
        raise ValueError('it has no states')
    return containers


def _set_aside(path: str) -> str:
    try:
        os.replace(path, path + DAMAGED)
    except OSError as err:
        return 'it could not be set aside ({})'.format(err)
    return 'it is kept as {}'.format(path + DAMAGED)


def _hand_over(path: str, learner: Learner, states: Dict[str, Any]) -> None:
    for label, learned in states.items():
        try:
            learner.learn(label, learned)
        except (ValueError, TypeError, AttributeError) as err:
            smach.logwarn('Rates file {}: {!r} of {} cannot be used: {}'.format(
                path, label, learner.path, err))
