"""The ROS interface documents itself: every field says what it means, every launch argument what it
is for.
"""

import re
import xml.etree.ElementTree as ElementTree

import pytest
from house import ROOT, shown

INTERFACES = sorted(
    path
    for pattern in (
        'msg/*.msg',
        'srv/*.srv',
        'action/*.action',
        'src/*_msgs/msg/*.msg',
        'src/*_msgs/action/*.action',
    )
    for path in ROOT.glob(pattern)
)
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch'))
FIELD = re.compile(r'^[\w/]+(\[\d*\])?\s+\w+\s*(=.*)?$')


def undocumented(text):
    """Yield the number of every field without a comment next to it or above it; constants speak by
    their names.
    """
    above = False
    for number, line in enumerate(text.splitlines(), 1):
        declaration, _, comment = line.partition('#')
        declaration = declaration.strip()
        assert not declaration or declaration == '---' or FIELD.match(declaration), (
            'line {}: {!r}'.format(number, line)
        )
        is_field = declaration not in ('', '---') and '=' not in declaration
        if is_field and not (comment.strip() or above):
            yield number
        above = not declaration and bool(comment.strip())


@pytest.mark.parametrize('path', INTERFACES, ids=shown)
def test_every_field_says_what_it_means(path):
    assert not list(undocumented(path.read_text(encoding='utf-8')))


@pytest.mark.parametrize('path', INTERFACES, ids=shown)
def test_every_file_says_what_it_is_for(path):
    assert path.read_text(encoding='utf-8').startswith('#')


def test_a_field_without_a_word_is_noticed():
    assert list(
        undocumented('# it\nstring a\nstring b\nstring c  # said\n# said\nuint8 A=1\nint8 d\n')
    ) == [3, 7]


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=shown)
def test_every_launch_argument_has_a_default_and_says_what_it_is_for(path):
    for argument in ElementTree.parse(str(path)).getroot().findall('arg'):
        assert argument.get('default') is not None or argument.get('value') is not None, (
            argument.get('name')
        )
        assert argument.get('doc'), argument.get('name')


def test_there_are_launch_files():
    assert LAUNCH_FILES
