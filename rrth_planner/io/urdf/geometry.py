# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The geometry of a link of a URDF, as triangles."""

from contextlib import suppress
import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from rrth_planner.io.extras import require
from rrth_planner.io.urdf.chain import TOOLS
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import ModelError, shown

# colcon does not install it; an error says so when a file is read.
with suppress(ImportError):
    import trimesh

# The kinds of mesh files that are read.
MESHES = ('.dae', '.obj', '.stl')
MOST_TRIANGLES = 2_000_000
# Sides of the prism around a cylinder.
N_SIDES = 64


def parts_of(link: Any, geometry: str) -> list[Any]:
    """
    Return what a link is enclosed by: its collisions or, with `visual`, what is seen of it.

    With `visual`, a link that is not seen has its collisions.
    """
    return list((geometry == 'visual' and link.visuals) or link.collisions)


def link_triangles(link: Any, file: Path, geometry: str = 'collision') -> tuple[Array, ...]:
    """
    Return the surfaces of a link, in its own frame, (n, 3, 3) each [m].

    Cylinders and spheres are polyhedra around them.

    Parameters
    ----------
    link : yourdfpy.Link
        With what the file says of it.
    file : Path
        The URDF: names of mesh files begin at its folder, packages at a folder above.
    geometry : str
        Which surfaces: collision or visual, as in `parts_of`.

    Raises
    ------
    ModelError, NotInstalledError
        A mesh that cannot be read, or a size that is none; what reads it is missing.

    """
    found = []
    for k, part in enumerate(parts_of(link, geometry)):
        label = f'link "{link.name}": {geometry} geometry {k}'
        T = np.eye(4) if part.origin is None else np.asarray(part.origin)
        triangles = _triangles(part.geometry, file, label)
        found.append(np.asarray(triangles @ T[:3, :3].T + T[:3, 3]))
    return tuple(found)


def _triangles(geometry: Any, file: Path, label: str) -> Array:
    """Return the surface of a geometry in its own frame, (n, 3, 3) [m]."""
    if geometry is None:
        raise ModelError(f'{label}: nothing, expected a box, capsule, cylinder, sphere or mesh')
    if geometry.box is not None:
        return box_triangles(_sizes(geometry.box.size, (3,), f'{label}: size of the box'))
    if geometry.cylinder is not None:
        sizes = [geometry.cylinder.radius, geometry.cylinder.length]
        radius, length = _sizes(sizes, (2,), f'{label}: radius and length of the cylinder')
        return cylinder_triangles(radius, length)
    if geometry.sphere is not None:
        radius = _sizes([geometry.sphere.radius], (1,), f'{label}: radius of the sphere')[0]
        return sphere_triangles(radius)
    mesh = geometry.mesh
    scale = 1.0 if mesh.scale is None else mesh.scale
    scale = [scale] * 3 if np.ndim(scale) == 0 else scale
    scale = frozen_array(scale, (3,), f'{label}: scale', '-', ModelError, FARTHEST)
    if not mesh.filename:
        raise ModelError(f'{label}: no file name, expected that of a mesh')
    return mesh_triangles(mesh_file(mesh.filename, file, label), label) * scale


def _sizes(values: Any, shape: tuple[int], label: str) -> Array:
    sizes = frozen_array(values, shape, label, 'm', ModelError, FARTHEST)
    if not (sizes > 0.0).all():
        raise ModelError(f'{label}: {sizes.tolist()}, expected lengths > 0 [m]')
    return sizes


def box_triangles(size: Array) -> Array:
    """Return the surface of a box around the origin, its full size (3,) -> (12, 3, 3) [m]."""
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    index = [(a, *pair) for a, b, c, d in sides for pair in ((b, c), (c, d))]
    result: Array = corners[index] * size
    return result


