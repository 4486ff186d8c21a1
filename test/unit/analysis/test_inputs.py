"""Errors say what was given in place of what a command reads, and which command takes it."""

import shutil
from pathlib import Path

import pytest

from smach_oracle.analysis import bag_statistics, comparison, sweep, trial_steps, what_if
from smach_oracle.analysis.compare_command import inputs
from smach_oracle.analysis.compare_command.inputs import InputKind
from smach_oracle.analysis.drawing import command as figures
from smach_oracle.analysis.learning import command as learn
from smach_oracle.analysis.trial_rows import TrialRow, append_rows

BAGS = Path(__file__).resolve().parents[2] / 'data/v0_1/trials/fetch'
ONE, TWO = ('x',), ('x', 'x')
READERS_OF_BAGS = [
    (bag_statistics, ONE),
    (sweep, ONE),
    (what_if, ONE),
    (learn, ONE),
    (trial_steps, TWO),
]
ROW = TrialRow('drink_retrieval', 'bare', 0, 1, 'success')


@pytest.fixture(name='places')
def each_kind_of_place(tmp_path, monkeypatch):
    """A folder with one of each kind, in which commands run."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(str(BAGS), 'bags')
    (tmp_path / 'rows/part').mkdir(parents=True)
    append_rows(tmp_path / 'rows/part/results.csv', [ROW])
    assert bag_statistics.main(['bags', '--csv', 'trials.csv']) == 0
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'other.csv').write_text('a,b\n1,2\n')
    (tmp_path / 'noise.csv').write_bytes(bytes(range(128, 256)) * 10)
    return tmp_path


def said(capsys, module, *arguments):
    """The error of a command, without its name. It printed nothing else."""
    capsys.readouterr()
    assert module.main(list(arguments)) == 2
    out, err = capsys.readouterr()
    assert out == '' and 'Traceback' not in err
    line = [each for each in err.splitlines() if not each.startswith('Skipped ')][0]
    return line.split(': ', 1)[1]


def test_a_place_is_known_by_its_content(places):
    (bag, *_) = sorted(places.glob('bags/*.bag'))
    for place, kind in {
        'nowhere': InputKind.MISSING,
        'bags': InputKind.FOLDER,
        'rows/part/results.csv': InputKind.ROWS,
        'trials.csv': InputKind.STATISTICS,
        str(bag): InputKind.BAG,
        'other.csv': InputKind.OTHER,
        'noise.csv': InputKind.OTHER,
    }.items():
        assert inputs.kind_of(place) is kind, place


def test_the_columns_by_which_files_are_known_are_the_first_ones(places):
    first = len(inputs.ROWS_COLUMNS)
    assert TrialRow._fields[:first] == inputs.ROWS_COLUMNS
    head = Path('trials.csv').read_text().splitlines()[0]
    assert head.startswith(','.join(inputs.STATISTICS_COLUMNS) + ',')


@pytest.mark.parametrize('module, places_of', READERS_OF_BAGS)
@pytest.mark.parametrize(
    'place, words',
    [
        ('nowhere', 'nowhere: no such folder'),
        (
            'rows',
            'rows: no bags, but rows of run_trials: use `compare variants '
            'rows/part/results.csv`, or `compare figures rows --output OUT`',
        ),
        (
            'rows/part/results.csv',
            'rows/part/results.csv: no bag, but rows of run_trials: use `compare variants '
            'rows/part/results.csv`',
        ),
        (
            'trials.csv',
            'trials.csv: no bag, but a CSV of bag_statistics: use `compare variants trials.csv`',
        ),
        ('empty', 'empty: no bags'),
    ],
)
@pytest.mark.usefixtures('places')
def test_a_command_that_reads_bags_says_what_was_given(capsys, module, places_of, place, words):
    assert said(capsys, module, *[place for _ in places_of]) == words


@pytest.mark.parametrize(
    'arguments, words',
    [
        (['nowhere.csv'], 'nowhere.csv: no such file'),
        (['rows'], 'rows: a folder: give files in it: rows/part/results.csv'),
        (
            ['bags'],
            'bags: no rows of run_trials, but 4 bag(s): use `bag_statistics bags --by settings`',
        ),
        (['empty'], 'empty: no results.csv with trials in it, and no bags'),
        (
            ['other.csv'],
            'other.csv: neither rows of run_trials nor a CSV of bag_statistics, by its columns',
        ),
        (
            ['noise.csv'],
            'noise.csv: neither rows of run_trials nor a CSV of bag_statistics, by its columns',
        ),
        (
            ['rows/part/results.csv', 'trials.csv'],
            'rows/part/results.csv: rows of run_trials, but trials.csv is a CSV of bag_statistics: '
            'give files of one kind',
        ),
        (
            ['rows/part/results.csv', '--by', 'host'],
            '--by: rows of run_trials are compared by variant',
        ),
    ],
)
@pytest.mark.usefixtures('places')
def test_compare_variants_says_what_was_given(capsys, arguments, words):
    assert said(capsys, comparison, *arguments) == words


def test_a_bag_in_place_of_a_file_of_rows_is_named(capsys, places):
    bag = str(sorted(places.glob('bags/*.bag'))[0])
    words = '{0}: no rows of run_trials, but a bag: use `bag_statistics {0}`'.format(bag)
    assert said(capsys, comparison, bag) == words
    assert said(capsys, figures, bag, '--output', 'out') == words


@pytest.mark.parametrize(
    'place, words',
    [
        ('nowhere', 'nowhere: no such folder'),
        (
            'rows/part/results.csv',
            'rows/part/results.csv: a file: give the folder in which it lies, rows/part',
        ),
        (
            'trials.csv',
            'trials.csv: a CSV of bag_statistics, no folder with rows of run_trials: `compare '
            'variants trials.csv` compares it, `bag_statistics FOLDER --figure OUT` draws bags',
        ),
        (
            'bags',
            'bags: no rows of run_trials, but 4 bag(s): use `bag_statistics bags --by settings`',
        ),
        ('empty', 'empty: no results.csv with trials in it, and no bags'),
    ],
)
def test_compare_figures_says_what_was_given(capsys, places, place, words):
    assert said(capsys, figures, place, '--output', 'out') == words
    assert not (places / 'out').exists()


@pytest.mark.parametrize('arguments', [['rows'], ['rows', 'a', '--output', 'b']])
@pytest.mark.usefixtures('places')
def test_the_folder_of_the_figures_is_named_once(capsys, arguments):
    with pytest.raises(SystemExit):
        figures.main(arguments)
    assert 'once: --output OUT' in capsys.readouterr().err


@pytest.mark.usefixtures('places')
def test_a_csv_among_bags_is_skipped_as_before(capsys):
    assert bag_statistics.main(['bags', 'trials.csv']) == 1
    assert capsys.readouterr().err.startswith('Skipped ')
