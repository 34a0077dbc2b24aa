# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a request to a proven motion, or to one sentence that says why there is none."""
