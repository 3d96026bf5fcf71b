"""`gonioctl replay` at the command line: exit status, the one JSON object, the words where something differs."""
import json
import signal
import sqlite3
import struct
import sys
import tempfile

sys.path.insert(0, "tests/support")
from goniod import Goniod, write_job  # noqa: E402


def record(folder):
    goniod = Goniod(folder)
    goniod.start()
    goniod.order("run", write_job(folder).name)
    assert goniod.wait_for_end() == "done"
    goniod.signal(signal.SIGTERM)
    return goniod, goniod.names()[0]


def alter(goniod, name):
    """One reading 4 % brighter; returns its exposure."""
    with sqlite3.connect(goniod.sessions / f"{name}.gonio") as db:
        db.execute("DROP TRIGGER exposure_no_update")
        rows = db.execute("SELECT id, counts FROM exposure WHERE kind = 'sample' AND saturated_pixels = 0").fetchall()
        number, counts = rows[len(rows) // 2]
        values = struct.unpack(f"<{len(counts) // 2}H", counts)
        brighter = struct.pack(f"<{len(values)}H", *(min(65535, round(v * 1.04)) for v in values))
        db.execute("UPDATE exposure SET counts = ? WHERE id = ?", (brighter, number))
    return number


def test_the_truth_gives_the_same_bytes(goniod, name):
    code, out, err = goniod.ctl("replay", name, "--surface", "truth", "--json")
    answer = json.loads(out)
    assert code == 0 and not err and answer["identical"] and answer["agrees"], out
    assert answer["against"] == "physics" and answer["surface"] == "truth" and answer["seed"] == 1
    assert answer["median_difference_u"] == 0 and answer["missing"] == 0 and answer["points"] > 20


def test_the_estimate_agrees_in_words(goniod, name):
    code, out, err = goniod.ctl("replay", name, "--against", "physics")
    assert code == 0 and not err
    assert "fitted estimate" in out and "chi2 per point" in out and out.endswith("agrees within its uncertainties\n")


def test_what_all_bands_found_of_the_bench_is_kept(goniod, name):
    joint = json.loads(goniod.order("show", name, "--json"))["joint"]
    assert joint["converged"] and joint["u_mirror_offset_deg"] > 0, joint["refusal"]
    told = f"off by {joint['mirror_offset_deg']:.4f} deg, u {joint['u_mirror_offset_deg']:.4f}"
    text = goniod.order("show", name)
    assert told in text[text.index("joint fit"):], text


def test_bad_usage_is_2(goniod, name):
    for words, part in [(("--against", "recording"), "not there yet"), (("--against", "x"), "takes physics"),
                        (("--surface", "x"), "estimate or truth"), (("--seed", "x"), "whole number")]:
        code, out, err = goniod.ctl("replay", name, *words)
        assert code == 2 and not out and part in err and err.count("\n") == 1, (code, out, err)
    assert goniod.ctl("replay", "nowhere")[0] == 2


def test_an_altered_reading_is_named(goniod, name):
    exposure = alter(goniod, name)
    for words in ((), ("--surface", "truth")):
        code, out, _ = goniod.ctl("replay", name, "--json", *words)
        answer = json.loads(out)
        assert code == 1 and answer["cause"] == "points" and not answer["agrees"], out[:600]
        assert answer["worst"][0]["exposure"] == exposure and answer["worst"][0]["against_neighbours"] > 5
        assert f"exposure {exposure})" in answer["text"]


def main():
    tests = [test_the_truth_gives_the_same_bytes, test_the_estimate_agrees_in_words,
             test_what_all_bands_found_of_the_bench_is_kept, test_bad_usage_is_2,
             test_an_altered_reading_is_named]
    print(f"1..{len(tests)}")
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        goniod, name = record(folder)
        for n, test in enumerate(tests, 1):
            try:
                test(goniod, name)
                print(f"ok {n} - {test.__name__}")
            except AssertionError as e:
                failed += 1
                print(f"not ok {n} - {test.__name__}\n# {str(e)[:1200]}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
