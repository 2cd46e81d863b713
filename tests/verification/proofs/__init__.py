"""Problems with known answers. `scripts/verify.py` prints what the program makes of them, tests hold the tolerances."""

from tests.verification.proofs import (
    closed_cracks,
    conforming,
    contact,
    crack_fields,
    cracks,
    hertz,
    inclusions,
    invariance,
    layers,
    panels,
    samples,
    shear_contact,
)
from tests.verification.proofs.proof import Outcome, Proof

PROOFS: tuple[Proof, ...] = (
    *cracks.PROOFS,
    *closed_cracks.PROOFS,
    *inclusions.PROOFS,
    *hertz.PROOFS,
    *conforming.PROOFS,
    *shear_contact.PROOFS,
    *contact.PROOFS,
    *samples.PROOFS,
    *panels.PROOFS,
    *layers.PROOFS,
    *invariance.PROOFS,
    *crack_fields.PROOFS,
)

__all__ = ["PROOFS", "Outcome", "Proof"]
