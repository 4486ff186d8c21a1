"""The settings of the executive, validated. Pure, and without smach.

`Settings.from_dict` reads nested plain dictionaries, as YAML and rosparam give them. Every error is
a SettingsError that names the dotted key, the value and what is allowed.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Collection, Dict, Mapping, Optional, Sequence, Tuple, Union

from ..decision.failure_rate import ESTIMATORS
from ..decision.policies import POLICIES
from ..decision.ways import Prices
from ..errors import SettingsError
from . import checks as values
from .checks import (
    Budget,
    Resolver,
    checked,
    checked_budget,
    checked_on_resume,
    checked_policy,
    checked_resume_map,
    setting,
    settings_of,
)
from .groups import Groups, no_such
from .health import HealthCondition, HealthKind, checked_health
from .interfaces import START_LIMIT_S, InterfaceOffer, checked_interfaces
from .names import Nested, check_name, checked_nested, did_you_mean, exactness, matches
from .preconditions import PreconditionSpec, parse_preconditions

ALLOW, CONFIRM, NEVER = 'allow', 'confirm', 'never'  # on_retry
RUN, ANNOUNCE, CONFIRM_FIRST = 'run', 'announce', 'confirm'  # autonomy
AUTONOMY_LEVELS = (RUN, ANNOUNCE, CONFIRM_FIRST)
_MAX_HISTORY = 1000000  # visits. Each question carries them all
_RATE = values.number(0, 1, 'a failure rate from 0 to 1')
_RESULTS = values.whole(1, 'a whole number of results from 1')
_COUNT = values.whole(0, 'a whole number from 0')
_VISITS = values.whole(
    1, 'a whole number of visits from 1 to {}'.format(_MAX_HISTORY), _MAX_HISTORY
)
_MOMENT = values.whole(0, 'the number of a stored moment, 0: the last one', 1 << 62)
_SECONDS = values.number(0, math.inf, 'seconds from 0')
_MINUTE = values.number(0, 60, 'seconds from 0 to 60')
_HOUR = values.number(0, 3600, 'seconds from 0 to 3600')


@dataclass(frozen=True)
class StateSettings:
    """The settings of one state: the machine's defaults, unless set for the state."""

    memory: int = setting(10, _RESULTS, "how many of a state's latest results enter its rate")
    prior: float = setting(0.1, _RATE, 'failure rate that a state starts with, 0 to 1')
    moderate_from: float = setting(0.4, _RATE, 'failure rate from which a state is MODERATE')
    high_from: float = setting(0.75, _RATE, 'failure rate from which a state is HIGH')
    estimator: str = setting(
        'window',
        values.choice(sorted(ESTIMATORS)),
        'how a rate is made of the results: `window` counts the latest `memory` of them, '
        '`exponential` gives later ones more weight',
    )
    max_recoveries: int = setting(
        5, _COUNT, 'recoveries of a state in a trial; after them the expert is asked'
    )
    on_retry: str = setting(
        ALLOW,
        values.choice((ALLOW, CONFIRM, NEVER)),
        'whether a state that the trial has done [is repeated]'
        '(limits.md#states-that-are-not-repeated): `allow` repeats it, `confirm` asks an expert '
        'first, `never` does not repeat it at all',
    )
    autonomy: str = setting(
        RUN,
        values.choice(AUTONOMY_LEVELS),
        'how a state [is entered](control.md#autonomy): `run` enters it by itself, `announce` '
        'tells it, `confirm` waits for an operator',
    )
    failure_outcomes: Tuple[str, ...] = setting(
        (), values.words, 'outcomes of states that are failures whatever they lead to'
    )
    author_recoveries: str = setting(
        'keep',
        values.choice(('keep', 'override')),
        "`keep`: an author's own transition from a failure stays; `override`: the oracle recovers",
    )
    time_limit_s: Optional[float] = setting(
        None, values.time_limit, 's that each execution of a state may take; 0: no limit'
    )
    grace_period_s: float = setting(
        2.0, _SECONDS, 's from the preempt after an overrun until the state is abandoned'
    )
    preconditions: Tuple[PreconditionSpec, ...] = setting(
        (),
        parse_preconditions,
        'what must hold before the state is entered ([preconditions.md](preconditions.md)); below '
        '`states` only',
        names_objects=True,
    )
    intended_outcomes: Tuple[str, ...] = setting(
        (),
        values.words,
        'outcomes of states that are [meant so](executive.md#what-is-a-failure): never a failure, '
        'wherever they lead',
    )


