"""The settings of the executive, validated. Pure, and without smach.

`Settings.from_dict` reads nested plain dictionaries, as YAML and rosparam give them. Every error is
a SettingsError that names the dotted key, the value and what is allowed.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any, Dict, List, Mapping, Optional, Tuple, Union

from ..decision.failure_rate import ESTIMATORS
from ..errors import SettingsError
from ..settings.interfaces import InterfaceOffer
from . import checks as values
from .budget import Budget, checked_budget
from .close_names import did_you_mean
from .failing_outcomes import DEFAULT_FAILING_OUTCOMES
from .health import HealthCondition, checked_health
from .interfaces import checked_interfaces
from .on_resume import checked_on_resume, checked_resume_map
from .patterns import Nested, check_name, checked_nested, exactness, matches
from .policy_choice import checked_policy
from .preconditions import PreconditionSpec, parse_preconditions
from .python_names import Resolver

ALLOW, CONFIRM, NEVER = 'allow', 'confirm', 'never'  # on_retry
RUN, ANNOUNCE, CONFIRM_FIRST = 'run', 'announce', 'confirm'  # autonomy
AUTONOMY_LEVELS = (RUN, ANNOUNCE, CONFIRM_FIRST)
_MAX_HISTORY = 1000000  # visits. Each question carries them all
_RATE = values.number(0, 1, 'a failure rate from 0 to 1')


@dataclass(frozen=True)
class StateSettings:
    """The settings of one state: the machine's defaults, unless set for the state."""

    memory: int = 10  # results
    prior: float = 0.1  # failure rate, 0 to 1
    moderate_from: float = 0.4  # failure rate from which a state is MODERATE
    high_from: float = 0.75  # and HIGH
    estimator: str = 'window'
    max_recoveries: int = 5  # per trial. Beyond it the oracle asks
    on_retry: str = ALLOW  # whether it may be repeated
    autonomy: str = RUN  # whether it is entered by itself
    failure_outcomes: Tuple[str, ...] = ()  # outcomes that are failures whatever they lead to
    author_recoveries: str = 'keep'
    time_limit_s: Optional[float] = None  # of each execution. None means no limit
    grace_period_s: float = 2.0  # between the preempt after an overrun and abandonment
    preconditions: Tuple[PreconditionSpec, ...] = ()


_STATE_CHECKS: Dict[str, values.Check] = {
    'memory': values.whole(1, 'a whole number of results from 1'),
    'prior': _RATE,
    'moderate_from': _RATE,
    'high_from': _RATE,
    'estimator': values.choice(sorted(ESTIMATORS)),
    'max_recoveries': values.whole(0, 'a whole number from 0'),
    'on_retry': values.choice((ALLOW, CONFIRM, NEVER)),
    'autonomy': values.choice(AUTONOMY_LEVELS),
    'failure_outcomes': values.words,
    'author_recoveries': values.choice(('keep', 'override')),
    'time_limit_s': values.time_limit,
    'grace_period_s': values.number(0, math.inf, 'seconds from 0'),
}
_TOP_KEYS = ('states', 'interfaces', 'healthy')
_MACHINE_CHECKS: Dict[str, values.Check] = {
    'policy': checked_policy,
    'budget': checked_budget,
    'failing_outcomes': values.words,
    'userdata': values.choice(('restore', 'keep')),
    'deep_copy_keys': values.words,
    'deadline_s': values.deadline,
    'on_no_answer': values.on_no_answer,
    'escalate': values.flag,
    'step_back_across': values.flag,
    'still_running_s': values.number(0, math.inf, 'seconds from 0'),
    'still_running_factor': values.number(1, math.inf, 'a number from 1'),
    'watch_preconditions': values.flag,
    'history_length': values.whole(
        1, 'a whole number of visits from 1 to {}'.format(_MAX_HISTORY), _MAX_HISTORY
    ),
    'rates_file': values.file,
    'checkpoint': values.file,
    'checkpoint_wait_s': values.number(0, 60, 'seconds from 0 to 60'),
    'on_resume': checked_on_resume,
    'resume_from': values.whole(0, 'the number of a stored moment, 0: the last one', 1 << 62),
    'resume_map': checked_resume_map,
    'resume_repeat': values.words,
    'checkpoint_synchronous': values.choice(('FULL', 'NORMAL', 'OFF')),
    'oracle_label': values.label,
    'nested': checked_nested,
    'health_settle_s': values.number(0, 60, 'seconds from 0 to 60'),
    'after_preempt_s': values.number(0, 3600, 'seconds from 0 to 3600'),
}


