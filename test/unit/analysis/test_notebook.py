"""examples/trials.ipynb and the lines of doc/notebook.md run as they stand."""

import json
import os
import re
import sys
from pathlib import Path

import pytest
from test_real_machine import FakeExpert, run_trials

ROOT = Path(__file__).parents[3]
NOTEBOOK = ROOT / 'examples/trials.ipynb'
PAGE = ROOT / 'doc/notebook.md'


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """A folder with `bags`, in which a state failed, and a person was asked once."""
    place = tmp_path_factory.mktemp('notebook')
    run_trials(place / 'bags', [0, 2, 1, 10], expert=FakeExpert(answers=True))
    run_trials(place / 'bags', [0, 1], recover=False)
    return place


@pytest.fixture
def own_kernel(tmp_path, monkeypatch):
    """Have notebooks run by the Python of this process. That of the system may lack rosbags."""
    place = tmp_path / 'jupyter/kernels/python3'
    place.mkdir(parents=True)
    words = [sys.executable, '-m', 'ipykernel_launcher', '-f', '{connection_file}']
    about = {'argv': words, 'display_name': 'this', 'language': 'python'}
    (place / 'kernel.json').write_text(json.dumps(about), encoding='utf-8')
    monkeypatch.setenv('JUPYTER_PATH', str(tmp_path / 'jupyter'))
    monkeypatch.setenv('IPYTHONDIR', str(tmp_path / 'ipython'))
    monkeypatch.setenv('PYDEVD_DISABLE_FILE_VALIDATION', '1')


def test_the_notebook_runs_as_it_stands(folder, own_kernel, monkeypatch):
    nbformat, nbclient = pytest.importorskip('nbformat'), pytest.importorskip('nbclient')
    monkeypatch.setenv('MPLBACKEND', 'module://matplotlib_inline.backend_inline')
    notebook = nbformat.read(str(NOTEBOOK), as_version=4)
    nbformat.validate(notebook)
    assert not any(cell.get('outputs') for cell in notebook.cells), 'it is kept without outputs'
    resources = {'metadata': {'path': str(folder)}}
    nbclient.NotebookClient(notebook, timeout=120, resources=resources).execute()
    shown = [
        text
        for cell in notebook.cells
        for output in cell.get('outputs', ())
        for text in [output.get('data', {}).get('text/plain', '')]
    ]
    assert '<6 trials, 0 bags skipped>' in shown
    assert any('TOP/PICK' in text and 'trying it again' in text for text in shown)
    images = [out for cell in notebook.cells for out in cell.get('outputs', ()) if 'data' in out]
    assert any('image/png' in out['data'] for out in images)


def test_the_lines_of_the_page_run_as_they_stand(folder, monkeypatch, capsys):
    pytest.importorskip('pandas')
    monkeypatch.chdir(folder)
    blocks = re.findall(r'```python\n(.*?)```', PAGE.read_text(encoding='utf-8'), re.DOTALL)
    assert blocks
    names = {}
    for block in blocks:
        exec(compile(block, str(PAGE), 'exec'), names)
    assert capsys.readouterr().out.strip()
    assert os.listdir(str(folder)) == ['bags']
