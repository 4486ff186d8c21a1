"""What the present code makes of the data. The tests compare it with what version 0.1 made."""

import csv
import json
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Dict, Iterator, List

import held_trials
import listings
import product
import pytest
import yaml
from held import RATES, SETTINGS, TRIALS, Result, bags, name_of, run, run_all, without_place

STATISTICS = ('bag_statistics', 'trials', 'experiment')
TRIED = ('--memory', '2', '20', '--policy', 'prose', 'algorithm1')
# commands that print figures: by the name of the file with them
TEXTS = {
    'bag_statistics': STATISTICS,
    'bag_statistics_strict': ('bag_statistics', 'trials', '--failing-outcomes', 'succeeded'),
    'compare_oracles': ('compare_oracles', 'trials', 'experiment'),
    'same_trials': ('same_trials', 'experiment', 'experiment'),
    'what_if_experiment': ('what_if', 'experiment', *TRIED),
    'what_if_fetch': ('what_if', 'trials/fetch', *TRIED),
    'what_if_fetch_thresholds': (
        'what_if',
        'trials/fetch',
        '--moderate-from',
        '0.3',
        '--high-from',
        '0.6',
        '--prior',
        '0.1',
        '0.5',
    ),
    'what_if_kitchen': ('what_if', 'trials/kitchen', *TRIED),
    'what_if_stopped': ('what_if', 'trials/stopped', *TRIED),
}
# a machine, its settings, and the rates file that it reads
RATES_CASES = [
    ('fetch', {}, RATES / 'window.json'),
    ('fetch', {'memory': 3}, RATES / 'window.json'),
    ('fetch', {'estimator': 'exponential'}, RATES / 'window.json'),
    (
        'fetch',
        {'states': {'PICK': {'memory': 2, 'moderate_from': 0.2, 'high_from': 0.5}}},
        RATES / 'window.json',
    ),
    ('fetch', {}, RATES / 'window_of_three.json'),
    ('fetch', {'memory': 3, 'prior': 0.5}, RATES / 'window_of_three.json'),
    ('fetch', {'estimator': 'exponential'}, RATES / 'exponential.json'),
    ('fetch', {'prior': 0.3}, RATES / 'exponential.json'),
    ('kitchen', {}, RATES / 'window_nested.json'),
    (
        'kitchen',
        {'estimator': 'exponential', 'memory': 4, 'prior': 0.2},
        RATES / 'exponential_nested.json',
    ),
    ('fetch', {'memory': 5}, TRIALS / 'fetch/rates.json'),
    ('fetch', {'memory': 5}, TRIALS / 'by_hand/rates.json'),
    ('kitchen', {'estimator': 'exponential', 'memory': 4}, TRIALS / 'kitchen/rates.json'),
]
# names that programs import, as the README and the pages of doc/ have them
PLACES = [
    'smach_oracle:OracleContainer',
    *(
        'smach_oracle.oracle:' + name
        for name in (
            'OracleContainer',
            'Settings',
            'FailureRate',
            'ExponentialFailureRate',
            'FailureClass',
        )
    ),
    'smach_oracle.ros.recorder:TrialRecorder',
    'smach_oracle.expert.rules:RuleExpert',
    'smach_oracle.expert.rules:Rules',
    *(
        'smach_oracle.expert.front_end:' + name
        for name in ('FrontEnd', 'ServerGoneError', 'wait_for_question')
    ),
    *(
        'smach_oracle.expert.interface_goal:' + name
        for name in ('InterfaceGoal', 'SettlingServices')
    ),
]
_FAILED = (
    ('ROBOT', 'DETECT'),
    ('ROBOT', 'PICK'),
    ('KITCHEN', 'OPEN_FRIDGE'),
    ('HALL', 'OPEN_FRIDGE'),
    ('FETCH', 'PLACE'),
    ('ROBOT', 'ELSE'),
)
# questions for the rules of a scripted expert: trial, container, state
QUESTIONS = [
    (trial, container, state)
    for trial, times in (('one', 3), ('two', 1))
    for container, state in _FAILED
    for _ in range(times)
]
# states that the settings of the scripted operator are read for
OPERATED = (
    'DETECT_TABLETOP',
    'DETECT_CUP',
    'PICK',
    'PICK_DRINK',
    'PLACE',
    'SERVE',
    'HAND_OVER',
    'MOVE_IN',
    'OTHER',
)


def events() -> Dict[str, List[Dict[str, Any]]]:
    """The events of every bag, without empty fields."""
    found = {name_of(path): held_trials.events(held_trials.with_rosbag(path)) for path in bags()}
    return {name: [held_trials.shortened(event) for event in each] for name, each in found.items()}


def topics() -> Dict[str, Any]:
    """The topics of every bag."""
    return {name_of(path): held_trials.topics(held_trials.with_rosbag(path)) for path in bags()}


