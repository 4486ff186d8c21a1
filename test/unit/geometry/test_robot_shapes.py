"""What a robot looks like, out of its URDF; and robot descriptions that would do harm."""

import numpy as np
import pytest

from smach_oracle.geometry import robot_shapes
from smach_oracle.geometry.robot_shapes import read_shapes

ARM = """<robot name="arm">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base">
    <visual><geometry><box size="1 2 3"/></geometry><material name="red"/></visual></link>
  <link name="upper">
    <visual><origin xyz="0 0 0.5"/><geometry>
      <mesh filename="package://arm/upper.stl" scale="0.001 0.001 0.001"/></geometry></visual>
    <collision><geometry><cylinder radius="0.1" length="1"/></geometry></collision></link>
  <link name="finger"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="thumb"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/></joint>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="finger"/><axis xyz="1 0 0"/></joint>
  <joint name="other" type="prismatic">
    <parent link="upper"/><child link="thumb"/><axis xyz="1 0 0"/>
    <mimic joint="slide" multiplier="-2" offset="0.5"/></joint>
</robot>"""


def with_visual(text):
    return '<robot name="r"><link name="one"><visual>{}</visual></link></robot>'.format(text)


def linked(*pairs):
    links = sorted({name for pair in pairs for name in pair})
    return '<robot name="r">{}{}</robot>'.format(
        ''.join('<link name="{}"/>'.format(name) for name in links),
        ''.join(
            '<joint name="{0}{1}" type="fixed"><parent link="{0}"/>'
            '<child link="{1}"/></joint>'.format(*pair)
            for pair in pairs
        ),
    )


def test_the_looks_of_every_link_and_what_stands_for_a_mesh():
    robot = read_shapes(ARM)
    assert (robot.root, robot.links) == ('base', ['base', 'upper', 'finger', 'thumb'])
    box, mesh, sphere = robot.shapes
    assert (box.link, box.kind, list(box.size), box.colour) == (
        'base',
        'box',
        [1, 2, 3],
        (255, 0, 0),
    )
    assert (mesh.mesh, mesh.size[0], mesh.origin[2, 3]) == ('package://arm/upper.stl', 0.001, 0.5)
    assert (sphere.link, sphere.kind, list(sphere.size)) == ('finger', 'sphere', [0.2, 0.2, 0.2])
    assert [(shape.link, shape.kind) for shape in robot.collisions] == [('upper', 'cylinder')]


def test_links_are_where_the_joints_say_and_mimics_follow():
    poses = read_shapes(ARM).poses({'turn': np.pi / 2, 'slide': 0.2})
    np.testing.assert_allclose(poses['finger'][:3, 3], [0, 0.2, 1], atol=1e-12)
    np.testing.assert_allclose(poses['thumb'][:3, 3], [0, 0.1, 1], atol=1e-12)
    np.testing.assert_allclose(read_shapes(ARM).poses({})['thumb'][:3, 3], [0.5, 0, 1])


@pytest.mark.parametrize(
    'text, said',
    [
        ('', 'not XML'),
        ('<robot', 'not XML'),
        ('<html><link/></html>', 'begins with <robot>'),
        ('<robot name="r"/>', '0 links'),
        (linked(('a', 'b'), ('b', 'a')), 'in a circle'),
        (linked(('a', 'b'), ('c', 'd'), ('d', 'c')), 'does not hang on a'),
        (linked(('a', 'b'), ('c', 'd')), '2 links'),
        (with_visual(''), "not ''"),
        (with_visual('<geometry><torus/></geometry>'), 'torus'),
        (with_visual('<geometry><box size="1 2"/></geometry>'), 'size="1 2"; it takes 3'),
        (with_visual('<geometry><box size="nan 1 1"/></geometry>'), 'finite'),
        (with_visual('<geometry><sphere/></geometry>'), 'radius'),
        (with_visual('<geometry><sphere radius="1e99"/></geometry>'), 'finite'),
        (
            with_visual('<origin xyz="inf 0 0"/><geometry><box size="1 1 1"/></geometry>'),
            'xyz="inf 0 0"',
        ),
        (ARM.replace('xyz="0 0 1"/><axis', 'xyz="nan 0 1"/><axis'), 'invalid place or axis'),
        (ARM.replace('multiplier="-2"', 'multiplier="x"'), 'multiplier="x"'),
        (ARM.replace('multiplier="-2"', 'multiplier="inf"'), "'other' mimics another"),
        (ARM.replace('offset="0.5"', 'offset="nan"'), "'other' mimics another"),
        (ARM.replace('<child link="finger"/>', ''), 'not a URDF'),
    ],
)
def test_what_is_wrong_is_said(text, said):
    with pytest.raises(ValueError, match='robot description') as error:
        read_shapes(text)
    assert said in str(error.value)


@pytest.mark.parametrize(
    'declared',
    [
        '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
        '<!DOCTYPE robot [<!ENTITY secret SYSTEM "file:///etc/passwd">]>',
        '<!doctype robot SYSTEM "http://evil/x.dtd">',
    ],
)
def test_document_types_and_entities_are_refused(declared):
    with pytest.raises(ValueError, match='not allowed'):
        read_shapes(declared + ARM.replace('name="arm"', 'name="&secret;&b;"'))


def test_sizes_are_limited(monkeypatch):
    with pytest.raises(ValueError, match='characters'):
        read_shapes(ARM + ' ' * robot_shapes.MOST_CHARACTERS)
    with pytest.raises(ValueError, match='links'):
        read_shapes('<robot>' + '<link name="x"/>' * (robot_shapes.MOST_LINKS + 1) + '</robot>')
    with pytest.raises(ValueError, match='shapes'):
        read_shapes(
            with_visual(
                '</visual><visual>'.join(
                    ['<geometry><sphere radius="1"/></geometry>'] * (robot_shapes.MOST_SHAPES + 1)
                )
            )
        )
    chain = read_shapes(linked(*(('l{}'.format(k), 'l{}'.format(k + 1)) for k in range(1500))))
    assert len(chain.poses({})) == 1501, 'a chain of any length is no recursion'
