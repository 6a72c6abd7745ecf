"""The figures: one module each, with `draw` on data and `write` from files to files."""
