"""Missions: patterns of straight legs, plans around a home, and the files ground stations exchange."""