@dataclass(frozen=True)
class Settings:
    """The settings of a wrapped machine.

    `states` holds what is set for single states, by LABEL or PATH/LABEL, or by a pattern of them.
    """

    defaults: StateSettings = StateSettings()
    policy: str = 'prose'
    failing_outcomes: Tuple[str, ...] = DEFAULT_FAILING_OUTCOMES
    userdata: str = 'restore'
    deep_copy_keys: Tuple[str, ...] = ()
    deadline_s: float = 300.0  # 0: waits without end
    on_no_answer: Tuple[str, str] = ('stop', '')
    escalate: bool = False
    # whether callables among them may be called while a question is open
    watch_preconditions: bool = True
    history_length: int = 50  # visits
    rates_file: str = ''
    oracle_label: str = 'ORACLE'
    # whether, or at which paths (patterns), containers and branches have oracles of their own
    nested: Nested = True
    # offer, states it serves ((): all)
    interfaces: Tuple[Tuple[InterfaceOffer, Tuple[str, ...]], ...] = ()
    states: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    budget: Budget = Budget()  # of a whole trial
    healthy: Tuple[HealthCondition, ...] = ()  # what must hold for the robot to be well
    # how long it must hold after a failure and at the end of a wait
    health_settle_s: float = 0.5
    # a state that the oracle has entered is asked about when it takes so long, and so many times as
    # long as before; 0 s: never
    still_running_s: float = 60.0
    still_running_factor: float = 10.0
    # whether a step back may lead to what ran before in the container above
    step_back_across: bool = False
    # those that are not the policy's defaults
    policy_parameters: Mapping[str, float] = field(default_factory=dict)
    checkpoint: str = ''  # the store of the trials. '' means nothing is stored
    checkpoint_wait_s: float = 1.0  # for its disk, at each moment that is stored
    checkpoint_synchronous: str = 'FULL'
    # what is done about a stored trial that was not finished, and for STATE the path of a state
    on_resume: Tuple[str, str] = ('ask', '')
    resume_from: int = 0  # number of the stored moment, 0: the last one of a trial
    # paths of states by those that they had in the script that was stopped
    resume_map: Mapping[str, str] = field(default_factory=dict)
    # how long states behind a preempt may run after Ctrl-C or SIGTERM, under oracle_run
    after_preempt_s: float = 0.0
    # paths of states that may be repeated as the trial goes on, whatever `on_retry` says
    resume_repeat: Tuple[str, ...] = ()

    @classmethod
    def from_dict(
        cls, given: Optional[Mapping[str, Any]], resolver: Optional[Resolver] = None
    ) -> 'Settings':
        """Check a dictionary of settings.

        `resolver` turns 'python:module:attribute' of a precondition or of a condition of health
        into that object.

        :raises SettingsError: naming key, value and what is allowed.
        """
        given = values.mapping('settings', given)
        allowed = sorted([*_STATE_CHECKS, *_MACHINE_CHECKS, *_TOP_KEYS])
        _refuse_unknown('', given, allowed)
        defaults = _checked_defaults(given)
        machine = {
            key: check(key, given[key]) for key, check in _MACHINE_CHECKS.items() if key in given
        }
        if 'policy' in machine:
            machine['policy'], machine['policy_parameters'] = machine['policy']
        states = {
            name: _checked_state(name, overrides, defaults, resolver)
            for name, overrides in values.mapping('states', given.get('states')).items()
        }
        return cls(
            defaults=defaults,
            interfaces=checked_interfaces(given.get('interfaces')),
            states=states,
            healthy=checked_health(given.get('healthy'), resolver),
            **machine,
        )

    def for_state(self, path: str, label: str) -> StateSettings:
        """Return the settings of a state.

        `path`: of its container, relative to the top machine, '' for that itself. Where several
        names of `states` stand for it, the most exact one wins.
        """
        full = '{}/{}'.format(path, label) if path else label
        merged: Dict[str, Any] = {}
        for name in sorted((name for name in self.states if matches(name, full)), key=exactness):
            merged.update(self.states[name])
        return replace(self.defaults, **merged) if merged else self.defaults

    def with_states(
        self, states: Mapping[str, Mapping[str, Any]], resolver: Optional[Resolver] = None
    ) -> 'Settings':
        """Return these settings with further settings of single states, which win.

        :raises SettingsError: naming key, value and what is allowed.
        """
        merged = {name: dict(overrides) for name, overrides in self.states.items()}
        for name, overrides in states.items():
            merged.setdefault(name, {}).update(
                _checked_state(name, overrides, self.defaults, resolver)
            )
        return replace(self, states=merged)

    def offers_for(self, path: str, label: str) -> Tuple[InterfaceOffer, ...]:
        """Return the shared-autonomy interfaces on offer for a state."""
        full = '{}/{}'.format(path, label) if path else label
        return tuple(
            offer
            for offer, states in self.interfaces
            if not states or any(matches(name, full) for name in states)
        )


