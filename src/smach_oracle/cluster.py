"""A Dask cluster that works for a command: it counts bags, or runs trials. `--scheduler ADDRESS`.

    ClusterError (an OracleError): the cluster cannot be used, or is there no longer

Dask sends functions and results as pickles, and whoever reaches the scheduler has code run on all
machines of the cluster and on this one. So it is off by default, and beyond loopback it wants TLS
with certificates of both sides. Dask is imported where a cluster is used.
"""

import argparse
import os
import re
import time
from pathlib import Path
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

from smach_oracle.oracle.errors import OracleError

from .packages import optional
from .release import VERSION

ANSWER_S = 10.0  # for the scheduler to answer, and for its first worker
DESERTED_S = 60.0  # without any worker, or without the scheduler, before it is given up
CHECK_S = 1.0  # between two looks at the workers, while something is waited for
LOOK_S = 0.1  # after a fault of the connection
TLS_KEYS = ('ca-file', 'client.cert', 'client.key')  # of Dask, below distributed.comm.tls
_ADDRESS = re.compile(r'(?:([a-z]+)://)?(\[[0-9a-fA-F:]+\]|[^:/\[\]@\s]+):(\d{1,5})', re.ASCII)
_PROBE = '.cluster_probe'  # file in a folder that all machines are to see
_LACKING = (
    '--scheduler needs Dask: sudo apt install python3-distributed (Debian 12), or '
    'python3 -m pip install distributed (elsewhere)'
)


class ClusterError(OracleError):
    """The cluster cannot be used, or is there no longer. The text says why, and what to do."""


class WorkersLost(ClusterError):
    """The workers that had a piece of work are gone, as far as one can see."""


class WorkerFacts(NamedTuple):
    """A worker's machine as it says itself."""

    host: str
    version: str  # of this package
    roslaunch: bool  # whether it is found there


def add_options(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the options of a command. `what` it lets the cluster do."""
    parser.add_argument(
        '--scheduler',
        metavar='ADDRESS',
        help='of a Dask cluster that {}, e.g. tls://10.0.0.5:8786. All its machines must see the '
        'folders under the same paths, and are trusted: they can run code here'.format(what),
    )
    parser.add_argument(
        '--without-tls',
        action='store_true',
        help='with --scheduler: allow tcp:// to another machine, where anybody on the network can '
        'run code on all machines of the cluster and on this one',
    )


def checked_address(address: str, without_tls: bool) -> str:
    """Return the address of a scheduler with its protocol. None stands for tcp.

    :raises ClusterError: where it is malformed, or leaves this machine without TLS.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found.group(3)) < 2**16:
        raise ClusterError(
            '--scheduler {}: not an address; write tcp://127.0.0.1:8786 on this machine, '
            'tls://HOST:PORT beyond it'.format(address)
        )
    protocol, host, port = found.groups()
    protocol = protocol or 'tcp'
    if protocol not in ('tcp', 'tls'):
        raise ClusterError(
            '--scheduler {}: {}:// is not known; write tcp:// or tls://'.format(address, protocol)
        )
    if protocol == 'tcp' and not (without_tls or _is_loopback(host.strip('[]'))):
        raise ClusterError(
            '--scheduler {}: another machine, without TLS; use tls:// (doc/cluster.md), or add '
            '--without-tls in a network that you trust'.format(address)
        )
    return '{}://{}:{}'.format(protocol, host, port)


def _is_loopback(host: str) -> bool:
    import ipaddress

    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False  # what a name stands for is not ours to say


