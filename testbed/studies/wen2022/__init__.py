"""Wen et al. 2022 played again: one robot, many robots, and what the paper claims."""
