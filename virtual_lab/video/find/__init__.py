"""Motion before a still background: drift of the picture, differences, outlines of blobs."""
