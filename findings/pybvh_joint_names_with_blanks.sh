#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
#
# pybvh 0.9.0: names of joints with a blank, as Biped skeletons have ("Bip01 Head").
#
# Guess: the name is the rest of the line after JOINT, as the viewers of BVH take it.
# Seen: it is cut at the first blank, so that all joints of such a skeleton have the same name.
# Ends with 0 while that is so, and with 1 once it has changed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pybvh==0.9.0 numpy==2.2.6
"$folder/env/bin/python" - "$folder/biped.bvh" <<'PYTHON'
from pathlib import Path
import sys

import pybvh

TURNS = 'Zrotation Xrotation Yrotation'
Path(sys.argv[1]).write_text(f"""HIERARCHY
ROOT Bip01 Pelvis
{{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition {TURNS}
JOINT Bip01 Head
{{
OFFSET 0 60 0
CHANNELS 3 {TURNS}
End Site
{{
OFFSET 0 20 0
}}
}}
}}
MOTION
Frames: 1
Frame Time: 0.04
0 0 0 0 0 0 0 0 0
""")
names = list(pybvh.read_bvh_file(sys.argv[1], world_up='+y').joint_names)
print(f'pybvh {pybvh.__version__}: {names}')
raise SystemExit(0 if names == ['Bip01', 'Bip01'] else 1)
PYTHON
