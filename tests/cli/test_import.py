"""`pbem import` as a user meets it: maps and meshes that become cases, and what is refused."""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

import pbem
from pbem.case import read_case
from pbem.case.build import make_checked_model
from pbem.cli import main
from pbem.contact.laws import find_joint
from pbem.importing.dxf_file import read_dxf
from tests.cli.gmsh_sample import make_block, make_plate, make_polygon, make_ring, make_row, write_2, write_4

Capture = pytest.CaptureFixture[str]
WRITERS = {"2.2": write_2, "4.1": write_4}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_map(*lines: Sequence[Sequence[float]], **keys: Any) -> str:
    """GeoJSON of lines without properties."""
    features = [{"type": "Feature", "geometry": {"type": "LineString", "coordinates": line}} for line in lines]
    return json.dumps({"type": "FeatureCollection", "features": features, **keys})


def bring_in(name: str, text: str, *options: str) -> dict[str, Any]:
    """The tables of the case that the command makes of a file; `pbem check` accepts it."""
    Path(name).write_text(text, encoding="utf-8")
    assert main(["import", name, "-o", "made.toml", "--force", *options]) == 0
    return tomllib.loads(Path("made.toml").read_text(encoding="utf-8"))


METRES = {"type": "name", "properties": {"name": "EPSG::3067"}}
CROSS = write_map([[0, 0], [2, 0]], [[1, -1], [1, 1]], crs=METRES)


def test_crossing_traces_are_cut_and_keep_their_names(capsys: Capture) -> None:
    tables = bring_in("map.geojson", CROSS)
    assert list(tables["curves"]) == ["t1.1", "t1.2", "t2.1", "t2.2"]
    assert tables["curves"]["t1.1"]["points"] == [[0, 0], [1, 0]]
    assert tables["regions"]["plane"]["cracks"] == list(tables["curves"]) and tables["regions"]["plane"]["infinite"]
    assert tables["interfaces"] == {"t1": {"friction": 0.6}, "t2": {"friction": 0.6}}
    said = capsys.readouterr().out
    for part in ("traces: 2, in all 4 long", "pieces: 4", "crossings: 1", "junctions: 1 (1 X)", "blocks: 0",
                 "2 cuts, where traces cross or meet"):
        assert part in said
    assert main(["check", "made.toml"]) == 0


def test_what_is_made_runs_with_a_law_of_each_trace() -> None:
    bring_in("map.geojson", CROSS, "--size", "0.5", "--sxx", "-1", "--syy", "-2")
    text = Path("made.toml").read_text(encoding="utf-8").replace("t2 = { friction = 0.6 }", 't2 = { law = "open" }')
    Path("made.toml").write_text(text, encoding="utf-8")
    case = read_case("made.toml")
    assert case.interfaces["t1.2"].friction == 0.6 and case.interfaces["t2.1"].law == "open"
    assert main(["run", "made.toml", "--quiet"]) == 0


def test_options_say_what_stands_in_the_case() -> None:
    tables = bring_in("map.geojson", CROSS, "--size", "0.3", "--friction", "0.2", "--young", "5", "--poisson", "0.1",
                      "--sxx", "-3", "--sxy", "1")  # fmt: skip
    assert {curve["size"] for curve in tables["curves"].values()} == {0.3}
    assert tables["interfaces"]["t1"]["friction"] == 0.2
    assert tables["materials"] == {"rock": {"young": 5.0, "poisson": 0.1}}
    assert tables["remote"] == {"sxx": -3.0, "syy": 0.0, "sxy": 1.0}


def test_defaults_are_told_and_follow_the_median_length(capsys: Capture) -> None:
    tables = bring_in("map.geojson", write_map([[0, 0], [2, 0]], [[0, 5], [4, 5]], [[0, 9], [40, 9]]))
    assert tables["curves"]["t1"]["size"] == pytest.approx(4 / 6) and tables["remote"]["syy"] == -1.0
    said = capsys.readouterr().out
    for part in ("--size 0.6667 (a sixth", "--snap 0.004 (a thousandth", "--friction 0.6", "--young 1000",
                 "--poisson 0.2", "--syy -1"):
        assert part in said


