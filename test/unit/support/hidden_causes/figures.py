"""Figures of public SMACH programs, by which machines are drawn. Facts, and no program of anybody.

They were counted in 338 public programs of 11 repositories, in which a row was read for each
outcome of each state. The labels were read from the source. Only the 234 programs with three states
or more are counted here, since a machine of one or two has hardly anything to step back to. These
have 403 containers, 2,175 states and 6,376 outcomes. An outcome is *failing* or *preempted* by its
name, and *work* otherwise. It leads to the *next* state in the order in which the author added
them, or *forward* beyond that, *back*, to the state it*self*, or it *leaves* the container.

The programs do not say which container lies in which state, and which of them are Concurrences or
Iterators. So the nesting, and the shares of these two, are a choice of ours (`CONCURRENT`,
`ITERATED`).
"""

from typing import Dict, Tuple

LEAST_STATES = 3  # of a program

# containers of a program: programs
CONTAINERS: Dict[int, int] = {
    1: 152, 2: 54, 3: 12, 4: 5, 5: 3, 6: 2, 8: 2, 10: 2, 11: 1, 13: 1,
}  # fmt: skip

# states of a container: containers
STATES: Dict[int, int] = {
    1: 65, 2: 35, 3: 77, 4: 44, 5: 33, 6: 33, 7: 30, 8: 15, 9: 13, 10: 10, 11: 10, 12: 8, 13: 3,
    14: 5, 15: 6, 17: 4, 18: 4, 20: 2, 21: 3, 24: 2, 27: 1,
}  # fmt: skip

# outcomes of a state (work, failing, preempted): states. Those of fewer than three are left out
OUTCOMES: Dict[Tuple[int, int, int], int] = {
    (1, 1, 1): 1048, (1, 1, 0): 267, (1, 0, 0): 145, (2, 0, 0): 133, (2, 2, 0): 121,
    (1, 2, 0): 69, (2, 1, 0): 52, (2, 1, 1): 50, (1, 2, 1): 49, (2, 0, 1): 35, (1, 0, 1): 31,
    (3, 1, 0): 20, (2, 2, 1): 17, (3, 1, 1): 15, (2, 3, 0): 13, (4, 1, 0): 12, (3, 2, 0): 10,
    (1, 3, 0): 9, (3, 0, 0): 9, (3, 2, 1): 9, (3, 0, 1): 8, (1, 3, 1): 8, (3, 3, 0): 7,
    (5, 1, 0): 6, (2, 4, 0): 6, (4, 2, 0): 6, (6, 0, 0): 4, (6, 1, 0): 3, (4, 1, 1): 3,
    (5, 0, 1): 3,
}  # fmt: skip

# where outcomes lead, by what they are: outcomes
LEADS: Dict[str, Dict[str, int]] = {
    'work': {'next': 1313, 'leave': 939, 'forward': 304, 'back': 265, 'self': 89},
    'failing': {'leave': 1291, 'next': 406, 'back': 243, 'forward': 145, 'self': 97},
    'preempted': {'leave': 1151, 'next': 82, 'forward': 23, 'self': 15, 'back': 13},
}

# containers in which a state leads back to itself by some way, of 403
WITH_A_LOOP = 162

# names of failing outcomes: programs. Names that fewer than four use are left out, and those that
# speak of what one project does
FAILING_NAMES: Dict[str, int] = {
    'aborted': 206, 'killed': 28, 'failed': 21, 'lost': 19, 'mission_abort': 15, 'error': 15,
    'not_completed': 8, 'attempts_none': 7, 'timeout': 5, 'failure': 5, 'planning_failed': 4,
    'no_ik_solution': 4,
}  # fmt: skip

# failing outcomes that leave: with an end of the same name, of all
SAME_NAME = 957 / 1291

# shares of nested containers, not from the programs
CONCURRENT, ITERATED = 0.08, 0.08
