"""Nests on the floor: how the station moved between rounds, and its drift off the readings."""
