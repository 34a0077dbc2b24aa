# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A monitored arm beside a wearer in virtual time: a seed gives the same run, to the bit."""
