"""How other programs write: exports of Spatial Analyzer, programs in RAPID, numbers with commas."""
