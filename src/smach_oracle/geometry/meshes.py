"""Triangles out of mesh files (STL, Wavefront OBJ, COLLADA), and fewer of them for a quick look.

Files are read as data: sizes are checked before anything is made of them, and whatever is wrong is
a MeshError.
"""

import xml.etree.ElementTree as ElementTree
from typing import Callable, Dict, Iterator, List, NamedTuple, Tuple

import numpy as np

from .transforms import rotation_about
from .xml_text import read_xml

MOST_BYTES = 100000000  # of a file
MOST_TEXT = 40000000  # of one that is text: it takes many times its size to read
MOST_TRIANGLES = 2000000
FURTHEST = 1e6  # of a corner from the origin, in the file's unit
_STL: np.dtype = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('attribute', '<u2')])
_FINEST = 2**20  # steps over the whole mesh: closer corners are one
_DEEPEST = 60  # nodes of a COLLADA scene within each other


class MeshError(ValueError):
    """A file without a usable mesh. The text gives the reason and quotes nothing of the file."""


class Mesh(NamedTuple):
    """Triangles."""

    corners: np.ndarray  # (n, 3) m
    triangles: np.ndarray  # (m, 3) int: indices of corners


def read_mesh(data: bytes, kind: str) -> Mesh:
    """
    :param kind: stl, obj or dae.
    :raises MeshError: for other kinds, and where the data is too large, none, or not finite.
    """
    reader = _READERS.get(kind)
    if reader is None:
        raise MeshError(
            'it is of the kind {!r}; readable: {}'.format(kind[:20], ', '.join(sorted(_READERS)))
        )
    most = MOST_BYTES if kind == 'stl' else MOST_TEXT
    if len(data) > most:
        raise MeshError('it has {} bytes; allowed: {}'.format(len(data), most))
    try:
        mesh = reader(data)
    except (ValueError, IndexError, KeyError, OverflowError) as err:
        if isinstance(err, MeshError):
            raise
        raise MeshError('it is no {} file'.format(kind)) from err
    if not len(mesh.triangles):
        raise MeshError('it has no triangles')
    if len(mesh.triangles) > MOST_TRIANGLES:
        raise MeshError(
            'it has {} triangles; allowed: {}'.format(len(mesh.triangles), MOST_TRIANGLES)
        )
    if mesh.triangles.min() < 0 or mesh.triangles.max() >= len(mesh.corners):
        raise MeshError('its triangles have corners that are not there')
    used = mesh.corners[mesh.triangles]
    if not (np.isfinite(used).all() and np.abs(used).max() < FURTHEST):
        raise MeshError(
            'its corners are not all finite, or further away than {:g}'.format(FURTHEST)
        )
    return mesh


def reduced(mesh: Mesh, most: int) -> Mesh:
    """About the same mesh with at most `most` triangles (>= 12).

    Corners within a cell of a grid become one.
    """
    mesh = _merged(mesh, 0.0)
    if len(mesh.triangles) <= most:
        return mesh
    span = float(np.ptp(mesh.corners, axis=0).max())
    low, high = 0.0, span
    best = _box(mesh)
    for _ in range(9):
        cell = (low + high) / 2 if low else high / 64
        candidate = _merged(mesh, cell)
        if len(candidate.triangles) > most:
            low = cell
            continue
        high = cell
        if len(candidate.triangles):
            best = candidate
        if len(candidate.triangles) > 0.8 * most:
            break
    return best


