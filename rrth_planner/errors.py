# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a broken contract raises: what was given, what was expected, the unit."""


class RrthError(Exception):
    """Base of every error that this package raises on purpose."""


class ModelError(RrthError):
    """An arm that cannot be planned for."""


class SceneError(RrthError):
    """A box, target or map that describes nothing physical."""


class OptionsError(RrthError):
    """A planner option or motion limit outside its range."""


class MessageError(RrthError):
    """Input from the wire that is refused."""


class RecordError(RrthError):
    """A record of an incident that says too little, too much or nothing."""
