"""The files of a picture: its origin names each that went into it by its bytes, and one that cannot be written is told
before the work."""
import functools
import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, "tests/support")
import in_folders  # noqa: E402
from scenes import small  # noqa: E402

GONIORENDER = Path(os.environ.get("BUILD", "build"), "goniorender").absolute()
tiny = functools.partial(small, width=16, height=12, samples=4)


def run(*words, cwd=None, stdout=subprocess.PIPE):
    done = subprocess.run([GONIORENDER, *map(str, words)], stdout=stdout, stderr=subprocess.PIPE, text=True,
                          timeout=300, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


def origin(folder, scene, *words):
    code, out, err = run("render", scene, "-o", "p.png", "--report", "r.json", *words, cwd=folder)
    assert code == 0, err
    report = json.loads((folder / "r.json").read_text())
    return report[0] if isinstance(report, list) else report


def origin_of_tiff(path):
    data = path.read_bytes()
    return json.loads(data[data.index(b'{"program"'):].split(b"\0")[0])


def hashes(value):
    """Every file that an origin names, as {name: sha256}."""
    found = {}
    if isinstance(value, list):
        for one in value:
            found |= hashes(one)
    elif isinstance(value, dict):
        for name, sha in (("file", "sha256"), ("scene", "scene_sha256"), ("spd", "spd_sha256"), ("image", "sha256")):
            if name in value and sha in value:
                found[Path(value[name]).name] = value[sha]
        for one in value.values():
            found |= hashes(one)
    return found


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def lamp(folder):
    (folder / "lamp.csv").write_text("lambda_nm,value\n380,1\n780,3\n")


def test_every_file_of_a_picture_is_named(folder):
    cases = {"painting.yaml": {"mask.png", "relief.png", "green.csv", "blue.csv", "orange.csv", "lamp.csv"},
             "mesh.yaml": {"bowl.obj", "knot.ply", "blue.csv", "orange.csv", "lamp.csv"},
             "room.yaml": {"room.png"}}
    for name, files in cases.items():
        scene = tiny(folder, name)
        lamp(folder)
        scene.write_text(re.sub(r"spd: (D50|D65)", "spd: lamp.csv", scene.read_text()))
        named = hashes(origin(folder, scene))
        assert files | {name} <= set(named), (name, named)
        for file, sha in named.items():
            assert sha == sha256(folder / file), file


def test_one_byte_changes_the_origin(folder):
    """At a place that no pixel shows: only the bytes differ."""
    scene = tiny(folder, "painting.yaml")
    before = origin(folder, scene)
    for file in ("mask.png", "relief.png", "green.csv"):
        with open(folder / file, "ab") as out:
            out.write(b"\n")
        after = origin(folder, scene)
        assert {n for n, sha in hashes(after).items() if sha != hashes(before)[n]} == {file}
        before = after


def test_a_file_that_is_not_read_is_not_named(folder):
    scene = tiny(folder, "painting.yaml")
    scene.write_text(scene.read_text().replace("relief_mm: 0.5", "relief_mm: 0"))
    (folder / "relief.png").unlink()
    shape = origin(folder, scene)["shapes"][0]
    assert shape["kind"] == "rectangle" and "relief" not in shape and shape["mask"]["file"] == "mask.png"


def test_recoloured_planes_name_the_new_lamp(folder):
    scene = tiny(folder, "cylinder.yaml")
    lamp(folder)
    scene.write_text(scene.read_text().replace("spd: D65", "spd: lamp.csv"))
    was = origin(folder, scene, "--planes", "p.exr")["lights"][0]
    assert was["spd_sha256"] == sha256(folder / "lamp.csv")
    for words in ([], ["--spd", "A"], ["--spd", "new.csv"]):
        (folder / "new.csv").write_text("lambda_nm,value\n380,3\n780,1\n")
        code, out, err = run("recolour", "p.exr", "-o", "c.tif", *words, cwd=folder)
        assert code == 0, err
        now = origin_of_tiff(folder / "c.tif")["lights"][0]
        spd = words[-1] if words else "lamp.csv"
        assert now["spd"] == spd
        assert now.get("spd_sha256") == (sha256(folder / spd) if spd.endswith("csv") else None)
    code, out, err = run("sheet", "p.exr", "-o", "s.png", "--spd", "A", "--spd", "new.csv", "--report", "s.json",
                         cwd=folder)
    tiles = json.loads((folder / "s.json").read_text())["sheet"]["tiles"]
    assert "spd_sha256" not in tiles[0] and tiles[1]["spd_sha256"] == sha256(folder / "new.csv")


def unwritable(folder):
    (folder / "taken.png").mkdir()
    yield folder / "missing" / "x.png", "missing"
    yield folder / "taken.png", "is a folder"
    yield Path("/proc/self/x.png"), "/proc/self/x."  # a folder that takes no file, even from root


def test_what_cannot_be_written_is_told_before_the_work(folder):
    scene = tiny(folder, "cylinder.yaml")
    assert run("render", scene, "-o", folder / "r.png", "--planes", folder / "p.exr")[0] == 0
    good = folder / "good.png"
    for bad, why in unwritable(folder):
        exr, report = bad.with_suffix(".exr"), bad.with_suffix(".json")
        if bad.name == "taken.png":
            exr.mkdir()
            report.mkdir()
        for words in (["render", scene, "-o", bad], ["render", scene, "-o", good, "--planes", exr],
                      ["render", scene, "-o", good, "--spectral", exr],
                      ["render", scene, "-o", good, "--uncertainty", exr],
                      ["render", scene, "-o", good, "--report", report],
                      ["diff", scene, "--other-spd", "A", "-o", bad],
                      ["diff", scene, "--other-spd", "A", "--values", exr],
                      ["diff", scene, "--other-spd", "A", "--report", report],
                      ["sheet", scene, "-o", bad], ["sheet", scene, "-o", good, "--report", report],
                      ["recolour", folder / "p.exr", "-o", bad],
                      ["bench", "--quick", "-o", bad], ["bench", "--quick", "--csv", bad],
                      ["bench", "--quick", "--plot", bad]):
            code, out, err = run(*words)
            assert code == 1 and why in err and err.count("\n") == 1 and out == "", (words, code, out, err)
            assert not good.exists(), words
    assert not [p.name for p in folder.rglob("*.part")]


def test_a_series_is_checked_by_its_numbers(folder):
    scene = tiny(folder, "raking.yaml")
    (folder / "r-002.png").mkdir()
    code, out, err = run("render", scene, "-o", folder / "r.png")
    assert code == 1 and "r-002.png" in err and out == "" and not (folder / "r-001.png").exists(), err


def test_what_is_protected_stays(folder):
    """Nobody may write it; root always may."""
    scene = tiny(folder, "cylinder.yaml")
    kept = folder / "kept.png"
    kept.write_bytes(b"kept")
    kept.chmod(0o444)
    code, out, err = run("render", scene, "-o", kept)
    if os.getuid() == 0:
        assert code == 0, err
    else:
        assert code == 1 and "kept.png" in err and kept.read_bytes() == b"kept", err


def test_a_full_output_is_told(folder):
    scene = tiny(folder, "cylinder.yaml")
    for words in (["--help"], ["--scene-reference"], ["render", scene, "-o", folder / "f.png"], ["stability"]):
        with open("/dev/full", "w") as full:
            code, out, err = run(*words, stdout=full)
        assert code == 1 and "goniorender: not everything could be written" in err, (words, code, err)


if __name__ == "__main__":
    sys.exit(in_folders.run(globals()))
