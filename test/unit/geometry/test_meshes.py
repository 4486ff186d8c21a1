"""Mesh files of the three kinds, whole, broken and hostile; and meshes with fewer triangles."""

import struct

import numpy as np
import pytest

from smach_oracle.geometry import meshes
from smach_oracle.geometry.meshes import Mesh, MeshError, read_mesh, reduced

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
SQUARE = np.array([[0, 1, 2], [0, 2, 3]])
OBJ = b'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1 2/2 3/3 -1\n'
DAE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
<asset><unit meter="0.01"/></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array count="12">0 0 0 100 0 0 100 100 0 0 100 0</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="NORMAL" source="#n" offset="1"/>
<vcount>4</vcount><p>0 0 1 0 2 0 3 0</p></polylist></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene><node><translate>0 0 100</translate>
<node><rotate>0 0 1 90</rotate>
<instance_geometry url="#g"/></node></node></visual_scene></library_visual_scenes></COLLADA>"""


def binary_stl(triangles, told=None, head=b'solid but binary'):
    body = b''.join(struct.pack('<12fH', 0, 0, 0, *np.ravel(each), 0) for each in triangles)
    return head.ljust(80, b' ') + struct.pack('<I', len(triangles) if told is None else told) + body


def text_stl(triangles):
    facets = ''.join(
        'facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n'.format(
            ''.join('vertex {} {} {}\n'.format(*corner) for corner in each)
        )
        for each in triangles
    )
    return ('solid square\n' + facets + 'endsolid').encode()


def area(mesh):
    a, b, c = (mesh.corners[mesh.triangles[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def ball(steps):
    """A sphere of radius 1 m."""
    turn, tilt = np.meshgrid(
        np.linspace(0, 2 * np.pi, steps), np.linspace(0.01, np.pi - 0.01, steps)
    )
    corners = np.stack(
        [np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)], axis=-1
    )
    at = np.arange(steps * steps).reshape(steps, steps)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    return Mesh(
        corners.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    )


@pytest.mark.parametrize(
    'data, kind',
    [
        (binary_stl(CORNERS[SQUARE]), 'stl'),
        (binary_stl(CORNERS[SQUARE], head=b''), 'stl'),
        (text_stl(CORNERS[SQUARE]), 'stl'),
        (OBJ, 'obj'),
        (DAE.encode(), 'dae'),
    ],
    ids=lambda value: value if isinstance(value, str) else 'data',
)
def test_every_kind_gives_the_same_square(data, kind):
    mesh = read_mesh(data, kind)
    assert len(mesh.triangles) == 2 and area(mesh) == pytest.approx(1.0)


def test_the_nodes_of_a_scene_and_the_unit_count():
    low, high = (
        getattr(read_mesh(DAE.encode(), 'dae').corners, each)(axis=0) for each in ('min', 'max')
    )
    np.testing.assert_allclose([low, high], [[-1, 0, 1], [0, 1, 1]], atol=1e-9)


@pytest.mark.parametrize(
    'data, kind, said',
    [
        (b'', 'stl', 'no STL'),
        (b'#!/bin/sh', 'stl', 'no STL'),
        (binary_stl(CORNERS[SQUARE], told=2**32 - 1), 'stl', 'triangles'),
        (binary_stl([]), 'stl', 'no triangles'),
        (binary_stl(CORNERS[SQUARE] * np.nan), 'stl', 'finite'),
        (binary_stl(CORNERS[SQUARE] * 1e30), 'stl', 'finite'),
        (b'solid x vertex 1 2', 'stl', 'stl'),
        (b'v 0 0\nf 1 1 1', 'obj', 'obj'),
        (b'v 0 0 0\nf 1 2 9', 'obj', 'not there'),
        (b'v 0 0 0\nf 1 2 -9', 'obj', 'not there'),
        (b'f x y z', 'obj', 'obj'),
        (b'\xff\xfe', 'dae', 'COLLADA'),
        (b'<COLLADA/>', 'dae', 'no geometry'),
        (
            b'<!DOCTYPE x [<!ENTITY y SYSTEM "file:///etc/passwd">]>' + DAE.encode()[38:],
            'dae',
            'document type',
        ),
        (DAE.replace('offset="1"', 'offset="100000000"').encode(), 'dae', 'invalid COLLADA'),
        (DAE.replace('<vcount>4', '<vcount>-4').encode(), 'dae', 'no triangles'),
        (DAE.replace('0 0 1 0 2 0 3 0', '0 0 1 0 2 0 77 0').encode(), 'dae', 'not there'),
        (DAE.replace('0 0 1 90', '0 0 1').encode(), 'dae', 'dae'),
        (OBJ, 'exe', 'readable: dae, obj, stl'),
    ],
    ids=lambda value: value if isinstance(value, str) else 'data',
)
def test_what_is_no_mesh_is_refused_without_quoting_it(data, kind, said):
    with pytest.raises(MeshError) as error:
        read_mesh(data, kind)
    assert (
        said in str(error.value)
        and 'passwd' not in str(error.value)
        and '/bin/sh' not in str(error.value)
    )


def test_sizes_are_limited_before_anything_is_made_of_them(monkeypatch):
    monkeypatch.setattr(meshes, 'MOST_TEXT', 50)
    for data, kind in ((OBJ * 2, 'obj'), (DAE.encode(), 'dae'), (text_stl(CORNERS[SQUARE]), 'stl')):
        with pytest.raises(MeshError, match='50'):
            read_mesh(data, kind)
    monkeypatch.setattr(meshes, 'MOST_TRIANGLES', 1)
    for data, kind in ((binary_stl(CORNERS[SQUARE]), 'stl'), (OBJ, 'obj')):
        with pytest.raises(MeshError, match='triangles'):
            read_mesh(data, kind)


def test_nodes_deep_within_each_other_end_somewhere():
    deep = DAE.replace('<node><rotate>', '<node>' * 5000 + '<rotate>').replace(
        '</node></node>', '</node>' * 5001
    )
    assert len(read_mesh(deep.encode(), 'dae').triangles) == 2, 'too deep to be placed: as it is'


@pytest.mark.parametrize('most', [2000, 500, 60])
def test_fewer_triangles_look_about_the_same(most):
    whole = ball(60)
    small = reduced(whole, most)
    assert 0.3 * most < len(small.triangles) <= most
    far = np.linalg.norm(small.corners, axis=1)
    assert far.max() < 1.01 and far.min() > (0.9 if most > 100 else 0.7)
    assert area(small) == pytest.approx(area(whole), rel=0.1 if most > 100 else 0.4)


def test_a_mesh_that_cannot_be_thinned_becomes_its_box():
    spikes = np.random.default_rng(1).uniform(-1, 1, (3000, 3))
    small = reduced(Mesh(spikes, np.arange(3000).reshape(-1, 3)), 12)
    assert len(small.triangles) <= 12
    assert np.abs(small.corners).max() <= 1.0


def test_one_with_few_enough_is_left_alone_but_for_corners_at_the_same_place():
    mesh = read_mesh(binary_stl(CORNERS[SQUARE]), 'stl')
    small = reduced(mesh, 100)
    assert (len(mesh.corners), len(small.corners), area(small)) == (6, 4, 1.0)
