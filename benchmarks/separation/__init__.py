# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