@dataclass(frozen=True)
class Settings:
    """The settings of a wrapped machine.

    `states` holds what is set for single states, by LABEL or PATH/LABEL, or by a pattern of them.

    >>> from smach_oracle.oracle import Settings
    >>> settings = Settings.from_dict({'memory': 20, 'states': {'PICK': {'memory': 5}}})
    >>> settings.for_state('', 'PICK').memory, settings.for_state('', 'LOOK').memory
    (5, 20)
    >>> Settings.from_dict({'states': {'PICK': {'memory': 0}}})
    Traceback (most recent call last):
    smach_oracle.oracle.errors.SettingsError: states.PICK.memory: 0 is not allowed;
    allowed: a whole number of results from 1
    """

    defaults: StateSettings = StateSettings()
    policy: str = setting(
        'prose',
        checked_policy,
        'how it decides ([policies.md](policies.md)): {}. With parameters it is a mapping with its '
        '`name`'.format(', '.join(POLICIES)),
    )
    failing_outcomes: Optional[Tuple[str, ...]] = setting(
        None,
        values.optional(values.words),
        'outcomes of containers that are failures: a list of names, whole or as a suffix. null: by '
        '[the words of their names](executive.md#what-is-a-failure)',
    )
    userdata: Optional[str] = setting(
        None,
        values.optional(values.choice(('restore', 'keep'))),
        'the userdata [after a jump](executive.md#userdata-on-a-jump). `restore`: as it was when '
        'the target was last entered. `keep`: as it is. If unset, it is `keep` under `escalating` '
        'and `any_way`, and else `restore`',
    )
    deep_copy_keys: Tuple[str, ...] = setting(
        (),
        values.words,
        'userdata keys whose values are changed in place, and so are copied for the restore',
    )
    deadline_s: float = setting(
        300.0,
        values.deadline,
        's until the fallback, for all questions about one failure; 0: waits without end',
        key='expert.deadline_s',
    )
    on_no_answer: Tuple[str, str] = setting(
        ('stop', ''),
        values.on_no_answer,
        'the fallback: `stop`, `{goto: LABEL}` or `{give_up: OUTCOME}`',
        key='expert.on_no_answer',
    )
    escalate: bool = setting(
        False,
        values.flag,
        'an oracle that would ask [lets the one above decide first](trees.md#escalate)',
        key='tree.escalate',
    )
    watch_preconditions: bool = setting(
        True,
        values.flag,
        'call functions among the preconditions while a question is open, to tell if they hold '
        '([expert.md](expert.md))',
        key='expert.watch_preconditions',
    )
    history_length: int = setting(
        50,
        _VISITS,
        'visits that a question shows',
        key='expert.history_length',
    )
    rates_file: str = setting(
        '',
        values.file,
        "keep [learned rates](#the-file-of-learned-rates) across runs in this file; '': in none",
    )
    oracle_label: str = setting('ORACLE', values.label, 'name of the meta state')
    nested: Nested = setting(
        True,
        checked_nested,
        'nested machines, and plain states of Iterators and Concurrences, have oracles of their '
        'own; or a list of [paths and patterns](trees.md#settings-by-patterns): '
        '`[ARM, ARM/**, ALL/EACH]`',
        key='tree.nested',
    )
    # offer, states it serves ((): all)
    interfaces: Tuple[Tuple[InterfaceOffer, Tuple[str, ...]], ...] = setting(
        (),
        checked_interfaces,
        'shared-autonomy interfaces that the expert may choose, by name: `action`, `description`, '
        '`states`; to have it started `launch` or `node`, with `args` and `start_limit_s` ({:g}) '
        '([shared_autonomy.md](shared_autonomy.md))'.format(START_LIMIT_S),
        key='expert.interfaces',
    )
    states: Mapping[str, Mapping[str, object]] = setting(
        {},
        values.mapping,
        'the settings with a * and `preconditions`, by LABEL (everywhere), PATH/LABEL (relative '
        'to the top machine; wins) or a [pattern](trees.md#settings-by-patterns), such as `ARM/*` '
        'or `**/PICK`',
    )
    budget: Budget = setting(
        Budget(),
        checked_budget,
        'limits of [a whole trial](limits.md#the-budget-of-a-trial), over all machines in it: '
        '`{recoveries: 20, minutes: 30, questions: 5}`, or some of these',
    )
    healthy: Tuple[HealthCondition, ...] = setting(
        (),
        checked_health,
        'what must hold for the robot [to be well](limits.md#health): a list, or one',
        names_objects=True,
        key='healthy.conditions',
        short='a list of conditions, or one',
        marks=tuple(kind.value for kind in HealthKind),
    )
    health_settle_s: float = setting(
        0.5,
        _MINUTE,
        's from 0 to 60: how long the oracle watches the health after a failure, and how long all '
        'must hold before the machine goes on',
        key='healthy.settle_s',
    )
    still_running_s: float = setting(
        60.0,
        _SECONDS,
        's after which a person is asked about a state that the oracle has entered, that has no '
        'time limit, and that [still runs](limits.md#still-running); 0: never',
        key='still_running.after_s',
    )
    still_running_factor: float = setting(
        10.0,
        values.number(1, math.inf, 'a number from 1'),
        'the state must also take so many times as long as it ever did',
        key='still_running.factor',
    )
    step_back_across: bool = setting(
        False,
        values.flag,
        'where nothing was visited before the failed state in its container, a step back leads to '
        'what ran before in the one above '
        '([trees.md](trees.md#preconditions-and-steps-back-across-containers))',
        key='tree.step_back_across',
    )
    # those that are not the policy's defaults
    policy_parameters: Mapping[str, float] = field(default_factory=dict)
    checkpoint: str = setting(
        '',
        values.file,
        'keep where the machine stands in this [store](survive.md), to go on from it after a '
        "crash; '': in none",
        key='checkpoint.file',
        short='the name of a file',
    )
    checkpoint_wait_s: float = setting(
        1.0,
        _MINUTE,
        "s from 0 to 60 that the machine waits for the store's disk",
        key='checkpoint.wait_s',
    )
    checkpoint_synchronous: str = setting(
        'FULL',
        values.choice(('FULL', 'NORMAL', 'OFF')),
        '`FULL`: a power cut loses nothing that was stored; `NORMAL`: it may lose the last '
        'moments; `OFF`: it may damage the store',
        key='checkpoint.synchronous',
    )
    # and for STATE the path of a state
    on_resume: Tuple[str, str] = setting(
        ('ask', ''),
        checked_on_resume,
        'what is done about a stored trial that was not finished: `ask`, `recover`, `restart` or '
        '`state:LABEL`',
        key='checkpoint.on_resume',
    )
    resume_from: int = setting(
        0,
        _MOMENT,
        'number of the stored moment to go on from, once (table `moments` of the store); 0: the '
        'last one of the trial',
        key='checkpoint.from',
    )
    resume_map: Mapping[str, str] = setting(
        {},
        checked_resume_map,
        'where the script has [changed](survive.md#a-script-that-has-changed): paths of states by '
        'those that they had, such as `{OLD: NEW, KITCHEN/OLD: COOK/NEW}`',
        key='checkpoint.map',
    )
    after_preempt_s: float = setting(
        0.0,
        _HOUR,
        's from 0 to 3600 that the states behind a preempt may run after Ctrl-C or SIGTERM, '
        '[under `oracle_run`](limits.md#after-ctrl-c); 0: not at all',
    )
    resume_repeat: Tuple[str, ...] = setting(
        (),
        values.words,
        'states that the trial that goes on may [repeat](survive.md#what-is-not-repeated) once, '
        'whatever `on_retry` says. Give it on the command line, as `--repeat`, rather than here',
        key='checkpoint.repeat',
    )
    cost: Prices = setting(
        Prices(),
        values.checked_prices,
        'what a policy that [goes by ways](ways.md#what-a-way-costs) reckons with, in minutes of '
        'the robot: `{robot_minute: 1, expert_minute: 5, lost_trial: 60, harm: 30}`, or some of '
        'these',
    )

    @classmethod
    def from_dict(
        cls, given: Optional[Mapping[str, object]], resolver: Optional[Resolver] = None
    ) -> 'Settings':
        """Check a dictionary of settings.

        `resolver` turns 'python:module:attribute' of a precondition or of a condition of health
        into that object.

        :raises SettingsError: naming key, value and what is allowed.
        """
        entries = GROUPS.given_in(values.mapping('settings', given))
        flat = {each.name: each.value for each in entries}
        _refuse_unknown('', flat, {*settings_of(cls), *_OF_ALL_STATES}, GROUPS.top_keys())
        defaults = replace(StateSettings(), **_checked_state('', flat, StateSettings(), resolver))
        found = checked(cls, '', flat, resolver, {each.name: each.written for each in entries})
        if 'policy' in found:
            found['policy'], found['policy_parameters'] = found['policy']
        states = found.pop('states', {})
        return cls(defaults=defaults, **found).with_states(states, resolver)

    def for_state(self, path: str, label: str) -> StateSettings:
        """Return the settings of a state.

        `path`: of its container, relative to the top machine, '' for that itself. Where several
        names of `states` stand for it, the most exact one wins.
        """
        full = '/'.join((path, label)) if path else label
        merged: Dict[str, object] = {}
        for name in sorted((name for name in self.states if matches(name, full)), key=exactness):
            merged.update(self.states[name])
        return replace(self.defaults, **merged) if merged else self.defaults

    def with_states(
        self, states: Mapping[str, object], resolver: Optional[Resolver] = None
    ) -> 'Settings':
        """Return these settings with further settings of single states, which win.

        :raises SettingsError: naming key, value and what is allowed.
        """
        merged = {name: dict(overrides) for name, overrides in self.states.items()}
        for name, given in states.items():
            prefix = 'states.{}.'.format(check_name('states', name))
            overrides = values.mapping(prefix[:-1], given)
            names = sorted(settings_of(StateSettings))
            _refuse_unknown(prefix, overrides, names, names)
            merged.setdefault(name, {}).update(
                _checked_state(prefix, overrides, self.defaults, resolver)
            )
        return replace(self, states=merged)

    def offers_for(self, path: str, label: str) -> Tuple[InterfaceOffer, ...]:
        """Return the shared-autonomy interfaces on offer for a state."""
        full = '/'.join((path, label)) if path else label
        return tuple(
            offer
            for offer, states in self.interfaces
            if not states or any(matches(name, full) for name in states)
        )


