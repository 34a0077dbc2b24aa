# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded people beside an arm in virtual time, for as many hours as asked."""
