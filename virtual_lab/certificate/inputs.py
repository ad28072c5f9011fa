"""What a budget calls the constants it rests on."""

from __future__ import annotations

__all__ = ["INPUTS", "STAGES"]

STAGES = {"bench": "Bench", "balls": "Wall rig", "impact": "Bat rig", "hall": "Hall"}
INPUTS = {  # name of a constant, of any stage: words, unit of print, SI times this gives it
    "hits": ("Scatter from hit to hit", "", 1.0),
    "choice of the place": ("Choice of the place", "", 1.0),
    "control.restitution_ratio": ("Control bat with this lot of balls", "", 1.0),
    "bat.mass": ("Bat mass, readings", "g", 1e3),
    "bat.length": ("Bat length, readings", "mm", 1e3),
    "bat.balance": ("Balance point, readings", "mm", 1e3),
    "bat.barrel_radius": ("Barrel radius, readings", "mm", 1e3),
    "bat.period": ("Pendulum period, readings", "ms", 1e3),
    "balls.repeatability": ("Ball restitution, wall hits of each ball", "", 1.0),
    "balls.slope_repeatability": ("Fall of ball restitution with speed, wall hits", "s/m", 1.0),
    "procedure.place_slope_error": ("Slope of e_A along the barrel, at the aim", "", 1.0),
    "ball.radius": ("Ball radius", "mm", 1e3),
    "ball.restitution_slope": ("Fall of ball restitution with speed", "s/m", 1.0),
    "scale.zero": ("scale, zero", "g", 1e3),
    "scale.span": ("scale, span", "ppm", 1e6),
    "rule.offset": ("rule, offset", "mm", 1e3),
    "stand.offset": ("balance stand, offset", "mm", 1e3),
    "pendulum.clock": ("pendulum, clock rate", "ppm", 1e6),
    "pendulum.amplitude_offset": ("pendulum, amplitude reading", "mrad", 1e3),
    "pendulum.pivot_from_knob": ("pendulum, axis to knob", "mm", 1e3),
    "pendulum.clamp_inertia": ("pendulum, inertia of the clamp", "g m²", 1e3),
    "pendulum.clamp_moment": ("pendulum, balance of the clamp", "g m", 1e3),
    "hall.gravity": ("Hall: gravity", "mm/s²", 1e3),
    "gates.clock": ("light gates, clock rate", "ppm", 1e6),
    "air.density": ("air density", "kg/m³", 1.0),
    "air.drag_coefficient": ("drag coefficient of the ball", "", 1.0),
    "pivot.from_knob": ("pivot to knob", "mm", 1e3),
    "pivot.height": ("bat above the line of fire", "mm", 1e3),
    "swing.scale": ("encoder of the swing, scale", "ppm", 1e6),
    "cannon.along": ("cannon, aim along the bat", "mm", 1e3),
    "aim.across_square": ("cannon, mean square aim across the bat", "mm²", 1e6),
    "camera.clock": ("camera, clock rate", "ppm", 1e6),
    "camera.focal": ("camera, focal length", "px", 1.0),
    "camera.plane": ("camera, height of the line of fire", "mm", 1e3),
    "camera.place_x": ("camera, place along the flight", "mm", 1e3),
    "camera.place_y": ("camera, place along the bat", "mm", 1e3),
    "camera.place_z": ("camera, height", "mm", 1e3),
    "encoder.scale": ("encoder, scale", "ppm", 1e6),
}
