# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One module a command: its arguments; with the standard library alone it prints --help."""
