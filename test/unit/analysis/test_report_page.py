"""The report: what is on the page, that it needs nothing else, and that foreign text stays text."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from failing_machines import record as record_events
from failing_machines import run
from test_by_state import story

from smach_oracle.analysis import bag_statistics
from smach_oracle.analysis.bag_events import BagError, RecordedCause, SkippedBag
from smach_oracle.analysis.comparing.groups import groups_by
from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.analysis.reporting import events_again, machine_graphs
from smach_oracle.analysis.reporting.contents import ReportOptions, report_on
from smach_oracle.analysis.reporting.inline_svg import for_page
from smach_oracle.analysis.reporting.page import LONGEST, page_of, shown, write_report
from smach_oracle.analysis.trials import Trials, events_of, load_trials
from smach_oracle.oracle.records.events import Event, EventKind

ROOT = Path(__file__).parents[3]
OLD_BAGS = ROOT / 'test/data/v0_1'
EMPTY = {'meta', 'br', 'rect', 'path', 'polygon', 'use'}  # <rect/> in an SVG closes itself
HOSTILE = (
    '<script>alert(1)</script>',
    ']]>',
    '"><img src=x onerror=alert(1)>',
    "' onload='alert(1)",
    '</style></svg></title>',
    '{{ 7 * 7 }}{% raw %}',
    '\u202egpj.exe\u2066',
    '\x00\x1b[31m\x85\u2028',
    '\ud800',
    'javascript:alert(1)',
    'https://example.org/x.js',
    'x' * 10000,
    '<' * 10000,
    '',
)


class Page(HTMLParser):
    """A page read strictly: each element that is opened is closed, each id is there once."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.tags, self.ids, self.links, self.texts, self.attributes = [], [], [], [], []
        self._open = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self._note(tag, attrs)
        if tag not in EMPTY:
            self._open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self._note(tag, attrs)

    def _note(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            self.attributes.append((name, value))
            if name == 'id':
                assert value not in self.ids
                self.ids.append(value)
            if name in ('href', 'src', 'srcset', 'action', 'data', 'xlink:href'):
                self.links.append(value)

    def handle_endtag(self, tag):
        if tag not in EMPTY:
            assert self._open.pop() == tag

    def handle_data(self, data):
        if self._open and self._open[-1] != 'style':
            self.texts.append(data)

    @property
    def text(self):
        return ' '.join(' '.join(self.texts).split())


def check(text):
    """What holds of every page; returns it."""
    page = Page(text)
    assert not {'script', 'img', 'iframe', 'object', 'embed', 'link', 'form', 'base'} & set(
        page.tags
    )
    assert not [name for name, _ in page.attributes if name.startswith('on')]
    assert all(link.startswith('#') for link in page.links)
    assert {link[1:] for link in page.links} <= set(page.ids)
    assert set(re.findall(r'url\(#([^)]+)\)', text)) <= set(page.ids)
    assert not re.search(r'url\((?!#)|@import', text)
    return page


def report(*options):
    """Run the command, and return its exit code."""
    return bag_statistics.main([str(each) for each in options])


@pytest.fixture(scope='module')
def trials_of_old_bags(tmp_path_factory):
    path = tmp_path_factory.mktemp('report') / 'r.html'
    assert report(OLD_BAGS / 'trials', '--html', path) == 0
    return path.read_text(encoding='utf-8')


def test_the_page_has_each_section_of_each_machine(trials_of_old_bags):
    page = check(trials_of_old_bags)
    for words in (
        'Read this first',
        'In short',
        'What happened in the trials',
        'Over the trials',
        'How long without a person',
        'The machine',
        'By state',
        'Which decision followed which failure, and how it ended',
        'Preconditions',
        'Learned failure rates',
        'Settings',
        'Words',
        'not recorded',  # host and version: these bags are old
    ):
        assert words in page.text
    for name in ('FETCH', 'KITCHEN', 'KITCHEN/CLEAN/TABLE'):
        assert name in page.text
    assert 'door_is_open or OpenAgain' in page.text and 'trying it again' in page.text


def test_the_numbers_are_those_that_the_command_prints(tmp_path, capsys):
    path = tmp_path / 'r.html'
    assert report(OLD_BAGS / 'experiment', '--by-state', '--html', path) == 0
    printed, page = capsys.readouterr().out, check(path.read_text(encoding='utf-8'))
    rows = re.findall(r'^  (\w[\w ]+?) {2,}(\d+) +([\d.]+%) +([\d.]+ to +[\d.]+%)', printed, re.M)
    assert len(rows) > 20
    for name, trials, share, interval in rows:
        words = '{} {} {} {}'.format(name, trials, share, ' '.join(interval.split()))
        assert words in page.text.replace(' (at least)', ''), words


def test_the_text_of_figures_is_text(trials_of_old_bags):
    page = check(trials_of_old_bags)
    assert 'oracle recoveries' in page.text and 'Events per trial' in page.text
    assert 'metadata' not in page.tags and page.tags.count('style') == 1
    assert 'xmlns' not in trials_of_old_bags


def test_the_same_bags_give_the_same_page(tmp_path, capsys):
    path = tmp_path / 'r.html'
    pages = []
    for _run in range(2):
        assert report(OLD_BAGS / 'trials', OLD_BAGS / 'experiment', '--html', path) == 0
        pages.append(path.read_bytes())
    assert pages[0] == pages[1]
    assert str(path) in capsys.readouterr().out


def test_other_hash_seeds_give_the_same_page(tmp_path):
    pages = []
    for seed in ('1', '2'):
        path = tmp_path / seed
        program = [sys.executable, str(ROOT / 'scripts/bag_statistics'), str(OLD_BAGS / 'trials')]
        subprocess.run(
            [*program, '--html', str(path)],
            env={
                'PYTHONHASHSEED': seed,
                'PYTHONPATH': str(ROOT / 'src'),
                'PATH': '/usr/bin:/bin',
                'HOME': str(tmp_path),
            },
            stdout=subprocess.DEVNULL,
            timeout=100,
            check=True,
        )
        pages.append(path.read_bytes())
    assert pages[0] == pages[1]


def test_groups_are_compared_where_that_is_asked_for(tmp_path, capsys):
    path = tmp_path / 'r.html'
    assert report(OLD_BAGS / 'experiment', '--by', 'settings', '--html', path) == 0
    page = check(path.read_text(encoding='utf-8'))
    assert 'Compared by settings' in page.text and "McNemar's exact test" in page.text
    assert 'Compared by settings' in capsys.readouterr().out


def test_skipped_bags_stand_at_the_top_and_at_the_end(record, tmp_path):
    folder = record('bags', 2)
    Path(folder, 'broken.bag').write_text('?')
    assert report(folder, '--html', tmp_path / 'r.html') == 1
    page = check((tmp_path / 'r.html').read_text(encoding='utf-8'))
    assert page.text.index('1 bag was skipped') < page.text.index('In short')
    assert 'broken.bag' in page.text and 'skipped' in page.ids


def test_missing_events_and_unknown_truth_stand_at_the_top():
    trials = run(3)
    del trials[0][4]
    found = Trials([summarise(each) for each in trials], [])
    events = {each[0].trial_id: each for each in trials}
    page = check(page_of(report_on(found, events, ReportOptions(['x']))))
    warnings = page.text[: page.text.index('In short')]
    assert '1 event is missing in 1 trial' in warnings
    assert 'No judge saw 3 trials' in warnings and '"person needed" is a lower bound' in warnings


def test_the_page_is_the_same_however_few_events_are_held(record, tmp_path, monkeypatch):
    folder, out = record('bags', 7), tmp_path / 'r.html'
    found = load_trials([folder])
    whole = {trial.trial_id: events for trial, events in events_of(found.trials)}
    text = page_of(report_on(found, whole, ReportOptions([folder])))
    for most in (events_again.MOST_HELD, 1):
        monkeypatch.setattr(events_again, 'MOST_HELD', most)
        assert report(folder, '--html', out) == 0
        assert out.read_text(encoding='utf-8') == text


def test_few_events_are_held_except_those_of_one_bag(record, monkeypatch):
    monkeypatch.setattr(events_again, 'MOST_HELD', 2)
    found = load_trials([record('bags', 5)]).trials
    events = events_again.EventsAgain(found)
    for trial in found:
        assert summarise(events[trial.trial_id]).trial_id == trial.trial_id
        assert len(events._held) <= 2
    one_bag = [each._replace(bags=found[0].bags) for each in found]
    with pytest.raises(BagError, match='no trial'):
        events_again.EventsAgain(one_bag)[found[1].trial_id]


@pytest.mark.parametrize('by_state', [True, False])
def test_a_bag_that_goes_while_the_report_is_made_is_named(record, tmp_path, monkeypatch, by_state):
    folder, real = record('bags', 2), bag_statistics.count_variants
    bag = sorted(Path(folder).glob('*.bag'))[0]
    monkeypatch.setattr(
        bag_statistics, 'count_variants', lambda trials: (bag.unlink(), real(trials))[1]
    )
    options = ['--by-state'] if by_state else []
    assert report(folder, '--html', tmp_path / 'r.html', *options) == 2
    assert not (tmp_path / 'r.html').exists()


@pytest.mark.parametrize('out', ['missing/r.html', '.'])
def test_a_page_that_cannot_be_written_is_an_error(record, tmp_path, capsys, out):
    assert report(record('bags', 1), '--html', tmp_path / out) == 2
    err = capsys.readouterr().err
    assert str(tmp_path / out) in err and 'Traceback' not in err


def test_without_trials_there_is_no_page(tmp_path, capsys):
    (tmp_path / 'bags').mkdir()
    out = tmp_path / 'r.html'
    assert report(tmp_path / 'bags', '--html', out) == 2
    (tmp_path / 'bags' / 'x.bag').write_text('?')
    assert report(tmp_path / 'bags', '--html', out) == 2
    assert 'nothing was recorded' in capsys.readouterr().err and not out.exists()


def test_without_jinja_the_command_names_it_and_counts_anyway(
    record, tmp_path, capsys, monkeypatch
):
    monkeypatch.setitem(sys.modules, 'jinja2', None)
    monkeypatch.delitem(sys.modules, 'smach_oracle.analysis.reporting.page', raising=False)
    assert report(record('bags', 1), '--html', tmp_path / 'r.html') == 2
    out, err = capsys.readouterr()
    assert 'with oracle: 1 trials' in out and 'jinja2' in err


def test_without_the_option_neither_jinja_nor_matplotlib_is_imported(record):
    program = (
        'import sys\nfrom smach_oracle.analysis.bag_statistics import main\n'
        'main([{!r}])\nassert not {{"jinja2", "matplotlib", "xml"}} & set(sys.modules)'
    ).format(record('bags', 1))
    result = subprocess.run(
        [sys.executable, '-c', program],
        env={'PYTHONPATH': str(ROOT / 'src'), 'PATH': '/usr/bin:/bin'},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=60,
        check=False,
    )
    assert result.returncode == 0, result.stdout.decode()


def test_without_dot_graphs_are_tables_and_the_page_says_so(monkeypatch):
    monkeypatch.setattr(
        machine_graphs.Drawer, '__init__', lambda self: _without_dot(self, 'no-such-dot')
    )
    trials = run(2)
    found = Trials([summarise(each) for each in trials], [])
    page = check(
        page_of(report_on(found, {each[0].trial_id: each for each in trials}, ReportOptions([])))
    )
    assert 'no no-such-dot in PATH' in page.text[: page.text.index('In short')]
    assert 'TOP/INNER: transitions' in page.text


def _without_dot(drawer, command):
    drawer._command, drawer._layouts, drawer.problem = command, {}, ''


def test_the_graph_of_recorded_machines_has_their_structure_and_counts(tmp_path):
    trials = run(6)
    record_events(tmp_path / 'bags', trials)
    assert report(tmp_path / 'bags', '--html', tmp_path / 'r.html') == 0
    page = check((tmp_path / 'r.html').read_text(encoding='utf-8'))
    visits = sum(each.kind == EventKind.STATE_START for trial in trials for each in trial)
    boxes = re.findall(r'(\d+)/(\d+) failed, \d+%', page.text)
    assert sum(int(of) for _, of in boxes) == 2 * visits, 'a box says it, and its title, too'
    failures = sum(each.kind == EventKind.FAILURE for trial in trials for each in trial)
    assert sum(int(number) for number, _ in boxes) == 2 * failures


def test_colours_go_from_light_to_dark_as_rates_grow():
    colours = [machine_graphs.colour_of(share / 10) for share in range(-1, 13)]
    light = [float(re.search(r'(\d+)%\)', each).group(1)) for each in colours]
    assert light == sorted(light, reverse=True) and light[0] > light[-1]


def hostile_trials(text):
    """Trials that have a text wherever a bag may have one."""
    name = text or 'x'
    fields = {'path': name, 'state': text}
    steps = (
        (
            EventKind.TRIAL_START,
            dict(
                fields,
                state='',
                data={
                    'recovers': True,
                    'settings': {text: text, 'policy': text, 'memory': text, 'prior': 0.1},
                    'origin': {'host': text, 'version': text},
                    'failure_rule': {'listed': [text]},
                },
            ),
        ),
        (EventKind.CONTAINER_START, fields),
        (EventKind.STATE_START, fields),
        (
            EventKind.FAILURE,
            dict(fields, outcome=text, text=text, failure_kind=3, failure_class=9, rate=0.5),
        ),
        (EventKind.TRANSITION, dict(fields, outcome=name, target=text)),
        (EventKind.PRECONDITION_END, dict(fields, outcome=text, target=text)),
        (EventKind.DECISION, dict(fields, outcome=text, text=text, failure_class=9, rate=0.5)),
        (EventKind.QUERY_OPENED, dict(fields, query_id=text)),
        (EventKind.QUERY_ANSWERED, dict(fields, query_id=text, outcome=text, by=text)),
        (EventKind.JUMP, dict(fields, target=text, by=text, data={'from': text, 'to': text})),
        (EventKind.STATE_START, fields),
        (EventKind.TRANSITION, dict(fields, outcome=name, target=name)),
        (99, dict(fields, text=text)),
        (
            EventKind.TRIAL_END,
            dict(fields, state='', outcome=text, data={'learned': {text: {text: {text: text}}}}),
        ),
    )
    return story(*steps)


@pytest.mark.parametrize('number', range(len(HOSTILE)))
def test_foreign_text_stays_text(tmp_path, number):
    text = HOSTILE[number]
    events = hostile_trials(text)
    cause = RecordedCause(1, text, (text,), (text,))
    trial = summarise(events, ('/{}/a.bag'.format(text),))._replace(cause=cause, node=text)
    others = [each._replace(trial_id='other') for each in events]
    found = Trials(
        [trial, summarise(others)._replace(cause=cause)],
        [SkippedBag(text, text), SkippedBag('', '')],
    )
    groups = groups_by('node', found.trials, ['/'])
    path = tmp_path / 'r.html'
    by_trial = {'id': events, 'other': others}
    write_report(str(path), found, by_trial, ReportOptions([text], None, 'node'), groups)
    page = check(path.read_text(encoding='utf-8'))
    assert max(map(len, page.texts)) < 3 * LONGEST
    assert max(len(value or '') for name, value in page.attributes if name != 'd') < 2 * LONGEST
    whole = ''.join(page.texts) + ''.join(value or '' for _, value in page.attributes)
    assert not re.search(
        '[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069]', whole
    )
    if text == HOSTILE[0]:
        assert page.text.count('<script>alert(1)</script>') > 20


@pytest.mark.parametrize('time', [float('nan'), float('inf'), -1e300, 1e300])
def test_times_that_are_none_make_a_page(time):
    events = [each._replace(wall_time=time) for each in run(1)[0]]
    found = Trials([summarise(events)], [])
    check(page_of(report_on(found, {events[0].trial_id: events}, ReportOptions([]))))


def test_a_record_of_one_event_makes_a_page():
    events = [Event(EventKind.STATE_START, 'id', 3, 1.0, 'TOP', 'PICK')]
    page = check(
        page_of(report_on(Trials([summarise(events)], []), {'id': events}, ReportOptions(['x'])))
    )
    assert 'variant unknown' in page.text and '3 events are missing' in page.text


def test_what_is_shown_of_a_value():
    assert shown(None) == '–' and shown(3) == 3
    assert shown('a\u202eb\x00') == 'a\ufffdb\ufffd'
    assert len(shown('x' * 10000)) == LONGEST


def test_figures_on_one_page_have_ids_of_their_own():
    text = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
        '<metadata>m</metadata><defs><path id="a" d="M0 0"/><style>*{}</style></defs>'
        '<g id="unused" clip-path="url(#c)" style="fill: url(#c)"><use xlink:href="#a"/></g>'
        '<clipPath id="c"/></svg>'
    )
    assert for_page(text, 'f1') == (
        '<svg><defs><path d="M0 0" id="f1-0" /></defs>'
        '<g clip-path="url(#f1-1)" style="fill: url(#f1-1)"><use href="#f1-0" /></g>'
        '<clipPath id="f1-1" /></svg>'
    )
