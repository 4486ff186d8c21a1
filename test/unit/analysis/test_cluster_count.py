"""A real Dask cluster on loopback counts what one process counts, also where workers die."""

import json
import os
import subprocess
import sys
from functools import partial

import pytest
from dask_cluster import DaskCluster, count_or_die

from smach_oracle import cluster as cluster_module
from smach_oracle.analysis import bag_statistics
from smach_oracle.analysis.bag_events import find_bags
from smach_oracle.analysis.counting import bag_counts, cluster_count
from smach_oracle.analysis.counting.bag_counts import count_bags
from smach_oracle.analysis.counting.counted_bag import Counting
from smach_oracle.cluster import ClusterError, WorkerCluster, checked_address

BAGS = 9
NOBODY = 'tcp://127.0.0.1:1'  # a port that no user may listen on


@pytest.fixture(autouse=True)
def busy_machine(monkeypatch, tmp_path):
    """Time for a machine with much to do, and groups that a few bags fill."""
    monkeypatch.setattr(cluster_module, 'ANSWER_S', 120.0)
    monkeypatch.setattr(bag_counts, 'GROUP', 2)
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))


@pytest.fixture(scope='module')
def dask(tmp_path_factory):
    with DaskCluster(tmp_path_factory.mktemp('dask'), 2) as started:
        yield started


def written(out, *argv):
    """What the command writes as JSON."""
    assert bag_statistics.main([*argv, '--json', str(out)]) == 1  # a bag is skipped
    return json.loads(out.read_text())


def test_the_cluster_counts_what_one_process_counts(dask, record, tmp_path, capsys):
    folder = record('bags', BAGS)
    with open(os.path.join(folder, 'damaged.bag'), 'wb') as damaged:
        damaged.write(b'no bag')
    for by_state in ([], ['--by-state']):
        here = written(tmp_path / 'here.json', folder, *by_state)
        printed = capsys.readouterr()
        there = written(tmp_path / 'there.json', folder, *by_state, '--scheduler', dask.address)
        assert there == here and len(there['trials']) == BAGS
        assert capsys.readouterr() == printed


def test_workers_that_see_another_folder_are_told_of(dask, record, tmp_path, monkeypatch, capsys):
    folder = record('bags', 1)
    monkeypatch.setattr(cluster_count, '_size', lambda path: 7)
    assert bag_statistics.main([folder, '--scheduler', dask.address]) == 2
    assert 'put the folder where all machines see it' in capsys.readouterr().err


def test_workers_that_die_cost_no_bag(dask, record, tmp_path, monkeypatch):
    paths, flag = find_bags([record('bags', BAGS)]), tmp_path / 'flag'
    counting = Counting(None, partial(count_or_die, str(flag)))
    here = list(count_bags(paths, counting))
    with WorkerCluster(dask.address) as cluster:
        flag.touch()
        assert list(count_bags(paths, counting, cluster)) == here
        assert not flag.exists() and [each.poll() for each in dask.workers].count(None) == 1
        assert not cluster.messages
        for worker in dask.workers:  # none is left
            worker.kill()
            worker.wait()
        monkeypatch.setattr(cluster_module, 'DESERTED_S', 1.0)
        assert list(count_bags(paths, counting, cluster)) == here
        assert 'no worker is left' in cluster.messages[0]
    monkeypatch.setattr(cluster_module, 'ANSWER_S', 2.0)
    with pytest.raises(ClusterError, match='no worker within 2 s; start some with'):
        WorkerCluster(dask.address)


@pytest.mark.parametrize(
    'address, without_tls, given',
    [
        ('127.0.0.1:8786', False, 'tcp://127.0.0.1:8786'),
        ('tcp://localhost:8786', False, 'tcp://localhost:8786'),
        ('tcp://[::1]:8786', False, 'tcp://[::1]:8786'),
        ('tls://10.0.0.5:8786', False, 'tls://10.0.0.5:8786'),
        ('tcp://10.0.0.5:8786', True, 'tcp://10.0.0.5:8786'),
    ],
)
def test_an_address_on_loopback_or_with_tls_is_taken(address, without_tls, given):
    assert checked_address(address, without_tls) == given


