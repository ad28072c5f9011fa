"""Simple bodies with textbook solutions."""

from virtual_lab.catalog.specs import BatBody, HoopMode, Lump, Material, Profile


def rod(
    diameters: tuple[float, ...] = (0.05, 0.05),
    length: float = 1.0,
    *,
    wall: float | None = None,
    density: float = 700.0,
    youngs_modulus: float = 1e10,
    shear_modulus: float = 1e9,
    shear_coefficient: float = 0.9,
    lumps: tuple[Lump, ...] = (),
    hoop: HoopMode | None = None,
) -> BatBody:
    """Return a body with evenly spaced stations; two stations make a straight outline."""
    last = len(diameters) - 1
    return BatBody(
        profile=Profile(
            z=tuple(length * i / last for i in range(last + 1)),
            outer_diameter=diameters,
            wall=None if wall is None else (wall,) * (last + 1),
        ),
        material=Material(
            density=density,
            youngs_modulus=youngs_modulus,
            shear_modulus=shear_modulus,
            shear_coefficient=shear_coefficient,
        ),
        damping_ratio=0.0,
        lumps=lumps,
        hoop=hoop,
    )


def rigid_rod(hoop: HoopMode | None = None) -> BatBody:
    """Return a rod that is heavy and stiff enough to act as a wall."""
    return rod((0.5, 0.5), density=1e9, youngs_modulus=1e16, shear_modulus=4e15, hoop=hoop)
