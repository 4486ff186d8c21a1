"""The parameters of the world node."""

import os
from dataclasses import dataclass
from typing import Any, Callable

from rosgraph.names import is_legal_name

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.checks import checked, setting
from smach_oracle.oracle.settings.paths import check_writable, path_of

from ..scenes.cause_draws import LASTING_SHARE
from ..scenes.tasks import TASKS

NONE = 'none'


def _number(low: float, high: float) -> checks.Check:
    return checks.number(low, high, 'a number from {:g} to {:g}'.format(low, high))


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


@dataclass(frozen=True)
class WorldSettings:
    """Parameters of the node, by their names without the tilde."""

    # whose scenes are drawn
    task: str = setting(TASKS[0], checks.choice(TASKS))
    # of the scene that is there before the first reset
    seed: int = setting(0, checks.whole(0, 'a whole number from 0'))
    benign: bool = setting(False, checks.flag)  # scenes without causes to fail
    # the share of the causes that last
    lasting: float = setting(LASTING_SHARE, _number(0.0, 1.0))
    # simulated s per wall s. 0 means as fast as possible, frozen while nothing is commanded
    real_time_factor: float = setting(0.0, _number(0.0, 100.0))
    # at factor 0: s that the clock goes on per wall s while nothing is commanded
    idle_speed: float = setting(10.0, _number(0.0, 1000.0))
    # at factor 0: wall s that nothing was commanded before the clock goes on alone
    idle_grace: float = setting(0.1, _number(0.0, 60.0))
    # file of a lab that goes on from trial to trial. None means each trial has a fresh world
    lab: str = setting(NONE, _file)
    truth_file: str = setting(NONE, _writable_file)  # gets a line of JSON on each trial that ended
    # joint states and transforms per simulated s. At factor 0 the default is 1
    state_rate: float = setting(10.0, _number(0.1, 60.0))
    # images per simulated s for those who subscribe. At factor 0 the default is 0: snapshots
    camera_rate: float = setting(2.0, _number(0.0, 30.0))
    film: str = setting(NONE, _folder)  # folder that gets a video of each trial
    # topic of a machine's events, which captions of the videos tell
    film_events: str = setting(NONE, _topic)
    # offer the truth to everybody, as services world/reveal and world/judge: to try things out
    reveal: bool = setting(False, checks.flag)
    # columns and rows of the camera's sensor that make one pixel of its images
    camera_binning: int = setting(1, _one_or_two)
    # in place of the usual causes one of the extra kinds in each scene, half of which last
    extra_causes: bool = setting(False, checks.flag)

    @property
    def lock_step(self) -> bool:
        """Whether time is that of the commands, and not that of a wall clock."""
        return self.real_time_factor == 0


def read_settings(get: Callable[[str, Any], Any]) -> WorldSettings:
    """Settings out of parameters.

    :param get: ``get(name, default)``, as rospy.get_param.
    :raises SettingsError: naming the parameter, its value and what is allowed.
    """
    defaults = dict(vars(WorldSettings()))
    if not get('~real_time_factor', 0.0):
        defaults.update(state_rate=1.0, camera_rate=0.0)
    given = {name: get('~' + name, default) for name, default in defaults.items()}
    settings = WorldSettings(**checked(WorldSettings, '~', given))
    if settings.extra_causes and (settings.benign or settings.lab != NONE):
        raise SettingsError('~extra_causes', True, 'false, where ~benign or ~lab is given')
    return settings