@pytest.mark.parametrize(
    'address, why',
    [
        ('', 'not an address'),
        ('8786', 'not an address'),
        ('tcp://127.0.0.1', 'not an address'),
        ('tcp://127.0.0.1:0', 'not an address'),
        ('tcp://127.0.0.1:70000', 'not an address'),
        ('tcp://user@127.0.0.1:8786', 'not an address'),
        ('tcp://127.0.0.1:8786/x', 'not an address'),
        ('inproc://10.0.0.5:8786', 'inproc:// is not known'),
        ('tcp://10.0.0.5:8786', 'another machine, without TLS'),
        ('10.0.0.5:8786', 'another machine, without TLS'),
        ('tcp://localhost.example:8786', 'another machine, without TLS'),
        ('tcp://0.0.0.0:8786', 'another machine, without TLS'),
    ],
)
def test_another_address_is_refused_before_anything_is_sent(address, why, capsys, tmp_path):
    with pytest.raises(ClusterError, match=why):
        checked_address(address, False)
    assert bag_statistics.main([str(tmp_path), '--scheduler', address or ':']) == 2
    assert capsys.readouterr().err.startswith('bag_statistics: --scheduler ')


@pytest.mark.parametrize(
    'argv', [['--scheduler', NOBODY, '--html', 'report.html'], ['--without-tls']]
)
def test_options_that_do_not_go_together_are_refused(argv, tmp_path):
    with pytest.raises(SystemExit):
        bag_statistics.main([str(tmp_path), *argv])


def test_a_scheduler_that_is_not_there_is_named_in_time(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(cluster_module, 'ANSWER_S', 0.5)
    assert bag_statistics.main([str(tmp_path), '--scheduler', NOBODY]) == 2
    assert 'no Dask scheduler answers there within' in capsys.readouterr().err


def test_without_dask_it_is_said_what_installs_it(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    assert bag_statistics.main([str(tmp_path), '--scheduler', NOBODY]) == 2
    assert 'sudo apt install python3-distributed' in capsys.readouterr().err


def test_dask_is_imported_for_a_cluster_alone(record):
    program = (
        'import sys\nfrom smach_oracle.analysis import bag_statistics\n'
        'bag_statistics.main(sys.argv[1:])\nprint({"distributed", "dask"} & set(sys.modules))'
    )
    told = subprocess.run(
        [sys.executable, '-c', program, record('bags', 1)],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    assert told.endswith('set()\n')


def certificates(folder):
    """An authority, and a certificate of it for both sides, as doc/cluster.md makes them."""
    for command in (
        'req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=cluster -keyout ca.key -out ca.pem',
        'req -newkey rsa:2048 -nodes -subj /CN=machine -keyout key.pem -out request.pem',
        'x509 -req -in request.pem -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -out cert.pem',
    ):
        subprocess.run(['openssl', *command.split()], cwd=str(folder), check=True)
    return [str(folder / name) for name in ('ca.pem', 'cert.pem', 'key.pem')]


def test_beyond_loopback_both_sides_show_certificates(tmp_path, record, capsys):
    from dask import config as dask_config

    keys = ['distributed.comm.tls.' + key for key in cluster_module.TLS_KEYS]
    with pytest.raises(ClusterError, match='Dask needs distributed.comm.tls.ca-file'):
        WorkerCluster('tls://127.0.0.1:1')
    files = certificates(tmp_path)
    with dask_config.set(dict(zip(keys, [files[0], files[1], str(tmp_path / 'absent')]))):
        with pytest.raises(ClusterError, match='client.key for tls:// .no such file'):
            WorkerCluster('tls://127.0.0.1:1')
    options = ('--tls-ca-file', '--tls-cert', '--tls-key')
    given = [each for pair in zip(options, files) for each in pair]
    folder = record('bags', 2)
    with DaskCluster(tmp_path / 'dask', 1, arguments=given, protocol='tls') as secured:
        with dask_config.set(dict(zip(keys, files))):
            assert bag_statistics.main([folder, '--scheduler', secured.address]) == 0
