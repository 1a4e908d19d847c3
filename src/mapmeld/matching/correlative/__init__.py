"""The default matcher: correlation of walls and floor, alignment, and a calibrated probability."""
