"""Build the documentation as a site, from the Markdown in doc/ and from the code.

Called by scripts/doc, in the environment of scripts/ros_env.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Dict, Iterable, Iterator, List, Tuple

import theme
from interfaces import interface_pages

from smach_oracle.documentation import PAGES

ROOT = Path(__file__).resolve().parents[2]
DOC = ROOT / 'doc'
GENERATED = {'Reference': ['api']}
# pages that a sidebar shows below another one, when that one is opened
BELOW = {
    'commands': ['options'],
    'console': ['on_call', 'open_console', 'console_security'],
    'expert': ['many_robots'],
    'install': ['noetic', 'container', 'stable'],
    'policies': ['ways'],
    'ros_interface': ['messages', 'services', 'actions'],
    'shared_autonomy': ['perception', 'own_interface'],
    'statistics': ['notebook', 'cluster'],
    'testing': ['own_rostest'],
}
EXPERIMENT = 'Robots and experiment'  # a section whose first page has the others below it
INSIDE = 'inside/index'
# headings: of the README, up to which the site shows it first, and of the index, from which on that
# page has the rest
FIRST_STEPS, WAYS_IN = '## Set it up', '## Ways in'
API = [
    (
        'The machine',
        'smach_oracle.oracle',
        ['OracleContainer', 'Settings', 'oracle_of', 'unwrap', 'register_codec', 'OperatorHand'],
    ),
    ('Experts', 'smach_oracle.oracle', ['Expert', 'Question', 'Answer', 'AnswerKind']),
    (
        'Failure rates',
        'smach_oracle.oracle',
        ['FailureRate', 'ExponentialFailureRate', 'FailureClass'],
    ),
    (
        'Errors',
        'smach_oracle.oracle.errors',
        [
            'OracleError',
            'SettingsError',
            'AnswerError',
            'OperatorError',
            'InterfaceError',
            'CheckpointError',
            'TrialError',
        ],
    ),
    ('Front ends', 'smach_oracle.expert.front_end', ['FrontEnd', 'wait_for_question']),
    ('Tests of your machines', 'smach_oracle.testing', []),
]
# links that show the name of a page's file, where a site shows its title
NAMED = re.compile(r'\[(?:\w+/)*(\w+)\.md\]\(((?:[\w.]+/)*\1\.md)(?=[#)])')
# links of a page to files that are not pages: to the repository's files, copied beside the pages
FILES = re.compile(r'(\]\()((?:\.\./)+)((?:launch|examples|msg|srv|action)/[\w./]+|LICENSE)\)')
# a command in the first cell of a table of commands
LISTED = re.compile(r'^\| `(\w+)` \|', re.MULTILINE)


def api_page() -> str:
    """The page of the Python API; autodoc fills it in."""
    lines = ['# Python API', '', 'From the docstrings.', '']
    for title, module, names in API:
        lines += ['## ' + title, '', '```{eval-rst}']
        if names:
            lines += ['.. currentmodule:: ' + module, '']
        lines += [
            '.. auto{}:: {}'.format('class' if name[0].isupper() else 'function', name)
            for name in names
        ] or ['.. automodule:: ' + module, '   :imported-members:']
        lines += ['```', '']
    return '\n'.join(lines)


def help_of(command: str) -> str:
    """Return what a command, or a subcommand, prints at --help."""
    script, *subcommand = command.split()
    run = subprocess.run(
        [sys.executable, str(ROOT / 'scripts' / script), *subcommand, '--help'],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
        timeout=120,
    )
    text = re.sub(r'\nMore: .*\n', '', run.stdout.decode())  # the page below, by a path of here
    if run.returncode:
        raise SystemExit(
            '{} --help ends with exit code {}:\n{}'.format(command, run.returncode, text)
        )
    return text


def helps_of(page: str) -> str:
    """A section for a page of commands: what each one that its tables list prints at --help."""
    listed = LISTED.findall(page)
    names = [name for first in listed for name in sorted(PAGES) if name.split()[0] == first]
    with ThreadPoolExecutor(2) as pool:
        helps = list(pool.map(help_of, names))
    lines = ['', '## Their help', '']
    for name, text in zip(names, helps):
        more = PAGES[name] + '.md'
        lines += ['### ' + name, '', '```text', text.rstrip(), '```', '']
        lines += ['More: [{0}]({0})'.format(more), '']
    return '\n'.join(lines)


def sections(index: str) -> Iterator[Tuple[str, List[str]]]:
    """The sections of the index, each with its pages."""
    for section in index.split('\n### ')[1:]:
        pages = re.findall(r'^(?:\| |\* )\[[^]]+\]\((\w+)\.md\)', section, re.MULTILINE)
        yield section.splitlines()[0], pages


def _toctree(pages: Iterable[str], caption: str = '') -> List[str]:
    captioned = [':caption: ' + caption] if caption else []
    return ['', '```{toctree}', ':hidden:', *captioned, *pages, '```', '']


def contents(index: str) -> str:
    """The site's table of contents, from the sections of the index."""
    lines = _toctree(['readme'])
    below = {page for pages in BELOW.values() for page in pages}
    for name, pages in sections(index):
        shown = [page for page in pages if page not in below] + GENERATED.get(name, [])
        if name == EXPERIMENT:
            lines += _toctree([pages[0], INSIDE], 'More')
        else:
            lines += _toctree(shown, name)
    return '\n'.join(lines)


