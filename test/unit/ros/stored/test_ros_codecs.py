"""ROS messages and numpy arrays in a store."""

import json

import numpy
import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String

from smach_oracle.ros.stored.ros_codecs import offer_ros_codecs
from smach_oracle.store.codecs import CODECS, Codecs, NotReadable, NotStorable


@pytest.fixture(autouse=True)
def _offered():
    offer_ros_codecs()


def again(value):
    text, whole, parts = CODECS.encode(value)
    return CODECS.decode(text, whole, parts.__getitem__)


def test_a_message_is_the_same_again_wherever_it_lies():
    pose = PoseStamped()
    pose.header.stamp = rospy.Time(3, 7)
    pose.pose.position.x = 1.5
    found = again({'poses': [pose], 'name': ('a', String('b'))})
    assert found == {'poses': [pose], 'name': ('a', String('b'))}
    assert type(found['poses'][0]) is PoseStamped


def test_a_message_whose_type_has_changed_is_refused():
    text, whole, parts = CODECS.encode(String('a'))
    other = text.replace(String._md5sum, '0' * 32)
    with pytest.raises(NotReadable, match='has md5 {} here'.format(String._md5sum)):
        CODECS.decode(other, whole, parts.__getitem__)


def test_a_message_whose_type_is_not_installed_is_refused():
    text, whole, parts = CODECS.encode(String('a'))
    with pytest.raises(NotReadable, match='std_msgs/Strong is not installed'):
        CODECS.decode(text.replace('std_msgs/String', 'std_msgs/Strong'), whole, parts.get)


def test_a_message_that_cannot_be_serialised_is_named():
    with pytest.raises(NotStorable, match='std_msgs/String cannot be serialised'):
        CODECS.encode(String(3.5))


def test_times():
    assert again([rospy.Time(1, 2), rospy.Duration(-3, 4)]) == [
        rospy.Time(1, 2),
        rospy.Duration(-3, 4),
    ]


@pytest.mark.parametrize(
    'array',
    [
        numpy.arange(12.0).reshape(3, 4),
        numpy.zeros((0, 3), 'u1'),
        numpy.array(5),
        numpy.asfortranarray(numpy.arange(6).reshape(2, 3)),
        numpy.arange(1000)[::3],
        numpy.array([(1, 2.5)], [('a', 'i4'), ('b', '>f8')]),
        numpy.array(['2020-01-01'], 'M8[s]'),
        numpy.array(['a', 'longer']),
        numpy.array([True, False]),
    ],
)
def test_an_array_is_the_same_again(array):
    found = again(array)
    assert found.dtype == array.dtype and found.shape == array.shape
    assert (found == array).all()
    assert found.flags.writeable


def test_a_scalar_keeps_its_type():
    for scalar in (numpy.float32(1.5), numpy.int64(3), numpy.float64(2.5), numpy.bool_(True)):
        assert type(again(scalar)) is type(scalar) and again(scalar) == scalar


def test_an_array_of_objects_is_refused_both_ways():
    with pytest.raises(NotStorable, match='Python objects'):
        CODECS.encode(numpy.array([object()]))
    stored = json.dumps({'$by': ['numpy_array', ['|O', [1], {'$bytes': 'AAAAAAAAAAA='}]]})
    with pytest.raises(NotReadable, match='Python objects'):
        CODECS.decode(stored, None, {}.get)


def test_a_masked_array_is_not_stored_without_its_mask():
    with pytest.raises(NotStorable, match='MaskedArray'):
        CODECS.encode(numpy.ma.masked_array([1, 2], [True, False]))


def test_what_the_user_registers_goes_before():
    codecs = Codecs(CODECS)
    codecs.register(String, lambda message: message.data, lambda told: String('mine ' + told))
    text, whole, parts = codecs.encode(String('a'))
    assert codecs.decode(text, whole, parts.get).data == 'mine a'
