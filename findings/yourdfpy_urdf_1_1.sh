#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
#
# yourdfpy 0.0.60: a URDF of version 1.1, with quat_xyzw in an origin.
#
# Guess: it reads the rotation, or rejects the file, as it does one with the <capsule> of 1.1.
# Seen: it reads the file without an error or a warning and leaves the rotation out, so that what
# stands on it is elsewhere.
# Ends with 0 while that is so, and with 1 once it has changed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check \
    yourdfpy==0.0.60 numpy==2.2.6
cat > "$folder/arm.urdf" <<'URDF'
<robot name="arm" version="1.1"><link name="base"/>
<link name="tip"/>
<joint name="j" type="fixed"><parent link="base"/><child link="tip"/>
<origin xyz="0 0 0.3" quat_xyzw="0 0.7071067811865476 0 0.7071067811865476"/></joint></robot>
URDF
"$folder/env/bin/python" - "$folder/arm.urdf" <<'PYTHON'
import sys

import numpy as np
import yourdfpy

model = yourdfpy.URDF.load(sys.argv[1], load_meshes=False, build_scene_graph=False)
rotation = model.robot.joints[0].origin[:3, :3]
print(f'rotation of the joint {rotation.tolist()}, expected a quarter turn about y')
raise SystemExit(0 if np.array_equal(rotation, np.eye(3)) else 1)
PYTHON