_OF_ALL_STATES = [name for name in settings_of(StateSettings) if name != 'preconditions']
GROUPS = Groups(
    settings_of(Settings),
    _OF_ALL_STATES,
    {
        'expert': 'the [expert](expert.md), and the questions that it is asked',
        'still_running': 'a state that [does not end](limits.md#still-running)',
        'healthy': "the robot's [health](limits.md#health): its conditions, or this group",
        'tree': 'machines that [lie in each other](trees.md)',
        'checkpoint': 'the [store](survive.md) of where the machine stands: a file, or this group',
    },
)


def _refuse_unknown(
    prefix: str, given: Mapping[str, object], known: Collection[str], allowed: Sequence[str]
) -> None:
    for key in given:
        if key not in known:
            raise no_such(prefix + key, given[key], allowed, _hint(prefix, key))


def _hint(prefix: str, key: str) -> str:
    """Say where the key belongs, or which one may be meant."""
    if key == 'preconditions':
        return ' here (it belongs to a state: below states: LABEL:)'
    if not prefix:
        return GROUPS.hint(key)
    if key in settings_of(Settings) or key in GROUPS.texts:
        place = GROUPS.key_of(key)
        return ' of a state (it holds for the whole machine: {})'.format(
            'it is called ' + place if '.' in place else 'move it to the top of the settings'
        )
    return did_you_mean(key, settings_of(StateSettings))


def _checked_state(
    prefix: str, given: Mapping[str, object], defaults: StateSettings, resolver: Optional[Resolver]
) -> Dict[str, object]:
    found = checked(StateSettings, prefix, given, resolver)
    settings = replace(defaults, **found)
    if settings.moderate_from > settings.high_from:
        # blame the threshold that was given, not the default of the other
        if 'moderate_from' not in found:
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
    return found


SettingsLike = Union[Settings, Mapping[str, object], None]
PreconditionLists = Optional[Mapping[str, Sequence[object]]]


def as_settings(settings: SettingsLike, preconditions: PreconditionLists) -> Settings:
    """Return checked settings, with preconditions added.

    :raises SettingsError: naming key, value and what is allowed.
    """
    found = settings if isinstance(settings, Settings) else Settings.from_dict(settings)
    if preconditions is None:
        return found
    if not isinstance(preconditions, Mapping):
        raise SettingsError('preconditions', preconditions, 'a mapping of state labels to lists')
    return found.with_states(
        {
            label: {'preconditions': given}
            for label, given in values.mapping('preconditions', preconditions).items()
        }
    )
