"""Values of settings in words."""

import math
from typing import Any, Iterator

from smach_oracle.oracle.settings.checks import Budget
from smach_oracle.oracle.settings.health import HealthCondition, HealthKind


def in_words(value: Any) -> str:
    """Return a setting's value as people would say it."""
    if isinstance(value, Budget):
        return _budget(value)
    if isinstance(value, HealthCondition):
        return _condition(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return '{:g}'.format(value)
    if isinstance(value, (tuple, list)):
        return '[{}]'.format(', '.join(in_words(each) for each in value))
    return str(value)


def _budget(budget: Budget) -> str:
    limits = [
        (budget.recoveries, 'recovery', 'recoveries'),
        (budget.minutes, 'minute', 'minutes'),
        (budget.questions, 'question', 'questions'),
    ]
    told = [
        '{:g} {}'.format(limit, one if limit == 1 else more)
        for limit, one, more in limits
        if limit is not None
    ]
    return 'of a trial: ' + (' and '.join(told) if told else 'no limit')


def _condition(condition: HealthCondition) -> str:
    """Return a condition as "motors (data of /motors_on is true)"."""
    return '{} ({})'.format(condition.name, ', '.join(_demands(condition)))


def _demands(condition: HealthCondition) -> Iterator[str]:
    if condition.kind is HealthKind.FUNCTION:
        yield 'a function'
    elif condition.kind is HealthKind.DIAGNOSTICS:
        yield 'diagnostics of {} at worst {}'.format(condition.source, condition.worst)
    else:
        yield '{} of {} {}'.format(condition.field, condition.source, _wanted(condition))
    if condition.max_age_s is not None:
        yield 'not older than {:g} s'.format(condition.max_age_s)


def _wanted(condition: HealthCondition) -> str:
    if condition.equals is not None:
        return 'is ' + in_words(condition.equals)
    limits = []
    if condition.at_least > -math.inf:
        limits.append('at least {:g}'.format(condition.at_least))
    if condition.at_most < math.inf:
        limits.append('at most {:g}'.format(condition.at_most))
    return 'is ' + ' and '.join(limits or ['any number'])
