#!/usr/bin/env python3
"""Draw what wrapping adds to a machine, and where a revisit and a step back lead.

    python3 doc/draw_machines.py    # doc/images/wrapped.svg and recovery.svg; needs graphviz

Run it in the environment of scripts/ros_env. The first picture is drawn from the machine itself,
before and after `OracleContainer.wrap`. The second is drawn from a trial that this script runs.
"""

import subprocess
import sys
from pathlib import Path
from typing import List, Tuple

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import Event, EventKind

IMAGES = Path(__file__).resolve().parent / 'images'
OUTCOMES = ['succeeded', 'failed']
LABELS = ['LOOK', 'PICK', 'PLACE']
ORACLE = 'ORACLE'
INK, QUIET, BLUE, ORANGE, GREEN = '#333333', '#9a9a9a', '#0072b2', '#d55e00', '#009e73'
LOOKS = [
    'graph [fontname="DejaVu Sans", fontsize=13, fontcolor="{0}", bgcolor=white];',
    'node [fontname="DejaVu Sans", fontsize=12, shape=box, style="rounded,filled", '
    'fillcolor=white, color="{0}", fontcolor="{0}"];',
    'edge [fontname="DejaVu Sans", fontsize=10, color="{0}", fontcolor="{0}", arrowsize=0.7];',
]
Edge = Tuple[str, str, str]  # outcome, from, to


class Step(smach.State):
    """A state whose outcomes are given."""

    def __init__(self, *outcomes: str) -> None:
        smach.State.__init__(self, outcomes=OUTCOMES)
        self._left = list(outcomes)

    def execute(self, userdata: smach.UserData) -> str:
        return self._left.pop(0) if self._left else 'succeeded'


def fetch(**outcomes: List[str]) -> smach.StateMachine:
    """LOOK, PICK and PLACE, with the outcomes that they have one after the other."""
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        for label, after in zip(LABELS, LABELS[1:] + ['succeeded']):
            smach.StateMachine.add(
                label, Step(*outcomes.get(label, ())), transitions={'succeeded': after}
            )
    return machine


def edges(machine: smach.StateMachine) -> List[Edge]:
    """The transitions that the machine has; an outcome of its own is a target, too."""
    return [
        (outcome, start, end or outcome) for outcome, start, end in machine.get_internal_edges()
    ]


def column(name: str, left: float, title: str, drawn: List[Edge], more: List[Edge]) -> List[str]:
    """One machine: the author's transitions, and those that the oracle has added.

    :param left: where its column stands, in.
    """
    places = {label: (2.1, 3.3 - 1.1 * row) for row, label in enumerate(LABELS + ['succeeded'])}
    places.update(failed=(0.3, 0.0), ORACLE=(0.3, 2.2))
    lines = [
        '{}_title [shape=plaintext, style="", fontsize=13, label="{}", pos="{},4.0!"];'.format(
            name, title, left + 1.2
        )
    ]
    for label, (across, up) in places.items():
        look = {ORACLE: 'fillcolor="{0}", color="{0}", fontcolor=white'.format(BLUE)}.get(
            label, 'shape=ellipse, style=filled, fillcolor="#f0f0f0"' if label in OUTCOMES else ''
        )
        if label != ORACLE or more:
            lines.append(
                '{0}_{1} [label="{1}", pos="{2},{3}!"{4}];'.format(
                    name, label, left + across, up, ', ' + look if look else ''
                )
            )
    for outcome, start, end in drawn:
        lines.append('{0}_{1} -> {0}_{2};'.format(name, start, end))
        if outcome != end:
            across, up = ((one + other) / 2 for one, other in zip(places[start], places[end]))
            lines.append(
                '{}_{}_label [shape=plaintext, style="", fontsize=10, label="{}", '
                'pos="{},{}!"];'.format(name, start, outcome, left + across + 0.5, up)
            )
    pairs = {(start, end) for _, start, end in more}
    for start, end in sorted(pairs):
        both = (end, start) in pairs
        if not both or start < end:
            lines.append(
                '{0}_{1} -> {0}_{2} [color="{3}", style=dashed, dir={4}];'.format(
                    name, start, end, BLUE, 'both' if both else 'forward'
                )
            )
    return lines


