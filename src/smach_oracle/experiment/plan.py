"""The plan of an experiment: what it consists of, and how its folder remembers it."""

import itertools
import json
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

EXPERIMENT_FILE = 'experiment.json'
LIMITS = 'hung_after_s'  # key of the limits that trials were run with, in the order of their use
FORMAT = 'smach_oracle experiment'
VERSION = 1
SPEED = 4  # world's s per wall s, of a world that is not in lock-step
ARMS = 'arms'  # key of the variants in an experiment's file: the older name
BARE = 'bare'  # name of the variant without the oracle
DEFAULT = 'default'  # and of that with the oracle as the task has it
ONE_LINE = 'one_line:'  # before a policy's name: no settings but the robot's own interfaces
CONFIGURED = 'configured'  # a setting's value that leaves it as the task has it
PACKAGES = ('pybullet', 'ompl', 'numpy', 'scipy', 'opencv-python-headless', 'example-robot-data')


class ExperimentError(Exception):
    """The experiment cannot be run. The text says which part of it, why and where its log is."""


class RunTask(NamedTuple):
    """A task that can be run."""

    launch_file: str
    trials: int  # by default: as many as the paper has of it, where it has it
    # its world waits for commands. So the same seed gives the same trial, and causes can be told
    # to last, and the world to go on from trial to trial
    lock_step: bool = True

    def arguments(self) -> Dict[str, Any]:
        """Return arguments of the launch file that every trial of the task has."""
        return {} if self.lock_step else {'speed': SPEED}


TASKS: Dict[str, RunTask] = {
    'pick_and_place': RunTask('pick_and_place.launch', 150),
    'drink_retrieval': RunTask('drink_retrieval.launch', 100),
    'inspection': RunTask('inspection.launch', 60, lock_step=False),
}


class Variant(NamedTuple):
    """Trials under the same oracle, or without one. Its name is that of its folder."""

    name: str
    recovers: bool
    settings: Mapping[str, Any]  # of the oracle, over those of the task
    one_line: bool = False  # of the task's settings, only the interfaces are in force

    def as_data(self) -> Dict[str, Any]:
        """Return it as plain data, as a plan's file has it."""
        data = dict(self._asdict(), settings=dict(self.settings))
        if not self.one_line:  # folders of older versions do not have it
            del data['one_line']
        return data


class ExperimentPlan(NamedTuple):
    """An experiment: each variant runs in each replicate, on the same seeds."""

    task: str
    trials: int
    seed: int
    replicates: int
    variants: Tuple[Variant, ...]
    answer_delay: float  # s
    benign: bool = False  # worlds without causes to fail
    lasting: Optional[float] = None  # share of the causes that last. None means the world's own
    hours: Optional[float] = None  # of a world that goes on. None means each trial has a fresh one
    # trials in which nothing fails are run by the bare script alone, and count for all variants
    shares: bool = False
    extra_causes: bool = False  # one of the extra kinds in each trial, and none of the usual ones

    def first_seed(self, replicate: int) -> int:
        """Seed of the first trial of a replicate (from 0). Each next trial has the next seed."""
        return self.seed + replicate * self.trials

    @property
    def slot_h(self) -> Optional[float]:
        """h from the begin of a trial to that of the next, in a world that goes on."""
        return None if self.hours is None else self.hours / self.trials

    def as_data(self) -> Dict[str, Any]:
        """The plan as plain data, as its file has it."""
        data = self._asdict()
        del data['variants']
        # folders of older versions have none of them
        for name in ('lasting', 'hours', 'shares', 'extra_causes'):
            if data[name] in (None, False):
                del data[name]
        data[ARMS] = [variant.as_data() for variant in self.variants]
        return data


def make_variants(
    which: str, settings: Mapping[str, Any], varied: Mapping[str, Sequence[Any]]
) -> Tuple[Variant, ...]:
    """The variants: one with the oracle for each combination of what is varied, one without.

    :param which: 'both', 'with' or 'without'.
    :param settings: of every oracle.
    :param varied: settings with the values they take one after the other, e.g. {'memory': [5, 10]}.
    """
    variants: List[Variant] = []
    if which in ('both', 'with'):
        for values in itertools.product(*varied.values()):
            chosen = dict(zip(varied, values))
            named = ['{}_{}'.format(key, chosen[key]) for key in varied if len(varied[key]) > 1]
            given = {key: value for key, value in chosen.items() if value != CONFIGURED}
            variants.append(Variant('_'.join(['with_oracle'] + named), True, {**settings, **given}))
    if which in ('both', 'without'):
        variants.append(Variant('without_oracle', False, {}))
    return tuple(variants)


