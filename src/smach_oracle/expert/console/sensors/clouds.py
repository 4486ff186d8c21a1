"""Point clouds thinned to what a browser can turn round smoothly. Messages only, no node."""

from typing import Dict, List, NamedTuple, Optional, Tuple, cast

import numpy as np
from sensor_msgs.msg import JointState, PointCloud2, PointField

from ..feeds.views import number
from ..shapes.basics import Vector
from ..shapes.sensors import CloudSizeView
from .images import BrowserFile

MOST_SHOWN = 20000  # points
MOST_POINTS = 20000000  # of a message
MOST_JOINTS = 500
_SPARE = 4  # so many times more points are read than are shown, for some are not finite
_CODES = {
    PointField.INT8: 'i1',
    PointField.UINT8: 'u1',
    PointField.INT16: 'i2',
    PointField.UINT16: 'u2',
    PointField.INT32: 'i4',
    PointField.UINT32: 'u4',
    PointField.FLOAT32: 'f4',
    PointField.FLOAT64: 'f8',
}


class CloudError(ValueError):
    """A message that is not the cloud it should be. The text says why."""


class Cloud(NamedTuple):
    """Points to show."""

    points: np.ndarray  # (n, 3) m, finite
    colours: np.ndarray  # (n, 3) uint8


def encode_cloud(message: PointCloud2) -> BrowserFile:
    """Return a cloud for the browser.

    First (n, 3) uint16 positions within `offset` and `offset + scale` (m), then (n, 3) uint8
    colours.
    """
    return encode_points(thinned(message), message.width * message.height)


def encode_points(cloud: Cloud, of: int) -> BrowserFile:
    """Return the same of points that were thinned already. `of`: how many there were."""
    low = cloud.points.min(axis=0) if len(cloud.points) else np.zeros(3)
    span = np.maximum(cloud.points.max(axis=0) - low, 1e-6) if len(cloud.points) else np.ones(3)
    facts: CloudSizeView = {
        'kind': 'cloud',
        'count': len(cloud.points),
        'of': of,
        'offset': vector(low),
        'scale': vector(span),
    }
    packed = np.round((cloud.points - low) / span * 65535).astype('<u2')
    return BrowserFile(
        'application/octet-stream',
        packed.tobytes() + cloud.colours.tobytes(),
        dict(facts),
    )


def vector(values: np.ndarray) -> Vector:
    """Return three numbers, rounded."""
    x, y, z = (round(float(each), 6) for each in values)
    return x, y, z


def thinned(message: PointCloud2, most: int = MOST_SHOWN) -> Cloud:
    """Return at most so many points of a cloud, evenly taken.

    They have their colours, or are coloured by their heights.

    :raises CloudError: for a message that contradicts itself, or too large a one.
    """
    fields = {field.name: field for field in message.fields}
    count = message.width * message.height
    if (
        not {'x', 'y', 'z'} <= set(fields)
        or count > MOST_POINTS
        or (
            count
            and (
                message.row_step < message.width * message.point_step
                or len(message.data) < message.row_step * message.height
            )
        )
    ):
        raise CloudError(
            'PointCloud2 claims {} x {} points but carries {} bytes; allowed: x, y, z and at '
            'most {} points'.format(message.width, message.height, len(message.data), MOST_POINTS)
        )
    chosen = (
        np.unique(np.linspace(0, count - 1, min(count, _SPARE * most)).astype(np.int64))
        if count
        else []
    )
    records = _records(message, np.asarray(chosen, np.int64))
    points = np.stack(
        [_values(records, fields[name], message).astype(np.float64) for name in 'xyz'], axis=1
    )
    kept = np.flatnonzero(np.isfinite(points).all(axis=1) & (np.abs(points) < 1e6).all(axis=1))
    if len(kept) > most:
        kept = kept[np.linspace(0, len(kept) - 1, most).astype(np.int64)]
    return Cloud(points[kept], _colours(records[kept], points[kept], fields, message))


def encode_joints(message: JointState) -> BrowserFile:
    """Joint states as JSON, under `joints` of the facts: name, position, velocity, effort."""

    def column(values: List[float], index: int) -> Optional[float]:
        return number(values[index]) if index < len(values) else None

    joints = [
        [
            name[:200],
            column(message.position, index),
            column(message.velocity, index),
            column(message.effort, index),
        ]
        for index, name in enumerate(message.name[:MOST_JOINTS])
    ]
    return BrowserFile('application/json', b'', {'kind': 'joints', 'joints': joints})


def _records(message: PointCloud2, chosen: np.ndarray) -> np.ndarray:
    """(n, point_step) bytes."""
    data = np.frombuffer(message.data, np.uint8)
    starts = (
        chosen // max(message.width, 1) * message.row_step
        + chosen % max(message.width, 1) * message.point_step
    )
    return data[starts[:, None] + np.arange(message.point_step)]


def _values(
    records: np.ndarray, field: PointField, message: PointCloud2, code: str = ''
) -> np.ndarray:
    kind: np.dtype = np.dtype(code or _CODES.get(field.datatype, 'f4')).newbyteorder(
        '>' if message.is_bigendian else '<'
    )
    if field.offset + kind.itemsize > message.point_step:
        raise CloudError(
            'field {} lies outside of the points of {} bytes'.format(
                field.name[:40], message.point_step
            )
        )
    return np.ascontiguousarray(records[:, field.offset : field.offset + kind.itemsize]).view(kind)[
        :, 0
    ]


def _colours(
    records: np.ndarray, points: np.ndarray, fields: Dict[str, PointField], message: PointCloud2
) -> np.ndarray:
    field = fields.get('rgb') or fields.get('rgba')
    if field is not None:
        # declared as a float by custom
        packed: np.ndarray = _values(records, field, message, 'u4').astype(np.uint32)
        return np.stack([packed >> shift & 255 for shift in (16, 8, 0)], axis=1).astype(np.uint8)
    return by_rank(points[:, 2])


def by_rank(values: np.ndarray) -> np.ndarray:
    """(n, 3) uint8 of (n,): blue for the least, yellow for the most."""
    share = _ranked(values)[:, None]
    return ((1 - share) * np.array([60, 110, 220]) + share * np.array([250, 190, 60])).astype(
        np.uint8
    )


def _ranked(values: np.ndarray) -> np.ndarray:
    """0 to 1."""
    low, high = _span(values)
    return np.clip((values - low) / (high - low), 0, 1)


def _span(values: np.ndarray) -> Tuple[float, float]:
    if not len(values):
        return 0.0, 1.0
    # an array, which numpy's types may take for one number
    low, high = (float(each) for each in cast('np.ndarray', np.percentile(values, (2, 98))))
    return low, max(high, low + 1e-6)
