"""Named scenes as users film them, each with one difficulty that has misled a tracker."""

from dataclasses import replace

from tests.video.scenery.backdrop import Backdrop
from tests.video.scenery.motion import Ball, Carried, Rolling, Surface, Swinging, Thrown
from tests.video.scenery.scene import Actor, Phone, Scene

__all__ = ["LARGE", "SCENES", "UNSEEN"]

GREEN = Ball(diameter=0.080, mass=0.070, colour=(0.05, 0.72, 0.07))
RED = Ball(diameter=0.040, mass=0.024, colour=(0.06, 0.07, 0.55), facing=2)
PALE = Ball(diameter=0.070, mass=0.058, colour=(0.22, 0.42, 0.25), texture=0.2, facing=3)
TABLE_TENNIS = Ball(diameter=0.040, mass=0.0027, colour=(0.72, 0.74, 0.74), texture=0.05)

PLASTER = Backdrop()
SPECKLED = Backdrop(
    wall=(105, 108, 122),
    floor=(95, 110, 205),
    slope=(0, 25, 6),
    grain=6,
    specks=0.12,
    plates=0,
    tiles=True,
)
ROOM = Backdrop(wall=(200, 203, 203), floor=(135, 138, 145), slope=(0, 20, 4), skirting=12)
CUPBOARD = Backdrop(wall=(150, 156, 155), slope=(6, 12, 8), grain=1, joints=2, plates=1)
WINDOW = Backdrop(wall=(172, 175, 182), slope=(10, 15, 8), grain=1, joints=3, plates=2)
TABLE = Backdrop(wall=(160, 168, 170), floor=(80, 120, 160), slope=(10, 15, 5), floor_grain=3)

HELD = Phone(drift=14.0, flicker=0.01)