def test_the_default_size_is_one_that_check_does_not_doubt(capsys: Capture) -> None:
    bring_in("map.geojson", write_map([[0, 0], [3, 0]], [[0, 5], [3, 5]], [[0, 9], [3, 10]]))
    capsys.readouterr()
    assert main(["check", "made.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["doubts"] == []


def test_one_change_is_told_of_in_the_singular(capsys: Capture) -> None:
    bring_in("map.geojson", write_map([[0, 0], [2, 0]], [[1, 0.001], [1, 1]], [[5, 5], [5, 5]]), "--snap", "0.002")
    said = capsys.readouterr().out
    for part in ("1 trace dropped, of which the snap distance leaves nothing",
                 "1 end or vertex joined to what it all but reaches, by 0.001",
                 "1 cut, where traces cross or meet: listed in"):
        assert part in said


def test_what_was_changed_is_listed_with_place_and_distance(capsys: Capture) -> None:
    lines = [[[0, 0], [2, 0]], [[1, 0.001], [1, 1]], [[0.5, -0.001], [0.5, 1]], [[0, 3], [1, 3]], [[0, 3], [1, 3]],
             [[5, 5], [5, 5]], [[0, 7], [0, 7], [1, 7]]]  # fmt: skip
    tables = bring_in("map.geojson", write_map(*lines), "--snap", "0.002")
    assert list(tables["curves"]) == ["t1.1", "t1.2", "t1.3", "t2", "t3", "t4", "t7"]
    said = capsys.readouterr().out
    for part in ("t2 at (1, 0.001): moved by 0.001 to t1", "t3 at (0.5, -0.001): 0.001 beyond t1",
                 "t5 from (0, 3) on: 1 long, on t4", "t6 at (5, 5): 0 long", "t7 at (0, 7): 0 from the next",
                 "of 2 nothing is left"):
        assert part in said
        comment = [line for line in Path("made.toml").read_text(encoding="utf-8").splitlines() if line.startswith("#")]
        assert part in "\n".join(comment)
    assert "t1 at (0.5, 0), by t3" in "\n".join(comment)


def test_long_lists_are_shortened_on_the_terminal_only(capsys: Capture) -> None:
    lines = [[[0, 0], [100, 0]]] + [[[k, 0.001], [k, 1]] for k in range(1, 40)]
    bring_in("map.geojson", write_map(*lines), "--snap", "0.01")
    said = capsys.readouterr().out
    assert "39 ends and vertices joined" in said and "and 34 more, in the comment" in said
    text = Path("made.toml").read_text(encoding="utf-8")
    assert text.count("moved by 0.001 to t1") == 39 and len(said) < 2500


def test_names_come_from_a_unique_property(capsys: Capture) -> None:
    def write(*names: Any) -> str:
        data = json.loads(write_map(*([[0, k], [1, k]] for k in range(len(names)))))
        for feature, name in zip(data["features"], names, strict=True):
            feature["properties"] = {"Name": name, "other": 3}
        return json.dumps(data)

    assert list(bring_in("map.geojson", write("east", "west"))["curves"]) == ["east", "west"]
    assert list(bring_in("map.geojson", write(7, 9.0))["curves"]) == ["7", "9"]
    for names in (("east", "east"), ("east", None), ("a\u001bb", "c")):
        assert list(bring_in("map.geojson", write(*names))["curves"]) == ["t1", "t2"]


@pytest.mark.parametrize(("names", "told"), [
    (("east", "west", "east"), "Names: 'name' is not different for each (\"east\" stands 2 times). The traces are"),
    (("east", None, "west"), "Names: 'name' is missing of 1 of 3. The traces are called t1, t2, ..."),
    (("east", "west", " north"),
     "Names: 'name' cannot be used (\" north\" has blanks around it or signs that do not print)"),
    (("east", "west", "north"), ""),
    ((None, None, None), ""),
])
def test_names_that_do_not_tell_traces_apart_are_told(
    names: Sequence[str | None], told: str, capsys: Capture
) -> None:
    """Of features, of rows of a table, and where another property serves instead."""
    data = json.loads(write_map(*([[0, k], [1, k]] for k in range(3)), crs=METRES))
    for feature, name in zip(data["features"], names, strict=True):
        feature["properties"] = {"name": name}
    bring_in("map.geojson", json.dumps(data))
    said = capsys.readouterr().out
    assert (told in said) if told else ("Names" not in said)
    for number, feature in enumerate(data["features"]):
        feature["properties"]["fid"] = 7 * number
    curves = bring_in("map.geojson", json.dumps(data))["curves"]
    said = capsys.readouterr().out
    unique = not told and None not in names
    assert list(curves) == ([*names] if unique else ["0", "7", "14"])
    assert (told.partition(". The")[0] + ". The traces have those of 'fid'." in said) if told else ("Names" not in said)
    if " north" not in names:
        rows = [f"{name or ''},0,{k},1,{k}" for k, name in enumerate(names)]
        bring_in("map.csv", "\n".join(["id,x1,y1,x2,y2", *rows]))
        said = capsys.readouterr().out
        assert (told.replace("'name'", "'id'") in said) if told else ("Names" not in said)


def test_traces_with_names_of_pieces_of_others_have_laws_of_their_own(capsys: Capture) -> None:
    # The law of fault is that of all of its pieces, fault.1, fault.2, ..., and of no other trace.
    rows = {"fault": (0, 0, 2, 0), "fault.1": (1, -1, 1, 1), "fault.2": (0, 3, 2, 3), "fault_1": (0, 4, 2, 4)}
    text = "\n".join(f"{name},{','.join(map(str, row))}" for name, row in rows.items())
    tables = bring_in("map.csv", f"id,x1,y1,x2,y2\n{text}\n")
    assert list(tables["interfaces"]) == ["fault", "fault_1_", "fault_2", "fault_1"]
    said = capsys.readouterr().out
    assert "2 of the traces called otherwise" in said and "fault.1: fault_1_" in said
    tables["interfaces"]["fault"]["cohesion"] = 5.0
    model = make_checked_model(pbem.Case(**tables))
    assert [find_joint(model, name).law.cohesion for name in tables["curves"]] == [5, 5, 0, 0, 0, 0]


def test_columns_that_are_not_read_are_told(capsys: Capture) -> None:
    bring_in("map.csv", "id,x1,y1,x2,y2,aperture,note\n5,0,0,1,0,0.1,a\n6,0,1,1,1,0.2,b\n")
    assert 'Columns that are not read: "aperture", "note".' in capsys.readouterr().out


def test_parts_and_order_of_vertices_are_those_of_their_columns() -> None:
    # As a geographic information system extracts the vertices of lines with several parts.
    rows = ["1,0,0,0,0", "1,1,0,1,0", "1,2,1,2,0", "1,3,1,3,1", "2,0,0,0,5", "2,1,0,4,5"]
    tables = bring_in("map.csv", "\n".join(["fid,vertex_index,vertex_part,x,y", *rows]))
    assert {name: curve["points"] for name, curve in tables["curves"].items()} == {
        "1.1": [[0, 0], [1, 0]], "1.2": [[2, 0], [3, 1]], "2": [[0, 5], [4, 5]],
    }


@pytest.mark.parametrize(("order", "read"), [
    (["3", "2", "1"], True), (["first", "second", "third"], False), (["1", "", "3"], False),
])
def test_an_order_may_fall_and_what_is_none_is_not_read(order: list[str], read: bool, capsys: Capture) -> None:
    rows = [f"a,{x},0,{each}" for x, each in enumerate(order)]
    tables = bring_in("map.csv", "\n".join(["id,x,y,order", *rows]))
    assert tables["curves"]["a"]["points"] == [[0, 0], [1, 0], [2, 0]]
    assert ("order" in capsys.readouterr().out) != read


def test_traces_that_would_be_pieces_of_none_are_told_apart(capsys: Capture) -> None:
    # By what ends in a number, 1.1 and 1.2 would be the trace 1 in tables, pictures and laws.
    tables = bring_in("map.csv", "id,x1,y1,x2,y2\n1.1,0,0,2,0\n1.2,0,1,2,1\n2.10,0,2,2,2\n2.10a,0,3,2,3\n")
    assert list(tables["curves"]) == ["1_1", "1_2", "2_10", "2.10a"]
    assert "3 of the traces called otherwise" in capsys.readouterr().out


def test_parts_of_a_line_are_one_trace() -> None:
    data = json.loads(CROSS)
    data["features"][0]["geometry"] = {
        "type": "MultiLineString", "coordinates": [[[0, 0], [2, 0]], [[5, 0], [6, 0], [7, 1]]],
    }
    tables = bring_in("map.geojson", json.dumps(data))
    assert list(tables["curves"]) == ["t1.1", "t1.2", "t1.3", "t2.1", "t2.2"]
    assert list(tables["interfaces"]) == ["t1", "t2"]
    assert main(["check", "made.toml"]) == 0


def test_degrees_and_what_is_no_line_are_told(capsys: Capture) -> None:
    data = json.loads(CROSS)
    data["crs"]["properties"]["name"] = "urn:ogc:def:crs:OGC:1.3:CRS84"
    data["features"] += [{"type": "Feature", "geometry": None},
                         {"type": "Feature", "geometry": {"type": "Point", "coordinates": [1, 2]}}]
    data["features"][0]["geometry"]["coordinates"][0].append(12.0)
    bring_in("map.geojson", json.dumps(data))
    said = capsys.readouterr().out
    for part in ("The coordinates are degrees", "features[3]: no geometry", 'features[4]: a "Point"', "Heights"):
        assert part in said


@pytest.mark.parametrize("text", [
    "0,0,2,0\n1,-1,1,1\n", "x1,y1,x2,y2\n0,0,2,0\n1,-1,1,1\n", "x1;y1;x2;y2\n0;0;2,0;0\n1;-1;1;1\n",
    "0 0 2 0\n\n1 -1 1 1\n", "# made by hand\n0\t0\t2\t0\n1\t-1\t1\t1", "from x,from y,to x,to y\n0,0,2,0\n1,-1,1,1",
    "\ufeffid,x,y\nt1,0,0\nt1,2,0\nt2,1,-1\nt2,1,1\n", "t1,0,0\nt1,2,0\nt2,1,-1\nt2,1,1\n",
    "y,x,name,z\n0,0,t1,5\n0,2,t1,5\n-1,1,t2,5\n1,1,t2,5\n",
])  # fmt: skip
def test_tables_of_any_dress_are_the_same_map(text: str) -> None:
    expected = bring_in("map.geojson", CROSS)
    found = bring_in("map.csv", text)
    assert found["curves"] == expected["curves"] and found["interfaces"] == expected["interfaces"]


def test_simplified_traces_lose_the_vertices_that_say_little(capsys: Capture) -> None:
    x = np.linspace(0, 10, 101)
    wave = np.stack([x, 0.01 * np.sin(40 * x)], axis=1).tolist()
    tables = bring_in("map.geojson", write_map([*wave, [15, 5]], [[3, 0.02], [3, 5]]), "--simplify", "0.05")
    assert len(tables["curves"]) == 2 and len(tables["curves"]["t1"]["points"]) == 3
    assert "of 102 straight or circular parts 3 remain" in capsys.readouterr().out


def test_junctions_are_kept_if_that_is_asked_for(capsys: Capture) -> None:
    lines = [[0, 0], [5, 0.04], [10, 0]], [[5, 0.04], [5, 3]], [[2, 0.016], [2, -3]]
    tables = bring_in("map.geojson", write_map(*lines), "--simplify", "0.05", "--snap", "0.001")
    assert list(tables["curves"]) == ["t1.1", "t1.2", "t2", "t3.1", "t3.2"]
    assert "2 ends that lay on another trace now miss it or poke through it" in capsys.readouterr().out
    tables = bring_in("map.geojson", write_map(*lines), "--simplify", "0.05", "--snap", "0.001", "--keep-junctions")
    assert list(tables["curves"]) == ["t1.1", "t1.2", "t1.3", "t2", "t3"]
    said = capsys.readouterr().out
    assert "Simplified by 0.05 between junctions" in said and "junctions: 2 (2 T)" in said


def test_maps_far_from_the_origin_keep_their_digits() -> None:
    lines = [[[466000.282, 6691582.099], [466010.282, 6691582.099]], [[466005.001, 6691577], [466005.001, 6691587]]]
    tables = bring_in("map.geojson", write_map(*lines))
    assert tables["curves"]["t1.1"]["points"] == [[466000.282, 6691582.099], [466005.001, 6691582.099]]
    assert main(["check", "made.toml"]) == 0


DXF = """0
SECTION
2
ENTITIES
{}
0
ENDSEC
0
EOF
"""


def write_dxf(*entities: Sequence[object]) -> str:
    return DXF.format("\n".join(str(each) for entity in entities for each in entity))


def test_drawings_of_all_kinds(capsys: Capture) -> None:
    line = (0, "LINE", 8, 0, 10, 0, 20, 0, 11, 2, 21, 0)
    polyline = (0, "POLYLINE", 8, 0, 66, 1, 70, 0, 0, "VERTEX", 8, 0, 10, 0, 20, 5, 42, 1,
                0, "VERTEX", 8, 0, 10, 2, 20, 5, 0, "VERTEX", 8, 0, 10, 4, 20, 5, 0, "SEQEND")
    arc = (0, "ARC", 8, 0, 10, 10, 20, 0, 40, 2, 50, 300, 51, 60)
    below = (0, "ARC", 8, 0, 10, -20, 20, 0, 40, 2, 50, 0, 51, 90, 210, 0, 220, 0, 230, -1)
    circle = (0, "CIRCLE", 8, 0, 10, 30, 20, 0, 40, 1)
    point = (0, "CIRCLE", 8, 0, 10, 40, 20, 0, 40, 0)
    text = (0, "TEXT", 8, 0, 10, 0, 20, 0, 40, 1, 1, "north")
    Path("map.dxf").write_text(write_dxf(line, polyline, arc, below, circle, point, text))
    code = main(["import", "map.dxf", "-o", "made.toml"])
    assert code == 0
    curves = tomllib.loads(Path("made.toml").read_text())["curves"]
    assert curves["t1"]["points"] == [[0, 0], [2, 0]]
    # A bulge of 1 is half a circle to the right of the way there, below the chord.
    assert curves["t2.1"]["center"] == pytest.approx([1, 5]) and curves["t2.1"]["radius"] == pytest.approx(1)
    assert curves["t2.1"]["angles"] == pytest.approx([180, 360]) and curves["t2.2"]["points"] == [[2, 5], [4, 5]]
    first, last = curves["t3"]["angles"]
    assert curves["t3"]["center"] == pytest.approx([10, 0]) and [first, last] == pytest.approx([-60, 60])
    # Seen from below, x is turned round: from the left end up to the top, clockwise.
    assert curves["t4"]["center"] == pytest.approx([20, 0]) and curves["t4"]["angles"] == pytest.approx([180, 90])
    assert np.allclose(curves["t5"]["center"], [30, 0], atol=1e-12)
    assert curves["t5"]["radius"] == 1 and "angles" not in curves["t5"]
    said = capsys.readouterr().out
    assert "CIRCLE 2: one point or none" in said and "1 TEXT: only LINE" in said


LAYERS = """0
SECTION
2
TABLES
0
TABLE
2
LAYER
{}
0
ENDTAB
0
ENDSEC
"""


def test_lines_on_sheets_of_a_drawing_are_left_out_and_told(capsys: Capture) -> None:
    drawing = ezdxf.new("R2010")  # type: ignore[attr-defined]
    drawing.modelspace().add_line((0, 0), (2, 0))
    for end in ((9, 9), (9, 0)):
        drawing.layout("Layout1").add_line((0, 0), end)
    drawing.saveas("map.dxf")
    assert main(["import", "map.dxf", "-o", "made.toml"]) == 0
    assert '2 on the sheet "Layout1": only the model space is read' in capsys.readouterr().out


def test_what_a_drawing_does_not_show_is_left_out_and_told(capsys: Capture) -> None:
    """Entities on layers that are frozen (a flag) or turned off (a negative colour), and invisible ones."""
    layers = [(0, "LAYER", 2, name, 70, flag, 62, colour, 6, "CONTINUOUS")
              for name, flag, colour in (("faults", 0, 7), ("guides", 0, -7), ("old", 1, 7))]
    table = LAYERS.format("\n".join(str(each) for layer in layers for each in layer))
    lines = [(0, "LINE", 8, layer, 60, hidden, 10, 0, 20, k, 11, 2, 21, k) for k, (layer, hidden) in enumerate(
        [("faults", 0), ("GUIDES", 0), ("old", 0), ("old", 0), ("faults", 1), ("unknown", 0)])]
    Path("map.dxf").write_text(table + write_dxf(*lines))
    assert main(["import", "map.dxf", "-o", "made.toml"]) == 0
    curves = tomllib.loads(Path("made.toml").read_text())["curves"]
    assert [curve["points"][0][1] for curve in curves.values()] == [0, 5]
    said = capsys.readouterr().out
    for part in ('1 LINE on layer "GUIDES", which is turned off', '2 LINE on layer "old", which is frozen',
                 "1 LINE that is set invisible"):
        assert part in said
    Path("map.dxf").write_text(table + write_dxf(*lines[1:2]))
    assert main(["import", "map.dxf", "-o", "made.toml", "--force"]) == 2
    assert 'on layer "GUIDES", which is turned off' in capsys.readouterr().err


@pytest.mark.parametrize("turn", [0.0, 0.77])
@pytest.mark.parametrize("other", ["a line through", "a line from there", "a circle outside", "a circle inside"])
def test_what_touches_a_circle_is_refused_for_that_reason(turn: float, other: str, capsys: Capture) -> None:
    """Wherever they touch, on a mark of the circle or between two, in place of curves that run over each other."""
    along = complex(np.exp(1j * turn))
    at, tangent = 3 + 4j + 1.3 * along, 1j * along
    ends = {"a line through": (at - 2 * tangent, at + 1.5 * tangent), "a line from there": (at, at + 2 * tangent)}
    radius = {"a circle outside": 0.7, "a circle inside": -0.7}
    circle = (0, "CIRCLE", 8, 0, 10, 3.0, 20, 4.0, 40, 1.3)
    if other in ends:
        one, two = ends[other]
        second: Sequence[object] = (0, "LINE", 8, 0, 10, one.real, 20, one.imag, 11, two.real, 21, two.imag)
    else:
        center = at + radius[other] * along
        second = (0, "CIRCLE", 8, 0, 10, center.real, 20, center.imag, 40, 0.7)
    Path("map.dxf").write_text(write_dxf(circle, second))
    assert main(["import", "map.dxf", "-o", "made.toml"]) == 2
    said = capsys.readouterr().err
    assert "without an angle between them" in said
    x, y = (float(part) for part in said.partition(" near (" if " near (" in said else " at (")[2].partition(")")[0]
            .split(","))
    assert abs(complex(x, y) - at) < 0.02


def test_cracks_at_a_very_small_angle_are_refused_with_the_angle() -> None:
    """As no elements fit between them, in place of their distance."""
    text = """
materials.m = { young = 1.0, poisson = 0.2 }
curves.a = { points = [[0, 0], [2, 0]], elements = 8 }
curves.b = { points = [[0, 0], [2, 1e-4]], elements = 8 }
regions.p = { material = "m", infinite = true, cracks = ["a", "b"] }
interfaces.a.friction = 0.3
interfaces.b.friction = 0.3
"""
    Path("case.toml").write_text(text)
    with pytest.raises(pbem.CaseError, match=r"meeting at \(0, 0\) at an angle of 0.0029 degrees"):
        make_checked_model("case.toml")


@pytest.mark.parametrize("flag", [0, 8])
def test_a_spline_of_a_drawing_runs_through_its_points_and_not_its_frame(flag: int) -> None:
    """A polyline of the plane or of space (8): what the spline was drawn to is in the file with the rest."""
    frame = [(0, 0), (1, 2), (3, 2), (4, 0)]
    spline = [(4 * t, 6 * t * (1 - t)) for t in (0, 0.25, 0.5, 0.75, 1)]
    space = 32 if flag else 0
    vertices = [
        (0, "VERTEX", 8, 0, 10, x, 20, y, 70, kind | space) for kind, own in ((16, frame), (8, spline)) for x, y in own
    ]
    polyline = [(0, "POLYLINE", 8, 0, 66, 1, 70, 4 | flag), *vertices, (0, "SEQEND")]
    Path("map.dxf").write_text(write_dxf(*polyline))
    [trace] = read_dxf(Path("map.dxf")).traces
    [legs] = trace.parts
    assert [legs[0].start, *(leg.end for leg in legs)] == [complex(*each) for each in spline]


@pytest.mark.parametrize("first", [0.0, 10.1, 152.2, 154.2, 359.9])
def test_an_arc_of_a_drawing_that_turns_by_360_degrees_is_a_circle(first: float) -> None:
    """Whatever the rounding of its angles: 512.2 - 152.2 is above 360 by a bit."""
    arc = write_dxf((0, "ARC", 8, 0, 10, 5.0, 20, 2.0, 40, 1.5, 50, first, 51, round(first + 360, 1)))
    Path("map.dxf").write_text(arc)
    [trace] = read_dxf(Path("map.dxf")).traces
    length = sum(leg.length for part in trace.parts for leg in part)
    assert length == pytest.approx(3 * np.pi, rel=1e-12)
    assert trace.parts[0][0].start == trace.parts[-1][-1].end


@pytest.mark.parametrize("name, text, expected", [
    ("map.geojson", "", "the file: found nothing in it"),
    ("map.geojson", "{", "line 1, column 2: found"),
    ("map.geojson", '{"type": "Topology"}', 'the file: found "Topology"'),
    ("map.geojson", '{"type": "FeatureCollection", "features": []}', "the file: found no line"),
    ("map.csv", "x_start,x_end,y_start,y_end\n0,10,0,0\n", 'line 1: found columns "x_start", "x_end"'),
    ("map.csv", "start x,end x,start y,end y\n0,10,0,0\n", 'line 1: found columns "start x", "end x"'),
    ("map.csv", "x,y,trace no\n0,0,1\n10,0,1\n", 'line 1: found columns "x", "y", "trace no"'),
    ("map.csv", "trace no,north,east\n1,0,0\n1,0,10\n", 'line 1: found columns "trace no", "north", "east"'),
    ("map.csv", "0,0,1_0,0\n", 'line 1, x2: found "1_0"; expected a number'),
    ("map.geojson", write_map([[0, 0], [float("nan"), 1]]), "features[1].geometry.coordinates[2][1]: found nan"),
    ("map.geojson", write_map([[0, 0], [1, None]]), "features[1].geometry.coordinates[2][2]: found None"),  # type: ignore[list-item]
    ("map.geojson", write_map([[0, 0], ["1", 2]]), "features[1].geometry.coordinates[2][1]: found \"1\""),  # type: ignore[list-item]
    ("map.geojson", write_map([[0, 0], [1e200, 1]]), "features[1].geometry.coordinates[2][1]: found 1e+200"),
    ("map.geojson", write_map([[1, 1], [1, 1]]), "the map: found 1 traces of length 0"),
    ("map.geojson", write_map([[1e20, 1], [1e20, 2]]), "the map: found traces of a median length of 1"),
    ("map.csv", "\n\n", "the file: found nothing in it"),
    ("map.csv", "a,b\n1,2\n", "line 1: found columns"),
    ("map.csv", "0,0,1,1\n0,0,1\n", "line 2, y2: found a row of 3"),
    ("map.csv", "0,0,1,1\n0,5,1,1,2\n", "line 2: found a row of 5; expected 4 columns"),
    ("map.csv", "id,x,y\na,0,0\na,1,5,2\n", "line 3: found a row of 4; expected 3 columns"),
    ("map.csv", "id,order,x,y\na,1,0,0\na,3,2,0\na,2,1,1\n", "line 4, order: found 2 after 3"),
    ("map.csv", "id,order,x,y\na,2,0,0\na,1,1,0\na,1,2,0\na,2,3,0\n", "line 5, order: found 2 after 1"),
    ("map.csv", "0,0,1,x\n", "line 1, y2: found \"x\""),
    ("map.csv", "id,x,y\na,0,inf\n", "line 2, y: found \"inf\""),
    ("map.dxf", "no drawing", "the file: found what ezdxf cannot read"),
    ("map.msh", "$Nodes\n", "line 1: found '$Nodes'; expected $MeshFormat"),
    ("map.msh", "$MeshFormat\n3.0 0 8\n", "line 2: found version 3.0; expected 2.2 or 4.1"),
    ("map.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n2\n1 0 0 0\n", "line 6: found the end of the file"),
    ("map.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 x 0\n", "line 6: found '0 x 0'"),
    ("map.msh", write_2(make_block(2, 2)).replace("1 3 2 1 1 ", "1 5 2 1 1 "), "of type 5"),
    ("map.shp", "x", "found a file name that ends in '.shp'; expected .geojson"),
])  # fmt: skip
def test_wrong_files_are_refused_with_their_place(name: str, text: str, expected: str, capsys: Capture) -> None:
    Path(name).write_text(text, encoding="utf-8")
    if "of type 5" in expected:
        Path(name).write_text(write_2(make_block(2, 2)).replace(" 3 2 1 1 ", " 5 2 1 1 ", 1), encoding="utf-8")
    assert main(["import", name, "-o", "made.toml"]) == 2
    said = capsys.readouterr().err
    assert expected in said and "Traceback" not in said and not Path("made.toml").exists()


def test_all_faults_are_told_at_once_but_not_thousands(capsys: Capture) -> None:
    Path("map.csv").write_text("0,0,1,1\n" + "0,0,1,x\n" * 30)
    assert main(["import", "map.csv", "-o", "made.toml"]) == 2
    said = capsys.readouterr().err
    assert "line 2, y2" in said and "line 21, y2" in said and "10 more of such faults" in said


def test_a_binary_file_and_no_file_are_refused(capsys: Capture) -> None:
    Path("map.csv").write_bytes(b"0,0,1,1\n\x00\x01\x02")
    for arguments, expected in (
        (["map.csv"], "line 2: found the byte 0x00"), (["none.csv"], "found no such file"),
        (["map.csv", "--size", "0"], "expected a length above 0"), (["map.csv", "--snap", "-1"], "0 or more"),
    ):
        assert main(["import", *arguments, "-o", "made.toml"]) == 2
        assert expected in capsys.readouterr().err


def test_a_case_that_is_there_is_kept(capsys: Capture) -> None:
    Path("map.geojson").write_text(CROSS)
    Path("made.toml").write_text("mine")
    assert main(["import", "map.geojson", "-o", "made.toml"]) == 2
    assert "--force" in capsys.readouterr().err and Path("made.toml").read_text() == "mine"
    assert main(["import", "map.geojson", "-o", "nowhere/made.toml"]) == 2


@pytest.mark.parametrize("version", ["", "AC1009", "AC1015"])
def test_polylines_need_no_marks_of_their_class(capsys: Capture, version: str) -> None:
    closed = (0, "LWPOLYLINE", 8, "faults", 90, 3, 70, 1, 10, 0, 20, 0, 10, 2, 20, 0, 42, 0, 10, 2, 20, 1)
    lifted = (0, "LWPOLYLINE", 8, 0, 90, 2, 38, 1, 10, 9, 20, 0, 10, 9, 20, 4)
    header = f"0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\n{version}\n0\nENDSEC\n" if version else ""
    Path("map.dxf").write_text(header + write_dxf(closed, lifted))
    assert main(["import", "map.dxf", "-o", "made.toml"]) == 0
    curves = tomllib.loads(Path("made.toml").read_text())["curves"]
    assert [curve["points"] for curve in curves.values()] == [[[0, 0], [2, 0], [2, 1], [0, 0]], [[9, 0], [9, 4]]]
    assert "Heights" in capsys.readouterr().out


def test_entities_of_no_known_kind_are_left_out_and_told(capsys: Capture) -> None:
    line = ["0", "LINE", "8", "0", "10", "0", "20", "0", "11", "1", "21", "1"]
    tags = ["0", "SECTION", "2", "ENTITIES", *line, "0", "POL", "5", "FF", "0", "ENDSEC", "0", "EOF", ""]
    Path("map.dxf").write_text("\n".join(tags))
    assert main(["import", "map.dxf", "-o", "made.toml"]) == 0
    assert "1 POL: only LINE" in capsys.readouterr().out


def test_a_missing_library_is_named(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    Path("map.dxf").write_text(write_dxf())
    assert main(["import", "map.dxf", "-o", "made.toml"]) == 2
    assert "install python3-ezdxf" in capsys.readouterr().err


def test_a_mesh_has_no_stress_far_away(capsys: Capture) -> None:
    Path("ring.msh").write_text(write_4(make_ring(24, 3, 1.0, 2.0)))
    assert main(["import", "ring.msh", "-o", "made.toml", "--syy", "-1"]) == 2
    assert "found --syy with a mesh of surfaces; expected no such option: finite regions have no stress far away" in (
        capsys.readouterr().err)


@pytest.mark.parametrize("version", WRITERS)
def test_a_ring_under_pressure(version: str, capsys: Capture) -> None:
    tables = bring_in("ring.msh", WRITERS[version](make_ring(24, 3, 1.0, 2.0)), "--young", "10", "--poisson", "0.25")
    assert tables["curves"] == {
        "bore": {"center": [0.0, 0.0], "radius": 1.0, "elements": 24},
        "mantle": {"center": [0.0, 0.0], "radius": 2.0, "elements": 24},
    }
    assert tables["regions"] == {"ring": {"material": "ring", "boundary": ["bore", "mantle"]}}
    assert "outer curves: 2 (bore, mantle)" in capsys.readouterr().out
    tables["boundary"] = {"bore": {"pressure": 1.0}}
    tables["output"] = {"points": [[1.5, 0.0]]}
    pbem.run(tables, "ring.h5")
    results = pbem.open_results("ring.h5")
    # Lame, plane strain: u = (1 + nu)/E p a^2/(b^2 - a^2) ((1 - 2 nu) r + b^2/r).
    expected = 1.25 / 10 / 3 * (0.5 * 1.5 + 4 / 1.5)
    assert results.interior.displacement[-1][0] == pytest.approx([expected, 0.0], rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("version", WRITERS)
def test_a_block_of_two_materials(version: str, capsys: Capture) -> None:
    text = WRITERS[version](make_block(2, 2))
    tables = bring_in("block.msh", text, "--young", "1000", "--poisson", "0")
    assert list(tables["curves"]) == ["bottom", "top", "seam", "left.1", "left.2", "right.1", "right.2"]
    assert tables["regions"]["upper"]["boundary"] == ["top", "seam", "left.2", "right.2"]
    assert "# bottom = { ux = 0.0, uy = 0.0 }" in Path("made.toml").read_text()
    tables["materials"]["upper"] = {"young": 250.0, "poisson": 0.0}
    tables["boundary"] = {"bottom": {"uy": 0.0}, "left": {"ux": 0.0}, "top": {"ty": -1.0}}
    tables["output"] = {"points": [[0.5, 0.5], [0.5, 1.5]]}
    pbem.run(tables, "block.h5")
    displacement = pbem.open_results("block.h5").interior.displacement[-1]
    # Springs in series: -1 * (y/1000), then -1/1000 - (y - 1)/250.
    assert displacement[:, 1] == pytest.approx([-0.5e-3, -1e-3 - 2e-3], rel=1e-6)
    assert displacement[:, 0] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("version", WRITERS)
def test_a_plate_with_holes(version: str, capsys: Capture) -> None:
    holes = [0j, 4 + 0j]
    tables = bring_in("plate.msh", WRITERS[version](make_plate(4, 2.0, holes, 0.5)))
    corners = {name: sorted(curve["points"]) for name, curve in tables["curves"].items() if "points" in curve}
    assert corners == {
        "left": [[-2, -2], [-2, 2]], "right": [[6, -2], [6, 2]],
        "top": [[-2, 2], [6, 2]], "bottom": [[-2, -2], [6, -2]],
    }
    circles = {name: curve["center"] for name, curve in tables["curves"].items() if "radius" in curve}
    assert circles == {"hole 1": [0.0, 0.0], "hole 2": [4.0, 0.0]}
    assert tables["curves"]["hole 2"]["radius"] == 0.5 and tables["curves"]["top"]["elements"] == 8
    assert main(["check", "made.toml"]) == 0


def test_a_wide_plate_with_a_hole_has_kirschs_stresses() -> None:
    tables = bring_in("plate.msh", write_4(make_plate(6, 10.0, [0j], 0.5)))
    tables["boundary"] = {"left": {"ux": 0.0}, "bottom": {"uy": 0.0}, "right": {"tx": 1.0}}
    tables["output"] = {"points": [[0.0, 0.75]]}
    pbem.run(tables, "plate.h5")
    ratio = 0.5 / 0.75
    expected = 0.5 * (1 + ratio**2) + 0.5 * (1 + 3 * ratio**4)
    assert pbem.open_results("plate.h5").interior.stress[-1][0][0] == pytest.approx(expected, rel=0.01)


def test_a_polygon_stays_one(capsys: Capture) -> None:
    # Sides of one edge each lie on a circle, too.
    hexagon = {k + 1: np.exp(1j * np.pi * k / 3).item() for k in range(6)} | {7: 0j}
    mesh = (hexagon, [], [(1, 1, (7, k + 1, (k + 1) % 6 + 1)) for k in range(6)], {})
    tables = bring_in("hexagon.msh", write_2(mesh))
    assert len(tables["curves"]["surface_1_edge"]["points"]) == 7
    assert "Named here, as no physical line does: surface_1_edge" in capsys.readouterr().out


GABLE = [0j, 3 + 0j, 3 + 1j, 2 + 1.5j, 1 + 1.5j, 1j]


@pytest.mark.parametrize("entities", [[1, 2, 3, 4, 5, 6], [0] * 6])
@pytest.mark.parametrize("version", WRITERS)
def test_three_sides_of_a_gable_are_no_arc(version: str, entities: list[int]) -> None:
    # Their four corners lie on a circle, as those of all that is the same on both sides do.
    (curve,) = bring_in("gable.msh", WRITERS[version](make_polygon(GABLE, None, entities)))["curves"].values()
    points = np.array(curve["points"]) @ [1, 1j]
    assert points[0] == points[-1] and set(points.tolist()) == set(GABLE)


@pytest.mark.parametrize("edges", [3, 4, 6])
@pytest.mark.parametrize("version", WRITERS)
def test_edges_of_second_order_on_a_circle_are_one(version: str, edges: int) -> None:
    corners, middles = (np.exp(2j * np.pi * (np.arange(edges) + half) / edges).tolist() for half in (0.1, 0.6))
    for entities in (range(1, edges + 1), [1] * edges, [0] * edges):
        (curve,) = bring_in(
            "disc.msh", WRITERS[version](make_polygon(corners, middles, list(entities)))
        )["curves"].values()  # fmt: skip
        assert curve == {"center": [0.0, 0.0], "radius": 1.0, "elements": 8}


def test_edges_of_second_order_that_are_straight_are_a_polygon() -> None:
    corners = np.exp(2j * np.pi * np.arange(16) / 16)
    middles = 0.5 * (corners + np.roll(corners, -1))
    tables = bring_in("polygon.msh", write_4(make_polygon(corners.tolist(), middles.tolist(), [1] * 16)))
    assert len(tables["curves"]["rim"]["points"]) == 17


def test_edges_of_second_order_are_arcs_through_their_nodes() -> None:
    # An ellipse; sides beside it are straight.
    ellipse = [2 * np.cos(t) + 1j * np.sin(t) for t in np.pi * np.arange(17) / 16]
    corners = [*ellipse[::2], -2 - 1j, 2 - 1j]
    middles = [*ellipse[1::2], -2 - 0.5j, -1j, 2 - 0.5j]
    tables = bring_in("ellipse.msh", write_4(make_polygon(corners, middles, [*[1] * 8, 2, 3, 4])))
    area = 0.0
    for curve in tables["curves"].values():
        if "points" in curve:
            points = np.array(curve["points"]) @ [1, 1j]
        else:
            angles = np.radians(np.linspace(*curve["angles"], 2001))
            points = curve["center"] @ np.array([1, 1j]) + curve["radius"] * np.exp(1j * angles)
        area += 0.5 * (np.conj(points[:-1]) * points[1:]).imag.sum()
    assert abs(area) == pytest.approx(np.pi + 4, rel=1e-3)


@pytest.mark.parametrize("version", WRITERS)
def test_a_physical_surface_of_two_parts_is_two_regions_of_one_material(version: str, capsys: Capture) -> None:
    tables = bring_in("row.msh", WRITERS[version](make_row()), "--poisson", "0")
    assert list(tables["regions"]) == ["ends.1", "ends.2", "core"] and list(tables["materials"]) == ["ends", "core"]
    assert "The physical surface 'ends' has 2 parts that are not connected" in capsys.readouterr().out
    tables["materials"]["core"]["young"] = 250.0
    tables["boundary"] = {"left": {"ux": 0.0}, "bottom": {"uy": 0.0}, "right": {"tx": 1.0}}
    tables["output"] = {"points": [[0.5, 0.5], [1.5, 0.5], [2.5, 0.5]]}
    pbem.run(tables, "row.h5")
    displacement = pbem.open_results("row.h5").interior.displacement[-1]
    # Springs in series.
    assert displacement[:, 0] == pytest.approx([0.5e-3, 1e-3 + 2e-3, 1e-3 + 4e-3 + 0.5e-3], rel=1e-6)


def test_what_is_in_two_groups_is_in_the_first_of_them(capsys: Capture) -> None:
    nodes, lines, surfaces, names = make_row()
    again = [*surfaces, (3, surfaces[0][1], surfaces[0][2])]
    tables = bring_in("row.msh", write_2((nodes, lines, again, {**names, (2, 3): "first"})))
    assert list(tables["regions"]) == ["ends.1", "ends.2", "core"]
    assert "For entities with several physical groups the first one is used." in capsys.readouterr().out


def test_a_line_inside_of_a_region_is_a_crack() -> None:
    nodes, lines, surfaces, names = make_block(4, 4)
    tables = bring_in("crack.msh", write_2((nodes, lines, [(1, 1, own) for _, _, own in surfaces], names)),
                      "--friction", "0.4")  # fmt: skip
    assert tables["regions"]["lower"]["cracks"] == ["seam"] and tables["interfaces"] == {"seam": {"friction": 0.4}}


def test_lines_without_surfaces_are_traces(capsys: Capture) -> None:
    nodes, lines, _, names = make_block(2, 2)
    tables = bring_in("lines.msh", write_2((nodes, [line for line in lines if line[0] in (1, 3)], [], names)))
    assert list(tables["curves"]) == ["bottom", "seam"]
    assert tables["curves"]["seam"]["points"] == [[0, 1], [1, 1]] and tables["regions"]["plane"]["infinite"]


def test_options_of_maps_are_refused_for_meshes(capsys: Capture) -> None:
    Path("block.msh").write_text(write_2(make_block(2, 2)))
    assert main(["import", "block.msh", "-o", "made.toml", "--sxx", "1"]) == 2
    assert "found --sxx with a mesh of surfaces" in capsys.readouterr().err


def test_mutants(folder: Path) -> None:
    from scripts.fuzz_import import try_mutant

    # The last one is snapped at so far that cuts would bring ever more cuts, without end. The one before had parts
    # without a length, where rounding let ends cross what they lie on.
    ends = [try_mutant(seed, folder) for seed in (*range(1000, 1012), 70071, 2926)]
    assert ends[-1][0] == "refused" and "expected a smaller distance: --snap" in ends[-1][1]
    assert {end for end, _ in ends} == {"accepted", "refused"}, [said for end, said in ends if end == "wrong"]


def test_a_curve_that_turns_back_on_itself_is_told_by_the_angle(capsys: Capture) -> None:
    """Not as two curves, one of which is the other."""
    Path("case.toml").write_text("""
remote = { syy = 1.0 }
materials.rock = { young = 1e3, poisson = 0.25 }
curves.crack = { points = [[0, 0], [1, 0], [0, 1e-4]], elements = 10 }
regions.plane = { material = "rock", infinite = true, cracks = ["crack"] }
interfaces.crack = { law = "open" }
""")
    assert main(["check", "case.toml"]) == 2
    assert "legs of 'crack' meeting at (1, 0) at an angle of 0.0057 degrees" in capsys.readouterr().err
