"""Keys in the table of a law, their types and what they say: its name, and those of bonds that soften."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pbem.description.values import NotNegative, Positive, ResidualAngle

LawName = Annotated[
    Literal["bonded", "coulomb", "open", "frictionless", "rate_and_state", "cohesive", "barton_bandis", "custom"]
    | None,
    Field(
        description='without this key `"bonded"` for a curve of two regions and `"coulomb"` for a crack; `"open"`: the '
        'faces never touch; `"rate_and_state"`: friction coefficient f0 + a ln(V/V0) + b ln(V0 theta/L) at the slip '
        'rate V and the state theta, with d theta/dt = 1 - V theta/L; `"cohesive"`: bonds that soften with opening and '
        'slip; `"barton_bandis"`: rock joints, whose friction angle phi_r + JRC log10(JCS/sigma) falls with the '
        'normal stress; `"custom"`: see `pbem help laws`'
    ),
]
FractureEnergy = Annotated[
    Positive | None,
    Field(description="of `cohesive`: energy per area that parting in tension takes, stress times length"),
]
ShearFractureEnergy = Annotated[
    Positive | None,
    Field(description="the same in shear; that in tension if not given (and the shear strength the tensile one)"),
]
Softening = Annotated[
    Literal["linear", "exponential", "constant"] | None,
    Field(description='how tractions fall; `"linear"` if not given; `"constant"`: not at all until the bond is lost'),
]
ResidualFrictionAngle = Annotated[
    ResidualAngle | None,
    Field(description="of `barton_bandis`: friction angle of smooth, weathered faces, degrees; below 70"),
]
Roughness = Annotated[
    NotNegative | None, Field(description="of `barton_bandis`: joint roughness coefficient, degrees; 0 (smooth) to 20")
]
WallStrength = Annotated[
    Positive | None, Field(description="of `barton_bandis`: compressive strength of the joint's walls, stress")
]
Closure = Annotated[
    Positive | None,
    Field(
        description="of `barton_bandis`: largest closure V, length; `normal_stiffness` is then that at the beginning, "
        "K in sigma = K v/(1 - v/V)"
    ),
]