thrown_on_wall = Scene(
    name="thrown-on-wall",
    count=80,
    exposure=1 / 80,
    actors=(
        Actor(
            ball=GREEN,
            motion=Thrown(
                place=(-0.78, -0.05),
                velocity=(0.9, -2.3),
                released=0.5,
                arm_from=(-1.6, 0.5),
                surfaces=(Surface(at=0.46, restitution=(0.77, 0.78, 0.80)),),
            ),
        ),
    ),
    phone=Phone(distance=1.9, drift=22, flicker=0.01, noise=1.2),
    backdrop=SPECKLED,
    floor=0.46,
)
thrown_on_plaster = Scene(
    name="thrown-on-plaster",
    seed=20,
    count=105,
    exposure=1 / 120,
    actors=(
        Actor(
            ball=GREEN,
            motion=Thrown(
                place=(-0.66, -0.36),
                velocity=(0.42, -0.3),
                released=0.5,
                arm_from=(-1.4, -0.2),
                surfaces=(Surface(at=0.46, restitution=(0.76, 0.79, 0.80, 0.81), keeps=0.97),),
            ),
        ),
    ),
    phone=Phone(distance=1.9, drift=12, noise=1.0),
    backdrop=replace(PLASTER, floor=(150, 158, 165), floor_grain=9, plates=0, skirting=14),
    floor=0.46,
    wall_shadow=0.1,
)
dropped_on_carpet = Scene(
    name="dropped-on-carpet",
    seed=2,
    size=(128, 640),
    fps=120,
    file_rate=30,
    count=200,
    exposure=1 / 240,
    actors=(
        Actor(
            ball=RED,
            motion=Thrown(
                place=(-0.03, -0.72),
                velocity=(0.0, 0.0),
                released=0.35,
                arm_from=(-0.4, -0.5),
                surfaces=(Surface(at=0.72, restitution=(0.52, 0.56), keeps=0.7),),
            ),
        ),
    ),
    phone=Phone(distance=1.8, focal=680, drift=9, noise=1.2),
    backdrop=ROOM,
    floor=0.72,
    codec="mp4v",
)
carried = Scene(
    name="carried",
    seed=3,
    fps=24,
    count=80,
    exposure=1 / 50,
    actors=(Actor(ball=PALE, motion=Carried(reach=(0.15, 0.1), arm_from=(0.7, 0.25))),),
    phone=Phone(distance=0.9),
    backdrop=CUPBOARD,
)
pendulum = Scene(
    name="pendulum",
    seed=4,
    count=90,
    actors=(Actor(ball=GREEN, motion=Swinging(pivot=(0.05, -0.75), length=0.95)),),
    phone=HELD,
    backdrop=PLASTER,
)
thrown_up = Scene(
    name="thrown-up",
    seed=5,
    count=60,
    exposure=1 / 100,
    actors=(
        Actor(
            ball=PALE,
            motion=Thrown(
                place=(-0.05, 0.34),
                velocity=(0.18, -3.3),
                released=0.6,
                arm_from=(-0.7, 0.9),
                caught=0.6 + 0.66,
            ),
        ),
    ),
    phone=Phone(distance=1.7, noise=1.0),
    backdrop=WINDOW,
)
free_fall = Scene(
    name="free-fall",
    seed=6,
    fps=60,
    count=70,
    exposure=1 / 250,
    actors=(
        Actor(
            ball=GREEN,
            motion=Thrown(place=(0.05, -0.40), released=0.4, arm_from=(0.9, -0.6)),
        ),
    ),
    phone=HELD,
    backdrop=PLASTER,
)
rolling = Scene(
    name="rolling",
    seed=7,
    count=70,
    actors=(Actor(ball=GREEN, motion=Rolling(place=(-0.62, 0.16), speed=0.7)),),
    phone=Phone(drift=10),
    backdrop=TABLE,
    floor=0.20,
    mirror=0.10,
)
empty = Scene(name="empty", seed=8, count=60, phone=HELD, backdrop=CUPBOARD)
light_ball = Scene(
    name="light-ball",
    seed=9,
    size=(240, 320),
    fps=120,
    count=150,
    exposure=1 / 500,
    actors=(
        Actor(
            ball=TABLE_TENNIS,
            motion=Thrown(
                place=(-0.14, -0.38),
                velocity=(0.12, 0.0),
                released=0.12,
                arm_from=(-0.8, -0.6),
                surfaces=(Surface(at=0.42, restitution=(0.88, 0.89, 0.90)),),
            ),
        ),
    ),
    phone=Phone(distance=1.5, focal=480),
    backdrop=replace(TABLE, wall=(95, 80, 70), plates=1),
    floor=0.42,
)
glossy_floor = Scene(
    name="glossy-floor",
    seed=10,
    fps=60,
    count=90,
    exposure=1 / 200,
    actors=(
        Actor(
            ball=GREEN,
            motion=Thrown(
                place=(-0.72, -0.25),
                velocity=(0.95, -0.8),
                surfaces=(Surface(at=0.36, restitution=(0.70, 0.72)),),
            ),
        ),
    ),
    phone=Phone(drift=10),
    backdrop=replace(PLASTER, floor=(150, 160, 165), floor_grain=2.5),
    floor=0.36,
    mirror=0.30,
)
two_balls = replace(
    glossy_floor,
    name="two-balls",
    seed=11,
    mirror=0.0,
    actors=(
        *glossy_floor.actors,
        Actor(
            ball=RED,
            motion=Thrown(
                place=(0.70, -0.40),
                velocity=(-0.55, -0.6),
                surfaces=(Surface(at=0.36, restitution=(0.6,)),),
            ),
        ),
    ),
)
against_wall = Scene(
    name="against-wall",
    seed=12,
    fps=240,
    count=110,
    exposure=1 / 500,
    actors=(
        Actor(
            ball=GREEN,
            motion=Thrown(
                place=(-0.60, 0.05),
                velocity=(3.4, -1.2),
                surfaces=(Surface(kind="right", at=0.55, restitution=(0.72,)),),
            ),
        ),
    ),
    phone=Phone(drift=6),
    backdrop=PLASTER,
)
doubled = replace(
    thrown_on_plaster, name="doubled", seed=13, count=75, stored="doubled", codec="mp4v"
)
repeated = replace(thrown_on_wall, name="repeated", seed=14, stored="repeated", codec="VP80")
squeezed = replace(thrown_on_plaster, name="squeezed", seed=21, jpeg=20)
lossless = replace(thrown_up, name="lossless", seed=22, codec="FFV1", jpeg=100)
pictures = replace(free_fall, name="pictures", seed=23, codec="PNG", jpeg=100)
thinned = replace(thrown_on_wall, name="thinned", seed=15, stored="thinned")
lost = replace(thrown_on_wall, name="lost", seed=16, stored="lost", codec="VP80")
rolling_shutter = replace(
    thrown_on_wall,
    name="rolling-shutter",
    seed=17,
    phone=replace(thrown_on_wall.phone, readout=0.025),
)
tilted = replace(
    glossy_floor,
    name="tilted",
    seed=18,
    mirror=0.0,
    phone=Phone(drift=10, pitch=28, yaw=12, focal=390, distance=1.7),
)
upright = replace(light_ball, name="upright", seed=19, rotation=90, codec="mp4v")

# scene for measuring time and memory, not for tests
LARGE = replace(
    thrown_on_wall,
    name="large",
    seed=24,
    size=(1920, 1080),
    fps=80,
    count=216,
    exposure=1 / 160,
    phone=replace(thrown_on_wall.phone, focal=2025, drift=60, blur=1.2),
    backdrop=replace(SPECKLED, grain_size=3.0),
    codec="mp4v",
)

SCENES = {
    scene.name: scene
    for scene in (
        thrown_on_wall,
        thrown_on_plaster,
        dropped_on_carpet,
        carried,
        pendulum,
        thrown_up,
        free_fall,
        rolling,
        empty,
        light_ball,
        glossy_floor,
        two_balls,
        against_wall,
        doubled,
        repeated,
        squeezed,
        lossless,
        pictures,
        thinned,
        lost,
        rolling_shutter,
        tilted,
        upright,
    )
}

