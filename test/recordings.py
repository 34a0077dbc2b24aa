# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files of motion capture as other programs write them, made up."""

from dataclasses import replace
import struct
import warnings

import numpy as np
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.person_file import write_person
from rrth_planner.wearer.recorded_person import excerpt

# The joint before each, its offset [cm], and the order of its rotations.
JOINTS = (
    ('hip', None, (0.0, 0.0, 0.0), 'ZYX'),
    ('chest', 'hip', (0.0, 32.0, -1.0), 'ZXY'),
    ('head', 'chest', (0.5, 29.0, -1.0), 'ZXY'),
    ('lHand', 'chest', (60.0, 16.0, 4.0), 'XYZ'),
    ('lFoot', 'hip', (9.0, -84.0, 0.0), 'YXZ'),
)
RATE = 50


def bvh_text(n_frames=12, seed=1, scale=1.0):
    """Return a BVH of JOINTS whose lengths are scaled, and the numbers of its frames."""
    rng = np.random.default_rng(seed)
    values = rng.uniform(-60.0, 60.0, (n_frames, 3 * len(JOINTS) + 3)).round(4)
    values[:, :3] *= scale

    def block(name):
        _, before, offset, order = next(joint for joint in JOINTS if joint[0] == name)
        rotations = ' '.join(f'{axis}rotation' for axis in order)
        root = 'Xposition Yposition Zposition ' if before is None else ''
        inner = [block(other) for other, parent, _, _ in JOINTS if parent == name]
        return '\n'.join(
            [
                f'{"ROOT" if before is None else "JOINT"} {name}',
                '{',
                'OFFSET ' + ' '.join(f'{scale * x:.6f}' for x in offset),
                f'CHANNELS {3 if before else 6} {root}{rotations}',
                *(inner or ['End Site', '{', f'OFFSET 0 {scale:.6f} 0', '}']),
                '}',
            ]
        )

    lines = [' '.join(f'{value:.6f}' for value in row) for row in values]
    head = f'HIERARCHY\n{block("hip")}\nMOTION\nFrames: {n_frames}\nFrame Time: {1 / RATE}\n'
    return head + '\n'.join(lines) + '\n', values


def write_c3d(path, names, positions, unit='mm', lost=()):
    """Write points (n_frames, n, 3) as a C3D; lost: (frame, point) of each that is invalid."""
    import c3d

    writer = c3d.Writer(point_rate=RATE, point_units=f'{unit:4}')
    writer.set_point_labels(names[:255])
    # The library writes one for each point, and fails where there are more than 255.
    writer.get('POINT').add_str(
        'DESCRIPTIONS', '', ' ' * min(len(names), 255), 1, min(len(names), 255)
    )
    for k in range(1, (len(names) + 254) // 255):
        some = names[255 * k : 255 * (k + 1)]
        width = max(map(len, some))
        text = ''.join(name.ljust(width) for name in some)
        writer.get('POINT').add_str(f'LABELS{k + 1}', '', text, width, len(some))
    for k, frame in enumerate(positions):
        points = np.zeros((len(names), 5), dtype=np.float32)
        points[:, :3] = frame
        for _, point in filter(lambda place: place[0] == k, lost):
            points[point, 3:] = -1.0
        writer.add_frames([(points, np.empty((0, 0)))])
    with warnings.catch_warnings(), path.open('wb') as file:
        warnings.simplefilter('ignore')
        writer.write(file)


def write_child(path):
    """Write the packaged person, of 70 % of his size, as a table of half a second."""
    person = excerpt(load_person(), 0.0, 0.5)
    write_person(replace(person, positions=0.7 * person.positions), path)
    return path


def set_frames(path, first, last):
    """Write frame numbers into a C3D as the format has them: two words, the lower one first."""
    data = bytearray(path.read_bytes())
    for name, value in ((b'ACTUAL_START_FIELD', first), (b'ACTUAL_END_FIELD', last)):
        i = data.index(name) + len(name)
        data[i + 5 : i + 9] = struct.pack('<HH', value % 65536, value // 65536)
    data[6:10] = struct.pack('<HH', min(first, 65535), min(last, 65535))
    path.write_bytes(data)
