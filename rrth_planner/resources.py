# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files that come with the package, found in a source tree and when installed."""

from pathlib import Path
import sys
from typing import Any

from rrth_planner.arm import arm_from_mapping, ArmModel
from rrth_planner.errors import ModelError
import yaml


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


class _UniqueKeys(yaml.SafeLoader):  # type: ignore[misc]
    """YAML whose keys are said once: of two, the first would be dropped without a word."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        """Return a mapping, or raise MarkedYAMLError where a key comes again."""
        keys = [key.value for key, _ in node.value if key.tag != 'tag:yaml.org,2002:merge']
        for i, key in enumerate(keys):
            if isinstance(key, str) and key in keys[:i]:
                raise yaml.MarkedYAMLError(problem=f'{key} twice', problem_mark=node.start_mark)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        return mapping


def load_yaml(path: str | Path) -> Any:
    """
    Return what a YAML file holds.

    Raises
    ------
    ModelError
        It cannot be read, or a mapping in it has a key twice.

    """
    try:
        return yaml.load(Path(path).read_text(encoding='utf-8'), _UniqueKeys)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as problem:
        reason = ' '.join(str(problem).split())
        raise ModelError(f'file {path}: {reason}; expected a readable YAML file') from problem


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
    if _begins_as_xml(file):
        raise ModelError(
            f'file {file}: XML, as a URDF is, expected an arm laid out as config/arm.yaml; '
            'read_urdf writes one from a URDF'
        )
    try:
        return arm_from_mapping(load_yaml(file))
    except ModelError as problem:
        if str(file) in str(problem):
            raise
        raise ModelError(f'file {file}: {problem}') from problem


def _begins_as_xml(path: Path) -> bool:
    try:
        with path.open('rb') as file:
            return file.read(100).removeprefix(b'\xef\xbb\xbf').lstrip().startswith(b'<')
    except OSError:
        # What cannot be read is said by what reads it.
        return False


def _share_folders() -> list[Path]:
    folders = [Path(sys.prefix) / 'share' / 'rrth_planner']
    try:
        # Only where ROS 2 is: the core also works without.
        from ament_index_python.packages import get_package_share_directory

        folders.insert(0, Path(get_package_share_directory('rrth_planner')))
    except (ImportError, LookupError, OSError):
        pass
    return folders
