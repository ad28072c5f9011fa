"""High-speed video: from the frames of a clip to where the ball was and how fast it went.

A clip goes through the rooms in this order:

* `clips`: files to frames with their times; the calibration file of a camera.
* `find`: what differs from the still frame, in each picture: blobs that may be a ball.
* `follow`: blobs to pieces of smooth motion (`pieces`), pieces to flights of one gravity
  (`flights`), all flights of a clip to one joint fit (`joint`); then a ruler, contacts, and what
  speaks against them. `following` leads through.
* `locate`: the ball by its outline, for flights before a calibrated camera (`follow.sharpening`),
  and for the windows of a laboratory's camera (`measurement.camera`).
* `calibration`: lens, pose and scale from pictures of a board; pixels to metres in a plane.
* `show`: results as text, tables and pictures.
"""