def _refuse_unknown(prefix: str, given: Mapping[str, Any], allowed: List[str]) -> None:
    for key in given:
        if key not in allowed:
            keys = 'one of the keys ' + ', '.join(allowed)
            raise SettingsError(
                prefix + key,
                given[key],
                keys,
                '{}: no such setting{}; allowed: {}'.format(
                    prefix + key, _hint(prefix, key, allowed), keys
                ),
            )


def _hint(prefix: str, key: str, allowed: List[str]) -> str:
    """Say where the key belongs, or which one may be meant."""
    if not prefix and key == 'preconditions':
        return ' here (it belongs to a state: below states: LABEL:)'
    if prefix and (key in _MACHINE_CHECKS or key in _TOP_KEYS):
        return ' of a state (it holds for the whole machine: move it to the top of the settings)'
    return did_you_mean(key, allowed)


def _checked_defaults(given: Mapping[str, Any]) -> StateSettings:
    defaults = StateSettings(
        **{key: check(key, given[key]) for key, check in _STATE_CHECKS.items() if key in given}
    )
    _check_thresholds('', defaults, given)
    return defaults


def _checked_state(
    name: str, overrides: object, defaults: StateSettings, resolver: Optional[Resolver]
) -> Dict[str, Any]:
    prefix = 'states.{}.'.format(check_name('states', name))
    overrides = values.mapping(prefix[:-1], overrides)
    _refuse_unknown(prefix, overrides, sorted(list(_STATE_CHECKS) + ['preconditions']))
    checked = {
        key: check(prefix + key, overrides[key])
        for key, check in _STATE_CHECKS.items()
        if key in overrides
    }
    if 'preconditions' in overrides:
        checked['preconditions'] = parse_preconditions(
            prefix + 'preconditions', overrides['preconditions'], resolver
        )
    _check_thresholds(prefix, replace(defaults, **checked), checked)
    return checked


def _check_thresholds(prefix: str, settings: StateSettings, given: Mapping[str, Any]) -> None:
    """Blame the threshold that was given, not the default of the other."""
    if settings.moderate_from > settings.high_from:
        if 'moderate_from' not in given:
            raise SettingsError(
                prefix + 'high_from',
                settings.high_from,
                'at least moderate_from, which is {}'.format(settings.moderate_from),
            )
        raise SettingsError(
            prefix + 'moderate_from',
            settings.moderate_from,
            'at most high_from, which is {}'.format(settings.high_from),
        )


SettingsLike = Union[Settings, Mapping[str, Any], None]
PreconditionLists = Optional[Mapping[str, List[Any]]]


def as_settings(settings: SettingsLike, preconditions: PreconditionLists) -> Settings:
    """Return checked settings, with preconditions added.

    :raises SettingsError: naming key, value and what is allowed.
    """
    checked = settings if isinstance(settings, Settings) else Settings.from_dict(settings)
    if preconditions is None:
        return checked
    if not isinstance(preconditions, Mapping):
        raise SettingsError('preconditions', preconditions, 'a mapping of state labels to lists')
    return checked.with_states(
        {label: {'preconditions': given} for label, given in preconditions.items()}
    )
