"""What the first rank keeps through a run to write the results, beside its share of the matrices."""

from __future__ import annotations

from pathlib import Path

from pbem.mesh.generate import generate_mesh
from pbem.results.writer import ResultWriter
from tests.parallel.held_arrays import list_arrays
from tests.unit.case_sample import build
from tests.unit.test_uniform import FIELD


def test_the_writer_keeps_neither_faces_nor_elements_of_all_tips(tmp_path: Path) -> None:
    """For each unknown 16 bytes of laws, 8 of weights, 10 of tips, 4 of the order of pairs; the places, normals and
    numbers of all faces would be 77 more."""
    model = build(FIELD.replace("count = 12", "count = 150").replace("12, 12", "50, 50"))
    mesh = generate_mesh(model)
    with ResultWriter(tmp_path / "field.h5", model, mesh, 1, "3.18", []) as writer:
        seen: set[int] = set()
        list_arrays((model, mesh), seen)
        forms = [group.forms for group in writer.tip_rules.groups]
        of_forms = list_arrays(forms, seen)
        held = [each for each in list_arrays(vars(writer), seen) if any(each.strides)]
    assert sum(each.nbytes for each in held) < 42 * 2 * mesh.nodes
    assert not any(each.dtype.kind == "c" and each.size >= mesh.nodes for each in held)
    # No array of the forms of a kind of tips grows with the number of tips.
    largest = max(form.release.size for form in forms)
    assert len(forms) < 0.1 * 300 and max(each.size for each in of_forms) <= largest
