"""A file that a document or a comment names is there."""

import re
import subprocess

import pytest
from house import ROOT

ENDINGS = r'(?:py|js|d\.ts|md|css|launch|yaml|rst|cmake)'
IN_TEXT = re.compile(r'`((?:[\w.-]+/)*[\w-]+\.%s)`' % ENDINGS)
IN_CODE = re.compile(
    r'(?<![\w.$*{}<>/~:-])((?:test|src|doc|launch|scripts|cmake)/(?:[\w.-]+/)*'
    r'[\w-]+\.%s)\b' % ENDINGS
)
# examples: files of a user's own package
OF_USERS = dict.fromkeys(
    [
        'doc/own_rostest.md',
        'test/rostest/expert_own_script.py',
        'test/unit/house/test_named_files.py',
    ],
    {'scripts/task.py', 'test/task_rules.yaml', 'test/task_test.py'},
)
OF_USERS['doc/tutorial.md'] = {'careful.yaml'}


def listed():
    """The files of the checkout that git knows, as text."""
    output = subprocess.run(
        ['git', 'ls-files'], cwd=str(ROOT), stdout=subprocess.PIPE, check=False
    ).stdout.decode()
    return output.split() or [
        str(path.relative_to(ROOT))
        for path in ROOT.rglob('*')
        if path.is_file() and 'build' not in path.parts
    ]


FILES = listed()
DOCUMENTS = [name for name in FILES if name.endswith('.md') or name == 'CHANGELOG.rst']
CODE = [
    name
    for name in FILES
    if name.endswith(('.py', '.js', '.ts', '.css', '.cmake', '.launch'))
    and not name.startswith('test/data')
]


def missing(name, named, exact):
    """The names in a file that no file of the checkout has, or none ends with."""
    paths = set(FILES)
    known = (
        paths
        if exact
        else {
            path[at:]
            for path in paths
            for at in [0] + [i + 1 for i, c in enumerate(path) if c == '/']
        }
    )
    text = (ROOT / name).read_text(encoding='utf-8', errors='replace')
    return set(named.findall(text)) - known - OF_USERS.get(name, set())


@pytest.mark.parametrize('name', DOCUMENTS)
def test_every_file_that_a_document_names_is_there(name):
    # `my_script.py` is the reader's
    assert not {
        each
        for each in missing(name, IN_TEXT, exact=False)
        if '/' in each or not each.startswith(('my_', 'task'))
    }


def test_every_path_in_the_code_is_there():
    wrong = {name: missing(name, IN_CODE, exact=True) for name in CODE}
    assert not {name: paths for name, paths in wrong.items() if paths}
