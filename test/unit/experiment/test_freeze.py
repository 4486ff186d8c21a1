"""Evaluation seeds come from the protocol and the code, as committed; every freeze is logged."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from smach_oracle.experiment import command, freeze
from smach_oracle.experiment.freeze import (
    ABANDONED,
    FROZEN,
    first_seed_of,
    frozen_folders,
    frozen_seeds,
    last_freeze,
    run_freeze,
    standing_freezes,
)
from smach_oracle.experiment.plan import ExperimentError

SEED = 118989624  # of 'page' and two trees
PAGE = '# Protocol\n\n```frozen\ncode/one\ncode/two\n```\n'


def git(root, *arguments):
    subprocess.run(
        ['git', '-c', 'user.name=a', '-c', 'user.email=a@b', *arguments],
        cwd=root,
        check=True,
        stdout=subprocess.DEVNULL,
    )


def commit(root):
    git(root, 'add', '-A')
    git(root, 'commit', '-q', '--no-verify', '-m', 'change')


@pytest.fixture
def root(tmp_path):
    for name, text in (
        ('doc/protocol.md', PAGE),
        ('code/one/a.py', '1'),
        ('code/two/b.py', '2'),
        ('code/three/c.py', '3'),
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    git(tmp_path, 'init', '-q')
    commit(tmp_path)
    return tmp_path


def test_the_seeds_are_those_of_page_and_folders_and_nothing_else(root):
    first = frozen_seeds(root)
    (root / 'code/three/c.py').write_text('other')
    commit(root)
    assert frozen_seeds(root)._replace(commit='') == first._replace(commit='')
    seeds = {first.first_seed}
    for name in ('code/two/b.py', 'doc/protocol.md'):
        (root / name).write_text((root / name).read_text() + '\n')
        commit(root)
        seeds.add(frozen_seeds(root).first_seed)
    assert len(seeds) == 3 and min(seeds) >= 1_000_000


def test_the_same_page_and_trees_have_the_same_seed_on_any_machine():
    trees = {'b': '2' * 40, 'a': '1' * 40}
    assert first_seed_of(b'page', trees) == first_seed_of(b'page', dict(sorted(trees.items())))
    assert first_seed_of(b'page', trees) == SEED
    assert first_seed_of(b'page', {'b': '1' * 40, 'a': '2' * 40}) != SEED


@pytest.mark.parametrize('name', ['code/one/a.py', 'code/one/new.py', 'doc/protocol.md'])
def test_what_is_not_committed_is_not_frozen(root, name):
    (root / name).write_text(PAGE + 'changed')
    with pytest.raises(ExperimentError, match='not committed: .*' + name):
        frozen_seeds(root)


def test_a_folder_that_is_not_there_is_named(root):
    (root / 'doc/protocol.md').write_text(PAGE.replace('two', 'four'))
    commit(root)
    with pytest.raises(ExperimentError, match='code/four'):
        frozen_seeds(root)


@pytest.mark.parametrize(
    'page', ['nothing', '```frozen\n```\n', PAGE + PAGE, '```frozen\na\na\n```\n']
)
def test_a_page_must_name_folders_once(page):
    with pytest.raises(ExperimentError, match='must name folders'):
        frozen_folders(page)


def test_every_freeze_is_logged_and_an_abandoned_one_too(root):
    text = run_freeze(root, FROZEN, 'the first')
    first = last_freeze(root)
    assert first == frozen_seeds(root)
    assert 'drink retrieval        from seed {}'.format(first.first_seed + 10_000) in text
    run_freeze(root, ABANDONED, 'a fault of the judge')
    with pytest.raises(ExperimentError, match='no freeze holds'):
        run_freeze(root, ABANDONED, 'again')
    rows = list(csv.DictReader((root / freeze.LOG).open()))
    assert [(row['what'], row['note']) for row in rows] == [
        (FROZEN, 'the first'),
        (ABANDONED, 'a fault of the judge'),
    ]
    assert {(row['commit'], int(row['first_seed'])) for row in rows} == {
        (first.commit, first.first_seed)
    }


def test_the_freezes_that_were_not_abandoned_stand_in_their_order(root):
    run_freeze(root, FROZEN, 'the first')
    first = last_freeze(root)
    run_freeze(root, ABANDONED, 'a fault')
    assert standing_freezes(root) == []
    seconds = []
    for words in ('two', 'three'):
        (root / 'doc/protocol.md').write_text(PAGE + words)
        commit(root)
        run_freeze(root, FROZEN, words)
        seconds.append(last_freeze(root))
    assert standing_freezes(root) == seconds and first not in seconds


def test_a_freeze_says_why(root):
    with pytest.raises(ExperimentError, match='needs a note'):
        run_freeze(root, FROZEN, ' ')
    assert not (root / freeze.LOG).exists()


def test_the_command_freezes_and_runs_nothing(root, monkeypatch, capsys):
    monkeypatch.setattr(command, 'checkout', lambda: root)
    assert command.main(['--freeze', 'the first']) == 0
    told = capsys.readouterr()
    assert last_freeze(root).commit in told.out
    assert '--freeze is now called benchmarks/freeze_seeds.py' in told.err
    (root / 'code/one/a.py').write_text('changed')
    assert command.main(['--freeze', 'the second']) == 1
    assert 'not committed' in capsys.readouterr().err
    assert command.main(['--abandon-freeze', 'a fault']) == 0


def test_the_script_of_developers_freezes_the_checkout_that_it_lies_in(root):
    script = Path(__file__).resolve().parents[3] / 'benchmarks/freeze_seeds.py'
    code = (
        'import runpy, sys, smach_oracle.experiment.freeze as f; f.checkout = lambda: f.Path.cwd()'
    )
    run = [sys.executable, '-c', code + "; runpy.run_path(sys.argv[0], run_name='__main__')"]
    run[-1] = run[-1].replace('sys.argv[0]', 'sys.argv.pop(1)')
    for words, frozen in ((['the first'], True), (['--abandon', 'a fault'], False)):
        subprocess.run([*run, str(script), *words], cwd=str(root), check=True, timeout=60)
        assert bool(standing_freezes(root)) == frozen


def test_the_protocol_names_folders_that_are_there():
    root = freeze.checkout()
    folders = frozen_folders((root / freeze.PROTOCOL).read_text(encoding='utf-8'))
    assert len(folders) >= 5 and all((root / folder).is_dir() for folder in folders)
