"""Motion in front of a still background: drift of the picture, differences, outlines of blobs."""