# scenes for which the tracker was not tuned, in a phone's H.264
PHONED = Phone(drift=14.0, flicker=0.01, noise=1.2)
BOUNCING = Surface(at=0.46, restitution=(0.77, 0.78, 0.80))
GREY = Ball(diameter=0.070, mass=0.060, colour=(0.42, 0.43, 0.44), texture=0.08)


def _thrown(name: str, **changes: object) -> Scene:
    motion = {key: changes.pop(key) for key in list(changes) if key in Thrown.__annotations__}
    actor = Actor(
        ball=changes.pop("ball", GREEN), motion=replace(thrown_on_wall.actors[0].motion, **motion)
    )
    defaults = {"phone": PHONED, "backdrop": PLASTER, "actors": (actor,), "codec": "H264"}
    return replace(thrown_on_wall, name=name, **(defaults | changes))


UNSEEN = {
    scene.name: scene
    for scene in (
        _thrown(
            "far-away",
            size=(640, 360),
            count=110,
            fps=60,
            exposure=1 / 240,
            phone=replace(PHONED, distance=6.0, focal=800, drift=20),
            place=(-1.2, -0.3),
            velocity=(0.7, 0.0),
            surfaces=(replace(BOUNCING, at=1.0),),
            floor=1.0,
        ),
        _thrown(
            "across",
            fps=60,
            count=70,
            exposure=1 / 250,
            place=(-1.3, 0.1),
            velocity=(3.2, -1.9),
            released=0.25,
            arm_from=None,
            surfaces=(),
        ),
        _thrown("lobbed", place=(-0.5, 0.3), velocity=(0.45, -4.2), fps=60, count=110),
        _thrown(
            "off-a-table",
            fps=60,
            count=100,
            exposure=1 / 200,
            place=(-0.1, -0.25),
            velocity=(0.55, 0.0),
            released=0.9,
            rolls=True,
            arm_from=None,
        ),
        replace(
            two_balls,
            name="two-alike",
            codec="H264",
            actors=(two_balls.actors[0], replace(two_balls.actors[1], ball=GREEN)),
        ),
        _thrown(
            "caught",
            fps=60,
            count=90,
            exposure=1 / 200,
            place=(-0.3, -0.35),
            velocity=(0.25, 0.0),
            arm_from=(-1.2, -0.4),
            caught=1.12,
        ),
        _thrown("window", phone=replace(PHONED, window=0.25, mains=0.02), fps=60, count=160),
        _thrown(
            "lamp", fps=240, count=300, exposure=1 / 960, phone=replace(PHONED, mains=0.25, drift=6)
        ),
        _thrown(
            "grey-on-grey",
            fps=60,
            count=150,
            exposure=1 / 120,
            ball=GREY,
            backdrop=replace(PLASTER, floor=(158, 160, 162), wall=(95, 90, 88)),
            velocity=(0.6, -1.9),
            surfaces=(replace(BOUNCING, at=0.25),),
            floor=0.0,
        ),
        _thrown("sharp", size=(960, 540), phone=replace(PHONED, focal=1250, blur=0.35, drift=30)),
        _thrown("at-25", fps=25, count=66),
        _thrown("slow-motion", fps=240, file_rate=30, count=300, exposure=1 / 500, rate_said=False),
        _thrown(
            "zoomed",
            size=(640, 480),
            fps=240,
            count=240,
            exposure=1 / 1000,
            phone=replace(PHONED, distance=2.0, focal=3750, drift=8, blur=1.5),
            place=(-0.1, -0.05),
            velocity=(0.12, 0.0),
            released=0.2,
            arm_from=(-0.6, -0.3),
            surfaces=(replace(BOUNCING, at=0.12),),
            floor=0.12,
        ),
        _thrown("tiny", phone=replace(PHONED, focal=225, distance=2.1), fps=60, count=150),
        _thrown("blurred", exposure=1 / 31, place=(-0.70, 0.0), velocity=(1.1, -2.4)),
        _thrown("rolled", phone=replace(PHONED, turn=1.4, growth=0.006, drift=40)),
        _thrown("panned", phone=replace(PHONED, pan=90.0, drift=6), fps=60, count=140),
        _thrown(
            "turned-after",
            phone=replace(PHONED, pan=150.0, drift=0),
            backdrop=SPECKLED,
            count=70,
            place=(0.2, -0.05),
            arm_from=(-0.8, 0.5),
        ),
        _thrown("stamped", stored="lost", true_stamps=True),
        _thrown("hevc", codec="HEVC"),
        _thrown(
            "portrait",
            size=(240, 426),
            rotation=90,
            fps=60,
            count=120,
            place=(-0.2, -0.1),
            velocity=(0.22, -1.2),
        ),
        _thrown(
            "into-a-corner",
            fps=120,
            count=170,
            exposure=1 / 400,
            place=(-0.6, -0.2),
            velocity=(1.9, -0.4),
            surfaces=(BOUNCING, Surface(kind="right", at=0.5, restitution=(0.7,))),
        ),
    )
}
