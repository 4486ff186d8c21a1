"""The site's search finds the words that people look for, also without the summaries."""

import json
import subprocess
import sys

import pytest
from sphinx.search.en import SearchEnglish
from workspace import ROOT

sys.path.insert(0, str(ROOT / 'doc/site'))
import build


@pytest.fixture(scope='module')
def index(tmp_path_factory):
    """The index of the site that is made of the pages alone."""
    top = tmp_path_factory.mktemp('site')
    build.write_sources(top / 'source', quick=True)
    subprocess.run(
        [
            sys.executable,
            '-m',
            'sphinx',
            '-b',
            'html',
            '-q',
            '-c',
            str(ROOT / 'doc/site'),
            str(top / 'source'),
            str(top / 'html'),
        ],
        timeout=600,
        check=True,
    )
    shown = (top / 'html/_static/documentation_options.js').read_text(encoding='utf-8')
    assert 'SHOW_SEARCH_SUMMARY: true' in shown, 'behind a web server it shows sentences'
    text = (top / 'html/searchindex.js').read_text(encoding='utf-8')
    return json.loads(text[text.index('{') : text.rindex('}') + 1])


@pytest.mark.parametrize(
    'word, page',
    [
        ('precondition', 'preconditions'),
        ('checkpoint', 'survive'),
        ('teleoperation', 'messages'),
        ('interface', 'own_interface'),
        ('move_base', 'navigation'),
    ],
)
def test_it_finds(index, word, page):
    stem = SearchEnglish({}).stem(word)
    found = [index[part].get(stem, []) for part in ('terms', 'titleterms')]
    numbers = {number for each in found for number in ([each] if isinstance(each, int) else each)}
    assert page in {index['docnames'][number] for number in numbers}