def machines() -> Dict[str, Any]:
    """The containers and the camera frames in every bag."""
    found = {}
    for path in bags():
        read = product.read_machines(str(path))
        frames = [dict(product.plain(frame), data=len(frame.data)) for frame in read.frames]
        found[name_of(path)] = {'containers': product.plain(read.containers), 'frames': frames}
    return found


def statistics() -> Dict[str, Any]:
    """The files of bag_statistics, JSON and CSV."""
    with tempfile.TemporaryDirectory() as folder:
        json_file, csv_file = Path(folder) / 'out.json', Path(folder) / 'out.csv'
        run(*STATISTICS, '--json', str(json_file), '--csv', str(csv_file))
        with csv_file.open(encoding='utf-8', newline='') as stream:
            rows = list(csv.DictReader(stream))
        return {'json': statistics_in(json_file), 'csv': [dict(row) for row in rows]}


def statistics_in(path: Path) -> Any:
    """A JSON file of bag_statistics."""
    return json.loads(without_place(path.read_text(encoding='utf-8')))


def texts() -> Dict[str, Result]:
    """The output of the commands."""
    return dict(zip(TEXTS, run_all(list(TEXTS.values()))))


def settings(name: str, monkeypatch: Any) -> Any:
    """The effective values of a settings file."""
    read = next(read for kind, read in _READERS if name.startswith(kind))
    return json.loads(json.dumps(read(SETTINGS / name, monkeypatch)))


def _oracle(path: Path, monkeypatch: Any) -> Any:
    return product.settings_of(path)


def _parameter(path: Path, monkeypatch: Any) -> Any:
    return product.from_parameter(_yaml(path)['oracle'], monkeypatch)


def _manipulation(path: Path, monkeypatch: Any) -> Any:
    return product.plain(product.manipulation(_yaml(path), monkeypatch))


def _operator(path: Path, monkeypatch: Any) -> Any:
    settings = product.operator(_yaml(path), monkeypatch)
    found = {key: product.plain(value) for key, value in vars(settings).items() if key != 'plans'}
    found['states'] = {state: product.plain(settings.plans.of(state)) for state in OPERATED}
    return found


def _perception(path: Path, monkeypatch: Any) -> Any:
    return product.plain(product.perception(_yaml(path)))


def _joystick(path: Path, monkeypatch: Any) -> Any:
    return product.plain(product.joystick(_yaml(path)))


def _rules(path: Path, monkeypatch: Any) -> Any:
    rules = product.rules(path)
    return [product.plain(rules.next('/robot', *question)) for question in QUESTIONS]


def _yaml(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding='utf-8'))


# by how the names of the files begin; the last one is for all others
_READERS = [
    ('parameter', _parameter),
    ('manipulation', _manipulation),
    ('operator', _operator),
    ('perception', _perception),
    ('joystick', _joystick),
    ('rules', _rules),
    ('', _oracle),
]


def tokens(folder: Path) -> Dict[str, Any]:
    """The owner of each token of the console; only the owner of the file may read it."""
    text = (SETTINGS / 'tokens.txt').read_text(encoding='utf-8')
    path = folder / 'tokens.txt'
    path.write_text(text, encoding='utf-8')
    path.chmod(0o600)
    book = product.tokens(path)
    words = [line.split()[1] for line in text.splitlines() if not line.startswith('#')]
    words.append('another-token-of-some-length')
    return {word: product.plain(book.identify(word)) for word in words}


def rates(name: str, given: Dict[str, Any], path: Path) -> Dict[str, Any]:
    """What a machine knows once it has read a rates file."""
    machine = product.OracleContainer.wrap(product.machine(name), settings=given, name=name.upper())
    with tempfile.TemporaryDirectory() as folder:
        # a file that cannot be used is renamed
        machine.load_rates(shutil.copy(str(path), folder))
    states = [product.plain(row) for row in machine.rates()]
    return {'file': name_of(path), 'settings': given, 'states': states}


def options() -> Dict[str, Any]:
    """The options of every command."""
    commands = listings.commands()
    results = run_all([(command, '--help') for command in commands])
    return {command: listings.options_of(result.text) for command, result in zip(commands, results)}


def private_names() -> Dict[str, List[str]]:
    """The documented private names, by whether the code has them as a whole."""
    in_code, names = listings.texts_of_the_code(), listings.documented_private_names()
    return {
        'whole': [name for name in names if name in in_code],
        'put_together': [name for name in names if name not in in_code],
    }


@contextmanager
def own_monkeypatch() -> Iterator[Any]:
    """A monkeypatch outside of a test."""
    patch = pytest.MonkeyPatch()
    try:
        yield patch
    finally:
        patch.undo()
