"""The site's files do not get into the way of ROS."""
import importlib.util
import sys
from pathlib import Path

SITE = Path(__file__).resolve().parents[3] / 'doc' / 'site'


def test_a_launch_file_on_the_site_has_another_name(tmp_path, monkeypatch):
    """Roslaunch looks in all folders of the package, and refuses one of which it finds two."""
    monkeypatch.syspath_prepend(str(SITE))
    spec = importlib.util.spec_from_file_location('site_build', str(SITE / 'build.py'))
    build = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, 'site_build', build)
    spec.loader.exec_module(build)
    page = build.FILES.sub(lambda link: build._copied(link, tmp_path),
                           'See [it](../launch/inspection.launch).')
    assert page == 'See [it](files/launch/inspection.launch.txt).'
    copy, = (path for path in tmp_path.rglob('*') if path.is_file())
    assert copy.name == 'inspection.launch.txt'
    assert copy.read_bytes() == (SITE.parents[1] / 'launch/inspection.launch').read_bytes()