def _merged(mesh: Mesh, cell: float) -> Mesh:
    """The mesh with the corners of each cell made one, their mean.

    Triangles that collapse are left out.

    :param cell: m. 0 means corners at the same place.
    """
    corners = mesh.corners
    low, span = corners.min(axis=0), float(np.ptp(corners, axis=0).max())
    steps = np.round((corners - low) / max(cell, span / _FINEST, 1e-12)).astype(np.int64)
    _, index = np.unique(
        (steps[:, 0] << 42) + (steps[:, 1] << 21) + steps[:, 2], return_inverse=True
    )
    index = index.reshape(-1)
    count = np.bincount(index).astype(float)
    merged = np.stack([np.bincount(index, corners[:, axis]) / count for axis in range(3)], axis=1)
    triangles = index[mesh.triangles]
    a, b, c = np.sort(triangles, axis=1).T
    kept = np.flatnonzero((a != b) & (b != c))
    if len(merged) < _FINEST:
        _, first = np.unique((a[kept] << 42) + (b[kept] << 21) + c[kept], return_index=True)
        kept = kept[np.sort(first)]
    triangles = triangles[kept]
    used, renumbered = np.unique(triangles, return_inverse=True)
    return Mesh(merged[used], renumbered.reshape(-1, 3))


def _box(mesh: Mesh) -> Mesh:
    """The box around it."""
    low, high = mesh.corners.min(axis=0), mesh.corners.max(axis=0)
    corners = (
        np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low
    )
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(
        corners, np.array([half for a, b, c, d in faces for half in ((a, b, c), (a, c, d))])
    )


