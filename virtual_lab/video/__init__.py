"""High-speed video: from the frames of a clip to the positions and speeds of the ball.

A clip passes through the packages in this order:

* `clips`: files to frames with their times; the calibration file of a camera.
* `find`: differences of each picture from the still frame (the scene without moving objects), and
  blobs in them that may be a ball.
* `follow`: blobs to pieces of smooth motion (`pieces`), pieces to flights with one common gravity
  (`flights`), and all flights of a clip to one joint fit (`joint`); then scale, contacts, and
  doubts about them. `following` calls these steps.
* `locate`: the ball by its outline, for flights before a calibrated camera (`follow.sharpening`),
  and for the windows of a laboratory's camera (`measurement.camera`).
* `calibration`: lens, pose and scale from pictures of a board; pixels to meters in a plane.
* `show`: results as text, tables and pictures.
"""
