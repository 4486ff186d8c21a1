"""Build the documentation as a site, from the Markdown in doc/ and from the code.

Called by scripts/doc, in the environment of scripts/ros_env.
"""

import argparse
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Iterator, List, Tuple

import theme
from interfaces import interface_pages

from smach_oracle.documentation import PAGES

ROOT = Path(__file__).resolve().parents[2]
DOC = ROOT / 'doc'
GENERATED = {'Reference': ['commands', 'messages', 'services', 'actions', 'api']}
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
NAMED = re.compile(r'\[(?:doc/)?(\w+)\.md\](?=\(\1\.md[#)])')
# links of a page to files that are not pages: to the repository's files, copied beside the pages
FILES = re.compile(r'(\]\()\.\./((?:launch|examples|msg|srv|action)/[\w./]+|LICENSE)\)')


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


def commands_page() -> str:
    """The page of the commands, each with its help."""
    names = [
        name
        for name in sorted(PAGES)
        if 'run_renamed(' not in (ROOT / 'scripts' / name.split()[0]).read_text('utf-8')
    ]
    with ThreadPoolExecutor(2) as pool:
        helps = list(pool.map(help_of, names))
    lines = [
        '# Commands',
        '',
        'Run them with `rosrun smach_oracle NAME`. `--help` prints this.',
        '',
    ]
    for name, text in zip(names, helps):
        page = PAGES[name] + '.md'
        lines += [
            '## ' + name,
            '',
            '```text',
            text.rstrip(),
            '```',
            '',
            'More: [{0}]({0})'.format(page),
            '',
        ]
    return '\n'.join(lines)


def sections(index: str) -> Iterator[Tuple[str, List[str]]]:
    """The sections of the index, each with its pages."""
    for section in index.split('\n### ')[1:]:
        yield section.splitlines()[0], re.findall(r'^\| \[(\w+)\.md\]', section, re.MULTILINE)


def contents(index: str) -> str:
    """The site's table of contents, from the tables of the index."""
    lines = ['', '```{toctree}', ':hidden:', 'readme', 'contributing', '```', '']
    for name, pages in sections(index):
        lines += [
            '```{toctree}',
            ':hidden:',
            ':caption: ' + name,
            *pages,
            *GENERATED.get(name, []),
            '```',
            '',
        ]
    return '\n'.join(lines)


def write_sources(folder: Path, quick: bool) -> None:
    """Put all pages into one folder, with links that hold there."""
    shutil.rmtree(str(folder), ignore_errors=True)
    shutil.copytree(str(DOC / 'images'), str(folder / 'images'))
    for table in DOC.glob('*.csv'):
        shutil.copy(str(table), str(folder))
    for name in ('README.md', 'CONTRIBUTING.md'):
        text = (ROOT / name).read_text(encoding='utf-8').replace('](LICENSE)', '](../LICENSE)')
        text = re.sub(r'((?:\]\(|src="))doc/', r'\1', text)
        (folder / name.lower()).write_text(
            text.replace('](CONTRIBUTING.md)', '](contributing.md)'), 'utf-8'
        )
    for page in DOC.glob('*.md'):
        text = page.read_text(encoding='utf-8').replace('](../README.md', '](readme.md')
        text = text.replace('```frozen\n', '```text\n')  # Pygments does not know the first
        (folder / page.name).write_text(text, 'utf-8')
    generated = [
        *interface_pages(ROOT),
        ('api.md', '# Python API\n' if quick else api_page()),
        ('commands.md', '# Commands\n' if quick else commands_page()),
    ]
    for name, text in generated:
        (folder / name).write_text(text, 'utf-8')
    index = folder / 'index.md'
    index.write_text(index.read_text('utf-8') + contents(index.read_text('utf-8')), 'utf-8')
    titles = {
        page.stem: page.read_text('utf-8').split('\n', 1)[0].lstrip('# ')
        for page in folder.glob('*.md')
    }
    for page in folder.glob('*.md'):
        text = FILES.sub(lambda link: _copied(link, folder), page.read_text('utf-8'))
        text = NAMED.sub(lambda link: '[{}]'.format(titles[link.group(1)]), text)
        page.write_text(text, 'utf-8')


def _copied(link: 're.Match[str]', folder: Path) -> str:
    """The link to a file of the repository that is copied to the pages.

    It gets another name: roslaunch looks for a launch file in all folders below the package, and
    refuses one of which it finds two.
    """
    name = link.group(2) + '.txt'
    target = folder / 'files' / name
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(str(ROOT / link.group(2)), str(target))
    return '{}files/{})'.format(link.group(1), name)


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
    quick = parser.parse_args().check
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
    return status


if __name__ == '__main__':
    sys.exit(main())
