#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
#
# c3d 0.6.0: a trial that begins after frame 65,535, as long sessions cut into pieces do.
#
# Guess: TRIAL:ACTUAL_START_FIELD and ACTUAL_END_FIELD, two words each, are read alike.
# Seen: the high word of the start counts 65,535 and that of the end 65,536, so that a trial of 8
# frames has 9, and the last one is what stands behind the data: zeros.
# Ends with 0 while that is so, and with 1 once it has changed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check c3d==0.6.0 numpy==2.2.6
"$folder/env/bin/python" -W ignore - "$folder/late.c3d" <<'PYTHON'
from importlib.metadata import version
from pathlib import Path
import struct
import sys

import c3d
import numpy as np

file, n, start = Path(sys.argv[1]), 8, 70_000
writer = c3d.Writer(point_rate=100.0)
writer.set_point_labels(['a', 'b', 'c'])
for _ in range(n):
    writer.add_frames([(np.full((3, 5), 500.0, np.float32), np.array([]))])
with file.open('wb') as handle:
    writer.write(handle)
data = bytearray(file.read_bytes())
for name, value in ((b'ACTUAL_START_FIELD', start), (b'ACTUAL_END_FIELD', start + n - 1)):
    # The format: the low word first.
    at = data.index(name) + len(name) + 5
    data[at : at + 4] = struct.pack('<HH', value % 65536, value // 65536)
data[6:10] = struct.pack('<HH', 65535, 65535)
file.write_bytes(data)
with file.open('rb') as handle:
    reader = c3d.Reader(handle)
    frames = [points[:, :3] for _, points, _ in reader.read_frames()]
    print(f'c3d {version("c3d")}: first {reader.first_frame}, last {reader.last_frame}, frames {len(frames)}')
print('last frame:', frames[-1][0].tolist())
raise SystemExit(0 if reader.first_frame == start - 1 and len(frames) == n + 1 else 1)
PYTHON
