"""Flights with one thing changed."""

from __future__ import annotations

from dataclasses import replace

from dslam_mav import Flight


def changed(flight, change):
    return Flight(tuple(change(j, leg) for j, leg in enumerate(flight.legs)), closed=flight.closed)


def changed_readings(flight, change):
    return changed(flight, lambda j, leg: replace(leg, reading=change(j, leg.reading)))
