"""The parameters of the world node."""

import os
from typing import Any, Callable, NamedTuple, TypeVar

from rosgraph.names import is_legal_name

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.paths import check_writable, path_of

from ..scenes.cause_draws import LASTING_SHARE
from ..scenes.tasks import TASKS

NONE = 'none'
T = TypeVar('T')


class WorldSettings(NamedTuple):
    """Parameters of the node, by their names without the tilde."""

    task: str = TASKS[0]  # whose scenes are drawn
    seed: int = 0  # of the scene that is there before the first reset
    benign: bool = False  # scenes without causes to fail
    # the share of the causes that last, 0 to 1
    lasting: float = LASTING_SHARE
    # simulated s per wall s. 0 means as fast as possible, frozen while nothing is commanded
    real_time_factor: float = 0.0
    # at factor 0: s that the clock goes on per wall s while nothing is commanded
    idle_speed: float = 10.0
    # at factor 0: wall s that nothing was commanded before the clock goes on alone
    idle_grace: float = 0.1
    # file of a lab that goes on from trial to trial. None means each trial has a fresh world
    lab: str = NONE
    truth_file: str = NONE  # gets a line of JSON on each trial that has ended
    # joint states and transforms per simulated s. At factor 0 the default is 1
    state_rate: float = 10.0
    # images per simulated s for those who subscribe. At factor 0 the default is 0: snapshots
    camera_rate: float = 2.0
    film: str = NONE  # folder that gets a video of each trial
    # topic of a machine's events, which captions of the videos tell
    film_events: str = NONE
    # offer the truth to everybody, as services world/reveal and world/judge: to try things out
    reveal: bool = False
    # columns and rows of the camera's sensor that make one pixel of its images
    camera_binning: int = 1

    @property
    def lock_step(self) -> bool:
        """Whether time is that of the commands, and not that of a wall clock."""
        return self.real_time_factor == 0


def read_settings(get: Callable[[str, Any], Any]) -> WorldSettings:
    """Settings out of parameters.

    :param get: ``get(name, default)``, as rospy.get_param.
    :raises SettingsError: naming the parameter, its value and what is allowed.
    """

    def number(name: str, default: float, low: float, high: float) -> float:
        allowed = 'a number from {:g} to {:g}'.format(low, high)
        return taken(name, default, checks.number(low, high, allowed))

    def taken(name: str, default: T, check: checks.Check) -> T:
        value: T = check('~' + name, get('~' + name, default))
        return value

    factor = number('real_time_factor', 0.0, 0.0, 100.0)
    return WorldSettings(
        task=taken('task', TASKS[0], checks.choice(TASKS)),
        real_time_factor=factor,
        seed=taken('seed', 0, checks.whole(0, 'a whole number from 0')),
        benign=taken('benign', False, checks.flag),
        lasting=number('lasting', LASTING_SHARE, 0.0, 1.0),
        reveal=taken('reveal', False, checks.flag),
        idle_speed=number('idle_speed', 10.0, 0.0, 1000.0),
        idle_grace=number('idle_grace', 0.1, 0.0, 60.0),
        truth_file=taken('truth_file', NONE, _writable_file),
        lab=taken('lab', NONE, _file),
        film=taken('film', NONE, _folder),
        film_events=taken('film_events', NONE, _topic),
        state_rate=number('state_rate', 10.0 if factor else 1.0, 0.1, 60.0),
        camera_rate=number('camera_rate', 2.0 if factor else 0.0, 0.0, 30.0),
        camera_binning=taken('camera_binning', 1, _one_or_two),
    )


def _one_or_two(key: str, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value not in (1, 2):
        raise SettingsError(key, value, '1 or 2')
    return value


def _file(key: str, value: object) -> str:
    if not isinstance(value, str) or not value:
        raise SettingsError(key, value, "a file's name, or {}".format(NONE))
    return value if value == NONE else path_of(value)


def _folder(key: str, value: object) -> str:
    path = _file(key, value)
    if path != NONE:
        if not os.path.isdir(path):
            raise SettingsError(key, value, 'a folder that is there, or {}'.format(NONE))
        check_writable(key, os.path.join(path, '0.mp4'))
    return path


def _topic(key: str, value: object) -> str:
    if not isinstance(value, str) or not is_legal_name(value) or not value:
        raise SettingsError(key, value, 'the name of a topic, or {}'.format(NONE))
    return value


def _writable_file(key: str, value: object) -> str:
    path = _file(key, value)
    if path != NONE:
        check_writable(key, path)
    return path
