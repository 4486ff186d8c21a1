"""The settings of a variant by one line: those that the robot brings, and no other."""

from pathlib import Path

import yaml

TASKS_FOLDER = Path(__file__).parent.parent / 'tasks'
CONFIG_FILE = 'one_line.yaml'
GROUP, OF_THE_ROBOT = 'expert', 'interfaces'  # what it offers, whoever writes the task


def write_config(folder: Path, task: str) -> Path:
    """Write the settings of a task without all that its author has set, and return the file.

    :raises OSError: where it cannot be read or written.
    """
    settings = yaml.safe_load((TASKS_FOLDER / (task + '.yaml')).read_text(encoding='utf-8'))
    path = folder / CONFIG_FILE
    group = settings.get(GROUP, {})
    kept = {GROUP: {OF_THE_ROBOT: group[OF_THE_ROBOT]}} if OF_THE_ROBOT in group else {}
    path.write_text(yaml.safe_dump(kept, sort_keys=True), encoding='utf-8')
    return path
