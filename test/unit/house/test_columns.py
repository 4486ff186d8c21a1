"""Code and settings have at most 100 columns; ruff and test_page_scripts hold theirs, too."""

import pytest
from house import ROOT, shown, tracked_text

MOST_COLUMNS = 100
# prose, drawings and data, and what others have written
FREE = {'.md', '.rst', '.css', '.dot', '.csv', '.jsonl', '.urdf'}
RECORDED = ROOT / 'test/data'


def is_held(path):
    """Whether `path` is code or settings."""
    return path.suffix not in FREE and not path.is_symlink() and RECORDED not in path.parents


def too_long(text):
    """The numbers of the lines with more columns than there may be."""
    return [number for number, line in enumerate(text.splitlines(), 1) if len(line) > MOST_COLUMNS]


def test_every_line_of_code_and_settings_has_at_most_100_columns():
    held = {path: path.read_bytes() for path in tracked_text() if is_held(path)}
    assert not [
        '{}:{}'.format(shown(path), number)
        for path, content in held.items()
        if b'\0' not in content
        for number in too_long(content.decode('utf-8'))
    ]


@pytest.mark.parametrize(
    'name',
    [
        'CMakeLists.txt',
        'cmake/stand_ins.cmake',
        'launch/oracle.yaml',
        'launch/pr2.launch',
        'msg/OracleEvent.msg',
        'package.xml',
        'pyproject.toml',
        'scripts/setup',
        'src/smach_oracle/tasks/pick_and_place.yaml',
        'srv/AnswerQuery.srv',
        'action/OpenDoor.action',
        'test/rostest/expert_paused.test',
    ],
)
def test_each_kind_of_file_is_held(name):
    assert ROOT / name in {path for path in tracked_text() if is_held(path)}


def test_a_long_line_is_noticed():
    assert too_long('x' * 100 + '\n' + 'x' * 101) == [2]
