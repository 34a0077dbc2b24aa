# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Hours of requests, beside a monitor of what is published."""
