"""The mesh files that a robot description names, found on this machine and read as meshes alone.

Names come from the parameter server, never from a browser. `package://NAME/PATH` is looked for
within that package. An absolute path (with or without file://) is read where it ends as a mesh does
and is a plain file of a mesh's size.
"""

import os
import stat
from typing import Dict, Optional
from urllib.parse import unquote

import rospkg

from smach_oracle.geometry.meshes import MOST_BYTES, Mesh, MeshError, read_mesh

MOST_BYTES_TOGETHER = 400000000  # of one robot's
_KINDS = ('stl', 'obj', 'dae')


class MeshFiles:
    """The mesh files of one robot. Each is read once."""

    def __init__(self, packages: Optional[rospkg.RosPack] = None) -> None:
        """`packages`: where to look for them. None means ROS_PACKAGE_PATH."""
        self._packages = packages
        self._read: Dict[str, Mesh] = {}
        self._bytes = 0

    def mesh(self, name: str) -> Mesh:
        """Return the mesh of a file name as a URDF has it.

        :raises MeshError: for a name that is not allowed, and where the file is not there or no
            mesh.
        """
        path = self._path(name)
        if path not in self._read:
            self._read[path] = self._from(path)
        return self._read[path]

    def _path(self, name: str) -> str:
        if '\0' in name or len(name) > 2000:
            raise MeshError('it is no file name')
        if name.startswith('package://'):
            return self._in_package(unquote(name[len('package://') :]))
        path = unquote(name[len('file://') :]) if name.startswith('file://') else name
        if not os.path.isabs(path) or '\0' in path:
            raise MeshError('it is neither package://NAME/PATH nor an absolute path')
        return path

    def _in_package(self, name: str) -> str:
        package, _, path = name.partition('/')
        if (
            not package
            or not path
            or '\0' in path
            or '..' in name.split('/')
            or os.path.isabs(path)
        ):
            raise MeshError('it does not stay within a package')
        if self._packages is None:
            self._packages = rospkg.RosPack()
        try:
            return os.path.join(self._packages.get_path(package), path)
        except rospkg.ResourceNotFound as err:
            raise MeshError('there is no package {} here'.format(package[:60])) from err

    def _from(self, path: str) -> Mesh:
        kind = path.rsplit('.', 1)[-1].lower()
        if kind not in _KINDS:
            raise MeshError('it ends with .{}; readable: .{}'.format(kind[:20], ', .'.join(_KINDS)))
        try:
            with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), 'rb') as file:
                status = os.fstat(file.fileno())
                self._bytes += status.st_size
                if (
                    not stat.S_ISREG(status.st_mode)
                    or status.st_size > MOST_BYTES
                    or self._bytes > MOST_BYTES_TOGETHER
                ):
                    raise MeshError(
                        'it is no plain file of at most {} bytes ({} with the others)'.format(
                            MOST_BYTES, MOST_BYTES_TOGETHER
                        )
                    )
                data = file.read(MOST_BYTES + 1)
        except OSError as err:
            raise MeshError(os.strerror(err.errno or 0)) from err
        return read_mesh(data, kind)
