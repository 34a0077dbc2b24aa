# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Loaded machine code without what only a compiler reads."""

from typing import Any

from numba.core.codegen import JITCodeLibrary, ll
from numba.core.registry import cpu_target


class SlimLibrary(JITCodeLibrary):
    """
    What numba has of a kernel: its code, and its module when others are compiled against it.

    numba unpacks that module of each kernel that it loads, and keeps it: 45 MB of the 235
    MB of a process that plans, and never compiles anything.
    """

    _bitcode: bytes | None = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        library = super()._unserialize(codegen, state)
        _, kind, data = state
        if kind == 'object':
            _, library._bitcode = data
            library._shared_module = None
        return library

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None and self._bitcode is not None:
            self._shared_module = ll.parse_bitcode(self._bitcode)
        return super()._get_module_for_linking()


def use_slim_libraries() -> None:
    """Have numba load all further code of this process so."""
    cpu_target.target_context.codegen()._library_class = SlimLibrary
