"""Keys in the table of a law, their types and what they say: its name, and those of bonds that soften."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pbem.description.values import FrictionAngle, NotNegative, PartOrWhole, Positive, ResidualAngle, RoughnessNumber

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
    RoughnessNumber | None,
    Field(description="of `barton_bandis`: joint roughness coefficient, degrees; 0 (smooth) to 20"),
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
DilationAngle = Annotated[
    FrictionAngle | None,
    Field(
        description="of `coulomb`: slip pushes the faces apart by the tangent of this angle, degrees; at most the "
        "angle of friction"
    ),
]
DilationSlip = Annotated[
    Positive | None, Field(description="... over this length of slip, in either direction; without end if not given")
]
DilationPart = Annotated[
    PartOrWhole | None,
    Field(
        description="of `barton_bandis`: the dilation angle is this part of JRC log10(JCS/sigma), 0.5 under high and 1 "
        "under low stress; needs `peak_slip`"
    ),
]
PeakSlip = Annotated[
    Positive | None,
    Field(
        description="of `barton_bandis`: slip at which dilation is steepest, length; about a hundredth of the joint's"
    ),
]
RateEffect = Annotated[Positive | None, Field(description="a of `rate_and_state`: how friction rises with ln V")]
StateEffect = Annotated[
    NotNegative | None, Field(description="b of `rate_and_state`: how friction rises with ln theta")
]
ReferenceRate = Annotated[Positive | None, Field(description="V0 of `rate_and_state`, length/time")]
InitialState = Annotated[
    Positive | None,
    Field(description="theta of `rate_and_state` at the start, time; `slip_distance/reference_rate` if not given"),
]
