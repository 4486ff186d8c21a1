"""The parameters of the world node."""
from typing import Any, Callable, NamedTuple

from smach_oracle.oracle.errors import ConfigError
from smach_oracle.oracle.paths import check_writable, path_of

TASKS = ('pick_and_place', 'drink_retrieval')
NONE = 'none'


class WorldSettings(NamedTuple):
    """Parameters of the node, by their names without the tilde."""

    task: str = TASKS[0]  # whose scenes are drawn
    seed: int = 0  # of the scene that is there before the first reset
    benign: bool = False  # scenes without causes to fail
    real_time_factor: float = 0.0  # simulated s per wall s; 0: as fast as possible, frozen while nothing is commanded
    idle_speed: float = 10.0  # at factor 0: s that the clock goes on per wall s while nothing is commanded
    idle_grace: float = 0.1  # at factor 0: wall s that nothing was commanded before the clock goes on alone
    truth_file: str = NONE  # gets a line of JSON on each trial that has ended
    state_rate: float = 10.0  # joint states and transforms per simulated s; at factor 0 the default is 4
    camera_rate: float = 2.0  # frames per simulated s for those who subscribe; at factor 0 the default is 0: snapshots

    @property
    def lock_step(self) -> bool:
        """Whether time is that of the commands, and not that of a wall clock."""
        return self.real_time_factor == 0


def read_settings(get: Callable[[str, Any], Any]) -> WorldSettings:
    """Settings out of parameters.

    :param get: ``get(name, default)``, as rospy.get_param.
    :raises ConfigError: naming the parameter, its value and what is allowed.
    """
    factor = _number('real_time_factor', get, 0.0, 0.0, 100.0)
    task = get('~task', TASKS[0])
    if task not in TASKS:
        raise ConfigError('~task', task, ', '.join(TASKS))
    return WorldSettings(
        task=task, real_time_factor=factor,
        seed=_seed(get('~seed', 0)),
        benign=_truth('benign', get),
        idle_speed=_number('idle_speed', get, 10.0, 0.0, 1000.0),
        idle_grace=_number('idle_grace', get, 0.1, 0.0, 60.0),
        truth_file=_file('truth_file', get),
        state_rate=_number('state_rate', get, 10.0 if factor else 4.0, 0.1, 60.0),
        camera_rate=_number('camera_rate', get, 2.0 if factor else 0.0, 0.0, 30.0))


def _number(name: str, get: Callable[[str, Any], Any], default: float, lower: float, upper: float) -> float:
    value = get('~' + name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not lower <= value <= upper:
        raise ConfigError('~' + name, value, 'a number from {:g} to {:g}'.format(lower, upper))
    return float(value)


def _truth(name: str, get: Callable[[str, Any], Any]) -> bool:
    value = get('~' + name, False)
    if not isinstance(value, bool):
        raise ConfigError('~' + name, value, 'true or false')
    return value


def _file(name: str, get: Callable[[str, Any], Any]) -> str:
    value = get('~' + name, NONE)
    if not isinstance(value, str) or not value:
        raise ConfigError('~' + name, value, "a file's name, or {}".format(NONE))
    if value == NONE:
        return value
    path = path_of(value)
    check_writable('~' + name, path)
    return path


def _seed(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ConfigError('~seed', value, 'a whole number from 0')
    return value
