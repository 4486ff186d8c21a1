"""The lists of packages: what users need, and what developers need beside."""

import re

import pytest
from house import ROOT

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
        for name in PAIRS[2]
        for line in (ROOT / name).read_text().splitlines()
        if not line.startswith('#')
    ]
    assert lines and all(re.match(r'[\w-]+(==|<)\d', line) for line in lines)


@pytest.mark.parametrize('script, dev', [('demo', False), ('test', True), ('doc', True)])
def test_only_what_developers_run_sets_up_their_packages(script, dev):
    (line,) = re.findall(
        r'^"\$root/scripts/setup".*$', (ROOT / 'scripts' / script).read_text(), re.MULTILINE
    )
    assert line.endswith(' --dev') == dev
