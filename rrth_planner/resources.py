# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files that come with the package, found in a source tree and when installed."""

from pathlib import Path
import sys

from rrth_planner.arm import arm_from_mapping, ArmModel
from rrth_planner.errors import ModelError
from rrth_planner.text_files import parse_yaml, read_text


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
    folders = [Path(__file__).parent.parent, *_share_folders()]
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise ModelError(f'file {name}: not found, expected in one of {[str(f) for f in folders]}')


def load_arm(path: str | Path | None = None) -> ArmModel:
    """
    Return the arm that a YAML file describes, laid out as `config/arm.yaml`.

    Parameters
    ----------
    path : str or Path, optional
        None or empty: the packaged arm.

    Raises
    ------
    ModelError
        The file cannot be read, or describes no arm.

    """
    file = Path(path) if path else resource_path('config/arm.yaml')
    text = read_text(file)
    if text.lstrip().startswith('<'):
        raise ModelError(
            f'file {file}: XML, as a URDF is, expected an arm laid out as config/arm.yaml; '
            'read_urdf writes one from a URDF'
        )
    data = parse_yaml(text, f'file {file}')
    try:
        return arm_from_mapping(data)
    except ModelError as problem:
        raise ModelError(f'file {file}: {problem}') from problem


def _share_folders() -> list[Path]:
    folders = [Path(sys.prefix) / 'share' / 'rrth_planner']
    try:
        # Only where ROS 2 is: the core also works without.
        from ament_index_python.packages import get_package_share_directory

        folders.insert(0, Path(get_package_share_directory('rrth_planner')))
    except (ImportError, LookupError, OSError):
        pass
    return folders
