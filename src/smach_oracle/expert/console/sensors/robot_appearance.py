"""The looks of a robot in a browser: its geometries once, then the poses of its links. No node."""

import hashlib
import json
import struct
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from smach_oracle.geometry.meshes import Mesh, MeshError, reduced
from smach_oracle.geometry.robot_shapes import RobotShapes, Shape, read_shapes

from ..shapes.sensors import GeometryView, ModelHeaderView
from .clouds import vector
from .images import BrowserFile
from .mesh_files import MeshFiles

MOST_TRIANGLES = 28000  # that a browser draws, over all links
LEAST_TRIANGLES = 40  # of a mesh that has more
MOST_ROUND = 300  # shapes of a robot whose cylinders and spheres are drawn round
MOST_CORNERS = 65536  # of a geometry
MOST_NAMED = 20  # meshes that are missing
_ROUND = 16  # sides of a cylinder


class LinkGeometry(NamedTuple):
    """A geometry at a link."""

    link: str
    geometry: int
    place: np.ndarray  # 4x4, link from geometry, with its scale
    colour: Tuple[int, int, int]


class RobotAppearance:
    """The geometries and links of one robot description."""

    def __init__(self, urdf: str, files: Optional[MeshFiles] = None) -> None:
        """Read the meshes, which takes some seconds.

        :raises ValueError: for text that is no URDF, or too large a one.
        """
        self.version = version_of(urdf)
        self.robot: RobotShapes = read_shapes(urdf)
        self.missing: List[str] = []
        self._geometries: List[Mesh] = []
        self._parts: List[LinkGeometry] = []
        self._add_all(files or MeshFiles())
        drawn = {part.link for part in self._parts}
        self.links = [link for link in self.robot.links if link in drawn]

    def places(self, positions: Mapping[str, float]) -> np.ndarray:
        """Poses of `links` in the root: (links, 12) float32, each the rows of (3, 4)."""
        poses = self.robot.poses(positions)
        return np.array([poses[link][:3] for link in self.links], '<f4').reshape(-1, 12)

    def encoded(self) -> BrowserFile:
        """Return the appearance as one file.

        uint32 length of a text, that text (JSON, filled up to four bytes), then corners and
        triangles of each geometry: (n, 3) uint16 within `offset` and `offset + scale`, and (m, 3)
        uint16.
        """
        numbers = {link: index for index, link in enumerate(self.links)}
        blocks: List[bytes] = []
        geometries: List[GeometryView] = []
        for mesh in self._geometries:
            low = mesh.corners.min(axis=0)
            span = np.maximum(np.ptp(mesh.corners, axis=0), 1e-9)
            blocks += [
                np.round((mesh.corners - low) / span * 65535).astype('<u2').tobytes(),
                mesh.triangles.astype('<u2').tobytes(),
            ]
            geometries.append(
                {
                    'corners': len(mesh.corners),
                    'triangles': len(mesh.triangles),
                    'offset': vector(low),
                    'scale': vector(span),
                }
            )
        header: ModelHeaderView = {
            'name': self.robot.name,
            'version': self.version,
            'root': self.robot.root,
            'links': self.links,
            'geometries': geometries,
            'missing': self.missing[:MOST_NAMED],
            'lost': len(self.missing),
            'parts': [
                (
                    numbers[part.link],
                    part.geometry,
                    _plain(part.place[:3].ravel()),
                    part.colour,
                )
                for part in self._parts
            ],
        }
        text = json.dumps(header, allow_nan=False, separators=(',', ':')).encode()
        text += b' ' * (-len(text) % 4)
        return BrowserFile(
            'application/octet-stream', b''.join([struct.pack('<I', len(text)), text] + blocks), {}
        )

    def _add_all(self, files: MeshFiles) -> None:
        shapes, meshes = self._found(files)
        most = _share([len(meshes[shape.mesh].triangles) for shape in shapes if shape.mesh])
        round_as = {} if len(shapes) <= MOST_ROUND else {'cylinder': 'box', 'sphere': 'box'}
        known: Dict[str, int] = {}
        for shape in shapes:
            name = shape.mesh or round_as.get(shape.kind, shape.kind)
            if name not in known:
                known[name] = len(self._geometries)
                self._geometries.append(
                    _fitting(meshes[name], most) if shape.mesh else _PRIMITIVES[name]
                )
            place = shape.origin @ np.diag(list(shape.size) + [1.0])
            self._parts.append(LinkGeometry(shape.link, known[name], place, shape.colour))

    def _found(self, files: MeshFiles) -> Tuple[List[Shape], Dict[str, Mesh]]:
        """The shapes that can be drawn, and their meshes.

        Where a mesh of a link is missing, its collision shapes are drawn in its place.
        """
        meshes: Dict[str, Mesh] = {}
        poor = {shape.link for shape in self.robot.shapes if not self._has(shape, files, meshes)}
        shapes = [shape for shape in self.robot.shapes if not shape.mesh or shape.mesh in meshes]
        shapes += [
            shape
            for shape in self.robot.collisions
            if shape.link in poor and self._has(shape, files, meshes)
        ]
        return shapes, meshes

    def _has(self, shape: Shape, files: MeshFiles, meshes: Dict[str, Mesh]) -> bool:
        if not shape.mesh or shape.mesh in meshes:
            return True
        try:
            meshes[shape.mesh] = files.mesh(shape.mesh)
        except MeshError as err:
            problem = '{}: {}'.format(shape.mesh[:200], err)
            if problem not in self.missing:
                self.missing.append(problem)
            return False
        return True


def version_of(urdf: str) -> str:
    """Return a digest that differs between robot descriptions."""
    return hashlib.sha256(urdf.encode('utf-8', 'replace')).hexdigest()[:16]


def _share(counts: List[int]) -> int:
    """The most triangles that each mesh may have, so that all together stay within the limit."""
    left, waiting = MOST_TRIANGLES, len(counts)
    for count in sorted(counts):
        if count > left // waiting:
            return max(left // waiting, LEAST_TRIANGLES)
        left, waiting = left - count, waiting - 1
    return MOST_TRIANGLES


def _fitting(mesh: Mesh, most: int) -> Mesh:
    found = reduced(mesh, most)
    return found if len(found.corners) <= MOST_CORNERS else reduced(mesh, MOST_CORNERS // 3)


def _plain(values: Iterable[float]) -> List[float]:
    return [round(float(value), 6) for value in values]


def _box() -> Mesh:
    """A box of 1 m. The other primitives have that size, too."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(
        corners, np.array([half for a, b, c, d in faces for half in ((a, b, c), (a, c, d))])
    )


def _turned(profile: List[Tuple[float, float]]) -> Mesh:
    """A profile of (radius, height), turned about z."""
    angles = np.arange(_ROUND) * 2 * np.pi / _ROUND
    rings = [
        np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(_ROUND, height)])
        for radius, height in profile
    ]
    steps = [
        (ring * _ROUND + k, ring * _ROUND + (k + 1) % _ROUND)
        for ring in range(len(profile) - 1)
        for k in range(_ROUND)
    ]
    return Mesh(
        np.concatenate(rings),
        np.array(
            [half for a, b in steps for half in ((a, b, b + _ROUND), (a, b + _ROUND, a + _ROUND))]
        ),
    )


_PRIMITIVES = {
    'box': _box(),
    'cylinder': _turned([(0.0, -0.5), (0.5, -0.5), (0.5, 0.5), (0.0, 0.5)]),
    'sphere': _turned(
        [(0.5 * np.sin(angle), -0.5 * np.cos(angle)) for angle in np.linspace(0, np.pi, 9)]
    ),
}
