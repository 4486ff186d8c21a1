"""Rules that answer questions without a person: for tests and for runs that nobody watches. Pure.

    rules = Rules.parse({
        'default': {'kind': 'give_up'},
        'PICK': [{'kind': 'goto', 'state': 'DETECT'},                      # the first question of a
        trial
                 {'kind': 'interface', 'interface': 'assist'}],            # every later one
        'KITCHEN/OPEN_FRIDGE': {'kind': 'supersede', 'outcome': 'succeeded', 'outputs': {'angle':
        1.2}, 'delay_s': 2},
    })

A key is the label of the failed state, alone or behind its container path, which is the more
specific one. `default` is for all others. The same questions in the same order get the same
answers. A question about a state that still runs is ignored: rules are for failures.
"""

import math
import threading
from typing import Any, Dict, Iterable, Mapping, NamedTuple, Optional, Protocol, Sequence, Tuple

from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert, Progress, Question
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import FailureKind
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.interfaces import InterfaceOffer
from smach_oracle.oracle.settings.written import as_text, plain

DEFAULT = 'default'
OLD_NAME = 'SM_ROOT'  # of machines that were given none, before they had that of their node
IGNORE = 'ignore'  # leave the question to others, or to its deadline
KINDS = {kind.name.lower(): kind for kind in AnswerKind}
_NAMED_BY = {'goto': 'state', 'supersede': 'outcome', 'interface': 'interface'}
_FIELDS = (
    'kind',
    'state',
    'outcome',
    'interface',
    'outputs',
    'why',
    'delay_s',
    'confirm',
    'container',
)


class _Choice(Protocol):
    """A state to go to, of a question or of the goal that carries it."""

    @property
    def state(self) -> str: ...

    @property
    def container(self) -> str: ...

    @property
    def repeats(self) -> Sequence[str]: ...


class Rule(NamedTuple):
    """The answer to give, and the time to wait before it."""

    kind: str  # goto, supersede, give_up, interface or ignore
    state: str = ''
    outcome: str = ''
    interface: str = ''
    outputs: Optional[Mapping[str, Any]] = None
    why: str = ''
    delay_s: float = 0.0
    confirm: bool = False  # whether it may have a state repeated that is not repeated by itself
    container: str = ''  # goto, give_up: path of another container than that of the failed state

    def why_not(self, choices: Iterable[_Choice]) -> str:
        """Return why it must not answer a question with these choices, '' where it may."""
        repeats = self.kind == 'goto' and any(
            self._names(choice)
            and any(
                (each + '/').endswith('/{}/'.format(choice.state)) or each == choice.state
                for each in choice.repeats
            )
            for choice in choices
        )
        if not repeats or self.confirm:
            return ''
        return (
            '{} was done in this trial, and only a rule with confirm: true has it repeated'.format(
                self.state
            )
        )

    def _names(self, choice: _Choice) -> bool:
        return choice.state == self.state and self.container in ('', choice.container)

    def answer(self, by: str) -> Answer:
        """Return the answer. A rule that ignores has none.

        :raises KeyError: for a rule that ignores.
        """
        return Answer(
            KINDS[self.kind],
            self.state,
            self.outcome,
            self.interface,
            self.outputs,
            by,
            self.why,
            self.container,
        )


class Rules:
    """Answers by failed state, counted per trial where a state has several."""

    def __init__(self, by_state: Mapping[str, Tuple[Rule, ...]]) -> None:
        self._by_state = dict(by_state)
        self._asked: Dict[Tuple[str, str], Tuple[str, int]] = {}

    @classmethod
    def parse(cls, settings: Mapping[str, Any]) -> 'Rules':
        """Make rules from a dictionary as YAML gives it.

        :raises SettingsError: naming the key, the value and what is allowed.
        """
        if not isinstance(settings, Mapping):
            raise SettingsError('rules', settings, 'a mapping from failed states to rules')
        return cls({state: _parse_rules(state, value) for state, value in settings.items()})

    def next(self, robot: str, trial_id: str, container_path: str, state: str) -> Rule:
        """Return the rule for one more question. Each call counts."""
        path = '{}/{}'.format(container_path, state)
        keys = (path, '/'.join([OLD_NAME] + path.split('/')[1:]), state, DEFAULT)
        rules = next((self._by_state[key] for key in keys if key in self._by_state), ())
        trial, count = self._asked.get((robot, path), (trial_id, 0))
        if trial != trial_id:
            count = 0
        self._asked[(robot, path)] = (trial_id, count + 1)
        return rules[min(count, len(rules) - 1)] if rules else Rule(IGNORE)


