"""`pbem import` of meshes as partitioning, crack plugins and other hands leave them."""

from __future__ import annotations

import cmath
import math
import re
import struct
import tomllib
from pathlib import Path
from typing import Any

import pytest

from pbem.cli import main
from tests.cli.gmsh_binary import PACKED, unpack
from tests.cli.gmsh_sample import Mesh, make_block, make_polygon, make_row, write_2, write_4, write_parts

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bring_in(text: str) -> dict[str, Any]:
    """The tables of the case of a mesh."""
    Path("mesh.msh").write_text(text, encoding="utf-8")
    assert main(["import", "mesh.msh", "-o", "made.toml", "--force"]) == 0
    return tomllib.loads(Path("made.toml").read_text(encoding="utf-8"))


def refuse(text: str | bytes, capsys: Capture) -> str:
    """What is said of a mesh that is refused."""
    Path("mesh.msh").write_bytes(text if isinstance(text, bytes) else text.encode())
    assert main(["import", "mesh.msh", "-o", "made.toml", "--force"]) == 2
    return capsys.readouterr().err


def name_again(mesh: Mesh, names: dict[tuple[int, int], str]) -> Mesh:
    """The mesh with other names of its groups."""
    return mesh[0], mesh[1], mesh[2], {**mesh[3], **names}


def test_a_mesh_in_partitions_has_the_groups_of_the_whole() -> None:
    # Left and right half; the lower and the upper one are of two materials.
    block = make_block(2, 2)
    whole = bring_in(write_4(block))
    parts = bring_in(write_parts(block, lambda z: 1 if z.real < 0.5 else 2))
    assert parts["regions"] == whole["regions"] and parts["materials"] == whole["materials"]
    for name, curve in whole["curves"].items():
        assert sorted(parts["curves"][name]["points"]) == sorted(curve["points"])
        assert parts["curves"][name]["elements"] == curve["elements"]


def test_one_file_of_a_mesh_in_several_is_refused(capsys: Capture) -> None:
    said = refuse(write_parts(make_block(2, 2), lambda z: 1 if z.real < 0.5 else 2, kept=[2]), capsys)
    assert "found surface elements of partition 2, none of partition 1; expected the whole mesh in one file" in said


@pytest.mark.parametrize("ghosts", [True, False])
def test_one_file_of_several_of_version_2_is_refused_or_told(ghosts: bool, capsys: Capture) -> None:
    # Number of partitions of an element, its own one, and with a minus sign others that have it as a ghost.
    lines = write_2(make_row()).splitlines()
    first = lines.index("$Elements") + 2
    for number in range(first, lines.index("$EndElements")):
        index, kind, _, group, entity, *nodes = lines[number].split()
        tags = ["5", group, entity, "2", "3", "-1"] if ghosts else ["4", group, entity, "1", "3"]
        lines[number] = " ".join([index, kind, *tags, *nodes])
    text = "\n".join(lines) + "\n"
    if ghosts:
        assert "found surface elements of partition 3, none of partition 1" in refuse(text, capsys)
    else:
        assert list(bring_in(text)["regions"]) == ["ends.1", "ends.2", "core"]
        assert "All surface elements are of partition 3" in capsys.readouterr().out


@pytest.mark.parametrize("version", PACKED)
def test_binary_meshes_are_read_as_texts_are(version: str, capsys: Capture) -> None:
    Path("mesh.msh").write_bytes(unpack(version))
    assert main(["import", "mesh.msh", "-o", "made.toml"]) == 0
    tables = tomllib.loads(Path("made.toml").read_text(encoding="utf-8"))
    assert {name: sorted(table["boundary"]) for name, table in tables["regions"].items()} == {
        "first": ["first_edge.1", "first_edge.2", "left", "seam"],
        "zweiter Körper": ["right", "seam", "zweiter Körper_edge.1", "zweiter Körper_edge.2"],
    }
    ends = {name: sorted(map(tuple, tables["curves"][name]["points"])) for name in ("left", "seam", "right")}
    assert ends == {name: [(x, 0), (x, 1)] for name, x in (("left", 0), ("seam", 1), ("right", 2))}
    # Both are in another group as well, which is told in files of all kinds.
    said = capsys.readouterr().out
    assert "Of the physical line 'ends' 2 elements have the name of 'left', 'right' instead." in said


