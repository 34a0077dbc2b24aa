# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files that come with the package, found in a source tree and however it is installed."""

from pathlib import Path

from rrth_planner.model.errors import ModelError

PACKAGE = Path(__file__).parents[1]


def resource_path(name: str) -> Path:
    """
    Return where a file is that is named relative to the project's root, as `config/arm.yaml`.

    Raise ModelError where it is neither in the package, as pip installs it, nor beside it, as in
    a source tree, nor in its share folder, as colcon installs it.
    """
    folders = [PACKAGE, PACKAGE.parent, *_share_folder()]
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise ModelError(f'file {name}: not found, expected in one of {[str(f) for f in folders]}')


def _share_folder() -> list[Path]:
    try:
        # Only where ROS 2 is: the core also works without.
        from ament_index_python.packages import get_package_share_directory

        return [Path(get_package_share_directory(PACKAGE.name))]
    except (ImportError, LookupError, OSError):
        return []
