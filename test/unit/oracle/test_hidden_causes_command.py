"""The command that compares policies where causes are hidden: its figures, and its refusals."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = Path(__file__).resolve().parents[3] / 'benchmarks' / 'hidden_causes.py'


def run(*arguments):
    """Run it; its exit status, and all that it has said."""
    ended = subprocess.run(
        [sys.executable, str(COMMAND), *arguments],
        timeout=300,
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    return ended.returncode, ended.stdout.decode()


def test_it_compares_policies_with_the_best_order_and_by_other_prices(tmp_path):
    report = tmp_path / 'rows.csv'
    status, said = run(
        *'--machines 3 --trials 4 --best 2 --best-trials 2 --jobs 1 --harm 40'.split(),
        *['--policy', 'bare', 'ladder:wait_s=9', 'best', '--report', str(report)],
    )
    assert status == 0, said
    assert '3 machines, seeds 0 to 2 (for trying), 4 trials each, 1 jobs' in said
    best = next(line for line in said.splitlines() if line.startswith('best of'))
    assert 'seeds 900 to 901 with 2 trials' in best
    assert said.count('\nladder:wait_s=9 ') == 2 and 'double lost_trial' in said
    with report.open(newline='', encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    assert [row['seed'] for row in rows] == ['0', '1', '2'] * 3
    assert {row['policy'].split(':')[0] for row in rows} == {'bare', 'ladder', 'order'}
    for row in rows:
        cost = float(row['robot_min']) + 5 * float(row['expert_min'])
        cost += 60 * float(row['lost']) + 40 * float(row['harm'])
        assert float(row['cost']) == pytest.approx(cost)


@pytest.mark.parametrize(
    'arguments, why',
    [
        (['--policy', 'guess'], "'guess' is no policy"),
        (['--seed', '850'], 'seeds 850 to 949 overlap'),
        (['--trials', '0'], 'at least 1'),
    ],
)
def test_it_refuses_what_it_cannot_compare(arguments, why):
    status, said = run(*arguments)
    assert status == 2 and why in said
