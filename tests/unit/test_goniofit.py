"""goniofit as a person meets it: help, eval against a formula of its own, fit of what eval printed, bad input."""
import json
import math
import os
import random
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, "tests/support")
import in_folders  # noqa: E402

GONIOFIT = Path(os.environ.get("BUILD", "build"), "goniofit")
MATERIAL = {"S": 0.2, "sigma": 0.3, "gamma": 0.07, "beta_prime": 7.6, "n": 1.7, "kappa": 1, "q": 1.5}


def run(*words, text=None):
    done = subprocess.run([GONIOFIT, *map(str, words)], input=text, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout, done.stderr


def formula(i_deg, v_deg, m, p=0.0):
    """The printed equations, in plane."""
    i, v = math.radians(i_deg), math.radians(v_deg)
    alpha, beta, side = max(i, abs(v)), min(i, abs(v)), -1 if v > 0 else 1
    s2 = m["sigma"] ** 2
    c2 = 0.45 * s2 / (s2 + 0.09) * (math.sin(alpha) - ((2 * beta / math.pi) ** 3 if side < 0 else 0))
    diffuse = m["S"] * (1 - 0.5 * s2 / (s2 + 0.33) + side * c2 * math.tan(beta))
    inter = m["kappa"] * m["q"] * 0.17 * m["S"] ** 2 * s2 / (s2 + 0.13) * (1 - side * (2 * beta / math.pi) ** 2)
    phi, tq = abs(i - v) / 2, abs(i + v) / 2
    g = min(1, 2 * math.cos(phi) * min(math.cos(i), math.cos(v)) / math.cos(tq))
    c = math.cos(tq)
    root = math.sqrt(m["n"] ** 2 + c * c - 1)
    f = 0.5 * ((root - c) / (root + c)) ** 2 * (
        1 + p + (1 - p) * ((c * (root + c) - 1) / (c * (root - c) + 1)) ** 2)
    d = math.exp(-math.log(2) * (phi / m["gamma"]) ** 2)
    return diffuse + inter + m["beta_prime"] * d * g * f / (math.cos(i) * math.cos(v))


def rows_of(text):
    head, *lines = text.strip().splitlines()
    names = head.split(",")
    return [dict(zip(names, map(float, line.split(",")))) for line in lines]


def grid(folder):
    path = folder / "g.csv"
    path.write_text("theta_i_deg,note,theta_v_deg\n" + "".join(
        f"{i},x,{v}\n" for i in range(10, 61, 10) for v in range(-80, 81, 5)))
    return path


def evaluated(folder, material=None):
    params = folder / "p.json"
    params.write_text(json.dumps(material or MATERIAL))
    code, out, err = run("eval", "--params", params, "--points", grid(folder))
    assert code == 0, err
    return rows_of(out)


def means_of(folder, material, name="means.csv", degree=1.0, scale=1.0):
    path = folder / name
    path.write_text("theta_i_deg,theta_v_deg,beta,u_beta\n" + "".join(
        f"{r['theta_i_deg'] * degree},{r['theta_v_deg'] * degree},{r['beta'] * scale},{0.002 * r['beta'] * scale}\n"
        for r in evaluated(folder, material)))
    return path


def test_means_of_a_coloured_surface_want_their_q(folder):
    path = means_of(folder, dict(MATERIAL, q=1.9))
    code, out, err = run("fit", path, "--json")
    fitted = json.loads(out)
    assert code == 0 and fitted["parameters"]["q"] == 1, fitted["parameters"]
    assert fitted["parameters"]["S"] / MATERIAL["S"] - 1 > 0.005, "without it S is wrong, and no residual shows it"
    assert any("do not tell q" in note for note in fitted["input"]["notes"])
    code, out, err = run("fit", path, "--json", "--q", "1.9")
    fitted = json.loads(out)
    assert code == 0 and fitted["parameters"]["q"] == 1.9 and fitted["chi2"] < 1e-6 and not fitted["input"]["notes"]
    assert abs(fitted["parameters"]["S"] / MATERIAL["S"] - 1) < 1e-6
    assert run("fit", path, "--q", "0.5")[0] == 2


def test_what_was_not_meant_is_asked(folder):
    for unit, path in (("radians", means_of(folder, MATERIAL, "rad.csv", degree=math.pi / 180)),
                       ("per cent", means_of(folder, MATERIAL, "percent.csv", scale=100))):
        assert f"are they {unit}?" in run("fit", path)[1]
    code, out, err = run("fit", means_of(folder, MATERIAL), "--max-theta-i", "5")
    assert code == 1 and "left out: 198 points of an incidence beyond --max-theta-i" in out, out


def test_eval_agrees_with_the_printed_equations(folder):
    rows = evaluated(folder)
    assert len(rows) == 198
    for row in rows:
        expected = formula(row["theta_i_deg"], row["theta_v_deg"], MATERIAL)
        assert abs(row["beta"] - expected) < 1e-12 * max(1, expected), row
        parts = row["diffuse"] + row["interreflection"] + row["specular"]
        assert abs(row["beta"] - parts) < 1e-13 * max(1, parts)
    step = dict(MATERIAL, gamma=0.07 + 1e-6)
    for row, moved in zip(rows, evaluated(folder, step)):
        assert abs((moved["beta"] - row["beta"]) / 1e-6 - row["d_gamma"]) < 1e-2 + 1e-3 * abs(row["d_gamma"])
    assert list(evaluated(folder, {"S": 0.5})[0]) == ["theta_i_deg", "theta_v_deg", "beta", "diffuse",
                                                     "interreflection", "specular", "d_S"]


def measured(folder, name="d.csv", noise=0.003):
    dice = random.Random(4)
    path = folder / name
    with open(path, "w") as f:
        f.write("theta_i_deg,theta_v_deg,beta,u_ind\n")
        for row in evaluated(folder, dict(MATERIAL, q=1)):
            u = noise * row["beta"] + 1e-4
            f.write(f"{row['theta_i_deg']},{row['theta_v_deg']},{row['beta'] + dice.gauss(0, u):.9g},{u:.4g}\n")
    return path


def test_fit_finds_what_eval_was_given(folder):
    path = measured(folder)
    code, out, err = run("fit", path, "--json")
    assert code == 0, err
    fit = json.loads(out)
    for name in ("S", "sigma", "gamma", "beta_prime", "n"):
        assert abs(fit["parameters"][name] - MATERIAL[name]) < 4.5 * fit["std"][name], name
    for key in ("model", "n_points", "converged", "std_statistical", "std_common", "correlation", "chi2", "bic", "r2",
                "median_relative_error", "specular_energy", "at_bound", "warnings", "not_identifiable", "trace",
                "solver"):
        assert key in fit, key
    assert fit["trace"][0]["cost"] >= fit["trace"][-1]["cost"] > 0
    (folder / "fit.json").write_text(out)
    code, out, err = run("eval", "--params", folder / "fit.json", "--points", grid(folder))
    assert code == 0 and len(rows_of(out)) == 198, err
    code, out, err = run("fit", path)
    assert code == 0 and "beta_prime" in out and "chi-square" in out


def test_a_lobe_that_does_not_show_has_no_uncertainty(folder):
    """Null and a reason, in JSON and in words: 0 would say that its width is known exactly."""
    dice, path = random.Random(5), folder / "matte.csv"
    rows = evaluated(folder, dict(MATERIAL, q=1, beta_prime=1e-9))
    head, cells = "theta_i_deg,theta_v_deg", []
    for row in rows:
        u = 0.003 * row["beta"]
        beta = [f"{row['beta'] + dice.gauss(0, u):.9g},{u:.4g}" for _ in range(2)]
        cells.append(",".join([f"{row['theta_i_deg']},{row['theta_v_deg']}", *beta]))
    path.write_text("\n".join([head + ",beta_500nm,u_500nm,beta_600nm,u_600nm", *cells]) + "\n")
    code, out, err = run("fit", path, "--joint", "--json")
    assert code == 0, err
    fit = json.loads(out)
    named = fit["at_bound"] + [gap["parameter"] for gap in fit["not_identifiable"] if gap["why"]]
    without = [name for name, std in fit["std"].items() if std is None]
    assert "gamma" in without and "n" in without and set(without) <= set(named), (fit["std"], named)
    assert 0 not in fit["std"].values() and fit["std"]["S"] > 0
    for part in ("std_statistical", "std_common"):
        assert [name for name, std in fit[part].items() if std is None] == without
    code, out, err = run("fit", path, "--joint")
    assert code == 0 and "nan" not in out, out
    for line in out.splitlines():
        if line.split()[:1] in (["gamma"], ["n"]):
            assert "at its bound" in line or (" - " in line and "not identifiable" in line), line


def test_all_bands_tell_the_polarisation(folder):
    """P, which no band alone tells so well, is among what the joint fit found: in JSON and in words."""
    dice, path, p = random.Random(6), folder / "polarised.csv", 0.04
    bands = {500: 0.1, 600: 0.3}
    with open(path, "w") as f:
        f.write("theta_i_deg,theta_v_deg," + ",".join(f"beta_{nm}nm,u_{nm}nm" for nm in bands) + "\n")
        for i, v in ((i, v) for i in range(10, 61, 10) for v in range(-80, 81, 5)):
            cells = [i, v]
            for s in bands.values():
                beta = formula(i, v, dict(MATERIAL, q=1, S=s), p)
                cells += [f"{beta + dice.gauss(0, 0.003 * beta + 1e-4):.9g}", f"{0.003 * beta + 1e-4:.4g}"]
            f.write(",".join(map(str, cells)) + "\n")
    words = ("fit", path, "--joint", "--polarisation", "0,0.1")
    code, out, err = run(*words, "--json")
    assert code == 0, err
    joint = json.loads(out)["joint"]
    assert 0 < joint["u_polarisation"] < 0.03 and joint["u_mirror_offset_deg"] == 0, joint["u_polarisation"]
    assert abs(joint["polarisation"] - p) < 3 * joint["u_polarisation"], joint["polarisation"]
    code, out, err = run(*words)
    rows = [line.split() for line in out[out.index("joint fit"):].splitlines()]
    found = [row for row in rows if row and row[0] == "P"]
    assert len(found) == 1 and abs(float(found[0][1]) - joint["polarisation"]) < 1e-6, out
    assert abs(float(found[0][2]) / joint["u_polarisation"] - 1) < 0.01


def test_what_the_instrument_is_known_to_be(folder):
    path = measured(folder)
    code, out, err = run("fit", path, "--json")
    plain = json.loads(out)
    span = plain["polarisation_span"]  # of a file, nothing is known
    assert span["P"] == [-0.1, 0.1] and span["n"][0] < plain["parameters"]["n"] < span["n"][1], span
    code, out, err = run("fit", path, "--json", "--source-width", 2, "--sensor-width", 1, "--polarisation", "0.05,0.03")
    seen = json.loads(out)
    assert code == 0 and seen["source_width_deg"] == 2 and seen["sensor_width_deg"] == 1, err
    assert "polarisation_span" not in seen and 0 < seen["u_polarisation"] <= 0.03
    assert seen["parameters"]["gamma"] < plain["parameters"]["gamma"]  # a part of the lobe's width is the instrument's
    for words in (["--source-width", "-1"], ["--polarisation", "2"], ["--polarisation", "0.1,x"],
                  ["--mirror-offset", "loose"]):
        code, out, err = run("fit", path, *words)
        assert code == 2 and not out, (words, err)


def test_eval_as_the_points_were_seen(folder):
    """Laid over the points of a fit, the model is what the fit compared them with: its chi-square comes back."""
    path = measured(folder)
    for words in ([], ["--model", "heavy-tail"]):
        code, out, err = run("fit", path, "--json", "--source-width", 2, "--sensor-width", 1,
                             "--polarisation", "0.05,0.03", *words)
        assert code == 0, err
        fit = json.loads(out)
        (folder / "seen.json").write_text(out)
        points = rows_of(path.read_text())
        chi2 = {}
        for how in ([], ["--as-seen"]):
            code, out, err = run("eval", "--params", folder / "seen.json", "--points", path, *how)
            assert code == 0, err
            chi2[bool(how)] = sum(((row["beta"] - p["beta"]) / p["u_ind"]) ** 2 for row, p in zip(rows_of(out), points))
            assert words == [] or "d_tail" in rows_of(out)[0]
        assert abs(chi2[True] / fit["chi2"] - 1) < 0.05 and chi2[False] > 2 * chi2[True], (chi2, fit["chi2"])
    (folder / "p.json").write_text(json.dumps(MATERIAL))
    code, out, err = run("eval", "--params", folder / "p.json", "--points", path, "--as-seen")
    assert code == 2 and "goniofit fit --json" in err, err


def test_all_bands_together(folder):
    """S of each band, and one shape that they share, known better than from any band alone."""
    dice, bands, path = random.Random(3), {500: 0.1, 550: 0.4, 600: 0.2}, folder / "bands.csv"
    rows = {nm: evaluated(folder, dict(MATERIAL, q=1, S=s)) for nm, s in bands.items()}
    with open(path, "w") as f:
        f.write("theta_i_deg,theta_v_deg," + ",".join(f"beta_{nm}nm,u_{nm}nm" for nm in bands) + "\n")
        for at, row in enumerate(rows[500]):
            cells = [row["theta_i_deg"], row["theta_v_deg"]]
            for nm in bands:
                u = 0.003 * rows[nm][at]["beta"] + 1e-4
                cells += [f"{rows[nm][at]['beta'] + dice.gauss(0, u):.9g}", f"{u:.4g}"]
            f.write(",".join(map(str, cells)) + "\n")
    code, out, err = run("fit", path, "--joint", "--json")
    assert code == 0, err
    joint = json.loads(out)["joint"]
    assert joint["n_bands"] == 3 and joint["n_values"] == 3 * 198 and not joint["misfit"]
    for name in ("sigma", "gamma", "beta_prime", "n"):
        assert abs(joint["parameters"][name] - MATERIAL[name]) < 4.5 * joint["std"][name], name
    for nm, s in bands.items():
        at = (nm - 380) // 5
        assert abs(joint["s_lambda"][at] - s) < 4.5 * joint["u_s_lambda"][at], nm
    n = len(joint["rows"])
    assert n == 4 + 3 and len(joint["covariance_statistical"]) == n * (n + 1) // 2
    assert joint["rows"][0] == ["sigma"] and ["S", 550] in joint["rows"]
    other = folder / "other_u.csv"  # without weights no u matters, in the bands either
    lines = path.read_text().splitlines()
    cells = [line.split(",") for line in lines[1:]]
    for at, row in enumerate(cells):
        row[3::2] = [f"{float(u) * (1 + 9 * (at % 2)):.4g}" for u in row[3::2]]
    other.write_text("\n".join([lines[0]] + [",".join(row) for row in cells]) + "\n")
    alike = [json.loads(run("fit", p, "--weights", "none", "--json", "--joint")[1]) for p in (path, other)]
    for nm in bands:
        s = [fit["joint"]["s_lambda"][(nm - 380) // 5] for fit in alike]
        assert abs(s[0] / s[1] - 1) < 1e-9, (nm, s)
    code, out, err = run("fit", path, "--beta-prime-per-band")
    assert code == 0 and "joint fit of 3 bands" in out and out.count("beta' ") == 3, out + err
    code, out, err = run("fit", measured(folder), "--joint")
    assert code == 1 and "no joint fit: the points have no bands" in err


def test_models_are_ranked(folder):
    path = measured(folder)
    code, out, err = run("fit", path, "--model", "all", "--json")
    fits = json.loads(out)
    assert code == 0 and fits[0]["model"] == "composite", err
    assert sorted(f["model"] for f in fits) == [
        "composite", "eq1", "heavy-tail", "lambert", "oren-nayar", "transmitted", "two-lobe"]
    bics = [f["bic"] for f in fits]
    assert bics == sorted(bics)
    assert any("does not fit" in w for w in fits[-1]["warnings"])
    assert [f["recommended"] for f in fits] == [True] + 6 * [False]
    assert fits[0]["loio"] < 2 < 10 * fits[0]["loio"] < fits[-1]["loio"]
    tail = next(f for f in fits if f["model"] == "heavy-tail")
    assert "tail is not needed" in tail["choice"] and "median error" in tail["choice"]
    code, out, err = run("fit", path, "--model", "all")
    assert code == 0 and "recommended: S, sigma, gamma, beta_prime, n" in out and "too simple, without" in out


def test_files_of_others_are_read(folder):
    rows = evaluated(folder, dict(MATERIAL, q=1))
    path = folder / "m.astm"
    path.write_text("NUM_POINTS 198\nVARS theta_i,phi_i,theta_s,550nm\n" + "".join(
        f"{math.radians(r['theta_i_deg']):.9f},3.141592654,{math.radians(abs(r['theta_v_deg'])):.9f},"
        f"{0 if r['theta_v_deg'] > 0 else 3.141592654},{r['beta'] / math.pi:.12g}\n" for r in rows))
    code, out, err = run("fit", path, "--u", "0.005:0.001", "--max-theta-i", 50, "--blind", 8, "--json")
    assert code == 0, err
    fit = json.loads(out)
    assert fit["input"]["format"] == "astm" and "180 deg (detected)" in fit["input"]["azimuth"]
    assert any("taken for phi_s" in note for note in fit["input"]["notes"])
    left_out = fit["input"]["left_out"]
    assert left_out["theta_i"] == 33 and left_out["blind"] > 4 and left_out["theta_v"] == 0
    assert fit["n_points"] == 198 - left_out["theta_i"] - left_out["blind"]
    for name in ("S", "sigma", "gamma", "beta_prime", "n"):
        assert abs(fit["parameters"][name] / MATERIAL[name] - 1) < 1e-5, name
    code, out, err = run("fit", path)
    assert code == 0 and "(astm)" in out and "azimuth: forward" in out and "note: column 4" in out
    broken = folder / "broken.astm"
    broken.write_text(path.read_text().replace("3.141592654,", "pi,", 1))
    code, out, err = run("fit", broken)
    assert code == 2 and "broken.astm:3:" in err and "'pi' is no number" in err
    for words in (["--format", "xls"], ["--azimuth", "left"], ["--blind", "x"], ["--max-theta-i", "0"], ["--u", "1"],
                  ["--wavelength", "700"], ["--wavelength", "700:400"], ["--u", "0:0"]):
        code, out, err = run("fit", path, *words)
        assert code == 2 and not out, (words, err)


def test_stability_is_a_table(folder):
    code, out, err = run("stability", "--only", "S 0.", "--json")
    assert code == 0, err
    table = json.loads(out)
    assert table["bad"] == 0 and table["good"] == len(table["rows"]) == 4
    row = table["rows"][0]
    assert row["group"] == "S" and row["verdict"] == "good" and row["condition"] > 1 and row["iterations"] > 0
    assert row["parameters"]["S"]["truth"] == 0.001 and row["worst_u"] < 5 and row["solvers_apart_u"] < 1e-3
    code, out, err = run("stability", "--only", "one is", "--csv")
    rows = out.strip().splitlines()
    assert code == 0 and rows[0].startswith("group,case,n_points,condition") and len(rows) == 3, out
    assert all(",refused," in r and "leave the point out" in r for r in rows[1:]), out
    code, out, err = run("stability", "--only", "5 points", "--seed", 7)
    assert code == 0 and "needs at least 7 geometries" in out and "1 cases: 0 good, 1 refused" in out, out
    for words in (["--seed", "x"], ["nonsense"], ["--nonsense"]):
        assert run("stability", *words)[0] == 2


def test_paper_convention_is_a_refit(folder):
    code, out, err = run("fit", measured(folder), "--paper-convention", "--weights", "none", "--json")
    fit = json.loads(out)
    assert code == 0, err
    assert fit["parameters"]["kappa"] == math.pi and fit["parameters"]["q"] == 1
    assert abs(fit["S_paper"] - math.pi * fit["parameters"]["S"]) < 1e-15
    assert abs(fit["parameters"]["S"] - 0.2) > 0.002  # not a renaming


def test_bad_input_has_its_place(folder):
    bad = folder / "bad.csv"
    bad.write_text("theta_i_deg,theta_v_deg,beta\n10,0,0.5\n10,zero,0.5\n")
    code, out, err = run("fit", bad)
    assert code == 2 and f"{bad}:3:4: " in err and out == ""
    few = folder / "few.csv"
    few.write_text("theta_i_deg,theta_v_deg,beta,u_ind\n10,0,0.5,0.01\n20,0,0.5,0.01\n")
    code, out, err = run("fit", few)
    assert code == 1 and "needs at least 7" in err
    broken = folder / "p.json"
    for text, word in (("{", "p.json:1:"), ('{"S": "white"}', "S"), ('{"sigma": 1}', "S")):
        broken.write_text(text)
        code, out, err = run("eval", "--params", broken, "--points", grid(folder))
        assert code == 2 and word in err and out == "", (text, err)
    broken.write_text('{"S": 0.5}')
    bad.write_text("theta_i_deg,theta_v_deg\n10,0\n90,0\n")
    code, out, err = run("eval", "--params", broken, "--points", bad)
    assert code == 2 and f"{bad}:3:1: " in err and out == ""
    noise = folder / "noise.csv"
    noise.write_bytes(random.Random(1).randbytes(100000))
    for words in (("fit", noise), ("fit", folder), ("fit", folder / "absent"), ("fit",), ("fit", few, "--model", "x"),
                  ("fit", few, "--weights", "x"), ("fit", few, "--what"), ("eval",), ("nonsense",), ()):
        code, out, err = run(*words)
        assert code == 2 and len(err) > 10 and out == "", words


def test_help_and_version(folder):
    for words in (("--help",), ("fit", "--help"), ("eval", "--help")):
        code, out, err = run(*words)
        assert code == 0 and "exit status" in out and err == ""
    code, out, err = run("--version")
    assert code == 0 and out.startswith("goniofit ")
    assert run("--serve", text="")[0] == 0


if __name__ == "__main__":
    sys.exit(in_folders.run(globals()))