def _stl(data: bytes) -> Mesh:
    count = int.from_bytes(data[80:84], 'little')
    is_text = data[:5] == b'solid' and b'facet' in data[:400]
    if len(data) >= 84 and len(data) >= 84 + count * _STL.itemsize and not is_text:
        corners = np.frombuffer(data, _STL, count, 84)['corners'].reshape(-1, 3).astype(np.float64)
    else:
        words = data.split() if len(data) <= MOST_TEXT else []
        if len(words) < 4 or words[0] != b'solid':
            raise MeshError(
                'it is no STL file, or one of text with more than {} bytes'.format(MOST_TEXT)
            )
        corners = np.array(
            [words[at + 1 : at + 4] for at, word in enumerate(words) if word == b'vertex'],
            np.float64,
        ).reshape(-1, 3)
    return Mesh(corners, np.arange(len(corners) // 3 * 3).reshape(-1, 3))


def _obj(data: bytes) -> Mesh:
    corners: List[List[float]] = []
    triangles: List[Tuple[int, int, int]] = []
    for line in data.splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == b'v':
            corners.append([float(word) for word in words[1:4]])
        elif words[0] == b'f':
            at = [int(word.split(b'/')[0]) for word in words[1:]]
            at = [each - 1 if each > 0 else len(corners) + each for each in at]
            triangles += [(at[0], one, other) for one, other in zip(at[1:], at[2:])]
            if len(triangles) > MOST_TRIANGLES:
                raise MeshError('it has more than {} triangles'.format(MOST_TRIANGLES))
    return Mesh(
        np.array(corners, float).reshape(-1, 3), np.array(triangles, np.int64).reshape(-1, 3)
    )


def _dae(data: bytes) -> Mesh:
    try:
        root = read_xml(data.decode('utf-8'), 'COLLADA', MOST_TEXT)
    except ValueError as err:
        raise MeshError(
            'it is no COLLADA file, or one with a document type or in another encoding'
        ) from err
    for element in root.iter():
        element.tag = str(element.tag).rsplit('}', 1)[-1]
    unit = root.find('asset/unit')
    scale = float(unit.get('meter', '1')) if unit is not None else 1.0
    geometries = {
        each.get('id', ''): _dae_geometry(each)
        for each in root.findall('library_geometries/geometry')
    }
    parts = list(_placed(root, geometries)) or [(np.eye(4), mesh) for mesh in geometries.values()]
    corners: List[np.ndarray] = []
    triangles: List[np.ndarray] = []
    before, total = 0, 0
    for place, mesh in parts:
        total += len(mesh.triangles)
        if total > MOST_TRIANGLES:
            raise MeshError('it has more than {} triangles'.format(MOST_TRIANGLES))
        corners.append((mesh.corners @ place[:3, :3].T + place[:3, 3]) * scale)
        triangles.append(mesh.triangles + before)
        before += len(mesh.corners)
    if not corners:
        raise MeshError('it has no geometry')
    return Mesh(np.concatenate(corners), np.concatenate(triangles))


def _placed(
    root: ElementTree.Element, geometries: Dict[str, Mesh]
) -> Iterator[Tuple[np.ndarray, Mesh]]:
    """The geometries where the scenes have them."""
    waiting = [
        (node, np.eye(4), 0)
        for scene in root.findall('library_visual_scenes/visual_scene')
        for node in scene.findall('node')
    ]
    found = 0
    while waiting:
        node, place, deep = waiting.pop()
        for element in node:
            place = place @ _dae_transform(element)
        for instance in node.findall('instance_geometry'):
            mesh = geometries.get(instance.get('url', '').lstrip('#'))
            found += 1
            if mesh is not None and len(mesh.triangles) and found <= 5000:
                yield place, mesh
        if deep < _DEEPEST:
            waiting += [(child, place, deep + 1) for child in node.findall('node')]


def _dae_transform(element: ElementTree.Element) -> np.ndarray:
    result = np.eye(4)
    if element.tag not in ('matrix', 'translate', 'rotate', 'scale'):
        return result
    values = np.array((element.text or '').split(), float)
    if element.tag == 'matrix':
        return values.reshape(4, 4)
    if element.tag == 'translate':
        result[:3, 3] = values
    elif element.tag == 'scale':
        result[:3, :3] = np.diag(values)
    else:
        axis = values[:3] / max(float(np.linalg.norm(values[:3])), 1e-12)
        result[:3, :3] = rotation_about(axis, np.radians(values[3]))
    return result


def _dae_geometry(geometry: ElementTree.Element) -> Mesh:
    mesh = geometry.find('mesh')
    if mesh is None:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    arrays = {source.get('id', ''): _floats(source) for source in mesh.findall('source')}
    vertices = mesh.find('vertices')
    inputs = vertices.findall('input') if vertices is not None else []
    places = {each.get('semantic'): each.get('source', '').lstrip('#') for each in inputs}
    corners = arrays.get(places.get('POSITION', ''), np.zeros(0))
    triangles = [np.zeros((0, 3), np.int64)]
    for kind in ('triangles', 'polylist', 'polygons'):
        triangles += [_faces(each, kind) for each in mesh.findall(kind)]
    return Mesh(corners[: len(corners) // 3 * 3].reshape(-1, 3), np.concatenate(triangles))


def _floats(source: ElementTree.Element) -> np.ndarray:
    found = source.find('float_array')
    return np.array((found.text or '').split() if found is not None else [], float)


def _faces(element: ElementTree.Element, kind: str) -> np.ndarray:
    """(n, 3) indices of corners."""
    inputs = element.findall('input')
    step = 1 + max((int(each.get('offset', '0')) for each in inputs), default=0)
    offset = next(
        (int(each.get('offset', '0')) for each in inputs if each.get('semantic') == 'VERTEX'), 0
    )
    if not 0 <= offset < step <= 100:
        raise MeshError(
            'invalid COLLADA input offset {} for stride {}; allowed: an offset from 0 '
            'below the stride, and a stride of at most 100'.format(offset, step)
        )
    lists = [
        np.array((each.text or '').split(), np.int64)[offset::step] for each in element.findall('p')
    ]
    if kind == 'triangles':
        return np.concatenate(
            [each[: len(each) // 3 * 3].reshape(-1, 3) for each in lists] or [np.zeros((0, 3), int)]
        )
    if kind == 'polylist':
        counts = element.find('vcount')
        sides = np.array((counts.text or '').split() if counts is not None else [], np.int64)
        lists = [
            part
            for each in lists
            for part in np.split(each, np.cumsum(np.clip(sides, 0, 10000)))[:-1]
        ]
    fans = [
        (each[0], one, other)
        for each in lists
        if len(each) > 2
        for one, other in zip(each[1:], each[2:])
    ]
    return np.array(fans, np.int64).reshape(-1, 3)


_READERS: Dict[str, Callable[[bytes], Mesh]] = {'stl': _stl, 'obj': _obj, 'dae': _dae}
