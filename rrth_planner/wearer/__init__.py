# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as trackers see him: from skeletons to boxes, and recorded people."""
