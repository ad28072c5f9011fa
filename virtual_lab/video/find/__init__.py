"""What moves before a still background: the drift of the picture, differences, outlines of blobs."""
