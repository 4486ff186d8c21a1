"""Mesh files of round things: PyBullet shades its own badly, and leaks the memory of others."""

import os
import tempfile
from functools import lru_cache
from typing import List, Tuple

import numpy as np

from smach_oracle.pr2.model.pr2_model import pr2_files

SIDES = 36  # of a cylinder
ROUND_SIDES, ROUND_RINGS = 24, 11  # of something round
SQUARENESS = 3.0  # 2 is a ball, more is nearer to a cylinder


@lru_cache(maxsize=1)
def drum() -> str:
    """A file with a cylinder of radius and height 1 and sharp edges.

    Two processes may write it at once.
    """
    angles = np.arange(SIDES) * 2 * np.pi / SIDES
    lines = [
        'v {:.6f} {:.6f} {}'.format(np.cos(angle), np.sin(angle), z)
        for z in (-0.5, 0.5)
        for angle in angles
    ]
    lines += ['vn {:.6f} {:.6f} 0'.format(np.cos(angle), np.sin(angle)) for angle in angles] + [
        'vn 0 0 -1',
        'vn 0 0 1',
    ]
    for k in range(SIDES):
        low, after = k + 1, (k + 1) % SIDES + 1
        side = [
            '{}//{}'.format(point, normal)
            for point, normal in (
                (low, low),
                (after, after),
                (SIDES + after, after),
                (SIDES + low, low),
            )
        ]
        lines += [
            'f {} {} {}'.format(side[0], side[1], side[2]),
            'f {} {} {}'.format(side[0], side[2], side[3]),
        ]
        if 0 < k < SIDES - 1:
            lines.append('f 1//{0} {2}//{0} {1}//{0}'.format(SIDES + 1, low, after))
            lines.append(
                'f {3}//{0} {1}//{0} {2}//{0}'.format(
                    SIDES + 2, SIDES + low, SIDES + after, SIDES + 1
                )
            )
    return _written('cylinder.obj', lines)


@lru_cache(maxsize=1)
def egg() -> str:
    """A file with a rounded thing of 1 by 1 by 1, between a ball and a cylinder.

    Two processes may write it at once.
    """
    heights = np.radians(np.linspace(-90.0, 90.0, ROUND_RINGS + 2))
    power = 2 / SQUARENESS
    wide, high = (
        np.cos(heights).clip(0.0) ** power / 2,
        np.sign(heights) * np.abs(np.sin(heights)) ** power / 2,
    )
    points, normals = [], []
    for radius, z in zip(wide, high):
        for angle in np.arange(ROUND_SIDES) * 2 * np.pi / ROUND_SIDES:
            out = np.array([np.cos(angle), np.sin(angle), 0.0])
            normal = out * radius ** (SQUARENESS - 1) + [
                0.0,
                0.0,
                np.sign(z) * abs(z) ** (SQUARENESS - 1),
            ]
            points.append('v {:.6f} {:.6f} {:.6f}'.format(*(radius * out + [0.0, 0.0, z])))
            normals.append('vn {:.6f} {:.6f} {:.6f}'.format(*(normal / np.linalg.norm(normal))))
    faces = []
    for ring in range(ROUND_RINGS + 1):
        for k in range(ROUND_SIDES):
            low, after = ring * ROUND_SIDES + k + 1, ring * ROUND_SIDES + (k + 1) % ROUND_SIDES + 1
            faces += [
                'f {0}//{0} {1}//{1} {2}//{2}'.format(low, after, after + ROUND_SIDES),
                'f {0}//{0} {1}//{1} {2}//{2}'.format(low, after + ROUND_SIDES, low + ROUND_SIDES),
            ]
    return _written('egg.obj', points + normals + faces)


@lru_cache(maxsize=None)
def turned(name: str, profile: Tuple[Tuple[float, float], ...]) -> str:
    """A file with a thing of 1 by 1 by 1 as from a lathe. Two processes may write it at once.

    :param name: of the file, without its ending.
    :param profile: radius and height, 0 to 0.5 and -0.5 to 0.5, from the lowest ring to the
        highest. Convex, for physics fills what is not.
    """
    rings = np.array(profile)
    angles = np.arange(SIDES) * 2 * np.pi / SIDES
    lines = [
        'v {:.6f} {:.6f} {:.6f}'.format(radius * np.cos(angle), radius * np.sin(angle), z)
        for radius, z in rings
        for angle in angles
    ]
    normals, faces = ['vn 0 0 -1', 'vn 0 0 1'], []
    for ring, (low, high) in enumerate(zip(rings[:-1], rings[1:])):
        out = np.array([high[1] - low[1], low[0] - high[0]])
        out /= np.linalg.norm(out)
        first, base = len(normals) + 1, ring * SIDES + 1
        normals += [
            'vn {:.6f} {:.6f} {:.6f}'.format(out[0] * np.cos(angle), out[0] * np.sin(angle), out[1])
            for angle in angles
        ]
        for k in range(SIDES):
            after = (k + 1) % SIDES
            side = [
                '{}//{}'.format(base + point, first + normal)
                for point, normal in (
                    (k, k),
                    (after, after),
                    (SIDES + after, after),
                    (SIDES + k, k),
                )
            ]
            faces += ['f {} {} {}'.format(*side[:3]), 'f {0} {2} {3}'.format(*side)]
    top = (len(rings) - 1) * SIDES + 1
    for k in range(1, SIDES - 1):
        faces += [
            'f 1//1 {}//1 {}//1'.format(k + 2, k + 1),
            'f {0}//2 {1}//2 {2}//2'.format(top, top + k, top + k + 1),
        ]
    return _written(name + '.obj', lines + normals + faces)


def _written(name: str, lines: List[str]) -> str:
    path = pr2_files().urdf.parent.parent / name
    handle, draft = tempfile.mkstemp(dir=str(path.parent))
    with os.fdopen(handle, 'w', encoding='utf-8') as file:
        file.write('\n'.join(lines) + '\n')
    os.replace(draft, str(path))
    return str(path)
