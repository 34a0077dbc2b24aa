# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a request to a certified motion, or to a rejection with its reason."""
