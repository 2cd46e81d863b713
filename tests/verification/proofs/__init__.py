"""Problems with known answers. `scripts/verify.py` prints what the program makes of them, tests hold the tolerances."""

from tests.verification.proofs import closed_cracks, cracks
from tests.verification.proofs.proof import Outcome, Proof

PROOFS: tuple[Proof, ...] = (
    *cracks.PROOFS,
    *closed_cracks.PROOFS,
)

__all__ = ["PROOFS", "Outcome", "Proof"]
