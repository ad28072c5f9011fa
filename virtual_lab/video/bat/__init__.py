"""The bat in a clip: its outline at rest, its angle by frame, its recoil."""
