#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
#
# rosbags 0.11.9: a sensor_msgs/msg/JointState without efforts, as rclpy of ROS 2 Jazzy with Fast
# DDS serializes it, and the definition of its header in IDL, as ROS installs it.
#
# Guess: both are read, as they are by rclpy and by Foxglove.
# Seen: the message is rejected ("CDR message size mismatch"): Fast CDR reserves room to align the
# elements of a last sequence<double> that has none, here 4 bytes, and rosbags takes up to 3 bytes
# more than it reads. The definition is rejected for its #include ("Could not parse").
# Ends with 0 while that is so, and with 1 once it has changed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check rosbags==0.11.9
"$folder/env/bin/python" - <<'PYTHON'
from rosbags.typesys import Stores, get_types_from_idl, get_typestore

# Names a, b; positions 1, 2; velocities 0.5, 0.25; no efforts; 4 bytes that mean nothing.
JOINTS = bytes.fromhex(
    '00010000 00000000 00000000 01000000 00000000 02000000 02000000 61000000 02000000 62000000'
    '02000000 000000000000f03f 0000000000000040'
    '02000000 00000000 000000000000e03f 000000000000d03f 00000000 00000000'
)
# As installed at share/std_msgs/msg/Header.idl, without comments.
HEADER = """
#include "builtin_interfaces/msg/Time.idl"

module std_msgs {
  module msg {
    struct Header {
      builtin_interfaces::msg::Time stamp;

      string frame_id;
    };
  };
};
"""


def outcome(label, read):
    try:
        print(f'{label}: read {read()}')
    except Exception as problem:
        said = ' '.join(f'{type(problem).__name__}: {problem}'.split())
        print(f'{label}: {said[:90]}')
        return True
    return False


store, kind = get_typestore(Stores.ROS2_JAZZY), 'sensor_msgs/msg/JointState'
assert not outcome('without the last 4 bytes', lambda: store.deserialize_cdr(JOINTS[:-4], kind))
assert not outcome('IDL without that line', lambda: get_types_from_idl(HEADER.partition('idl"')[2]))
rejected = [
    outcome('joint states without efforts', lambda: store.deserialize_cdr(JOINTS, kind)),
    outcome('IDL with #include', lambda: get_types_from_idl(HEADER)),
]
raise SystemExit(0 if all(rejected) else 1)
PYTHON
