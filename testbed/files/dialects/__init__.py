"""How other programs write: Spatial Analyzer, controllers of robots, numbers with commas."""
