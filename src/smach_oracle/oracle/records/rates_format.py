"""The format of a rates file, and how it is written. Pure, and without smach.

Format: {"format": "smach_oracle rates", "version": 1, "containers": {PATH: {STATE: estimator
snapshot}}, "machines": {NAME: containers}}, with PATH relative to the top machine ('' itself).
"machines" is there once a machine with a name has written. "containers" has all states of all
machines then, for programs that do not know "machines". A machine without a name goes by ''.
"states": {NAME: {PATH: [STATE]}} has the states of each, also those without a result. "renamed":
{NAME: NEW NAME} has the machines whose rates one under a new name has taken over.
"failure_rules": {NAME: RULE} has the rule by which failures of a machine were told when it last
wrote. Files of earlier versions do not have it.
"""

import contextlib
import json
import os
import tempfile
from typing import Dict, List, Mapping, Optional

from ..settings.failure_rule import FailureRule
from .folder_locks import folder_lock

FORMAT = 'smach_oracle rates'
VERSION = 1
States = Dict[str, Mapping[str, object]]  # what was learned, by label
Containers = Dict[str, States]  # by path below the top machine
Labels = Dict[str, List[str]]  # by path, too


class Machines(Dict[str, Containers]):
    """What a file has, by the names of machines, '' for one that has none."""

    def __init__(
        self,
        content: Mapping[str, Containers],
        states: object = None,
        renamed: object = None,
        rules: object = None,
    ) -> None:
        """`states`: of each. `renamed`: new names, by those whose rates have gone there, too.

        `rules`: by which failures were told, as plain data.
        """
        super().__init__(content)
        self.states: Dict[str, Labels] = states if isinstance(states, dict) else {}
        self.renamed: Dict[str, str] = renamed if isinstance(renamed, dict) else {}
        self.rules: Dict[str, object] = rules if isinstance(rules, dict) else {}


def write_learned(path: str, containers: Mapping[str, States], rule: Optional[FailureRule]) -> None:
    """Write what `learned_by` returned, in place of all that the file had.

    `rule`: by which failures were told, where that is known.

    :raises OSError: where it cannot be written. The old file is then untouched.
    """
    path = os.path.realpath(path)
    with folder_lock(os.path.dirname(path)):
        rules = {} if rule is None else {'': rule.as_data()}
        write_machines(path, Machines({'': dict(containers)}, rules=rules), '')


def write_machines(path: str, machines: Machines, name: str) -> None:
    """Write all. In "containers" the machine of this name wins, as the latest."""
    machines.renamed.pop(name, None)  # it is there again
    containers: Containers = {}
    for each in [each for each in machines if each != name] + [name]:
        for place, states in machines[each].items():
            containers.setdefault(place, {}).update(states)
    content = {'format': FORMAT, 'version': VERSION, 'containers': containers}
    if set(machines) != {''}:
        content['machines'], content['states'] = machines, machines.states
    if machines.rules:
        content['failure_rules'] = machines.rules
    if machines.renamed:
        content['renamed'] = machines.renamed
    text = json.dumps(content, indent=1, sort_keys=True)
    folder = os.path.dirname(path)
    descriptor, temporary = tempfile.mkstemp(
        prefix=os.path.basename(path) + '.', suffix='.tmp', dir=folder
    )
    try:
        with os.fdopen(descriptor, 'w', encoding='utf-8') as stream:
            stream.write(text + '\n')
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.remove(temporary)
        raise
    with contextlib.suppress(OSError):  # not every file system lets folders be synced
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
