"""The PR2's model: derived once, mended, the same body however many links it is cut into."""

import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib import metadata

import numpy as np
import pybullet
import pytest

from smach_oracle.pr2.model import pr2_model
from smach_oracle.pr2.model.pr2_model import BASE_JOINTS, ModelError, pr2_files, srdf_pairs
from smach_oracle.pr2.model.rigid_links import fixed_frames
from smach_oracle.simulation.physics.bodies import pose_of

ASK = 'from smach_oracle.pr2.model.pr2_model import pr2_files; print(pr2_files().urdf)'


@pytest.fixture(scope='module')
def client():
    number = pybullet.connect(pybullet.DIRECT)
    yield number
    pybullet.disconnect(number)


def load(client, path):
    body = pybullet.loadURDF(
        str(path),
        useFixedBase=True,
        flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
        physicsClientId=client,
    )
    infos = [
        pybullet.getJointInfo(body, k, physicsClientId=client)
        for k in range(pybullet.getNumJoints(body, physicsClientId=client))
    ]
    return (
        body,
        {info[1].decode(): info for info in infos},
        {info[12].decode(): info[0] for info in infos},
    )


def mass(client, body):
    return sum(
        pybullet.getDynamicsInfo(body, k, physicsClientId=client)[0]
        for k in range(-1, pybullet.getNumJoints(body, physicsClientId=client))
    )


def test_two_processes_that_derive_it_at_once_both_get_it(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    asked = [
        subprocess.Popen(
            [sys.executable, '-c', ASK],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            universal_newlines=True,
        )
        for _ in range(2)
    ]
    told = [process.communicate(timeout=60) for process in asked]
    assert [process.returncode for process in asked] == [0, 0], told[0][1]
    answers = {output.strip().splitlines()[-1] for output, _ in told}
    assert len(answers) == 1
    (folder,) = (tmp_path / 'smach_oracle').iterdir()  # no draft is left over
    assert str(folder / 'pr2.urdf') in answers


def test_it_is_derived_only_once(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    first = pr2_files().urdf.stat().st_mtime_ns
    monkeypatch.setattr(pr2_model, '_derive', lambda *_: pytest.fail('derived again'))
    assert pr2_files().urdf.stat().st_mtime_ns == first


def test_a_cache_that_cannot_be_written_is_named(tmp_path, monkeypatch):
    (tmp_path / 'smach_oracle').write_text('a file where the folder should be')
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    with pytest.raises(ModelError, match='{}.*XDG_CACHE_HOME'.format(tmp_path)):
        pr2_files()


def test_a_missing_package_is_named(monkeypatch):
    def missing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(pr2_model.metadata, 'distribution', missing)
    with pytest.raises(ModelError, match='cmeel is not installed'):
        pr2_files()


def test_every_triangle_has_its_normal():
    meshes = sorted(pr2_files().urdf.parent.glob('*.stl'))
    assert len(meshes) > 20
    for mesh in meshes:
        triangles = np.frombuffer(mesh.read_bytes()[84:], pr2_model.TRIANGLE)
        corners = triangles['corners'].astype(float)
        area = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        assert np.allclose(
            np.linalg.norm(triangles['normal'][area > 1e-10], axis=1), 1, atol=1e-3
        ), mesh.name


def test_every_file_that_it_names_is_there_and_every_link_has_a_mass():
    root = ElementTree.parse(str(pr2_files().urdf)).getroot()
    assert all(open(mesh.get('filename'), 'rb').read(1) for mesh in root.iter('mesh'))
    assert all(float(link.find('inertial/mass').get('value')) > 0 for link in root.findall('link'))


def test_links_made_one_are_where_they_were_and_as_heavy(client):
    files = pr2_files()
    whole, joints, links = load(client, files.urdf)
    merged, merged_joints, merged_links = load(client, files.mobile)
    generator = np.random.default_rng(1)
    for name, info in joints.items():
        if info[2] != pybullet.JOINT_FIXED:
            position = (
                generator.uniform(*info[8:10]) if info[8] < info[9] else generator.uniform(-3, 3)
            )
            pybullet.resetJointState(whole, info[0], position, physicsClientId=client)
            pybullet.resetJointState(
                merged, merged_joints[name][0], position, physicsClientId=client
            )
    frames = fixed_frames(ElementTree.parse(str(files.urdf)).getroot())
    for name, number in links.items():
        holder, holder_from_link = frames[name]
        poses = [
            pose_of(
                *pybullet.getLinkState(
                    body, k, computeForwardKinematics=True, physicsClientId=client
                )[4:6]
            )
            for body, k in ((whole, number), (merged, merged_links[holder]))
        ]
        assert np.allclose(poses[0], poses[1] @ holder_from_link, atol=1e-5), name
    # 1 kg for each joint of the base
    assert mass(client, merged) == pytest.approx(mass(client, whole) + 3, abs=0.01)
    assert set(BASE_JOINTS) | {
        name for name, info in joints.items() if info[2] != pybullet.JOINT_FIXED
    } == set(merged_joints)


def test_the_sum_of_the_jaws_is_the_gap_between_the_tips(client):
    body, joints, links = load(client, pr2_files().mobile)
    for each in (0.0, 0.01, 0.045):
        for finger in 'lr':
            number = joints['r_gripper_{}_finger_joint'.format(finger)][0]
            pybullet.resetJointState(body, number, each, physicsClientId=client)
        gap = min(
            point[8]
            for point in pybullet.getClosestPoints(
                body,
                body,
                0.2,
                links['r_gripper_l_finger_link'],
                links['r_gripper_r_finger_link'],
                physicsClientId=client,
            )
        )
        assert gap == pytest.approx(2 * each, abs=2e-4)


def test_pairs_that_may_touch_are_pairs_of_its_links():
    links = {
        link.get('name')
        for link in ElementTree.parse(str(pr2_files().urdf)).getroot().findall('link')
    }
    pairs = srdf_pairs()
    assert frozenset(('r_elbow_flex_link', 'r_upper_arm_link')) in pairs
    assert sum(pair <= links for pair in pairs) > 500