def named_variants(
    names: Sequence[str], settings: Mapping[str, Any], memories: Sequence[int] = ()
) -> Tuple[Variant, ...]:
    """Return variants by name: BARE, DEFAULT, or a policy, each with every memory.

    ONE_LINE may stand before a policy.

    :param settings: of every oracle.
    """
    variants: List[Variant] = []
    for name in dict.fromkeys(names):
        if name == BARE:
            variants.append(Variant(name, False, {}))
            continue
        one_line = name.startswith(ONE_LINE)
        policy = {} if name == DEFAULT else {'policy': name[len(ONE_LINE) :] if one_line else name}
        for memory in memories or [0]:
            given = {**settings, **policy, **({'memory': memory} if memory else {})}
            variants.append(
                Variant(
                    '{}_memory_{}'.format(name, memory) if len(memories) > 1 else name,
                    True,
                    given,
                    one_line,
                )
            )
    return tuple(variants)


def enter_folder(folder: Path, plan: ExperimentPlan, hung_after_s: Optional[float] = None) -> bool:
    """Make the folder of an experiment, or come back to it.

    :param hung_after_s: noted in its file. An experiment may go on with another one.
    :returns: whether it was there before: the experiment goes on.
    :raises ExperimentError: where it holds another experiment, or something else.
    :raises OSError: where it cannot be made or read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / EXPERIMENT_FILE
    if path.exists():
        content = _refuse_another(path, plan)
        limits = list(content.get(LIMITS, []))
        if hung_after_s is not None and limits[-1:] != [hung_after_s]:
            write_json(path, {**content, LIMITS: [*limits, hung_after_s]})
        return True
    if any(item.name != '.lock' for item in folder.iterdir()):
        raise ExperimentError(
            '{}: not empty, and no experiment: there is no {} in it'.format(folder, EXPERIMENT_FILE)
        )
    write_json(
        path,
        {
            'format': FORMAT,
            'version': VERSION,
            'settings': plan.as_data(),
            'software': software(),
            **({} if hung_after_s is None else {LIMITS: [hung_after_s]}),
        },
    )
    return False


def _refuse_another(path: Path, plan: ExperimentPlan) -> Dict[str, Any]:
    """Return the content of an experiment's file, where its settings are these."""
    try:
        content = json.loads(path.read_text(encoding='utf-8'))
        there, ours = content['settings'], json.loads(json.dumps(plan.as_data()))
        known = (content['format'], content['version']) == (FORMAT, VERSION) and isinstance(
            there, dict
        )
    except (ValueError, KeyError, TypeError) as err:
        raise ExperimentError('{}: no settings of an experiment: {!r}'.format(path, err)) from err
    if not known:
        raise ExperimentError('{}: not written by this version'.format(path))
    differing = [key for key in sorted(set(there) | set(ours)) if there.get(key) != ours.get(key)]
    if differing:
        raise ExperimentError(
            '{}: an experiment with other settings was begun there ({}); go on with those, or give '
            'another --output'.format(
                path.parent,
                '; '.join(
                    '{}: there {}, now {}'.format(
                        'variants' if key == ARMS else key,
                        setting_text(there.get(key)),
                        setting_text(ours.get(key)),
                    )
                    for key in differing
                ),
            )
        )
    return dict(content)


def setting_text(value: Any) -> str:
    """A setting for an error's text. Variants by their names and settings."""
    if isinstance(value, list):
        return ', '.join(
            '{} {}'.format(variant['name'], variant['settings'] or '').strip() for variant in value
        )
    return repr(value)


def software() -> Dict[str, str]:
    """Versions of what the trials were run with, for the record."""
    versions = {'python': platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return versions


def write_json(path: Path, content: Any) -> None:
    """Write a file as write_text() does.

    :raises OSError: where it cannot be written.
    """
    write_text(path, json.dumps(content, indent=1, sort_keys=True) + '\n')


def write_text(path: Path, text: str) -> None:
    """Write a file so that a crash at any moment leaves the old one or the new.

    :raises OSError: where it cannot be written.
    """
    temporary = path.with_name(path.name + '.tmp')
    with temporary.open('w', encoding='utf-8') as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(str(temporary), str(path))
