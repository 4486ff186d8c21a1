"""The counts of states as text, for a terminal of 100 columns."""

import statistics
import textwrap
from typing import List, Sequence

from smach_oracle.oracle.records.short_text import shortened

from ..intervals import wilson_interval
from .rows import SECONDS_PER_HOUR, VariantStates, per
from .state_counts import ANSWERS, NO_ANSWERS, StateCounts, StatesOfTrials, WayCount

_WIDTH = 100
_NAME = 38  # of a state or a way
_SHOWN = 5  # reasons of a state
ANSWER_WORDS = {
    'goto': 'go to a state',
    'supersede': 'did its work',
    'interface': 'interface',
    'give_up': 'give up',
    'expired': 'not in time',
    'cancelled': 'taken back',
    'open': 'left open',
}


def format_states(variants: Sequence[VariantStates]) -> str:
    """Return the tables of each variant. '' where there are none."""
    lines: List[str] = []
    for experiment, variant, found in variants:
        lines += ['', '{}, {}: by state'.format(experiment, variant)]
        lines += _overview(experiment, found)
        for name in _in_order(found):
            if found.states[name].failures or found.states[name].questions:
                lines += _state(_short(name, experiment), found.states[name])
        lines += ['', '{}, {}: what it cost'.format(experiment, variant)] + _costs(found)
    return '\n'.join(lines + ['']) if lines else ''


def _in_order(found: StatesOfTrials) -> List[str]:
    """Return the states, those that failed most first."""
    return sorted(found.states, key=lambda name: (-found.states[name].failures, name))


def _short(name: str, experiment: str) -> str:
    begin = experiment + '/'
    return _in_one_line(name[len(begin) :] if name.startswith(begin) else name)


def _in_one_line(text: str) -> str:
    return ' '.join(text.splitlines())


def _overview(experiment: str, found: StatesOfTrials) -> List[str]:
    heads = ('visits', 'failed', 'questions', 's in it', 's lost', 'visits lost')
    lines = ['  {:<{}}{:>7}{:>8}{:>11}{:>10}{:>10}{:>13}'.format('state', _NAME, *heads)]
    for name in _in_order(found):
        counts = found.states[name]
        lines.append(
            '  {:<{}}{:>7}{:>8}{:>11}{:>10.1f}{:>10.1f}{:>13}'.format(
                shortened(_short(name, experiment), _NAME - 1),
                _NAME,
                counts.visits,
                counts.failures,
                counts.questions,
                counts.seconds,
                counts.lost_s,
                counts.lost_visits,
            )
        )
    return lines


def _state(name: str, counts: StateCounts) -> List[str]:
    lines = ['', '  {} failed {}:'.format(name, _times(counts.failures))]
    reasons = sorted(counts.reasons.items(), key=lambda each: (-each[1], each[0]))
    for (_, _, text), number in reasons[:_SHOWN]:
        lines += textwrap.wrap(
            text.replace('_', ' ', 1),
            _WIDTH - 1,
            initial_indent='  {:>6} '.format(number),
            subsequent_indent=' ' * 11,
        )
    if len(reasons) > _SHOWN:
        rest = sum(number for _, number in reasons[_SHOWN:])
        lines.append('  {:>6} in {} other ways'.format(rest, len(reasons) - _SHOWN))
    if counts.ways or counts.not_recovered:
        lines.append(
            '    {:<{}}{:>6}{:>9}{:>9}{:>11}{:>13}'.format(
                'went on by', _NAME + 6, 'times', 'helped', 'in vain', 'not known', 's each, mean'
            )
        )
    ways = sorted(counts.ways.items(), key=lambda each: (-each[1].gone, each[0]))
    lines += [_way(words, count) for words, count in ways]
    if counts.not_recovered:
        lines.append('    {:<{}}{:>6}'.format('nothing', _NAME + 6, counts.not_recovered))
    if counts.questions:
        answers = [
            '{} {}'.format(ANSWER_WORDS.get(answer, answer), counts.answers[answer])
            for answer in answers_of(counts)
        ]
        lines.append('    {} asked: {}'.format(_times(counts.questions), ', '.join(answers)))
    return lines


def answers_of(counts: StateCounts) -> List[str]:
    """Return the answers that questions about a state had, the known ones first."""
    known = [answer for answer in ANSWERS + NO_ANSWERS if counts.answers.get(answer)]
    return known + sorted(set(counts.answers) - set(ANSWERS + NO_ANSWERS))


def _way(words: str, count: WayCount) -> str:
    return '    {:<{}}{:>6}{:>9}{:>9}{:>11}{:>13.1f}'.format(
        shortened(_in_one_line(words), _NAME + 5),
        _NAME + 6,
        count.gone,
        count.helped,
        count.in_vain,
        count.not_known,
        count.seconds / count.gone if count.gone else 0.0,
    )


def _times(number: int) -> str:
    return 'once' if number == 1 else '{} times'.format(number)


def _costs(found: StatesOfTrials) -> List[str]:
    hours = found.robot_s / SECONDS_PER_HOUR
    lines = ['  {:<26}{:>10}{:>14}{:>10}'.format('', 'a trial', 'a robot hour', 'in all')]
    for words, value in (
        ('extra s', found.extra_s),
        ('extra visits', float(found.extra_visits)),
        ('expert s', found.expert_s),
    ):
        trial, hour = (
            '-' if each is None else '{:.2f}'.format(each)
            for each in (per(value, found.trials), per(value, hours))
        )
        lines.append('  {:<26}{:>10}{:>14}{:>10.1f}'.format(words, trial, hour, value))
    lines.append('  the robot ran for {:.1f} s in all'.format(found.robot_s))
    for words, times in (
        ('until claimed', found.times.to_claim),
        ('until answered', found.times.to_answer),
        ('until the robot went on', found.times.to_resume),
    ):
        if times:
            lines.append(
                '  a question, {:<24} median {:>6.1f} s, at most {:>6.1f} s, of {}'.format(
                    words, statistics.median(times), max(times), len(times)
                )
            )
    return lines + _led_on(found.choices)


def _led_on(choices: WayCount) -> List[str]:
    known = choices.helped + choices.in_vain
    if not choices.gone:
        return []
    share = ''
    if known:
        low, high = wilson_interval(choices.helped, known)
        share = ' ({:.1%}, {:.1%} to {:.1%})'.format(choices.helped / known, low, high)
    return [
        "  the expert's choices led on in {} of {}{}{}".format(
            choices.helped,
            known,
            share,
            ', and in {} it is not known'.format(choices.not_known) if choices.not_known else '',
        )
    ]
