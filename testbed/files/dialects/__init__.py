"""Files of other programs that are no tables: exports of Spatial Analyzer, programs in RAPID."""
