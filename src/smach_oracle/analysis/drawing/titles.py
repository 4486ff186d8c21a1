"""Names of tasks and variants as figures and tables have them, in which order."""

from typing import List, Sequence

from ..trial_rows import TrialRow

TITLES = {
    'pick_and_place': 'Pick and place',
    'drink_retrieval': 'Drink retrieval',
    'inspection': 'Inspection',
}


def title_of(task: str) -> str:
    """Return what a task is called in a figure."""
    return TITLES.get(task, task.replace('_', ' ').capitalize())


def tasks_of(rows: Sequence[TrialRow]) -> List[str]:
    """Return the tasks in the order in which the paper has them."""
    return sorted(
        {row.task for row in rows},
        key=lambda task: (
            task not in TITLES,
            list(TITLES).index(task) if task in TITLES else 0,
            task,
        ),
    )


def variants_of(rows: Sequence[TrialRow]) -> List[str]:
    """Return the variants in the order in which they were begun."""
    return list(dict.fromkeys(row.variant for row in rows))
