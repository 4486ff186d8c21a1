"""ruff holds these rules for us, each where it is meant to hold (pyproject.toml)."""

import subprocess

import pytest
from house import ROOT

PRODUCT = ('src/smach_oracle/oracle/container.py', 'benchmarks/killed.py', 'scripts/what_if')
LIBRARY = ('src/smach_oracle/ros/images.py', 'src/smach/state.py')
EXECUTIVE = ('src/smach_oracle/oracle/recovery/phases.py',)
TEST = ('test/unit/house/test_files.py',)


def rules_broken(source, place):
    """The rules that ruff finds broken where a file of this place has this source."""
    done = subprocess.run(
        ['ruff', 'check', '--no-cache', '--output-format', 'concise', '--stdin-filename', place],
        input=source.encode(),
        cwd=str(ROOT),
        stdout=subprocess.PIPE,
        check=False,
    )
    return {line.split()[1] for line in done.stdout.decode().splitlines() if place in line}


@pytest.mark.parametrize(
    'source, rule, held, free',
    [
        ('import pickle\n\npickle.loads(b"")\n', 'S301', PRODUCT, TEST),
        ('from pickle import load as read\n\nread(0)\n', 'S301', PRODUCT, TEST),
        ('import dill\n\ndill.Unpickler(0)\n', 'S301', PRODUCT, TEST),
        ('import shelve\n\nshelve.open("")\n', 'S301', PRODUCT, TEST),
        ('import marshal\n\nmarshal.load(0)\n', 'S302', PRODUCT, TEST),
        ('import joblib\n\njoblib.load("")\n', 'TID251', PRODUCT, TEST),
        ('def f(x):\n    assert x\n', 'S101', PRODUCT, TEST),
        ('print("here")\n', 'T201', LIBRARY, TEST + PRODUCT[1:]),
        ('def f():\n    import os\n\n    return os\n', 'PLC0415', EXECUTIVE, TEST + LIBRARY),
    ],
)
def test_a_rule_is_held_where_it_is_meant_to_be(source, rule, held, free):
    assert [place for place in held if rule not in rules_broken(source, place)] == []
    assert [place for place in free if rule in rules_broken(source, place)] == []