class RuleExpert(Expert):
    """An expert in the same process, without ROS, that goes by rules."""

    def __init__(
        self, rules: Rules, by: str = 'scripted', interfaces: Optional[Mapping[str, Any]] = None
    ) -> None:
        """
        :param interfaces: by name, functions that take the question and return a SUPERSEDE answer
            or None.
        """
        self._rules = rules
        self._by = by
        self._interfaces = dict(interfaces or {})

    def ask(
        self, question: Question, cancelled: threading.Event, progress: Progress
    ) -> Optional[Answer]:
        """Return the rule's answer after its delay.

        None by the deadline where the rule ignores or comes too late, or would have a state
        repeated that it does not confirm.
        """
        rule = Rule(IGNORE)  # of a state that still runs: rules are for failures
        if question.failure_kind is not FailureKind.STILL_RUNNING:
            rule = self._rules.next(
                '', question.trial_id, question.container_path, question.failed_state
            )
        ignores = rule.kind == IGNORE or bool(rule.why_not(question.choices))
        limit_s = question.deadline_s or math.inf
        wait_s = min(math.inf if ignores else rule.delay_s, limit_s)
        if (
            cancelled.wait(None if wait_s == math.inf else wait_s)
            or ignores
            or rule.delay_s > limit_s
        ):
            return None
        return rule.answer(self._by)

    def run_interface(
        self,
        offer: InterfaceOffer,
        question: Question,
        cancelled: threading.Event,
        progress: Progress,
    ) -> Optional[Answer]:
        """Call the function of that name. Return None where there is none."""
        progress('interface_start', offer.name, '')
        run = self._interfaces.get(offer.name)
        answer: Optional[Answer] = (
            run(question) if run is not None and not cancelled.is_set() else None
        )
        progress('interface_end', offer.name, answer.outcome if answer is not None else '')
        return answer


def _parse_rules(state: str, value: object) -> Tuple[Rule, ...]:
    if not isinstance(state, str) or not state:
        raise checks.no_name('rules', state, 'labels of states as keys, or "default"')
    if not isinstance(value, (list, tuple)):
        return (_parse_rule(state, value),)
    if not value:
        raise SettingsError(state, value, 'a rule, or a list of one rule or more')
    return tuple(
        _parse_rule('{}[{}]'.format(state, index), item) for index, item in enumerate(value)
    )


def _parse_rule(key: str, value: object) -> Rule:
    if not isinstance(value, Mapping):
        raise SettingsError(key, value, 'a mapping with a kind')
    unknown = sorted(str(field) for field in value if field not in _FIELDS)
    if unknown:
        raise SettingsError(
            '{}.{}'.format(key, unknown[0]), value, 'the keys {}'.format(', '.join(_FIELDS))
        )
    kind = as_text(value.get('kind'))
    if not isinstance(kind, str) or (kind != IGNORE and kind not in KINDS):
        raise SettingsError(key + '.kind', kind, ', '.join(sorted(KINDS)) + ' or ' + IGNORE)
    named_by = _NAMED_BY.get(kind)
    if named_by is not None and not as_text(value.get(named_by)):
        raise SettingsError(
            '{}.{}'.format(key, named_by), value.get(named_by), 'a name; {} needs one'.format(kind)
        )
    return Rule(
        kind,
        _text(key, value, 'state'),
        _text(key, value, 'outcome'),
        _text(key, value, 'interface'),
        _outputs(key, value),
        _text(key, value, 'why'),
        _delay_s(key, value),
        checks.flag(key + '.confirm', value.get('confirm', False)),
        _text(key, value, 'container'),
    )


def _text(key: str, value: Mapping[str, Any], field: str) -> str:
    return checks.text('{}.{}'.format(key, field), value.get(field, ''))


def _outputs(key: str, value: Mapping[str, Any]) -> Optional[Mapping[str, Any]]:
    outputs = plain(value.get('outputs')) or None
    if outputs is not None and not (
        isinstance(outputs, Mapping) and all(isinstance(name, str) for name in outputs)
    ):
        raise SettingsError(key + '.outputs', outputs, 'a mapping from userdata keys to plain data')
    return outputs


def _delay_s(key: str, value: Mapping[str, Any]) -> float:
    check = checks.number(0, math.inf, 'seconds from 0')
    return float(check(key + '.delay_s', value.get('delay_s', 0.0)))
