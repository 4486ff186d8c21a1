"""The site: its table of contents, and the reference that is made from comments."""

import re
import subprocess
import sys

from house import ROOT

sys.path.insert(0, str(ROOT / 'doc' / 'site'))
import build
import interfaces
import theme

MESSAGE = """# A wheel of a robot.
# It turns.
float64 speed    # rad/s,
                 # positive forwards
# where it is, in the frame of the base
geometry_msgs/Point at
bool is_stuck
"""


def test_comments_become_the_meaning_of_fields():
    part = interfaces.read_part(MESSAGE)
    assert part.about == 'A wheel of a robot. It turns.'
    assert part.fields == [
        ('float64', 'speed', 'rad/s, positive forwards'),
        ('geometry_msgs/Point', 'at', 'where it is, in the frame of the base'),
        ('bool', 'is_stuck', ''),
    ]


def test_every_message_service_and_action_is_in_the_reference():
    pages = dict(interfaces.interface_pages(ROOT))
    for name, folder in (('messages.md', 'msg'), ('services.md', 'srv'), ('actions.md', 'action')):
        files = list((ROOT / folder).glob('*.' + folder))
        assert files and all('\n## {}\n'.format(path.stem) in pages[name] for path in files)


MOST_AT_FIRST = 28  # entries of the sidebar, before one is opened


def entries(text):
    """The pages in the tables of contents of a page."""
    blocks = re.findall(r'^```{toctree}\n(.*?)^```', text, re.MULTILINE | re.DOTALL)
    return [
        line for block in blocks for line in block.splitlines() if re.fullmatch(r'[\w./]+', line)
    ]


def test_every_page_is_in_a_table_of_contents_and_a_user_meets_few(tmp_path):
    build.write_sources(tmp_path, quick=True)
    named = []
    for page in tmp_path.rglob('*.md'):
        named += [(page.parent / name).resolve() for name in entries(page.read_text('utf-8'))]
    there = {page.with_suffix('') for page in tmp_path.rglob('*.md')} - {tmp_path / 'index'}
    assert len(named) == len(set(named)) and set(named) == there
    first = entries((tmp_path / 'index.md').read_text('utf-8'))
    assert 20 < len(first) <= MOST_AT_FIRST


def test_the_theme_works_without_a_web_server(tmp_path, monkeypatch):
    for name, text in (
        (
            'styles/furo.css',
            '@import url(/javascript/normalize.css/normalize.css);\np {margin: 1px}',
        ),
        ('normalize.css', 'body {margin: 0}\n'),
        ('./scripts/gumshoe-patched.js', 'window.Gumshoe = 1;\n'),
        ('./scripts/furo.js', 'import Gumshoe from "./gumshoe-patched.js";\nmain()'),
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(theme, 'NORMALIZE', tmp_path / 'normalize.css')
    for _ in range(2):  # a second build finds them complete
        theme.complete(tmp_path)
        assert (tmp_path / 'styles/furo.css').read_text() == 'body {margin: 0}\np {margin: 1px}'
        assert (tmp_path / './scripts/furo.js').read_text() == 'window.Gumshoe = 1;\nmain()'


def test_the_site_is_dark_where_the_system_is():
    style = (
        '@media not print {\n  body[data-theme="dark"] {\n    --color: #fff; }\n'
        '    body[data-theme="dark"] .only-dark {\n      display: block } }\nbody {}\n'
    )
    added = theme.followed(style)
    assert added == (
        '\n@media not print {\n@media (prefers-color-scheme: dark) {\n'
        'body:not([data-theme="light"]) {\n    --color: #fff; }\n'
        '    body:not([data-theme="light"]) .only-dark {\n'
        '      display: block }\n}\n}\n'
    )
    assert not theme.followed(style + added)


def test_a_link_shows_the_title_of_a_page(tmp_path):
    build.write_sources(tmp_path / 'source', quick=True)
    pages = {
        page.stem: page.read_text(encoding='utf-8')
        for page in sorted((tmp_path / 'source').rglob('*.md'), reverse=True)
    }
    assert '[Troubleshooting](troubleshooting.md)' in pages['index']
    assert '[Settings](settings.md)' in pages['readme']
    assert '[Architecture](inside/architecture.md#to-add-a-policy)' in pages['trees']
    assert '[Settings](../settings.md)' in pages['architecture']
    assert not [name for name, text in pages.items() if build.NAMED.search(text)]


def test_a_link_into_the_repository_leads_to_a_copy(tmp_path):
    build.write_sources(tmp_path / 'source', quick=True)
    page = (tmp_path / 'source' / 'testing.md').read_text(encoding='utf-8')
    assert '](files/examples/fetch_task.py.txt)' in page
    assert (tmp_path / 'source' / 'files' / 'examples' / 'fetch_task.py.txt').is_file()
    assert 'src="images/robot.png"' in (tmp_path / 'source' / 'readme.md').read_text('utf-8')
    # roslaunch looks in all folders of a package, and refuses a launch file of which it finds two
    assert (tmp_path / 'source' / 'files' / 'launch' / 'inspection.launch.txt').is_file()
    assert not list(tmp_path.rglob('*.launch'))


def test_the_site_begins_with_the_top_of_the_readme(tmp_path):
    build.write_sources(tmp_path, quick=True)
    first = (tmp_path / 'index.md').read_text(encoding='utf-8')
    parts = ['images/recovery.gif', '## In six lines', '## Results', '## Why trust it']
    places = [first.index(part) for part in [*parts, '## Ways in', '### How-to']]
    assert places == sorted(places) and build.FIRST_STEPS not in first
    steps = (tmp_path / 'readme.md').read_text(encoding='utf-8')
    assert build.FIRST_STEPS in steps and '## In six lines' not in steps


def test_its_help_sets_nothing_up():
    shown = subprocess.run(
        [str(ROOT / 'scripts/doc'), '--help'],
        env={'PATH': '/usr/bin:/bin', 'PYTHONDONTWRITEBYTECODE': '1'},
        stdout=subprocess.PIPE,
        timeout=60,
        check=True,
    ).stdout.decode()
    assert shown.startswith('usage: scripts/doc ') and '--for-files' in shown