def test_comments_of_any_length_may_precede_a_binary_mesh(capsys: Capture) -> None:
    data = b"$Comments\n" + 60 * b"made by hand\n" + b"$EndComments\n" + unpack("4.1")
    Path("mesh.msh").write_bytes(data)
    assert main(["import", "mesh.msh", "-o", "made.toml"]) == 0
    assert len(tomllib.loads(Path("made.toml").read_text(encoding="utf-8"))["regions"]) == 2


@pytest.mark.parametrize("version", PACKED)
def test_binary_meshes_that_are_cut_short_are_refused_with_the_byte(version: str, capsys: Capture) -> None:
    data = unpack(version)
    end = data.rindex(b"$EndElements")
    for count in (*range(30, end, 37), end - 1, end + 5):
        found = int(re.search(r"byte (\d+): found", refuse(data[:count], capsys)).group(1))  # type: ignore[union-attr]
        assert 0 < found <= count + 1


def test_binary_meshes_with_other_orders_of_bytes_and_wrong_numbers(capsys: Capture) -> None:
    data = unpack("2.2")
    head, _, nodes = data.partition(b"$Nodes\n")
    count, _, rest = nodes.partition(b"\n")
    records = struct.iter_unpack("<i3d", rest[:28 * int(count)])
    swapped = b"".join(struct.pack(">i3d", *each) for each in records)
    words = rest[28 * int(count):].partition(b"$Elements\n")
    number, _, elements = words[2].partition(b"\n")
    end = elements.index(b"\n$EndElements")
    turned = b"".join(elements[k:k + 4][::-1] for k in range(0, end, 4))
    other = (head.replace(b"\1\0\0\0", b"\0\0\0\1") + b"$Nodes\n" + count + b"\n" + swapped + words[0]
             + b"$Elements\n" + number + b"\n" + turned + elements[end:])
    Path("mesh.msh").write_bytes(other)
    assert main(["import", "mesh.msh", "-o", "made.toml"]) == 0
    Path("first.msh").write_bytes(data)
    assert main(["import", "first.msh", "-o", "first.toml"]) == 0
    made, first = (tomllib.loads(Path(name).read_text(encoding="utf-8")) for name in ("made.toml", "first.toml"))
    assert made["curves"] == first["curves"] and made["regions"] == first["regions"]
    assert "found the bytes 02 00 00 00" in refuse(data.replace(b"\1\0\0\0", b"\2\0\0\0", 1), capsys)
    tags = unpack("4.1").replace(b"$Nodes\n", b"$Nodes\n" + b"\xff" * 20, 1)
    assert "byte" in refuse(tags, capsys)


def test_names_are_what_stands_between_the_quotation_marks() -> None:
    tables = bring_in(write_2(name_again(make_block(2, 2), {(1, 1): "it's", (1, 2): "to#p", (2, 1): "a=b\\"})))
    assert list(tables["curves"])[:2] == ["it's", "to#p"] and list(tables["regions"]) == ["a=b\\", "upper"]


def test_groups_of_one_name_are_told(capsys: Capture) -> None:
    tables = bring_in(write_2(name_again(make_block(2, 2), {(1, 2): "bottom", (2, 2): "lower"})))
    assert list(tables["curves"])[:2] == ["bottom.1", "bottom.2"] and list(tables["regions"]) == ["lower", "lower_2"]
    said = capsys.readouterr().out
    assert "Physical lines 1, 2 have the same name, 'bottom'." in said
    assert "Physical surfaces 1, 2 have the same name, 'lower'." in said