def tables_below(index: str, inside: str) -> Dict[str, str]:
    """The tables of contents of pages that have others below them."""
    below = dict(BELOW)
    first, *others = dict(sections(index))[EXPERIMENT]
    below[first] = others
    below[INSIDE] = re.findall(r'^\| \[\w+\.md\]\((\w+)\.md\)', inside, re.MULTILINE)
    below[INSIDE].append('../contributing')
    return {page: '\n'.join(_toctree(pages)) for page, pages in below.items()}


def halves_of(readme: str) -> Tuple[str, str]:
    """The first steps, as a page of the site, and the top, with which the site begins."""
    begin = readme.index(FIRST_STEPS)
    steps = readme[begin:].replace('](#results)', '](index.md#results)')
    return '# First steps\n\n' + steps, readme[:begin]


def write_sources(folder: Path, quick: bool) -> None:
    """Put all pages into one folder, with links that hold there."""
    shutil.rmtree(str(folder), ignore_errors=True)
    shutil.copytree(str(DOC / 'images'), str(folder / 'images'))
    (folder / 'inside').mkdir()
    for table in DOC.glob('*.csv'):
        shutil.copy(str(table), str(folder))
    front = {
        name: re.sub(
            r'((?:\]\(|src="))doc/',
            r'\1',
            (ROOT / name)
            .read_text(encoding='utf-8')
            .replace('](LICENSE)', '](../LICENSE)')
            .replace('](CONTRIBUTING.md)', '](contributing.md)'),
        )
        for name in ('README.md', 'CONTRIBUTING.md')
    }
    front['README.md'], landing = halves_of(front['README.md'])
    for name, text in front.items():
        (folder / name.lower()).write_text(text, 'utf-8')
    for page in (*DOC.glob('*.md'), *DOC.glob('inside/*.md')):
        text = re.sub(r'\]\((?:\.\./)+README\.md', '](/readme.md', page.read_text('utf-8'))
        text = re.sub(r'\]\((?:\.\./)+CONTRIBUTING\.md', '](/contributing.md', text)
        text = text.replace('```frozen\n', '```text\n')  # Pygments does not know the first
        (folder / page.relative_to(DOC)).write_text(text, 'utf-8')
    index = (folder / 'index.md').read_text('utf-8')
    generated = [
        ('index.md', landing + index[index.index(WAYS_IN) :]),
        *interface_pages(ROOT),
        ('api.md', '# Python API\n' if quick else api_page()),
    ]
    for name, text in generated:
        (folder / name).write_text(text, 'utf-8')
    _add_to_pages(folder, quick)
    _name_links(folder)


def _add_to_pages(folder: Path, quick: bool) -> None:
    """Add the help of commands and the tables of contents to pages."""
    index, inside = (folder / 'index.md'), (folder / (INSIDE + '.md'))
    added = tables_below(index.read_text('utf-8'), inside.read_text('utf-8'))
    added['index'] = contents(index.read_text('utf-8'))
    for name in ('commands', 'experiment'):
        helps = '' if quick else helps_of((folder / (name + '.md')).read_text('utf-8'))
        added[name] = helps + added[name]
    for name, text in added.items():
        page = folder / (name + '.md')
        page.write_text(page.read_text('utf-8') + text, 'utf-8')


def _name_links(folder: Path) -> None:
    """Let links to pages show their titles, and links to files lead to copies of them."""
    pages = list(folder.rglob('*.md'))
    titles = {page: page.read_text('utf-8').split('\n', 1)[0].lstrip('# ') for page in pages}

    def titled(link: 're.Match[str]', page: Path) -> str:
        target = Path(os.path.normpath(str(page.parent / link.group(2))))
        return '[{}]({}'.format(titles[target], link.group(2))

    for page in pages:
        text = FILES.sub(lambda link: _copied(link, folder), page.read_text('utf-8'))
        text = NAMED.sub(partial(titled, page=page), text)
        page.write_text(text, 'utf-8')


def _copied(link: 're.Match[str]', folder: Path) -> str:
    """The link to a file of the repository that is copied to the pages.

    It gets another name: roslaunch looks for a launch file in all folders below the package, and
    refuses one of which it finds two.
    """
    name = link.group(3) + '.txt'
    target = folder / 'files' / name
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(str(ROOT / link.group(3)), str(target))
    return '{}{}files/{})'.format(link.group(1), link.group(2)[len('../') :], name)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog='scripts/doc', description='Build the documentation as a site, in build/doc/html.'
    )
    parser.add_argument(
        '--check',
        action='store_true',
        help='only check the pages and the links between them: without the '
        'commands and the API, into build/doc/check',
    )
    parser.add_argument(
        '--for-files',
        action='store_true',
        help='the search shows titles alone. Without this it also shows the sentences that it '
        'finds, but only where a web server hands out the site',
    )
    args = parser.parse_args()
    quick = args.check
    source = ROOT / 'build' / 'doc' / ('check_source' if quick else 'source')
    target = ROOT / 'build' / 'doc' / ('check' if quick else 'html')
    write_sources(source, quick)
    status = subprocess.run(
        [
            sys.executable,
            '-m',
            'sphinx',
            '-b',
            'dummy' if quick else 'html',
            '-q',
            '-W',
            '--keep-going',
            *(['-D', 'html_show_search_summary=0'] if args.for_files else []),
            '-d',
            str(target.with_name(target.name + '_state')),
            '-c',
            str(Path(__file__).parent),
            str(source),
            str(target),
        ],
        check=False,
    ).returncode
    if not status and not quick:
        theme.complete(target / '_static')
        print('The site: {}'.format(target / 'index.html'))
        if not args.for_files:
            print('To search in sentences: python3 -m http.server -d {}'.format(target))
    return status


if __name__ == '__main__':
    sys.exit(main())
