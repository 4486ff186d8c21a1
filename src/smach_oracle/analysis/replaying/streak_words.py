"""Tells what streaks say of another policy: in words, and as plain data."""

from typing import Any, Dict, List, Mapping, Tuple

from .weighting import Findings

_SHOWN = (('cured', '{:.0%}'), ('questions', '{:.2f}'), ('cost', '{:.2f}'))


def findings_in_words(findings: Findings) -> List[str]:
    """Return the lines for people, none where no streak has an end that is known."""
    bounds, estimate = findings
    if not bounds.streaks:
        return []
    lines = [
        '{:.0f} of {} streaks agree{}. A mean streak, the rest all cured and none cured: {}'.format(
            bounds.agree,
            bounds.streaks,
            ', {} more have no known end'.format(bounds.left_out) if bounds.left_out else '',
            _listed(bounds.ranges),
        )
    ]
    if estimate is None:
        return lines + ['no way was drawn there, which supports no weighting']
    if estimate.why_not:
        return lines + ['not enough data to weight: ' + estimate.why_not]
    shown = [
        '{} {} ({})'.format(
            name, form.format(estimate.means[name]), _span(form, estimate.intervals[name])
        )
        for name, form in _SHOWN
    ]
    return lines + [
        'weighted, an effective {:.0f} streaks: {}'.format(estimate.effective, ', '.join(shown))
    ]


def _listed(ranges: Mapping[str, Tuple[float, float]]) -> str:
    return ', '.join('{} {}'.format(name, _span(form, ranges[name])) for name, form in _SHOWN)


def _span(form: str, found: Tuple[float, float]) -> str:
    return ' to '.join(map(form.format, found))


def findings_as_data(findings: Findings) -> Dict[str, Any]:
    """Return the same as plain data, with None for "weighted" where no way was drawn."""
    bounds, estimate = findings
    return {
        **bounds._asdict(),
        'weighted': None if estimate is None else estimate._asdict(),
    }