def wrapping() -> List[str]:
    """The machine as its author wrote it, and wrapped."""
    machine = fetch()
    before = edges(machine)
    OracleContainer.wrap(machine, settings={'policy': 'prose'})
    after = edges(machine)
    kept = [edge for edge in after if edge in before]
    added = [edge for edge in after if edge not in before]
    return (
        ['digraph wrapped {', 'splines=line;', *(line.format(INK) for line in LOOKS)]
        + column('a', 0.0, 'as its author wrote it', before, [])
        + column('b', 4.2, 'wrapped: the oracle adds what is blue', kept, added)
        + ['}']
    )


def trial() -> List[Event]:
    """A trial in which PICK fails twice, and its second failure leads further back."""
    machine = fetch(PICK=['failed', 'failed', 'succeeded'])
    oracle = OracleContainer.wrap(
        machine, preconditions={'PICK': ['LOOK']}, settings={'policy': 'prose'}
    )
    found: List[Event] = []
    oracle.events.observers.append(found.append)
    oracle.execute()
    return found


def draw_recovery(path: Path) -> None:
    """The course of the trial: a column for each state that ran, a row for each label."""
    events = trial()
    steps = [event.state for event in events if event.kind == EventKind.STATE_START]
    figure = Figure(figsize=(8.4, 3.3))
    axes = figure.add_subplot()
    rows = {label: -row for row, label in enumerate(LABELS)}
    column = -1
    jump = ''
    for event in events:
        if event.kind == EventKind.STATE_START:
            column += 1
            if column:
                _arrow(
                    axes, (column - 1, rows[steps[column - 1]]), (column, rows[event.state]), jump
                )
            jump = ''
            failed = any(each.kind == EventKind.FAILURE for each in _until_next(events, event))
            axes.text(
                column,
                rows[event.state],
                event.state,
                ha='center',
                va='center',
                color='white',
                fontsize=10,
                bbox={
                    'boxstyle': 'round,pad=0.45',
                    'linewidth': 0,
                    'facecolor': ORANGE if failed else GREEN,
                },
            )
        elif event.kind == EventKind.DECISION:
            jump = {'revisit': 'revisit', 'step_back': 'step back'}[event.outcome]
    axes.set_xlim(-0.6, column + 0.6)
    axes.set_ylim(-2.6, 0.95)
    axes.axis('off')
    for place, colour, text in (
        (0.33, GREEN, 'succeeded'),
        (0.47, ORANGE, 'failed'),
        (0.57, BLUE, 'what the oracle decided'),
    ):
        figure.text(place, 0.03, text, color=colour, fontsize=10)
    figure.savefig(str(path), metadata={'Date': None, 'Creator': None}, bbox_inches='tight')


def _until_next(events: List[Event], start: Event) -> List[Event]:
    """The events from one that a state starts with to the next such one."""
    later = events[events.index(start) + 1 :]
    ends = [index for index, event in enumerate(later) if event.kind == EventKind.STATE_START]
    return later[: ends[0]] if ends else later


def _arrow(axes: Axes, start: Tuple[float, float], end: Tuple[float, float], jump: str) -> None:
    across = bool(jump) and start[1] == end[1]
    axes.annotate(
        '',
        end,
        start,
        arrowprops={
            'arrowstyle': '-|>',
            'color': BLUE if jump else QUIET,
            'linewidth': 2 if jump else 1.3,
            'linestyle': '--' if jump else '-',
            'shrinkA': 19,
            'shrinkB': 19,
            'connectionstyle': 'arc3,rad={}'.format(-0.45 if across else 0),
        },
    )
    if jump:
        axes.text(
            (start[0] + end[0]) / 2 + (0 if across else 0.22),
            (start[1] + end[1]) / 2 + (0.52 if across else -0.12),
            jump,
            color=BLUE,
            fontsize=11,
            ha='center' if across else 'left',
            va='center',
        )


def main() -> int:
    subprocess.run(
        ['neato', '-Tsvg', '-o', str(IMAGES / 'wrapped.svg')],
        check=True,
        input='\n'.join(wrapping()).encode(),
    )
    with rc_context({'svg.hashsalt': 'smach_oracle', 'font.family': 'DejaVu Sans'}):
        draw_recovery(IMAGES / 'recovery.svg')
    return 0


if __name__ == '__main__':
    sys.exit(main())
