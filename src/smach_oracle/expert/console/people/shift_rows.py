"""The answers of each person in each shift, and the times that they took. Pure."""

from typing import Dict, Iterable, List, Optional, Sequence, Tuple

from ..shapes.people import ShiftView
from ..web.shifts import Shifts
from .answer_times import AnsweredQuestion

MOST_SHIFTS = 30  # that are shown, the latest


def shift_rows(answered: Iterable[AnsweredQuestion], shifts: Shifts) -> List[ShiftView]:
    """Return the latest shifts as plain data, newest first, each with its people.

    A person has the number of answers. `claim`, `answer` and `resume` are the mean and the longest
    of the times of AnsweredQuestion, in s, or None where none is known.
    """
    found: Dict[float, Dict[str, List[AnsweredQuestion]]] = {}
    for each in answered:
        people = found.setdefault(shifts.begin_of(each.at), {})
        people.setdefault(each.who, []).append(each)
    return [
        {
            'begin': begin,
            'people': [
                {
                    'who': who,
                    'answered': len(rows),
                    'claim': _times([row.claim_s for row in rows]),
                    'answer': _times([row.answer_s for row in rows]),
                    'resume': _times([row.resume_s for row in rows]),
                }
                for who, rows in sorted(found[begin].items())
            ],
        }
        for begin in sorted(found, reverse=True)[:MOST_SHIFTS]
    ]


def _times(values: Sequence[Optional[float]]) -> Optional[Tuple[float, float]]:
    known = [value for value in values if value is not None]
    return (round(sum(known) / len(known), 1), max(known)) if known else None
