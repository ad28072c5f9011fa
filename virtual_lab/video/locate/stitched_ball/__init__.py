"""A stitched or shaded ball: its outline fitted, a pattern of unknown strength at the rim."""
