"""Preempts that come at any moment, from another thread: what must hold anyway."""

import random
import threading
from typing import List, Optional

from .comparing import in_time, threads_left
from .executing import Executed
from .plan import TreePlan

SIGNAL_S = 30.0
PATIENCE_S = 0.3  # upstream's Concurrence loses a preempt that comes before it waits


def disturb(plan: TreePlan, trials: int = 2) -> List[str]:
    """Preempt a tree at a random entry of a leaf, and execute it again; returns what is wrong."""
    before = set(threading.enumerate())
    executed = Executed(plan)
    executed.world.patience_s = PATIENCE_S
    chance = random.Random('disturb ' + plan.seed)
    wrong = []
    for _ in range(trials):
        said = _preempted(executed, chance.randint(1, 12))
        if said is None:
            return ['seed {}: hung'.format(plan.seed)]
        if said.startswith(('hang', 'raised')):
            wrong.append('seed {}: {}'.format(plan.seed, said))
    if executed.machine.is_running():
        wrong.append('seed {}: still running'.format(plan.seed))
    return wrong + [
        'seed {}: thread left: {}'.format(plan.seed, name) for name in threads_left(before)
    ]


def _preempted(executed: Executed, entry: int) -> Optional[str]:
    """The outcome of a trial that is preempted about when that many leafs have been entered."""
    executed.world.signals_at = entry
    signal = executed.world.signal
    signal.clear()

    def preempt() -> None:
        if signal.wait(SIGNAL_S) and executed.machine.is_running():
            executed.machine.request_preempt()

    caller = threading.Thread(target=preempt, daemon=True)
    caller.start()
    said = in_time(executed)
    executed.world.signals_at = 0
    signal.set()
    caller.join(SIGNAL_S)
    executed.machine.recall_preempt()
    return said
