# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Statistics of durations, for diagnostics."""

import math

# Durations are counted in bins: bins in a decade, decades, and where the first begins [s].
BINS, DECADES, SHORTEST = 48, 8, 1e-6


class Figures:
    """A count, and statistics of a duration: the last, quantiles, the greatest [s]."""

    def __init__(self) -> None:
        """Begin with nothing done."""
        self.n, self.last, self.most = 0, 0.0, 0.0
        # Of constant size, however long the node runs.
        self._counts = [0] * (BINS * DECADES)

    def add(self, elapsed: float) -> None:
        """Count one more, with its duration [s]."""
        self.n, self.last, self.most = self.n + 1, elapsed, max(self.most, elapsed)
        ratio = min(max(elapsed / SHORTEST, 1.0), 10.0**DECADES)
        self._counts[min(math.ceil(BINS * math.log10(ratio)), len(self._counts) - 1)] += 1

    def quantile(self, share: float) -> float:
        """Return what a share of the durations do not exceed, rounded up by at most 5 % [s]."""
        wanted, seen = share * self.n, 0
        for k, count in enumerate(self._counts):
            seen += count
            if count and seen >= wanted:
                return min(self.most, SHORTEST * 10.0 ** (k / BINS))
        return self.most

    def __str__(self) -> str:
        """Return the figures in a line."""
        shown = {
            'last': self.last,
            'p50': self.quantile(0.5),
            'p99': self.quantile(0.99),
            'at most': self.most,
        }
        return ', '.join([str(self.n), *(f'{k} {1e3 * v:.3f} ms' for k, v in shown.items())])
