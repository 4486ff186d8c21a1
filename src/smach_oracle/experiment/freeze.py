"""The evaluation seeds, which nobody can choose: made of the protocol and of the code as committed.

The protocol names the folders. A freeze appends a line to a log that is committed, too: it has
every freeze, abandoned ones as well.
"""

import csv
import hashlib
import re
import subprocess
from datetime import datetime, timezone
from pathlib import Path
from typing import Dict, List, Mapping, NamedTuple

from .plan import ExperimentError

PROTOCOL, LOG = 'doc/protocol.md', 'doc/freezes.csv'
COLUMNS = ('date', 'commit', 'what', 'protocol_sha256', 'first_seed', 'note')
FROZEN, ABANDONED = 'frozen', 'abandoned'
NAMED = re.compile(r'^```frozen\n(.*?)^```$', re.MULTILINE | re.DOTALL)
LOWEST, RANGE = 1_000_000, 1_000_000_000  # of the first seed: all older seeds are below
BLOCK = 10_000  # seeds for each of these, one after the other
BLOCKS = (
    'pick and place',
    'drink retrieval',
    'persistence',
    'memory',
    'continuous operation',
    'pick and place, extension',
    'drink retrieval, extension',
    'inspection',
    'pick and place, extra causes',
    'drink retrieval, extra causes',
    'inspection, extra causes',
)


class Freeze(NamedTuple):
    """A freeze of protocol and folders."""

    commit: str
    protocol_sha256: str
    first_seed: int

    def blocks(self) -> Dict[str, int]:
        """The first seed of each figure."""
        return {name: self.first_seed + number * BLOCK for number, name in enumerate(BLOCKS)}


def frozen_folders(protocol: str) -> List[str]:
    """The folders that a protocol names, in its order.

    :raises ExperimentError: where it names none, or one twice.
    """
    found = NAMED.findall(protocol)
    folders = [line.strip() for line in '\n'.join(found).splitlines() if line.strip()]
    if len(found) != 1 or not folders or len(set(folders)) < len(folders):
        raise ExperimentError(
            '{}: one block "```frozen" must name folders, each once'.format(PROTOCOL)
        )
    return folders


def first_seed_of(protocol: bytes, trees: Mapping[str, str]) -> int:
    """The first evaluation seed.

    :param protocol: the page's content.
    :param trees: git's tree id of each folder that it names.
    """
    lines = [hashlib.sha256(protocol).hexdigest()]
    lines += ['{} {}'.format(trees[folder], folder) for folder in sorted(trees)]
    digest = hashlib.sha256('\n'.join(lines).encode('utf-8')).digest()
    return LOWEST + int.from_bytes(digest[:8], 'big') % RANGE


def frozen_seeds(root: Path) -> Freeze:
    """Return what a checkout would freeze now, as it is committed.

    :raises ExperimentError: where protocol or folders are not committed as they are, or missing.
    """
    protocol = _git(root, 'show', 'HEAD:' + PROTOCOL)
    folders = frozen_folders(protocol.decode('utf-8'))
    changed = _git(root, 'status', '--porcelain', '--', PROTOCOL, *folders).decode('utf-8')
    if changed.strip():
        raise ExperimentError(
            'not committed: {}'.format(', '.join(line[3:] for line in changed.splitlines()))
        )
    trees = {
        folder: _git(root, 'rev-parse', '--verify', 'HEAD:' + folder).decode('ascii').strip()
        for folder in folders
    }
    commit = _git(root, 'rev-parse', 'HEAD').decode('ascii').strip()
    return Freeze(commit, hashlib.sha256(protocol).hexdigest(), first_seed_of(protocol, trees))


def log_freeze(root: Path, what: str, freeze: Freeze, note: str) -> None:
    """Append a line to the log.

    :param what: FROZEN or ABANDONED.
    :param note: why.
    """
    path = root / LOG
    new = not path.exists() or not path.read_text(encoding='utf-8').strip()
    now = datetime.now(timezone.utc).strftime('%Y-%m-%dT%H:%M:%SZ')
    with path.open('a', newline='', encoding='utf-8') as file:
        writer = csv.writer(file, lineterminator='\n')
        if new:
            writer.writerow(COLUMNS)
        writer.writerow((now, freeze.commit, what, freeze.protocol_sha256, freeze.first_seed, note))


def last_freeze(root: Path) -> Freeze:
    """The freeze that holds: the last of the log.

    :raises ExperimentError: where there is none, or it was abandoned.
    """
    holding = standing_freezes(root)
    if not holding or _logged(root)[-1]['what'] != FROZEN:
        raise ExperimentError('{}: no freeze holds'.format(LOG))
    return holding[-1]


def standing_freezes(root: Path) -> List[Freeze]:
    """Return the freezes of the log that were not abandoned, in its order."""
    rows = _logged(root)
    abandoned = {row['first_seed'] for row in rows if row['what'] == ABANDONED}
    return [
        Freeze(row['commit'], row['protocol_sha256'], int(row['first_seed']))
        for row in rows
        if row['what'] == FROZEN and row['first_seed'] not in abandoned
    ]


def _logged(root: Path) -> List[Dict[str, str]]:
    path = root / LOG
    return list(csv.DictReader(path.open(encoding='utf-8'))) if path.exists() else []


def checkout() -> Path:
    """The checkout that this package lies in.

    :raises ExperimentError: where it is installed, without git.
    """
    return Path(_git(Path(__file__).parent, 'rev-parse', '--show-toplevel').decode('utf-8').strip())


def run_freeze(root: Path, what: str, note: str) -> str:
    """Freeze, or abandon the last freeze, and return the seeds, as a text to print.

    :param what: FROZEN or ABANDONED.
    :raises ExperimentError: as frozen_seeds() and last_freeze() do, and without a note.
    """
    if not note.strip():
        raise ExperimentError('a freeze needs a note: why it is made, or abandoned')
    freeze = frozen_seeds(root) if what == FROZEN else last_freeze(root)
    log_freeze(root, what, freeze, note.strip())
    lines = ['{}: commit {}, protocol {}'.format(what, freeze.commit, freeze.protocol_sha256)]
    if what == FROZEN:
        lines += ['  {:22} from seed {}'.format(*block) for block in freeze.blocks().items()]
    return '\n'.join(lines + ['Commit {}.'.format(LOG)])


def _git(root: Path, *command: str) -> bytes:
    try:
        return subprocess.run(
            ['git', *command],
            cwd=str(root),
            check=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ).stdout
    except FileNotFoundError as err:
        raise ExperimentError('git is not installed') from err
    except subprocess.CalledProcessError as err:
        raise ExperimentError(
            'git {}: {}'.format(' '.join(command), err.stderr.decode('utf-8', 'replace').strip())
        ) from err