class WorkerCluster:
    """A connection to the scheduler of a cluster, as a context."""

    def __init__(self, address: str, without_tls: bool = False) -> None:
        """Connect, and see that a worker of this version is there.

        :raises ClusterError: where the address is not allowed, nobody answers there within
            ANSWER_S, or a worker cannot be used.
        :raises ImportError: where Dask is missing. The text says what installs it.
        """
        self.address = checked_address(address, without_tls)
        self._dask = optional('distributed')
        if self._dask is None:
            raise ImportError(_LACKING)
        self._client = self._connected()
        self._seen_at = time.monotonic()  # a worker
        self.messages: List[str] = []  # for the person at the terminal
        try:
            self._check_workers()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> 'WorkerCluster':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the scheduler. The workers drop what they have not begun."""
        self._client.close(timeout=ANSWER_S)

    def _connected(self) -> Any:
        if self.address.startswith('tls:'):
            self._check_tls()
        try:
            return self._dask.Client(self.address, timeout=ANSWER_S, set_as_default=False)
        except (OSError, RuntimeError, TypeError, ValueError) as err:
            text = '{}'.format(err) or type(err).__name__
            raise ClusterError(
                '--scheduler {}: no Dask scheduler answers there within {:.0f} s ({})'.format(
                    self.address, ANSWER_S, text.splitlines()[0]
                )
            ) from err

    def _check_tls(self) -> None:
        """See that Dask has been told the certificates, and that they can be read."""
        try:
            given: Dict[str, Any] = self._dask.Security().get_tls_config_for_role('client')
        except (OSError, TypeError, ValueError) as err:  # that of TLS among them
            raise ClusterError('Dask cannot use its TLS configuration: {}'.format(err)) from err
        wanted = dict(zip(TLS_KEYS, (given.get('ca_file'), given.get('cert'), given.get('key'))))
        for key, path in wanted.items():
            if not path or not ('\n' in path or os.path.isfile(path)):
                raise ClusterError(
                    'Dask needs distributed.comm.tls.{} for tls:// ({}); doc/cluster.md shows '
                    'how to tell it'.format(key, 'no such file: ' + path if path else 'not set')
                )

    def _check_workers(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=ANSWER_S)
            told: Dict[str, List[Any]] = self._client.run(_facts)
        except ImportError as err:
            raise ClusterError(
                '--scheduler {}: a worker cannot import this package ({}); start it in a shell '
                'that has sourced the workspace'.format(self.address, err)
            ) from err
        except (OSError, self._dask.TimeoutError) as err:
            raise ClusterError(
                '--scheduler {}: no worker within {:.0f} s; start some with python3 -m '
                'distributed.cli.dask_worker {}'.format(self.address, ANSWER_S, self.address)
            ) from err
        self.facts = [WorkerFacts(*facts) for facts in told.values()]
        for facts in self.facts:
            if facts.version != VERSION:
                raise ClusterError(
                    '--scheduler {}: the worker on {} has version {} of this package, here is '
                    '{}'.format(self.address, facts.host, facts.version, VERSION)
                )

    def slots(self) -> int:
        """Return how many pieces of work the workers take at a time."""
        threads: Dict[str, int] = self._client.nthreads()
        return sum(threads.values())

    def check_folder(self, folder: Path) -> None:
        """See that each worker sees a folder of this machine.

        :raises ClusterError: where one does not.
        :raises OSError: where it cannot be written.
        """
        token = os.urandom(8).hex()
        probe = folder / _PROBE
        probe.write_text(token, encoding='ascii')
        try:
            seen: Dict[str, Tuple[str, str]] = self._client.run(_probed, str(probe))
        finally:
            probe.unlink()
        for host, text in seen.values():
            if text != token:
                raise ClusterError(
                    'the worker on {} does not see {}; put it where all machines see it under '
                    'that path'.format(host, folder)
                )

    def submit(self, work: Callable[..., Any], *args: object) -> Any:
        """Have a worker call a function, and return its future.

        :raises WorkersLost: where the scheduler is gone.
        """
        deadline = time.monotonic() + DESERTED_S
        while self._client.status != 'running':  # Dask is connecting again
            if self._client.status == 'closed' or time.monotonic() > deadline:
                raise WorkersLost('the scheduler at {} is gone'.format(self.address))
            time.sleep(CHECK_S)
        return self._client.submit(work, *args, pure=False)

    def deserted(self) -> bool:
        """Whether the scheduler is gone, or has had no worker for DESERTED_S."""
        if self._client.status == 'running' and self._client.scheduler_info()['workers']:
            self._seen_at = time.monotonic()
        gone = bool(self._client.status == 'closed')
        return gone or time.monotonic() - self._seen_at > DESERTED_S

    def result(self, future: Any) -> Any:
        """Wait for what a worker returns.

        :raises WorkersLost: where nobody will return it.
        :raises ClusterError: where the worker's call failed.
        """
        self._seen_at = time.monotonic()
        while not future.done():
            if self.deserted():
                raise WorkersLost('no worker is left at {}'.format(self.address))
            try:
                future.result(timeout=CHECK_S)
            except self._dask.TimeoutError:
                continue
            except Exception:  # of whichever kind: it is looked at below, if it is of the call
                time.sleep(LOOK_S)
        if future.status == 'finished':
            return future.result(timeout=ANSWER_S)
        if future.status != 'error':
            raise WorkersLost('the scheduler at {} is gone'.format(self.address))
        err = future.exception(timeout=ANSWER_S)
        if isinstance(err, self._dask.scheduler.KilledWorker):
            raise WorkersLost('workers died of it: {}'.format(err)) from err
        raise ClusterError('a worker failed: {!r}'.format(err)) from err


def _facts() -> WorkerFacts:
    from shutil import which

    return WorkerFacts(os.uname().nodename, VERSION, which('roslaunch') is not None)


def _probed(path: str) -> Tuple[str, str]:
    try:
        text = Path(path).read_text(encoding='ascii', errors='replace')
    except OSError:
        text = ''
    return os.uname().nodename, text
