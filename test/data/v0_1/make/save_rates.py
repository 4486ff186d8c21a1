#!/usr/bin/env python3
"""Write the rates files: save_rates.py FOLDER. The machines run here, without a ROS master."""

import sys
from pathlib import Path

import fetch
import kitchen
from acting import begin

from smach_oracle import OracleContainer

FETCH = [
    'nothing',
    'PICK:aborted',
    'PICK:aborted',
    'nothing',
    'PLACE:aborted',
    'LOOK:aborted',
    'PICK:dropped',
    'nothing',
]
KITCHEN = [
    'nothing',
    'FIND:aborted',
    'GRASP:aborted',
    'WIPE:aborted',
    'nothing',
    'OPEN:aborted',
    'SERVE:aborted',
]
FILES = [
    ('window', fetch, FETCH, {}),
    ('window_of_three', fetch, FETCH, {'memory': 3, 'prior': 0.5}),
    ('exponential', fetch, FETCH, {'estimator': 'exponential'}),
    ('window_nested', kitchen, KITCHEN, {}),
    (
        'exponential_nested',
        kitchen,
        KITCHEN,
        {'estimator': 'exponential', 'memory': 4, 'prior': 0.2},
    ),
]


def main():
    """Learn from a few trials without recoveries, and save what was learned."""
    for name, script, plans, settings in FILES:
        machine = OracleContainer.wrap(
            script.build(), settings=settings, name=name.upper(), recover=False
        )
        for plan in plans:
            begin(plan, machine)
            machine.execute()
        machine.save_rates(str(Path(sys.argv[1]) / (name + '.json')))


if __name__ == '__main__':
    main()
