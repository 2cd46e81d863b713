"""Keys in the table of a law, with their types and descriptions."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pbem.description.values import NotNegative, PartOrWhole, Positive, ResidualAngle, RoughnessNumber
from pbem.description.varying import Angle

LawName = Annotated[
    Literal["bonded", "coulomb", "open", "frictionless", "rate_and_state", "cohesive", "barton_bandis", "custom"]
    | None,
    Field(
        description='default: `"bonded"` for a curve of two regions and `"coulomb"` for a crack; `"open"`: the '
        'faces never touch; `"rate_and_state"`: friction coefficient f0 + a ln(V/V0) + b ln(V0 theta/L) at the slip '
        'rate V and the state theta, with d theta/dt = 1 - V theta/L; `"cohesive"`: bonds that soften with opening and '
        'slip; `"barton_bandis"`: rock joints, whose friction angle phi_r + JRC log10(JCS/sigma) falls with the '
        'normal stress; `"custom"`: see `pbem help laws`'
    ),
]
FractureEnergy = Annotated[
    Positive | None,
    Field(description="of `cohesive`: energy per area of separation in tension, stress times length"),
]
ShearFractureEnergy = Annotated[
    Positive | None,
    Field(description="the same in shear; by default that in tension (as the shear strength is that in tension)"),
]
Softening = Annotated[
    Literal["linear", "exponential", "constant"] | None,
    Field(description='decrease of the tractions; by default `"linear"`; `"constant"`: none until the bond is lost'),
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
        description="of `barton_bandis`: largest closure V, length; `normal_stiffness` is then the initial stiffness "
        "K in sigma = K v/(1 - v/V)"
    ),
]
DilationAngle = Annotated[
    Angle | None,
    Field(
        description="of `coulomb`: slip pushes the faces apart by the tangent of this angle, degrees; at most the "
        "angle of friction"
    ),
]
DilationSlip = Annotated[
    Positive | None, Field(description="... over this length of slip, in either direction; by default unlimited")
]
DilationPart = Annotated[
    PartOrWhole | None,
    Field(
        description="of `barton_bandis`: the dilation angle is this fraction of JRC log10(JCS/sigma), 0.5 under high "
        "and 1 under low stress; requires `peak_slip`"
    ),
]
PeakSlip = Annotated[
    Positive | None,
    Field(
        description="of `barton_bandis`: slip at which dilation is steepest; about a hundredth of the joint length"
    ),
]
RateEffect = Annotated[Positive | None, Field(description="a of `rate_and_state`: increase of friction with ln V")]
StateEffect = Annotated[
    NotNegative | None, Field(description="b of `rate_and_state`: increase of friction with ln theta")
]
ReferenceRate = Annotated[Positive | None, Field(description="V0 of `rate_and_state`, length/time")]
InitialState = Annotated[
    Positive | None,
    Field(description="theta of `rate_and_state` at the start, time; by default `slip_distance/reference_rate`"),
]