def cylinder_triangles(radius: float, length: float) -> Array:
    """Return the surface of a prism around a cylinder along z, (n, 3, 3) [m]."""
    angles = 2.0 * np.pi * np.arange(N_SIDES) / N_SIDES
    # Sides meet the cylinder, edges are outside.
    ring = radius / np.cos(np.pi / N_SIDES) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    low, high = (np.column_stack([ring, np.full(N_SIDES, z)]) for z in (-length / 2, length / 2))
    middle = np.zeros((N_SIDES, 3))
    triangles = [
        (low, np.roll(low, -1, axis=0), high),
        (np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high),
        *((middle + end.mean(axis=0), end, np.roll(end, -1, axis=0)) for end in (low, high)),
    ]
    return np.concatenate([np.stack(corners, axis=1) for corners in triangles])


def sphere_triangles(radius: float) -> Array:
    """Return the surface of a polyhedron around a sphere at the origin, (n, 3, 3) [m]."""
    triangles = np.array(trimesh.creation.icosphere(subdivisions=3, radius=1.0).triangles)
    a, b, c = np.moveaxis(triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    heights = (a * normals).sum(axis=1) / np.linalg.norm(normals, axis=1)
    result: Array = triangles * (radius / np.abs(heights).min())
    return result


def mesh_file(name: str, file: Path, label: str) -> Path:
    """
    Return where a mesh file is that a URDF names, or raise ModelError.

    `package://` is looked for in the folders above the URDF, with and without the name of the
    package, in those of ROS_PACKAGE_PATH, which hold packages, and where AMENT_PREFIX_PATH leads.
    """
    scheme, _, rest = name.rpartition('://')
    if scheme not in ('', 'file', 'package', 'model'):
        raise ModelError(f'{label}: mesh {shown(name)}, expected a file, or package://...')
    folder = file.resolve().parent
    tried = [folder / rest]
    if scheme in ('package', 'model'):
        inner = rest.partition('/')[2]
        tried = [above / path for path in (rest, inner) for above in (folder, *folder.parents)]
        tried += [path / rest for path in _paths('ROS_PACKAGE_PATH')]
        tried += [path / 'share' / rest for path in _paths('AMENT_PREFIX_PATH')]
    for path in tried:
        # What no file can be called raises.
        with suppress(OSError, ValueError):
            if path.is_file():
                return path
    if scheme in ('package', 'model'):
        raise ModelError(
            f'set ROS_PACKAGE_PATH to the folder that has the folder "{rest.partition("/")[0]}": '
            f'{label}: no mesh "{name}" in or above {folder}'
        )
    raise ModelError(f'{label}: no mesh "{name}" at {folder}; expected a file')


def _paths(variable: str) -> list[Path]:
    """Return the folders that a variable of the environment names."""
    return [Path(path) for path in os.environ.get(variable, '').split(os.pathsep) if path]


def mesh_triangles(path: Path, label: str) -> Array:
    """Return the triangles of a mesh file, (n, 3, 3) [m], or raise ModelError."""
    kind = path.suffix.lower()
    if kind not in MESHES:
        raise ModelError(f'{label}: file {path}, expected one of {", ".join(MESHES)}')
    if kind == '.dae':
        require('tools', *TOOLS, 'collada')
    try:
        mesh: Any = trimesh.load(path, force='mesh', process=False, skip_materials=True)
        unit = collada_unit(path) if kind == '.dae' else 1.0
        triangles = unit * np.asarray(mesh.triangles, dtype=np.float64)
    # Each format has a reader of its own, and each reader errors of its own.
    except Exception as problem:
        said = ' '.join(f'{type(problem).__name__}: {problem}'.split())
        raise ModelError(f'{label}: file {path}: {said}; expected a readable mesh') from problem
    if not 0 < len(triangles) <= MOST_TRIANGLES:
        raise ModelError(
            f'{label}: file {path}: {len(triangles)} triangles, expected 1 to {MOST_TRIANGLES}'
        )
    if not np.abs(triangles).max() <= FARTHEST:
        raise ModelError(f'{label}: file {path}, expected corners of at most {FARTHEST:g} [m]')
    return triangles


def collada_unit(path: Path) -> float:
    """Return how long the units of a COLLADA file are [m]; up_axis is ignored, as ROS does."""
    for _, element in ElementTree.iterparse(path, events=('start',)):
        if element.tag.rpartition('}')[2] == 'unit':
            return float(element.get('meter', '1'))
    return 1.0
