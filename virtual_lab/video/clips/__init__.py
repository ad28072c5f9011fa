"""Clips out of files: frames one at a time, when each was taken, what is known and seen of them."""
