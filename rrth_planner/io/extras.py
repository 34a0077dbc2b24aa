# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Optional libraries, and the extras of the package that install them."""

from importlib.util import find_spec

from rrth_planner.model.errors import NotInstalledError

ROS = 'rclpy'


def require(extras: str, *libraries: str) -> None:
    """
    Raise NotInstalledError where libraries, named as they are imported, are missing.

    It names them and the extras of the package that install them, as `ros,tools`.
    """
    missing = [name for name in libraries if find_spec(name) is None]
    if not missing:
        return
    them = 'it' if len(missing) == 1 else 'them'
    how = f"install {them} with: pip install 'rrth_planner[{extras}]'"
    if ROS in missing:
        missing[missing.index(ROS)] = f'ROS 2 Jazzy ({ROS})'
        how = f'source ROS, or {how}'
    raise NotInstalledError(f'needs {", ".join(missing)}; {how}')
