"""The lists of packages: what users need, and what developers need beside."""

import re

import pytest
from house import ROOT
from packaging.markers import default_environment
from packaging.requirements import Requirement

# what only those need who change this package
OF_DEVELOPERS = {
    'mypy',
    'ruff',
    'vermin',
    'import-linter',
    'grimp',
    'catkin-lint',
    'catkin_lint',
    'chromium',
    'chromium-driver',
    'chromium-headless-shell',
    'python3-selenium',
    'axe-playwright-python',
    'node-typescript',
    'python3-sphinx',
    'furo',
    'python3-proselint',
    'hypothesis',
    'python3-hypothesis',
    'python3-coverage',
}
PAIRS = [
    ('debian-packages.txt', 'debian-packages-dev.txt'),
    ('debian-packages.txt', 'debian-packages-doc.txt'),
    ('requirements.txt', 'requirements-dev.txt'),
    ('requirements-noetic.txt', 'requirements-noetic-dev.txt'),
]


def listed(name):
    lines = (ROOT / name).read_text(encoding='utf-8').splitlines()
    return {
        re.split('[=<]', line.split()[0])[0] for line in lines if line and not line.startswith('#')
    }


@pytest.mark.parametrize('users, developers', PAIRS)
def test_users_get_no_tool_of_developers(users, developers):
    assert listed(users) and not listed(users) & OF_DEVELOPERS
    assert listed(developers) & OF_DEVELOPERS and not listed(developers) & listed(users)


def test_every_package_for_python_3_8_has_its_version():
    lines = [
        line
        for name in PAIRS[-1]
        for line in (ROOT / name).read_text().splitlines()
        if not line.startswith('#')
    ]
    assert lines and all(re.match(r'[\w-]+(==|<)\d', line) for line in lines)


@pytest.mark.parametrize('python', ['3.10', '3.11', '3.12', '3.13'])
def test_each_python_gets_one_version_of_each_package(python):
    lines = (ROOT / 'requirements.txt').read_text(encoding='utf-8').splitlines()
    wanted = [Requirement(line.split(' #')[0]) for line in lines if not line.startswith('#')]
    its = dict(default_environment(), python_version=python)
    names = [each.name for each in wanted if each.marker is None or each.marker.evaluate(its)]
    assert len(names) == len(set(names))
    # pybullet has no wheel from 3.12 on: scripts/setup --simulation compiles it
    lacking = {each.name for each in wanted} - set(names)
    assert lacking == ({'pybullet'} if python in ('3.12', '3.13') else set())


@pytest.mark.parametrize('script, more', [('demo', ''), ('test', '--dev'), ('doc', '--doc')])
def test_a_script_sets_up_no_more_than_it_needs(script, more):
    (line,) = re.findall(
        r'^"\$root/scripts/setup".*$', (ROOT / 'scripts' / script).read_text(), re.MULTILINE
    )
    assert re.findall(r'--(?:dev|doc)', line) == ([more] if more else [])