def test_conditions_of_a_physical_line_are_not_those_of_edges_without_one() -> None:
    # The sides have no lines, and would be called as the bottom is.
    nodes, lines, surfaces, names = make_block(2, 2)
    rest = [line for line in lines if line[0] not in (4, 5)]
    tables = bring_in(write_2((nodes, rest, surfaces, {**names, (1, 1): "lower_edge"})))
    assert tables["curves"]["lower_edge"]["points"] == [[0, 0], [1, 0]]
    assert {"lower_edge_.1", "lower_edge_.2", "upper_edge.1", "upper_edge.2"} < set(tables["curves"])


def test_physical_points_are_left_out_and_told(capsys: Capture) -> None:
    nodes, lines, surfaces, names = make_block(2, 2)
    text = write_2((nodes, lines, surfaces, {**names, (0, 9): "pin"}))
    count = len(lines) + len(surfaces)
    text = text.replace(f"$Elements\n{count}\n", f"$Elements\n{count + 1}\n{count + 1} 15 2 9 9 1\n")
    bring_in(text)
    assert "1 point of the physical point 'pin'" in capsys.readouterr().out


def test_edges_that_lie_on_each_other_without_common_nodes_are_refused_with_them(capsys: Capture) -> None:
    # The seam is doubled, as for a contact or by a plugin for cracks.
    nodes, lines, surfaces, names = make_block(2, 2)
    doubled = {tag: 100 + tag for tag, z in nodes.items() if z.imag == 1}
    upper = [
        (group, entity, tuple(doubled.get(node, node) for node in own) if group == 2 else own)
        for group, entity, own in surfaces
    ]
    nodes = nodes | {new: nodes[tag] for tag, new in doubled.items()}
    said = refuse(write_2((nodes, [line for line in lines if line[0] < 4], upper, names)), capsys)
    assert "the edge at (0.25, 1): found two edges" in said and "and 1 more such place;" in said


@pytest.mark.parametrize("first", [0, 4, 9])
def test_a_circle_whose_edges_are_not_alike_is_one(first: int, capsys: Capture) -> None:
    # A quarter in three edges and the rest in eight: of a hole on which something ends. Nothing tells that it is one.
    angles = [*range(0, 90, 30), *(90 + 33.75 * k for k in range(8))]
    corners = [3 + 2j + cmath.rect(0.5, math.radians(angle)) for angle in angles]
    corners = corners[first:] + corners[:first]
    tables = bring_in(write_4(make_polygon(corners, None, [0] * len(corners))))
    curve, = tables["curves"].values()
    assert curve["center"] == pytest.approx([3.0, 2.0]) and curve["radius"] == pytest.approx(0.5)
    assert "Corners on a circle" not in capsys.readouterr().out


def test_a_polygon_that_may_be_a_circle_is_told(capsys: Capture) -> None:
    corners = [cmath.rect(0.5, 2 * math.pi * k / 10) for k in range(10)]
    tables = bring_in(write_4(make_polygon(corners, None, [0] * 10)))
    assert len(tables["curves"]["body_edge"]["points"]) == 11
    assert "Corners on a circle, sides straight: body_edge." in capsys.readouterr().out
    hexagon = [cmath.rect(0.5, math.pi * k / 3) for k in range(6)]
    bring_in(write_4(make_polygon(hexagon, None, [0] * 6)))
    assert "Corners on a circle" not in capsys.readouterr().out


def test_blocks_that_touch_in_a_corner_have_curves_that_end_there() -> None:
    nodes = {1 + i + 3 * j: complex(i, j) for j in range(3) for i in range(3)}
    blocks = [(1, 1, (1, 2, 5, 4)), (2, 2, (5, 6, 9, 8))]
    tables = bring_in(write_2((nodes, [], blocks, {(2, 1): "low", (2, 2): "high"})))
    assert sorted(tables["curves"]) == ["high_edge.1", "high_edge.2", "low_edge.1", "low_edge.2"]
    ends = {name: (curve["points"][0], curve["points"][-1]) for name, curve in tables["curves"].items()}
    assert all([1, 1] in pair for pair in ends.values())
