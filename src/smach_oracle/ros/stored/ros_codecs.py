"""Codecs that store ROS messages, ROS times and numpy arrays. Nothing is pickled."""

import io
import struct
from typing import TYPE_CHECKING, Any, List

import genpy
import roslib.message

from smach_oracle.store.codecs import OFFERED

if TYPE_CHECKING:
    import numpy


def offer_ros_codecs() -> None:
    """Let every store of this program take them. What the user has registered goes before."""
    OFFERED.register(genpy.Message, _of_message, _to_message, 'ros_message')
    OFFERED.register(genpy.Time, _of_time, _to_time, 'ros_time')
    OFFERED.register(genpy.Duration, _of_time, _to_duration, 'ros_duration')
    try:
        import numpy
    except ImportError:
        return  # then no script has arrays
    OFFERED.register(numpy.ndarray, _of_array, _to_array, 'numpy_array')
    OFFERED.register(numpy.generic, _of_scalar, _to_scalar, 'numpy_scalar')


def _of_message(message: genpy.Message) -> List[object]:
    """Return type, md5 and bytes.

    :raises ValueError: where a field has a value that its type does not allow.
    """
    buffer = io.BytesIO()
    try:
        message.serialize(buffer)
    except (genpy.SerializationError, struct.error, TypeError, AttributeError) as err:
        raise ValueError('the {} cannot be serialised: {}'.format(message._type, err)) from err
    return [message._type, message._md5sum, buffer.getvalue()]


def _to_message(told: List[Any]) -> genpy.Message:
    """Return a message.

    :raises ValueError: where its type is not installed here, or has another md5.
    """
    name, md5, data = told
    kind = roslib.message.get_message_class(name)
    if kind is None:
        raise ValueError('the message type {} is not installed'.format(name))
    if kind._md5sum != md5:
        raise ValueError(
            'the message type {} has md5 {} here, and had {}'.format(name, kind._md5sum, md5)
        )
    message: genpy.Message = kind()
    message.deserialize(data)
    return message


def _of_time(time: genpy.rostime.TVal) -> List[int]:
    return [time.secs, time.nsecs]


def _to_time(told: List[int]) -> genpy.Time:
    import rospy

    return rospy.Time(*told)


def _to_duration(told: List[int]) -> genpy.Duration:
    import rospy

    return rospy.Duration(*told)


def _of_array(array: 'numpy.ndarray') -> List[object]:
    """Return dtype, shape and bytes.

    :raises ValueError: for an array of objects, and for a subclass, whose own parts are not known.
    """
    import numpy

    if type(array) is not numpy.ndarray:
        raise ValueError('a {} needs a codec of its own'.format(type(array).__name__))
    return [_of_dtype(array.dtype), list(array.shape), array.tobytes()]


def _to_array(told: List[Any]) -> 'numpy.ndarray':
    import numpy

    described, shape, data = told
    dtype = _to_dtype(described)
    if not dtype.itemsize:  # such as of empty texts, which frombuffer refuses
        return numpy.zeros(shape, dtype)
    return numpy.frombuffer(data, dtype).reshape(shape).copy()


def _of_scalar(scalar: 'numpy.generic') -> List[object]:
    return [_of_dtype(scalar.dtype), scalar.tobytes()]


def _to_scalar(told: List[Any]) -> 'numpy.generic':
    described, data = told
    array: Any = _to_array([described, (), data])
    scalar: 'numpy.generic' = array[()]
    return scalar


def _of_dtype(dtype: 'numpy.dtype') -> object:
    """Return a dtype as plain data.

    :raises ValueError: where it has Python objects in it.
    """
    from numpy.lib import format as array_format

    if dtype.hasobject:
        raise ValueError('an array of Python objects is not stored')
    described: object = array_format.dtype_to_descr(dtype)
    return described


def _to_dtype(described: object) -> 'numpy.dtype':
    """Return a dtype.

    :raises ValueError: where it has Python objects in it.
    """
    from numpy.lib import format as array_format

    dtype = array_format.descr_to_dtype(described)
    if dtype.hasobject:
        raise ValueError('an array of Python objects is not read')
    return dtype
