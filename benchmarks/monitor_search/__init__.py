# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Search for an order of events after which the monitor of a moving arm does wrong."""
