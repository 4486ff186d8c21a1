"""The page's scripts and styles: lines, lengths, folders, types, and who may import whom."""

import json
import re
import subprocess
import sys

import pytest
from house import ROOT, shown

(STATIC,) = (path.parent for path in (ROOT / 'src').rglob('static/index.html'))
SCRIPTS = sorted((STATIC / 'js').rglob('*.js'))
DECLARATIONS = sorted((STATIC / 'js').rglob('*.d.ts'))
WRITTEN = STATIC / 'js/server.d.ts'  # by doc/write_page_types.py
FROM_PYTHON = sorted((STATIC.parent / 'shapes').glob('*.py'))
FILES = SCRIPTS + DECLARATIONS + sorted(STATIC.rglob('*.css')) + sorted(STATIC.rglob('*.html'))
MOST_COLUMNS = 100
MOST_LINES = 400
MOST_LINES_OF_A_FUNCTION = 40
MOST_OF_A_FOLDER = 20
# folder: the other folders that it may import
ARROWS = {
    'page': set(),
    'drawing': {'page'},
    'robots': {'page'},
    'sensors': {'page', 'drawing'},
    'answering': {'page'},
    'interfaces': {'page', 'drawing', 'sensors', 'answering'},
    'questions': {'page', 'robots', 'sensors', 'answering', 'interfaces'},
    'trials': {'page', 'robots', 'sensors'},
    'people': {'page'},
}
# a function of a module, or a method; with what is above the brace in lines of its own
HEAD = re.compile(r'(?:export )?(?:async )?function \w+\(|  (?:async |get |set |static )*\w+\(')
OPEN = re.compile(r'\b(?:any|Function|Object)\b')
TYPE = re.compile(r'@(?:type|param|returns|typedef|property|template)\s+\{(.*?)\}(?=\s|$)')


def text_of(path):
    return path.read_text(encoding='utf-8')


def comments_out(text):
    return re.sub(r'/\*.*?\*/|//[^\n]*', '', text, flags=re.DOTALL)


def functions(path):
    """Name and lines of each function and method, from its head to the brace that ends it."""
    head, begun = '', 0
    for number, line in enumerate(text_of(path).splitlines()):
        indent = line[: len(line) - len(line.lstrip())]
        if not head and HEAD.match(line) and not line.endswith((';', '}')):
            head, begun, end = line.strip(), number, indent + '}'
        elif head and line == end:
            yield head, number - begun + 1
            head = ''


def imports(path):
    """The scripts that one needs to run; not those of which it names types alone."""
    return [
        (path.parent / name).resolve()
        for name in re.findall(r"^(?:import|\}).* from '(.*)';$", text_of(path), re.MULTILINE)
    ]


def folder_of(path):
    return path.relative_to(STATIC / 'js').parts[0] if path.parent != STATIC / 'js' else ''


def test_there_are_scripts():
    assert len(SCRIPTS) > 40 and len(DECLARATIONS) > 1


def test_the_shapes_of_what_the_server_sends_are_those_of_the_python_types():
    checked = subprocess.run(
        [sys.executable, str(ROOT / 'doc/write_page_types.py'), '--check'],
        stdout=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout.decode()


def test_every_shape_in_python_reaches_the_scripts():
    classes = re.compile(r'^(?:class )?([A-Z]\w+)View(?:\(| = )', re.MULTILINE)
    names = {name for path in FROM_PYTHON for name in classes.findall(text_of(path))}
    declared = set(re.findall(r'^export interface (\w+)', text_of(WRITTEN), re.MULTILINE))
    assert len(names) > 60 and names <= declared


def test_every_line_has_at_most_100_columns():
    lines = [
        (len(line), '{}:{}'.format(shown(path), number))
        for path in FILES
        for number, line in enumerate(text_of(path).splitlines(), 1)
    ]
    assert not [place for length, place in lines if length > MOST_COLUMNS]


def test_no_script_asks_which_words_a_text_has():
    """Texts for people change now and then. Scripts ask for a name or a flag."""
    words = re.compile(r"(?:startsWith\('[A-Z]|includes\('[A-Z]|[!=]== '[A-Z]\w* )[^'\n]*'")
    found = [
        '{}: {}'.format(shown(path), match.group())
        for path in SCRIPTS
        for match in words.finditer(text_of(path))
    ]
    assert not found


def test_files_functions_and_folders_are_short():
    lengths = {shown(path): len(text_of(path).splitlines()) for path in FILES if path != WRITTEN}
    assert not {name: length for name, length in lengths.items() if length > MOST_LINES}
    found = [(lines, head, shown(path)) for path in SCRIPTS for head, lines in functions(path)]
    assert len(found) > 400, 'they are found'
    assert not [each for each in found if each[0] > MOST_LINES_OF_A_FUNCTION]
    folders = [path.parent for path in SCRIPTS]
    assert not {shown(each) for each in folders if folders.count(each) > MOST_OF_A_FOLDER}


@pytest.mark.parametrize('path', SCRIPTS, ids=shown)
def test_a_script_is_checked_by_the_compiler_and_says_what_it_is(path):
    first, second = text_of(path).splitlines()[:2]
    assert first == '// @ts-check' and second.startswith('// ')


@pytest.mark.parametrize('path', SCRIPTS + DECLARATIONS, ids=shown)
def test_no_type_is_left_open(path):
    text = text_of(path)
    assert not re.search(r'@ts-(?:ignore|nocheck|expect-error)', text)
    types = TYPE.findall(text) if path.suffix == '.js' else [comments_out(text)]
    assert not [each for each in types if each in ('*', '?') or OPEN.search(each)]


def test_the_compiler_looks_at_all_of_them_and_is_strict():
    options = json.loads(text_of(ROOT / 'jsconfig.json'))
    assert options['include'] == ['src/**/static/js'] and 'exclude' not in options
    strict = ('strict', 'checkJs', 'exactOptionalPropertyTypes', 'noImplicitReturns')
    assert all(options['compilerOptions'][name] for name in strict)


def test_a_folder_imports_only_those_that_it_may():
    assert {folder_of(path) for path in SCRIPTS} == set(ARROWS) | {''}
    found = [
        (folder_of(path), folder_of(other), shown(path))
        for path in SCRIPTS
        for other in imports(path)
    ]
    assert not [each for each in found if each[0] and each[1] not in ARROWS[each[0]] | {each[0]}]


def test_no_scripts_import_each_other():
    left = {path: set(imports(path)) for path in SCRIPTS}
    assert all(other in left for others in left.values() for other in others)
    while left:
        free = {path for path, others in left.items() if not others & set(left)}
        assert free, 'a circle among {}'.format(sorted(map(shown, left)))
        left = {path: others for path, others in left.items() if path not in free}
