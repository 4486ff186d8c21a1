"""The page as it is shipped: no markup made of text, nothing from elsewhere, everything there that
it names.
"""

import re
from pathlib import Path

import pytest

from smach_oracle.expert.console import server
from smach_oracle.expert.console.web.handlers import POLICY

FILES = sorted(path for path in server.STATIC.rglob('*') if path.is_file())
SCRIPTS = [path for path in FILES if path.suffix == '.js']
MARKUP = re.compile(
    r'innerHTML|outerHTML|insertAdjacentHTML|document\.write|createContextualFragment|DOMParser'
    r'|srcdoc|\beval\(|new Function|javascript:|setAttribute\(.on|Unsafe|parseFromString'
)


def test_there_is_a_page():
    assert {'.html', '.js', '.css', '.svg'} <= {path.suffix for path in FILES}


@pytest.mark.parametrize('path', SCRIPTS, ids=lambda path: path.name)
def test_no_script_makes_markup_or_code_of_text(path):
    assert not MARKUP.search(path.read_text(encoding='utf-8'))


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)
def test_nothing_comes_from_elsewhere(path):
    text = path.read_text(encoding='utf-8').replace('http://www.w3.org/2000/svg', '')
    assert not re.search(r'(https?:)?//[a-z0-9.-]+\.[a-z]{2,}|url\((?!#)', text)


@pytest.mark.parametrize('path', SCRIPTS, ids=lambda path: path.name)
def test_every_module_that_is_imported_is_there(path):
    for name in re.findall(r"from '(\.\.?/[\w./]+)'", path.read_text(encoding='utf-8')):
        assert (path.parent / name).is_file(), name


def test_the_page_has_neither_inline_scripts_nor_inline_styles():
    page = (server.STATIC / 'index.html').read_text(encoding='utf-8')
    assert not re.search(r'\son\w+=|\sstyle=|<style|<script(?![^>]*src=)', page)
    assert all((server.STATIC / name).is_file() for name in re.findall(r'"static/([\w./]+)"', page))


def test_the_policy_allows_nothing_that_is_not_its_own():
    assert "default-src 'none'" in POLICY and 'unsafe' not in POLICY and '*' not in POLICY
    assert "frame-ancestors 'none'" in POLICY and "require-trusted-types-for 'script'" in POLICY


def test_the_build_installs_all_of_it():
    setup = Path(__file__).resolve().parents[4] / 'setup.py'
    patterns = re.findall(r"'(static/[^']+)'", setup.read_text(encoding='utf-8'))
    assert {path for pattern in patterns for path in server.STATIC.parent.glob(pattern)} == set(
        FILES
    )
