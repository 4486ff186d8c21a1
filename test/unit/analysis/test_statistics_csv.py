"""The CSV of bag_statistics is compared as the bags are that it was made of."""

import shutil
from pathlib import Path

import pytest

from smach_oracle.analysis import bag_statistics, comparison
from smach_oracle.analysis.comparing.groups import BY

DATA = Path(__file__).resolve().parents[2] / 'data/v0_1'


@pytest.fixture(name='place')
def bags_and_their_csv(tmp_path, monkeypatch, capsys):
    """A folder with bags of version 0.1, and all.csv of them."""
    monkeypatch.chdir(tmp_path)
    for name in ('trials', 'experiment'):
        shutil.copytree(str(DATA / name), name)
    assert bag_statistics.main(['trials', 'experiment', '--csv', 'all.csv']) == 0
    capsys.readouterr()
    return tmp_path


def printed(capsys, module, *arguments):
    """What a command prints."""
    assert module.main(list(arguments)) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize('by', [each for each in BY if each != 'folder'])
@pytest.mark.usefixtures('place')
def test_groups_and_tests_are_those_of_the_bags(capsys, by):
    of_bags = printed(capsys, bag_statistics, 'trials', 'experiment', '--by', by)
    assert 'against' in of_bags or 'nothing to test' in of_bags
    of_csv = printed(capsys, comparison, 'all.csv', '--by', by)
    assert of_bags.endswith('\n' + of_csv)


@pytest.mark.usefixtures('place')
def test_one_file_is_compared_by_settings_and_pairs_by_seed(capsys):
    text = printed(capsys, comparison, 'all.csv')
    assert text == printed(capsys, comparison, 'all.csv', '--by', 'settings')
    assert text.startswith('Compared by settings\n') and '1 pairs by seed' in text


@pytest.mark.usefixtures('place')
def test_several_files_are_compared_by_file_and_a_trial_counts_once(capsys):
    lines = Path('all.csv').read_text().splitlines(True)
    fetch = [line for line in lines[1:] if ',FETCH,' in line]
    Path('old.csv').write_text(''.join([lines[0], *fetch[:5]]))
    Path('new.csv').write_text(''.join([lines[0], *fetch[4:]]))
    text = printed(capsys, comparison, 'old.csv', 'new.csv')
    assert text.startswith('Compared by file\n') and 'FETCH: new.csv against old.csv' in text
    rows = {line.split()[1]: line.split()[2] for line in text.splitlines() if 'FETCH  ' in line}
    assert rows == {'old.csv': '4', 'new.csv': str(len(fetch) - 4)}
    by_settings = printed(capsys, comparison, 'old.csv', 'new.csv', '--by', 'settings')
    assert 'new.csv: with' in by_settings


@pytest.mark.usefixtures('place')
def test_folders_are_named_from_the_one_around_them_on(capsys):
    text = printed(capsys, comparison, 'all.csv', '--by', 'folder')
    assert 'FETCH: trials/by_hand against trials/fetch\n' in text


@pytest.mark.usefixtures('place')
def test_a_file_without_the_later_columns_can_be_compared(capsys):
    lines = Path('all.csv').read_text().splitlines()
    kept = lines[0].split(',').index('why')
    cut = [','.join(line.split(',')[:kept]) for line in lines if 'PICK_AND' not in line]
    Path('old.csv').write_text('\n'.join(cut) + '\n')
    text = printed(capsys, comparison, 'old.csv')
    assert 'FETCH: with oracle against without oracle' in text
    assert 'not recorded' in printed(capsys, comparison, 'old.csv', '--by', 'host')


@pytest.mark.parametrize(
    'old, new, words',
    [
        (
            ',success,',
            ',splendid,',
            "ending: 'splendid' is not allowed; allowed: success, failure, ",
        ),
        (',True,', ',Yes,', "recovers: 'Yes' is not allowed; allowed: True, False, or"),
        ('recovers', 'recover', 'no column recovers'),
    ],
)
@pytest.mark.usefixtures('place')
def test_a_wrong_file_is_named_with_the_cell(capsys, old, new, words):
    text = Path('all.csv').read_text()
    Path('all.csv').write_text(text.replace(old, new, 1))
    assert comparison.main(['all.csv']) == 2
    err = capsys.readouterr().err
    assert 'all.csv' in err and words in err


@pytest.mark.usefixtures('place')
def test_a_file_of_no_trials_is_an_error(capsys):
    Path('none.csv').write_text(Path('all.csv').read_text().splitlines(True)[0])
    assert comparison.main(['none.csv']) == 2
    assert 'none.csv: no trials in it' in capsys.readouterr().err
