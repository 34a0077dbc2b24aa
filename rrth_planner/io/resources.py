# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files that come with the package, found in a source tree and when installed."""

from pathlib import Path
import sys

from rrth_planner.model.errors import ModelError


def resource_path(name: str) -> Path:
    """
    Return where a file of the package is.

    Parameters
    ----------
    name : str
        Relative to the project's root, as `config/arm.yaml`.

    Raises
    ------
    ModelError
        It is neither beside the package nor in the share folder of an installation.

    """
    folders = [Path(__file__).parents[2], *_share_folders()]
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise ModelError(f'file {name}: not found, expected in one of {[str(f) for f in folders]}')


def _share_folders() -> list[Path]:
    folders = [Path(sys.prefix) / 'share' / 'rrth_planner']
    try:
        # Only where ROS 2 is: the core also works without.
        from ament_index_python.packages import get_package_share_directory

        folders.insert(0, Path(get_package_share_directory('rrth_planner')))
    except (ImportError, LookupError, OSError):
        pass
    return folders
