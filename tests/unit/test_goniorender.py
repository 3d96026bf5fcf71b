"""goniorender as a person meets it: help, the example scenes at small size, a series, a report, bad input, Ctrl-C."""
import hashlib
import json
import os
import re
import signal
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

sys.path.insert(0, "tests/support")
import in_folders  # noqa: E402
from scenes import SCENES, small  # noqa: E402

GONIORENDER = Path(os.environ.get("BUILD", "build"), "goniorender").absolute()


def run(*words, cwd=None):
    done = subprocess.run([GONIORENDER, *map(str, words)], capture_output=True, text=True, timeout=300, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


def chunks(path):
    data = Path(path).read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at = 8
    while at < len(data):
        size, name = struct.unpack(">I4s", data[at:at + 8])
        yield name.decode(), data[at + 8:at + 8 + size]
        at += 12 + size


def origin_of(path):
    for name, data in chunks(path):
        if name == "iTXt" and data.startswith(b"goniod\0"):
            flags = data[7]
            text = data.split(b"\0", 5)[-1] if not flags else data[7 + 2:]
            if flags:
                language, keyword, text = text.split(b"\0", 2)
                text = zlib.decompress(text)
            return json.loads(text)
    raise AssertionError(f"{path} carries no origin")


def test_help_and_version(folder):
    for words in (["--help"], ["render", "--help"]):
        code, out, err = run(*words)
        assert code == 0 and "usage: goniorender" in out and err == ""
    assert run("--version")[1].startswith("goniorender ")
    assert run()[0] == 2 and run("paint")[0] == 2


def test_the_manual_names_every_command(folder):
    manual = Path("docs/goniorender.md").read_text()
    commands = re.findall(r"^  ([a-z]+)  ", run("--help")[1], re.M)
    assert {"render", "diff", "sheet"} <= set(commands)
    for command in commands:
        assert f"goniorender {command}" in manual, command


def test_the_manual_can_be_typed(folder):
    scene = small(folder, "cylinder.yaml").rename(folder / "SCENE.yaml")
    assert run("render", scene, "-o", folder / "r.png", "--planes", folder / "planes.exr")[0] == 0
    lines = re.findall(r"^goniorender (.*?)(?: +#.*)?$", Path("docs/goniorender.md").read_text(), re.M)
    typed = [line for line in lines if ".gonio" not in line]  # sessions: tests/scenario/test_fig8.py
    assert len(typed) >= 6, lines
    for line in typed:
        words = line.split() + (["--quick"] if line.startswith("bench") else [])
        code, out, err = run(*words, cwd=folder)
        assert code == 0, (line, err)
        assert "-o" not in words or (folder / words[words.index("-o") + 1]).stat().st_size > 0, line


def test_the_example_meshes_are_what_their_program_writes(folder):
    subprocess.run([sys.executable, SCENES / "meshes.py", folder], check=True)
    for name in ("bowl.obj", "knot.ply"):
        assert (folder / name).read_bytes() == (SCENES / name).read_bytes(), name


def test_meshes_tell_what_they_are_and_what_they_need(folder):
    scene = small(folder, "mesh.yaml")
    code, out, err = run("render", scene, "-o", folder / "m.png")
    assert code == 0, err
    assert "mesh:     bowl.obj, 1248 triangles, 48 x 20.6 x 48 mm; 96 of no area left out, 0 turned" in out
    assert "Embree (3936 triangles in 2 meshes)" in out
    environment = {**os.environ, "LD_PRELOAD": str(GONIORENDER.parent / "tests/preload/no_embree.so")}
    if "asan" in GONIORENDER.parts:  # the run-time library of ASan must be the first
        return
    for words, expected in ((scene, 2), (small(folder, "cylinder.yaml"), 0)):
        done = subprocess.run([GONIORENDER, "render", words, "-o", folder / "m.png"], env=environment,
                              capture_output=True, text=True, timeout=300)
        assert done.returncode == expected, done.stderr
        assert (expected == 2) == ("install the Debian package libembree3-3" in done.stderr), done.stderr


def test_every_example_renders(folder):
    scenes = sorted(p.name for p in SCENES.glob("*.yaml") if "session:" not in p.read_text())
    assert scenes, "no example needs no session"
    for scene in scenes:
        code, out, err = run("render", small(folder, scene), "-o", folder / "p.png")
        assert code == 0, (scene, err)
        assert "left out: " in out and "kept: " in out and "exposure: " in out
        assert list(folder.glob("p*.png")), scene
        for picture in folder.glob("p*.png"):
            header = dict(chunks(picture))["IHDR"]
            assert struct.unpack(">II", header[:8]) == (32, 24)
            picture.unlink()


def test_a_series_is_numbered(folder):
    code, out, err = run("render", small(folder, "raking.yaml"), "-o", folder / "r.png", "--report", folder / "r.json")
    assert code == 0, err
    assert sorted(p.name for p in folder.glob("r-*.png")) == ["r-001.png", "r-002.png", "r-003.png"]
    reports = json.loads((folder / "r.json").read_text())
    xs = [r["lights"][0]["direction"][0] for r in reports]
    assert xs[0] < -0.8 and abs(xs[1]) < 1e-12 and xs[2] > 0.8


def test_a_picture_carries_its_origin(folder):
    scene = small(folder, "cylinder.yaml")
    code, out, err = run("render", scene, "-o", folder / "c.png", "--report", folder / "c.json")
    assert code == 0, err
    origin, report = origin_of(folder / "c.png"), json.loads((folder / "c.json").read_text())
    for key in ("program", "command", "scene", "materials", "lights", "observer", "space", "adaptation", "exposure",
                "left_out", "kept", "bound", "counts", "clipped", "out_of_gamut", "max_y", "white"):
        assert origin[key] == report[key], key
    assert origin["materials"][0]["parameters"]["beta_prime"] == 7.6
    assert str(scene) in origin["command"]
    assert set(report["seconds"]) == {"parse", "trace", "trace_cpu", "colour", "write"}


def test_a_room_is_part_of_the_origin(folder):
    scene = small(folder, "room.yaml", samples=4, grid=1)
    code, out, err = run("render", scene, "-o", folder / "p.png")
    assert code == 0, err
    assert "drawn by light and facets, the light is all around" in out and "random samples a pixel" in out
    origin = origin_of(folder / "p.png")
    light = origin["lights"][0]
    assert light["kind"] == "environment" and light["image"] == "room.png"
    assert light["sha256"] == hashlib.sha256((SCENES / "room.png").read_bytes()).hexdigest()
    assert origin["noise_y"] > 0 and origin["counts"]["drawn"] > 0 and "facet sampling" in origin["kept"]


def test_threads_and_all_features_give_the_same_picture(folder):
    scene = small(folder, "cylinder.yaml", grid=2)
    pixels = []
    for words in ([], ["--threads", 1], ["--threads", 3], ["--all-features"]):
        code, out, err = run("render", scene, "-o", folder / "t.png", *words)
        assert code == 0, err
        pixels.append([data for name, data in chunks(folder / "t.png") if name == "IDAT"])
    assert pixels[0] == pixels[1] == pixels[2] == pixels[3]


def test_recolour_needs_no_scene(folder):
    for name in ("cylinder.yaml", "fold.yaml"):
        recolour_without(folder, small(folder, name))


def recolour_without(folder, scene):
    assert run("render", scene, "-o", folder / "r.png", "--planes", folder / "p.exr")[0] == 0
    scene.write_text(scene.read_text().replace("D65", "A"))
    assert run("render", scene, "-o", folder / "a.png")[0] == 0
    scene.unlink()
    for words, like in ((["--spd", "D65"], "r.png"), (["--spd", "A"], "a.png")):
        code, out, err = run("recolour", folder / "p.exr", "-o", folder / "c.png", *words)
        assert code == 0, err
        pixels = [[data for name, data in chunks(folder / p) if name == "IDAT"] for p in ("c.png", like)]
        assert pixels[0] == pixels[1], words
    origin, rendered = origin_of(folder / "c.png"), origin_of(folder / "r.png")
    assert origin["rendered"] == rendered and origin["command"].startswith("goniorender recolour ")
    assert origin["lights"] == [{**rendered["lights"][0], "spd": "A"}] and origin["white"] != rendered["white"]
    for key in ("materials", "left_out", "kept", "grid"):
        assert origin[key] == rendered[key], key
    for words in (["--spd", "X"], ["--spd", "A", "--spd", "A"], ["--space", "cmyk"], ["--session", "red=x.gonio"]):
        code, out, err = run("recolour", folder / "p.exr", "-o", folder / "x.png", *words)
        assert code == 2 and err and not (folder / "x.png").exists(), words


def test_several_bounces(folder):
    scene = small(folder, "fold.yaml")
    code, out, err = run("render", scene, "-o", folder / "p.png", "--planes", folder / "p.exr",
                         "--spectral", folder / "s.exr")
    assert code == 0 and "rays beyond the first bounce" in out, err
    assert "rendered as fitted, beyond the first bounce scaled" in out
    origin = origin_of(folder / "p.png")
    assert origin["bounces"] == 5 and origin["energy"] == "scale" and "interreflection" in origin["kept"]
    assert origin["counts"]["indirect_rays"] >= origin["counts"]["indirect_hits"] > 0
    code, out, err = run("render", scene, "-o", folder / "r.png", "--energy", "report")
    assert code == 0 and "rendered as fitted\n" in out and origin_of(folder / "r.png")["energy"] == "report", err
    pixels = [[data for name, data in chunks(folder / p) if name == "IDAT"] for p in ("p.png", "r.png")]
    assert pixels[0] != pixels[1]
    code, out, err = run("render", scene, "-o", folder / "x.png", "--energy", "more")
    assert code == 2 and "--energy" in err and not (folder / "x.png").exists(), err
    code, out, err = run("render", scene, "-o", folder / "u.png", "--uncertainty", folder / "u.exr")
    assert code == 0 and "uncertainty: " in out and err.count("exactly known") == 2, err
    code, out, err = run("recolour", folder / "p.exr", "-o", folder / "x.png", "--session", "orange=x.gonio")
    assert code == 2 and "another S(lambda)" in err and not (folder / "x.png").exists()
    code, out, err = run("sheet", folder / "p.exr", "-o", folder / "x.png", "--spd", "D65", "--spd", "A")
    assert code == 0, err


def test_spectral_picture_and_tiff(folder):
    scene = small(folder, "cylinder.yaml")
    code, out, err = run("render", scene, "-o", folder / "p.tif", "--spectral", folder / "s.exr")
    assert code == 0, err
    tiff, exr = (folder / "p.tif").read_bytes(), (folder / "s.exr").read_bytes()
    assert tiff[:4] in (b"II*\0", b"MM\0*") and b'"materials"' in tiff
    assert exr[:4] == b"\x76\x2f\x31\x01" and b"S0.550,000000nm\0" in exr and b'"materials"' in exr
    code, out, err = run("render", small(folder, "raking.yaml"), "-o", folder / "r.png", "--spectral", folder / "r.exr")
    assert code == 2 and "series" in err and not (folder / "r.exr").exists()


def test_uncertainty_of_what_is_exactly_known(folder):
    scene = small(folder, "cylinder.yaml")
    code, out, err = run("render", scene, "-o", folder / "p.png", "--uncertainty", folder / "u.exr",
                         "--report", folder / "r.json")
    assert code == 0 and "counts as exactly known: it is given by parameters" in err, err
    said = json.loads((folder / "r.json").read_text())["uncertainty"]
    assert said["median_of_p95"] == 0 and said["p95_of_sampling"] > 0 and said["exactly_known"] == ["green"], said
    assert b"covLab.ab\0" in (folder / "u.exr").read_bytes()
    code, out, err = run("render", small(folder, "raking.yaml"), "-o", folder / "s.png", "--uncertainty",
                         folder / "s.exr")
    assert code == 2 and "series" in err


def test_diff(folder):
    scene = small(folder, "cylinder.yaml")
    code, out, err = run("diff", scene, "--other-spd", "A", "-o", folder / "d.png", "--report", folder / "d.json",
                         "--values", folder / "d.exr")
    assert code == 0 and "CIEDE2000: mean" in out, err
    report = json.loads((folder / "d.json").read_text())
    assert origin_of(folder / "d.png") == report and (folder / "d.exr").stat().st_size > 1000
    assert 0.5 < report["mean"] <= report["p95"] <= report["max"] and report["pixels_in_one_only"] == [0, 0]
    assert [report[half]["lights"][0]["spd"] for half in ("first", "second")] == ["D65", "A"]
    # The same said by two scene files, and a scene against itself.
    other = folder / "other.yaml"
    other.write_text(scene.read_text().replace("D65", "A"))
    assert run("diff", scene, other, "--report", folder / "e.json")[0] == 0
    again = json.loads((folder / "e.json").read_text())
    for key in ("mean", "p95", "max", "mean_lab_second"):
        assert again[key] == report[key], key
    assert run("diff", scene, scene, "--report", folder / "e.json")[0] == 0
    assert json.loads((folder / "e.json").read_text())["max"] == 0
    for words in ([], [scene, "--other-spd", "X"], [scene, "--spd", "A", "--spd", "A"], [scene, "--top", "0"],
                  [scene, small(folder, "swatches.yaml", width=31)], [small(folder, "raking.yaml")]):
        code, out, err = run("diff", *words, "--values", folder / "x.exr")
        assert code == 2 and err and not (folder / "x.exr").exists(), (words, code, err)


def test_sheet(folder):
    scene = small(folder, "cylinder.yaml")
    assert run("render", scene, "-o", folder / "r.png", "--planes", folder / "p.exr")[0] == 0
    for source in (scene, folder / "p.exr"):
        code, out, err = run("sheet", source, "-o", folder / "s.png")
        assert code == 0 and "row 2, column 3: F11" in out, err
        assert struct.unpack(">II", dict(chunks(folder / "s.png"))["IHDR"][:8]) == (3 * 32 + 8, 2 * 24 + 4)
        tiles = origin_of(folder / "s.png")["sheet"]["tiles"]
        assert [t["spd"] for t in tiles] == ["A", "D50", "D65", "F2", "F7", "F11"]
    code, out, err = run("sheet", scene, "-o", folder / "s.tif", "--spd", "D65", "--spd", "5003 K", "--columns", "1",
                         "--report", folder / "s.json")
    assert code == 0 and json.loads((folder / "s.json").read_text())["sheet"]["rows"] == 2, err
    for words in ([], [scene, "--spd", "X"], [scene, "--columns", "0"], [small(folder, "raking.yaml")],
                  [folder / "p.exr", "--session", "green=x.gonio"]):
        code, out, err = run("sheet", *words, "-o", folder / "x.png")
        assert code == 2 and err and not (folder / "x.png").exists(), (words, code, err)


def test_extremes_are_all_numbers(folder):
    code, out, err = run("stability")
    rows = [line.split("|") for line in out.splitlines()[2:]]
    assert code == 0 and len(rows) == 22, err
    assert all(int(row[3]) > 0 and int(row[4]) == 0 for row in rows), out
    assert run("stability", "now")[0] == 2


def test_bench_writes_its_report(folder):
    code, out, err = run("bench", "--quick", "-o", folder / "r.md", "--csv", folder / "r.csv")
    assert code == 0 and out == "", err
    report = (folder / "r.md").read_text()
    for words in ("the figures below are worth nothing", "| S2 acrylic 17 | 64 |", "recolour, planes in memory",
                  "| sums over wavelengths |", "| 20 nm |", "(S4)", "## S5: a mesh", "| 8832 |", "commit ", "compiler: gcc", "libpng 1."):
        assert words in report, words
    assert re.search(r"at most \d\.\de-1[0-9] apart", report), "shade.h and reflectance.h differ"
    rows = [line.split(",") for line in (folder / "r.csv").read_text().splitlines() if line]
    assert len(rows) == 1 + 6 * 4 + 5 * 2 * 4 + 9 * 3
    rmse = {(row[0], row[1]): float(row[2]) for row in rows[1:]}
    # Narrow lobes need facets, a wide one the light alone, and each is what a picture takes.
    assert 10 * rmse["S3 g .01 3000 facets (chosen)", "64"] < rmse["S3 g .01 3000 light", "64"]
    assert rmse["S3 g .2 15.7 light (chosen)", "16"] < rmse["S3 g .2 15.7 facets", "16"]
    # The same paths with 4 wavelengths each add the noise of colour.
    assert all(rmse["S4 90 % 81", n] < 0.7 * rmse["S4 90 % 4", n] for n in ("4", "16", "64"))
    assert run("bench", "fast")[0] == 2


def test_bad_input_starts_nothing(folder):
    bad = folder / "bad.yaml"
    bad.write_text("camera: {orthographic: {height_mm: 50}}\nlights:\n  - beam: {theta: 20}\n")
    code, out, err = run("render", bad, "-o", folder / "b.png")
    assert code == 2 and f"{bad}:3:" in err and "theta_deg" in err and out == "", err
    assert not (folder / "b.png").exists()
    scene = small(folder, "cylinder.yaml")
    for words in (["render", scene], ["render", "-o", "x.png"], ["render", scene, "-o", "x.jpg"],
                  ["render", scene, "-o", "x.png", "--threads", "0"],
                  ["render", scene, "-o", "x.png", "--session", "green"],
                  ["render", scene, "-o", "x.png", "--session", "green=none.gonio"]):
        code, out, err = run(*words, cwd=folder)
        assert code == 2 and err and not list(folder.glob("x*")), words
    code, out, err = run("render", scene, "-o", folder / "missing" / "x.png")
    assert code == 1 and "cannot be written" in err


def test_a_lamp_file_that_ends_too_soon_is_told(folder):
    scene = small(folder, "cylinder.yaml")
    scene.write_text(scene.read_text().replace("D65", "lamp.csv"))
    (folder / "lamp.csv").write_text("lambda_nm,value\n400,1\n700,1\n")
    code, out, err = run("render", scene, "-o", folder / "l.png")
    assert code == 0 and "light lamp.csv: its file does not cover 20 of 81 bands" in err, err


def interrupted_rows(folder, scene, after_ticks):
    """Rows done when SIGINT comes after so much computing (in 1/100 s)."""
    program = subprocess.Popen([GONIORENDER, "render", scene, "-o", folder / "i.png", "--threads", "1"],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    # "material: ..." is flushed only at the end, so the kernel is asked whether it computes already.
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline:
        ticks = int(Path(f"/proc/{program.pid}/stat").read_text().rsplit(")", 1)[1].split()[11])
        if ticks >= after_ticks:
            break
        time.sleep(0.01)
    program.send_signal(signal.SIGINT)
    out, err = program.communicate(timeout=300)
    assert program.returncode == 1 and "interrupted: " in err, err
    rows = origin_of(folder / "i.png")["counts"]["rows_done"]
    assert f"holds {rows} of 4000 rows" in err
    (folder / "i.png").unlink()
    return rows


def test_ctrl_c_keeps_what_is_done(folder):
    scene = small(folder, "cylinder.yaml", width=600, height=4000, grid=8)
    # A slow machine has not come to its first row that soon.
    rows = next((n for n in (interrupted_rows(folder, scene, ticks) for ticks in (20, 80, 320)) if n > 0), 0)
    assert 0 < rows < 4000


if __name__ == "__main__":
    sys.exit(in_folders.run(globals()))
