"""One flat line for each trial, as in `bag_statistics --csv`. Columns: doc/statistics.md."""

import json
from typing import List, NamedTuple, Optional, Sequence

from ..counting.trial_summary import TrialSummary
from ..variants import variant_names


class TrialLine(NamedTuple):
    """One trial. None: it is not known, or no world has told it."""

    trial_id: str
    experiment: str
    recovers: Optional[bool]
    start_time: float  # s since the epoch
    duration_s: float
    ending: str  # a value of TrialEnding
    outcome: str
    failures: int
    recoveries: int
    questions: int
    answered: int
    lost_events: int
    seed: Optional[int]
    causes: Optional[str]  # kinds, one word each
    true_success: Optional[bool]
    why: Optional[str]
    sim_s: Optional[float]
    wall_s: Optional[float]
    unwell_s: float
    resumed: int
    down_s: float
    wrong_object: Optional[str]
    damage: Optional[int]
    expert_answered: bool
    person_needed: Optional[bool]
    variant: str
    node: str
    folder: str
    host: str
    version: str
    script: str
    inputs: str  # as JSON


def trial_lines(trials: Sequence[TrialSummary]) -> List[TrialLine]:
    """Return the lines of some trials, in their order."""
    names = variant_names(trials)
    return [_line(trial, names[trial.trial_id]) for trial in trials]


def _line(trial: TrialSummary, variant: str) -> TrialLine:
    cause, truth, origin = trial.cause, trial.truth, dict(trial.origin)
    damage = None if truth is None else truth.damage
    return TrialLine(
        trial_id=trial.trial_id,
        experiment=trial.experiment,
        recovers=trial.recovers,
        start_time=trial.start_time,
        duration_s=trial.duration_s,
        ending=trial.ending.value,
        outcome=trial.outcome,
        failures=trial.failures,
        recoveries=trial.recoveries,
        questions=trial.questions,
        answered=trial.answered,
        lost_events=trial.lost_events,
        seed=None if cause is None else cause.seed,
        causes=None if cause is None else ' '.join(cause.kinds),
        true_success=None if truth is None else truth.success,
        why=None if truth is None else truth.why,
        sim_s=None if truth is None else truth.sim_s,
        wall_s=None if truth is None else truth.wall_s,
        unwell_s=trial.unwell_s,
        resumed=trial.resumed,
        down_s=trial.down_s,
        wrong_object=None if truth is None or damage is None else truth.wrong_object,
        damage=None if damage is None else len(damage),
        expert_answered=trial.answered > 0,
        person_needed=trial.person_needed,
        variant=variant,
        node=trial.node,
        folder=trial.replicate,
        host=origin.get('host', ''),
        version=origin.get('version', ''),
        script=origin.get('script', ''),
        inputs=json.dumps(dict(trial.inputs), sort_keys=True) if trial.inputs else '',
    )
