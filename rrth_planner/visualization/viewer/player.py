# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Playback of a motion on the page."""

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True, kw_only=True)
class Player:
    """
    Playback state within a motion; immutable.

    Parameters
    ----------
    duration, time : float
        Of the motion, and within it [s].
    share : float
        Share of the last motion that was played, where there is none now [-].
    speed : float
        How much faster than the clock, > 0 [-].

    """

    duration: float = 0.0
    time: float = 0.0
    share: float = 0.0
    speed: float = 1.0
    is_playing: bool = False
    is_repeating: bool = False

    def advanced(self, elapsed: float) -> 'Player':
        """Return the state after some time by the clock [s]; playing stops at the end."""
        if not self.is_playing:
            return self
        if self.time >= self.duration and self.is_repeating:
            return replace(self, time=0.0)
        time = min(self.duration, self.time + self.speed * elapsed)
        return replace(self, time=time, is_playing=time < self.duration or self.is_repeating)

    def toggled(self) -> 'Player':
        """Return it with playing toggled; at the end it restarts from the beginning."""
        is_anew = self.time >= self.duration and not self.is_playing
        return replace(self, time=0.0 if is_anew else self.time, is_playing=not self.is_playing)

    def moved(self, time: float) -> 'Player':
        """Return it paused at another time of the motion [s]."""
        return replace(self, time=min(max(0.0, time), self.duration), is_playing=False)

    def at_end(self) -> 'Player':
        """Return it at the end of the motion, or of the next one where there is none."""
        return replace(self, time=self.duration, share=1.0)

    def aimed(self) -> 'Player':
        """Return it for another target: at the end if paused at the beginning."""
        return self if self.is_playing or self.time > 0.0 else self.at_end()

    def loaded(self, duration: float) -> 'Player':
        """Return it in another motion [s]: restarted when playing, else at the same share."""
        share = self.time / self.duration if self.duration > 0.0 else self.share
        time = 0.0 if self.is_playing else share * duration
        return replace(self, duration=duration, time=time, share=share)
