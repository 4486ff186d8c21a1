"""The PR2 as a model that physics can move, derived from example-robot-data and kept in a cache.

These parts are mended. File names are made absolute. Triangles get normals: some meshes have none
and would look black. Links without inertia get one of a gram, for simulators would take 1 kg. The
four-bar fingers become jaws that slide. Their joints read the travel (m) of one finger from its
closed place, so that the gap between the tips is their sum. Parts in signal colours get those of a
PR2.
"""

import os
import shutil
import tempfile
import xml.etree.ElementTree as ElementTree
from importlib import metadata
from pathlib import Path
from typing import FrozenSet, List, NamedTuple, Tuple
from urllib.parse import unquote, urlparse

import numpy as np

from smach_oracle.user_cache import cache_folder

from .rigid_links import inertia_of, merge_rigid_links, set_inertia

MENDED = 4  # raise it when what is derived here changes: it names the cache's folder
BASE_JOINTS = ('base_x', 'base_y', 'base_theta')  # of the mobile model: m, m, rad in the world
JAW_OPEN = 0.045  # m, each finger from its closed place
# m outwards, of each closed finger: as they are, the tips are within each other
JAW_SHIFT = 0.00187
LIGHT = 1e-3  # kg, of a link that has no mass
LEAST_INERTIA = 1e-6  # kg m2
COLOURS = {
    'White': '0.93 0.93 0.92 1',
    'Grey2': '0.84 0.85 0.86 1',
    'Grey': '0.60 0.61 0.63 1',
    'Blue': '0.42 0.47 0.55 1',
    'Green': '0.88 0.89 0.90 1',
    'Red': '0.25 0.26 0.28 1',
}
TRIANGLE: np.dtype = np.dtype(
    [('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('attribute', '<u2')]
)


class ModelError(RuntimeError):
    """The PR2's model cannot be had. The text names what is missing, and where."""


class Pr2Files(NamedTuple):
    """The mended model on disk."""

    urdf: Path  # root base_footprint, child base_link, what a robot_description has
    # on BASE_JOINTS, root 'world', links that are fixed to each other made one, for physics
    mobile: Path
    srdf: Path  # which pairs of links may touch, among others


def pr2_files() -> Pr2Files:
    """The mended model, derived if need be. Two processes may ask at once.

    :raises ModelError: where example-robot-data is not installed, or the cache cannot be written.
    """
    source = _installed()
    folder = cache_folder() / 'pr2-{}-{}'.format(metadata.version('example-robot-data'), MENDED)
    if not folder.is_dir():
        _derive(source, folder)
    return Pr2Files(folder / 'pr2.urdf', folder / 'pr2_mobile.urdf', folder / 'pr2.srdf')


def pr2_urdf() -> Path:
    """The mended model with root base_footprint."""
    return pr2_files().urdf


def srdf_pairs() -> FrozenSet[FrozenSet[str]]:
    """The pairs of links that may touch: neighbours, and those that never meet or always do."""
    root = ElementTree.parse(str(pr2_files().srdf)).getroot()
    return frozenset(
        frozenset((pair.get('link1', ''), pair.get('link2', '')))
        for pair in root.iter('disable_collisions')
    )


def _installed() -> Path:
    """The share folder of the installed example-robot-data."""
    try:
        package = metadata.distribution('cmeel')
        metadata.version('example-robot-data')
    except metadata.PackageNotFoundError as err:
        raise ModelError(
            'the Python package {} is not installed; it has the PR2. Run scripts/setup'.format(
                err.args[0]
            )
        ) from err  # Python 3.8 has no name in it
    share = Path(str(package.locate_file('cmeel.prefix'))) / 'share'
    if not (share / 'example-robot-data' / 'robots' / 'pr2_description').is_dir():
        raise ModelError(
            'there is no PR2 in {}: example-robot-data lies elsewhere or is broken'.format(share)
        )
    return share


def _derive(share: Path, folder: Path) -> None:
    """Write the model beside its place and move it there as a whole.

    Where another process was faster, its model stays and this one is dropped.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix='pr2-draft-', dir=str(folder.parent)))
    except OSError as err:
        raise ModelError(
            'the PR2 model cannot be kept in {}: {}; set XDG_CACHE_HOME to a folder that can be '
            'written'.format(folder.parent, err)
        ) from err
    try:
        _write(share, draft, folder)
        os.chmod(draft, 0o755)
        os.rename(draft, folder)
    except OSError:
        if not folder.is_dir():
            raise
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _write(share: Path, draft: Path, folder: Path) -> None:
    source = share / 'example-robot-data' / 'robots' / 'pr2_description'
    tree = ElementTree.parse(str(source / 'urdf' / 'pr2.urdf'))
    robot = tree.getroot()
    for tag in ('gazebo', 'transmission'):
        for element in robot.findall(tag):
            robot.remove(element)
    for mesh in robot.iter('mesh'):
        url = urlparse(mesh.get('filename', ''))
        found = share / url.netloc / unquote(url.path).lstrip('/')
        name = '{}_{}'.format(found.parent.name, found.name)
        (draft / name).write_bytes(with_normals(found.read_bytes()))
        mesh.set('filename', str(folder / name))
    for material in robot.findall('material'):
        _child(material, 'color').set('rgba', COLOURS[material.get('name', '')])
    for link in robot.findall('link'):
        _give_inertia(link)
    for joint in robot.findall('joint'):
        _mend_joint(joint)
    tree.write(str(draft / 'pr2.urdf'))
    for link in robot.findall('link'):
        _drop_placeholders(link)
    merge_rigid_links(robot)
    _put_on_wheels(robot)
    tree.write(str(draft / 'pr2_mobile.urdf'))
    shutil.copyfile(str(source / 'srdf' / 'pr2.srdf'), str(draft / 'pr2.srdf'))


def with_normals(stl: bytes) -> bytes:
    """A binary STL file with the normals that its triangles have."""
    triangles = np.frombuffer(stl[84:], TRIANGLE).copy()
    corners = triangles['corners'].astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    triangles['normal'] = normal / np.maximum(length, 1e-12)
    return stl[:84] + triangles.tobytes()


def _give_inertia(link: ElementTree.Element) -> None:
    inertial = link.find('inertial')
    if inertial is None:
        _inertial(link, LIGHT, LEAST_INERTIA)
        return
    mass = _child(inertial, 'mass')
    if float(mass.get('value', 0)) <= 0:
        mass.set('value', str(LIGHT))
    moments = np.linalg.eigvalsh(inertia_of(inertial))
    if moments[0] < LEAST_INERTIA or moments[2] > moments[0] + moments[1]:  # no body has such
        set_inertia(inertial, np.eye(3) * max(LEAST_INERTIA, moments[2]))


def _drop_placeholders(link: ElementTree.Element) -> None:
    """Remove the boxes that stand for cameras.

    Some enclose the camera itself, where the renderer would divide by their depth of 0.
    """
    for visual in link.findall('visual'):
        if visual.find('geometry/mesh') is None:
            link.remove(visual)


def _inertial(link: ElementTree.Element, mass: float, inertia: float) -> None:
    inertial = ElementTree.SubElement(link, 'inertial')
    ElementTree.SubElement(inertial, 'mass', value=str(mass))
    moments = {axes: str(inertia) for axes in ('ixx', 'iyy', 'izz')}
    ElementTree.SubElement(inertial, 'inertia', dict(moments, ixy='0', ixz='0', iyz='0'))


def _mend_joint(joint: ElementTree.Element) -> None:
    name = joint.get('name', '')
    if name.endswith(('gripper_l_finger_joint', 'gripper_r_finger_joint')):
        joint.set('type', 'prismatic')
        side = 1 if 'l_finger' in name else -1
        x, y, z = (float(value) for value in _child(joint, 'origin').get('xyz', '0 0 0').split())
        _child(joint, 'origin').set('xyz', '{} {} {}'.format(x, y + side * JAW_SHIFT, z))
        _child(joint, 'axis').set('xyz', '0 {} 0'.format(side))
        _child(joint, 'limit').attrib.update(
            lower='0', upper=str(JAW_OPEN), effort='200', velocity='0.1'
        )
        _child(joint, 'dynamics').set('damping', '10')
    elif name.endswith(('finger_tip_joint', 'parallel_root_joint')):
        joint.set('type', 'fixed')
    elif name == 'torso_lift_joint':
        # for 20000 (a spindle) the steps of physics are too long
        _child(joint, 'dynamics').set('damping', '100')
    for mimic in joint.findall('mimic'):
        joint.remove(mimic)


def _child(element: ElementTree.Element, tag: str) -> ElementTree.Element:
    found = element.find(tag)
    return ElementTree.SubElement(element, tag) if found is None else found


def _put_on_wheels(robot: ElementTree.Element) -> None:
    """Joints in front of the root that take it over the floor."""
    children = {_child(joint, 'child').get('link') for joint in robot.findall('joint')}
    root = next(
        str(link.get('name')) for link in robot.findall('link') if link.get('name') not in children
    )
    links: List[str] = ['world', 'base_x_link', 'base_y_link', root]
    kinds: Tuple[Tuple[str, str], ...] = (
        ('prismatic', '1 0 0'),
        ('prismatic', '0 1 0'),
        ('continuous', '0 0 1'),
    )
    for name in links[:3]:
        _inertial(ElementTree.SubElement(robot, 'link', name=name), 1.0, 0.1)
    for name, (kind, axis), parent, child in zip(BASE_JOINTS, kinds, links, links[1:]):
        joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
        ElementTree.SubElement(joint, 'parent', link=parent)
        ElementTree.SubElement(joint, 'child', link=child)
        ElementTree.SubElement(joint, 'axis', xyz=axis)
        ElementTree.SubElement(
            joint, 'limit', lower='-20', upper='20', effort='20000', velocity='1'
        )
